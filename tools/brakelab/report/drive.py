"""Drive as read by the report: columns over one time axis from Parquet, with the truth mapped onto it."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from brakelab.arrays import Vector
from brakelab.results.files import refuse_export
from ecu.contract.signals import CORNERS
from ecu.errors import UserError


class DriveResult(NamedTuple):
    """Columns in the contract's units; NaN means "not available"."""

    t: Vector
    """Time [s], strictly increasing, shape (n,)."""
    columns: Mapping[str, Vector]
    """Each of shape (n,)."""
    metadata: Mapping[str, str]

    def column(self, name: str) -> Vector:
        """Return a column, all NaN if the drive lacks it, shape (n,)."""
        return self.columns[name] if name in self.columns else np.full(len(self.t), np.nan)

    def has(self, name: str) -> bool:
        """Return whether the column holds at least one number."""
        return bool(np.isfinite(self.column(name)).any())

    def corners(self, stem: str) -> Vector:
        """Return the four columns of a corner quantity, shape (n, 4)."""
        return np.column_stack([self.column(f"{stem}_{corner}") for corner in CORNERS])


def read_parquet(path: Path, remedy: str) -> pa.Table:
    """Return the table; UserError with `remedy` when there is none or it cannot be read."""
    refuse_export(path)
    if not path.is_file():
        raise UserError(str(path), "no such file", remedy)
    try:
        return pq.read_table(path)
    except (pa.ArrowException, OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(str(path), f"not a readable Parquet file ({reason})", remedy) from error


def numbers(table: pa.Table, name: str, path: Path) -> Vector:
    """Return a column as float64 with NaN for null, shape (n,); UserError when it holds no numbers."""
    try:
        return np.asarray(table.column(name).cast(pa.float64()).to_numpy(zero_copy_only=False), np.float64)
    except pa.ArrowException as error:
        kind = table.schema.field(name).type
        raise UserError(str(path), f"column {name}", f"holds {kind}; numbers are needed") from error


def read_drive(path: Path, required: tuple[str, ...], remedy: str) -> DriveResult:
    """Read a result or truth file.

    Raises UserError when the file is missing or damaged, lacks `t` or a required column, is empty, or
    when `t` does not increase.
    """
    table = read_parquet(path, remedy)
    for name in ("t", *required):
        if name not in table.column_names:
            raise UserError(str(path), f"column {name}: missing", remedy)
    if table.num_rows < 2:
        raise UserError(str(path), f"{table.num_rows} rows", remedy)
    t = numbers(table, "t", path)
    wrong = np.flatnonzero(~(np.diff(t) > 0.0))
    if wrong.size or not np.isfinite(t).all():
        row = int(wrong[0]) + 1 if wrong.size else 0
        raise UserError(str(path), f"column t, row {row}", "time must be finite and increase from row to row")
    numeric = [
        field.name
        for field in table.schema
        if field.name in required
        or pa.types.is_integer(field.type)
        or pa.types.is_floating(field.type)
        or pa.types.is_boolean(field.type)
    ]
    metadata = {
        key.decode(errors="replace"): value.decode(errors="replace")
        for key, value in (pq.read_metadata(path).metadata or {}).items()
    }
    return DriveResult(t, {name: numbers(table, name, path) for name in numeric if name != "t"}, metadata)


def start_ns(drive: DriveResult) -> int | None:
    """Return the absolute start [ns since 1970] from the metadata, None when it is not stated."""
    text = drive.metadata.get("start_time_ns", "")
    return int(text) if text.lstrip("-").isdigit() else None


def onto(drive: DriveResult, truth: DriveResult, truth_path: Path) -> DriveResult:
    """Return the truth on the time axis of `drive`, NaN outside its span.

    The axes are aligned by the dates of their first rows if both files state them, else by a common zero.
    Raises UserError when the spans do not overlap.
    """
    starts = start_ns(drive), start_ns(truth)
    shift = 0.0
    if starts[0] is not None and starts[1] is not None:
        shift = (starts[1] - starts[0]) * 1e-9 - (truth.t[0] - drive.t[0])
    t = truth.t + shift
    if t[0] > drive.t[-1] or t[-1] < drive.t[0]:
        span = f"{drive.t[0]:.1f} to {drive.t[-1]:.1f} s"
        remedy = f"the result covers {span}; give the truth of the same drive"
        raise UserError(str(truth_path), f"time {t[0]:.1f} to {t[-1]:.1f} s", remedy)
    columns = {
        name: np.interp(drive.t, t, values, left=np.nan, right=np.nan)
        for name, values in truth.columns.items()
    }
    return DriveResult(drive.t, columns, truth.metadata)
