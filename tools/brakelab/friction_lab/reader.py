"""Reads the recording of a dynamometer, ours or a stranger's: CSV, Parquet or MDF4, by a file of columns.

Rows whose numbers cannot be read, or whose time does not rise, are left out and counted. Torque and speed are
turned to be positive; torque of one pad is doubled where the file of columns says so.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.friction_lab.columns import UNITS, ZEROS, Columns, load_columns
from brakelab.friction_lab.recording import NAMES, Recording
from brakelab.logs.csv_rows import csv_columns, csv_rows
from brakelab.logs.log_quality import Damage
from ecu.errors import UserError

Vector = NDArray[np.float64]

LEAST_SAMPLES = 100
ENDINGS = (".csv", ".txt", ".parquet", ".mf4")


class Read(NamedTuple):
    """A recording with what describes it."""

    recording: Recording
    columns: Columns
    damaged: str
    """Rows that were left out, one line; empty if none."""


def read_recording(path: Path, columns: Path | None = None) -> Read:
    """Return the recording `path`; `columns` defaults to the file of the same name that ends in .toml.

    Raises:
        UserError: a file, a column or a unit is missing or wrong, or too few rows are whole; one line.
    """
    if not path.is_file():
        raise UserError(str(path), "", "no such file")
    if path.suffix.lower() not in ENDINGS:
        raise UserError(str(path), "", f"ends in none of {' '.join(ENDINGS)}; export it as CSV")
    beside = columns or path.with_suffix(".toml")
    if not beside.is_file():
        raise UserError(
            str(path), "", "no file of columns; give --columns (docs/results/friction-lab.md has one)"
        )
    described = load_columns(beside)
    names = [getattr(described.columns, quantity)[0] for quantity in NAMES]
    damage = Damage()
    raw = np.concatenate(list(_rows(path, names, damage)) or [np.empty((5, 0))], axis=1)
    whole = np.isfinite(raw).all(axis=0)
    damage.note_damage(int((~whole).sum()), f"row {int(np.argmin(whole)) + 1} (a number is missing)")
    raw = raw[:, whole]
    rising = np.concatenate([[True], raw[0, 1:] > np.maximum.accumulate(raw[0])[:-1]])[: raw.shape[1]]
    damage.note_damage(int((~rising).sum()), "time does not rise")
    raw = raw[:, rising]
    if raw.shape[1] < LEAST_SAMPLES:
        raise UserError(str(path), "", f"only {raw.shape[1]} whole rows; needs {LEAST_SAMPLES}")
    note = f"{path}: {damage.damaged} rows left out, first: {damage.first_damaged}" if damage.damaged else ""
    return Read(_in_si(raw, described), described, "; ".join(part for part in (note, damage.cut) if part))


def _rows(path: Path, names: list[str], damage: Damage) -> Iterator[Vector]:
    """Yield blocks of columns, shape (5, rows), as numbers in the units of the file."""
    if path.suffix.lower() == ".mf4":
        yield _mdf(path, names)
        return
    if path.suffix.lower() == ".parquet":
        import pyarrow.parquet as pq

        _refuse_missing(path, names, pq.read_schema(path).names)
        table = pq.read_table(path, columns=names)
        yield np.array([table[name].to_numpy().astype(float) for name in names])
        return
    found, delimiter = csv_columns(path)
    _refuse_missing(path, names, found)
    for _, batch in csv_rows(path, found, delimiter, list(dict.fromkeys(names)), damage):
        columns = {name: _numbers(batch.column(name).to_pylist()) for name in dict.fromkeys(names)}
        yield np.array([columns[name] for name in names])


def _refuse_missing(path: Path, names: list[str], found: list[str]) -> None:
    for name in names:
        if name not in found:
            raise UserError(str(path), name, f"no such column; the file has {', '.join(found[:20])}")


def _numbers(cells: list[str | None]) -> Vector:
    def number(cell: str | None) -> float:
        try:
            return float(cell) if cell else np.nan
        except ValueError:
            return np.nan

    return np.array([number(cell) for cell in cells])


def _mdf(path: Path, names: list[str]) -> Vector:
    """Return channels of an MDF4 file on the time of the pressure, shape (5, rows)."""
    try:
        from asammdf import MDF
    except ImportError:
        raise UserError(str(path), "", "needs the extra mdf: pip install 'brake-ecu[mdf]'") from None
    with MDF(path) as file:
        _refuse_missing(path, names[1:], list(file.channels_db))
        pressure = file.get(names[1])
        time = np.asarray(pressure.timestamps, dtype=float)
        others = [file.get(name) for name in names[2:]]
        values = [np.interp(time, other.timestamps, np.asarray(other.samples, float)) for other in others]
        return np.array([time, np.asarray(pressure.samples, float), *values])


def _in_si(raw: Vector, described: Columns) -> Recording:
    """Return the numbers of a file in the units of a recording."""
    si = {}
    for quantity, values in zip(NAMES, raw, strict=True):
        unit = getattr(described.columns, quantity)[1]
        factor = UNITS[quantity][unit]
        if factor < 0.0:
            factor = -factor / described.brake.tyre_radius
        si[quantity] = (values - ZEROS.get(unit, 0.0)) * factor
    si["torque"] = _positive(si["torque"]) * (2.0 / described.rig.pads)
    si["speed"] = _positive(si["speed"])
    return Recording(**si)


def _positive(values: Vector) -> Vector:
    """Return `values` with the sign that makes their sum positive: noise about zero keeps its own."""
    return -values if values.sum() < 0.0 else values
