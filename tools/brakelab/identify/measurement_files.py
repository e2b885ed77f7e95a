"""Manifests and tables of measurements: read, and refused with one line if invalid."""

import csv
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from brakelab.arrays import Array
from brakelab.results.mdf import load_asammdf
from ecu.errors import UserError

WARMEST_COLD: Final = 250.0
"""degC: a disc that is never cooler is given in K."""
COLDEST: Final = -60.0  # degC


def read_manifest(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV manifest.

    Raises:
        UserError: it cannot be read.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(str(path), "", f"cannot be read: {error}; give a CSV manifest") from None


def measured_files(manifest: Path) -> list[Path]:
    """Return the manifest and the files that its rows name, which exist or not.

    Raises:
        UserError: it cannot be read.
    """
    return [manifest, *(manifest.parent / row["file"] for row in read_manifest(manifest) if row.get("file"))]


def read_columns(path: Path, names: tuple[str, ...], what: str) -> dict[str, Array]:
    """Return columns of a CSV, Parquet or MDF4 file, each of shape (n,); NaN where a row has no value.

    In MDF4 `t` is the time of the second of `names`; other channels are interpolated to it.

    Args:
        path: of the file.
        names: of the columns, among them `t` [s].
        what: the file is one of.

    Raises:
        UserError: it cannot be read, lacks a column, holds a non-number, or time does not rise.
    """
    if not path.is_file():
        raise UserError(str(path), "", f"no such file; the manifest names the file of each {what}, beside it")
    if path.suffix.lower() == ".mf4":
        columns = _channels(path, names, what)
        _check_time(path, columns["t"])
        return columns
    try:
        table = pq.read_table(path) if path.suffix.lower() == ".parquet" else pa_csv.read_csv(path)
    except (OSError, pa.ArrowInvalid) as error:
        reason = str(error).splitlines()[0]
        raise UserError(str(path), "", f"cannot be read as CSV or Parquet: {reason}") from None
    if missing := [name for name in names if name not in table.column_names]:
        raise UserError(str(path), missing[0], f"no such column; a {what} has {', '.join(names)}")
    try:
        columns = {name: table[name].cast(pa.float64()).to_numpy(zero_copy_only=False) for name in names}
    except pa.ArrowInvalid:
        raise UserError(str(path), "", f"{', '.join(names)} must be numbers") from None
    _check_time(path, columns["t"])
    return columns


def _check_time(path: Path, t: Array) -> None:
    if not np.all(np.diff(t) > 0.0):
        raise UserError(str(path), "t", "must rise from row to row")


def _channels(path: Path, names: tuple[str, ...], what: str) -> dict[str, Array]:
    load_asammdf(path)
    from asammdf import MDF
    from asammdf.blocks.utils import MdfException

    try:
        with MDF(path) as file:
            if missing := [name for name in names[1:] if name not in file.channels_db]:
                raise UserError(str(path), missing[0], f"no such channel; a {what} has {', '.join(names)}")
            signals = [file.get(name) for name in names[1:]]
            t = np.asarray(signals[0].timestamps, np.float64)
            values = [np.interp(t, each.timestamps, np.asarray(each.samples, np.float64)) for each in signals]
    except (MdfException, OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(str(path), "", f"cannot be read as MDF4: {reason}") from None
    return dict(zip(names, [t, *values], strict=True))


def check_celsius(path: Path, name: str, values: Array, hottest: float) -> None:
    """Refuse disc temperatures that cannot be degC.

    Raises:
        UserError: they cannot.
    """
    low, high = values.min(), values.max()
    if low > WARMEST_COLD or high > hottest or low < COLDEST:
        raise UserError(str(path), name, f"{low:.0f} to {high:.0f} cannot be degC; convert it")
