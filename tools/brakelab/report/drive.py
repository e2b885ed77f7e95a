"""Drive as read by the report: columns over one time axis from Parquet, with the truth mapped onto it."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from brakelab.arrays import Vector
from brakelab.results.columns import Columns, open_columns
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

    def without(self, names: set[str]) -> "DriveResult":
        """Return the drive without some columns."""
        left = [name for name in self.columns if name not in names]
        return self._replace(columns=Columns(left, self.columns.__getitem__))


def read_drive(path: Path, required: tuple[str, ...], remedy: str) -> DriveResult:
    """Open a result or truth file; its columns but `required` are read when they are asked for.

    Raises UserError when the file is missing or damaged, lacks `t` or a required column, is empty, or
    when `t` does not increase.
    """
    stored = open_columns(path, remedy, ("t", *required))
    if stored.rows < 2:
        raise UserError(str(path), f"{stored.rows} rows", remedy)
    t = stored.numbers("t")
    wrong = np.flatnonzero(~(np.diff(t) > 0.0))
    if wrong.size or not np.isfinite(t).all():
        row = int(wrong[0]) + 1 if wrong.size else 0
        raise UserError(str(path), f"column t, row {row}", "time must be finite and increase from row to row")
    for name in required:
        stored.numbers(name)
    kinds = pa.types.is_integer, pa.types.is_floating, pa.types.is_boolean
    others = {field.name for field in stored.schema if not any(kind(field.type) for kind in kinds)}
    return DriveResult(t, stored.columns, stored.metadata).without({"t", *others})


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

    def mapped(name: str) -> Vector:
        return np.interp(drive.t, t, truth.columns[name], left=np.nan, right=np.nan)

    return DriveResult(drive.t, Columns(truth.columns, mapped), truth.metadata)
