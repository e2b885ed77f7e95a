"""Drive as read by the report: columns over one time axis from Parquet, with the truth mapped onto it."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from brakelab.arrays import Vector
from brakelab.results.files import refuse_export
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

KEPT: Final = 128 << 20  # bytes of columns


class Columns(Mapping[str, Vector]):
    """Columns, all of one length, that `read` makes when asked for; the last `KEPT` bytes are kept."""

    def __init__(self, names: Iterable[str], read: Callable[[str], Vector]) -> None:
        self._names, self._read = dict.fromkeys(names), read
        self._kept: dict[str, Vector] = {}

    def __getitem__(self, name: str) -> Vector:
        if name not in self._names:
            raise KeyError(name)
        values = self._kept.pop(name, None)
        self._kept[name] = values = self._read(name) if values is None else values
        while len(self._kept) > 1 and len(self._kept) * values.nbytes > KEPT:
            del self._kept[next(iter(self._kept))]
        return values

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


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


def read_parquet(path: Path, remedy: str) -> pa.Table:
    """Return the table; UserError with `remedy` when there is none or it cannot be read."""
    with _readable(path, remedy):
        return pq.read_table(path)


@contextmanager
def _readable(path: Path, remedy: str) -> Iterator[None]:
    refuse_export(path)
    if not path.is_file():
        raise UserError(str(path), "no such file", remedy)
    try:
        yield
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
    with _readable(path, remedy):
        file = pq.ParquetFile(path)
    for name in ("t", *required):
        if name not in file.schema_arrow.names:
            raise UserError(str(path), f"column {name}: missing", remedy)
    if file.metadata.num_rows < 2:
        raise UserError(str(path), f"{file.metadata.num_rows} rows", remedy)

    def read(name: str) -> Vector:
        with _readable(path, remedy):
            table = file.read([name])
        return numbers(table, name, path)

    t = read("t")
    wrong = np.flatnonzero(~(np.diff(t) > 0.0))
    if wrong.size or not np.isfinite(t).all():
        row = int(wrong[0]) + 1 if wrong.size else 0
        raise UserError(str(path), f"column t, row {row}", "time must be finite and increase from row to row")
    numeric = [
        field.name
        for field in file.schema_arrow
        if field.name in required
        or pa.types.is_integer(field.type)
        or pa.types.is_floating(field.type)
        or pa.types.is_boolean(field.type)
    ]
    metadata = {
        key.decode(errors="replace"): value.decode(errors="replace")
        for key, value in (file.metadata.metadata or {}).items()
    }
    columns = Columns((name for name in numeric if name != "t"), read)
    for name in required:
        columns[name]
    return DriveResult(t, columns, metadata)


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
