"""Rows of a signal file on one clock and in its order: a clock that was set, rows from the end, rows twice.

Time is a number, or the time of day as programs of measurement export it, `14:23:05,12` or `2:23:05 PM`
with or without a date before it; at midnight a day is added. Where the clock was set back by more than a
second, or on by more than an hour, and rows go on from there, time goes on as before it. Rows that stand in
the file a second time are left out, and a row whose time alone does not fit between those beside it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from brakelab.arrays import arrow_array, median
from brakelab.logs.log_quality import MAX_JUMP_NS, STEP_NS, SignalQuality
from brakelab.logs.sample_block import FEW_ROWS
from brakelab.logs.signal_batches import Batch, is_csv

_SET_S: Final = 1e-9 * STEP_NS
_JUMP_S: Final = 1e-9 * MAX_JUMP_NS
_DAY_S: Final = 86_400.0
_CLOCK: Final = (
    r"(?:^|[ T])(?:(?P<h>\d{1,2}):)?(?P<m>\d{1,2}):(?P<s>\d{1,2}(?:\.\d+)?) *"
    r"(?:(?P<half>[AaPp])[Mm]|Z|[-+]\d\d:?\d\d)?$"
)
_NUMBER: Final = r"^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$"


@dataclass
class _Clock:
    shift_s: float = 0.0
    last_s: float = np.nan
    peak_s: float = -np.inf
    again: bool = False
    """Whether rows up to `peak_s` stand here a second time."""
    before: tuple[pa.RecordBatch, NDArray[np.float64]] | None = None
    """The last rows and their times [s]."""


def place_of(path: Path, number: int) -> str:
    """Return how a user finds what `Batch.places` names."""
    return f"line {number}" if is_csv(path) else f"row {number}"


def numbers(column: "pa.Array[Any]") -> NDArray[np.float64]:
    """Return the numbers of a column, and times of day [s]; NaN where a cell is neither."""
    import pyarrow.compute as pc  # see `signal_batches`

    if pa.types.is_null(column.type):
        return np.full(len(column), np.nan)
    if pa.types.is_string(column.type):
        text = pc.utf8_trim_whitespace(column)
        clock = pc.extract_regex(text, _CLOCK)
        if clock.null_count < len(clock):
            hours, minutes, seconds = (
                pc.replace_substring_regex(part, "^$", "0").cast(pa.float64()).to_numpy(zero_copy_only=False)
                for part in (pc.struct_field(clock, name) for name in "hms")
            )
            half = pc.utf8_upper(pc.struct_field(clock, "half")).to_numpy(zero_copy_only=False)
            hours = np.where((half == "A") | (half == "P"), hours % 12.0 + 12.0 * (half == "P"), hours)
            return np.asarray(3600.0 * hours + 60.0 * minutes + seconds, np.float64)
        column = pc.if_else(pc.match_substring_regex(text, _NUMBER), text, pa.scalar(None, pa.string()))
    try:
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), np.float64)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        return np.full(len(column), np.nan)


def in_order(
    path: Path, batches: Iterator[Batch], time: str, seconds: float, quality: SignalQuality
) -> Iterator[Batch]:
    """Yield the rows of a file in the order of time; `quality` is kept up to date.

    Args:
        path: the file.
        batches: its rows.
        time: its column of time.
        seconds: unit of it [s].
        quality: kept up to date.
    """
    clock, held = _Clock(), None
    for batch in _forwards(batches, time, quality):
        if not batch.rows.num_rows or time not in batch.rows.schema.names:
            yield batch
            continue
        if held is not None:
            ahead = numbers(batch.rows.column(time)[:FEW_ROWS]) * seconds
            yield _on_one_clock(path, held, time, seconds, ahead, clock, quality)
        held = batch
    if held is not None:
        yield _on_one_clock(path, held, time, seconds, np.empty(0), clock, quality)


def _forwards(batches: Iterator[Batch], time: str, quality: SignalQuality) -> Iterator[Batch]:
    """Yield the rows of a file from its end where time falls from row to row."""
    for batch in batches:
        if not batch.rows.num_rows:
            yield batch
            continue
        if time not in batch.rows.schema.names or not _falls(numbers(batch.rows.column(time))):
            yield batch
            break
        quality.backwards = True
        for rows, places in reversed([batch, *batches]):
            yield Batch(rows.take(pa.array(np.arange(rows.num_rows)[::-1])), places[::-1])
    yield from batches


def _falls(t: NDArray[np.float64]) -> bool:
    steps = np.diff(t[np.isfinite(t)])
    return len(steps) >= FEW_ROWS and bool((steps <= 0.0).all() and (steps < 0.0).any())


def _on_one_clock(
    path: Path,
    batch: Batch,
    time: str,
    seconds: float,
    ahead: NDArray[np.float64],
    clock: _Clock,
    quality: SignalQuality,
) -> Batch:
    """Return a batch on one clock; `ahead`: times of the first rows after it [s]."""
    column = batch.rows.column(time)
    every = numbers(column) * seconds
    known = np.flatnonzero(np.isfinite(every))
    ahead = ahead[np.isfinite(ahead)]
    strays = known[_strays(np.concatenate([[clock.last_s], every[known], ahead]), len(known))]
    if len(strays):
        place = place_of(path, batch.places[strays[0]])
        quality.note_damage(len(strays), f"{place}, {time} (does not fit between the rows beside it)")
        kept = np.ones(len(every), np.bool_)
        kept[strays] = False
        batch = Batch(batch.rows.filter(arrow_array(kept, pa.bool_())), batch.places[kept])
        return _on_one_clock(path, batch, time, seconds, ahead, clock, quality)
    t = every[known]
    steps = np.diff(np.concatenate([t, ahead]), prepend=clock.last_s)
    shift, again = np.full(len(t), clock.shift_s), np.zeros(len(t), np.bool_)
    if clock.again:
        again[: _beyond(t, clock)] = True
    for row in np.flatnonzero((steps[: len(t)] < -_SET_S) | (steps[: len(t)] > _JUMP_S)):
        following = steps[row + 1 : row + FEW_ROWS]
        goes_on = len(following) == FEW_ROWS - 1 and bool(((following >= 0) & (following <= _SET_S)).all())
        if again[row] or not goes_on:
            continue
        clock.peak_s = max(clock.peak_s, t[:row].max(initial=-np.inf))
        if steps[row] < 0.0 and _stands_twice(batch.rows, known, t, int(row), clock):
            clock.again = True
            again[row : row + _beyond(t[row:], clock)] = True
        elif abs(steps[row] + _DAY_S) < _JUMP_S:
            shift[row:] += _DAY_S
        else:
            quality.note_clock(place_of(path, batch.places[known[row]]), steps[row])
            shift[row:] += median(following) - steps[row]
    if len(t):
        clock.shift_s, clock.last_s = float(shift[-1]), float(t[-1])
        clock.peak_s = max(clock.peak_s, float(t.max()))
        clock.before = batch.rows, every
    if not again.any() and not shift.any() and not _is_clock(column, every):
        return batch
    mended = every.copy()
    mended[known] += shift
    at = batch.rows.schema.get_field_index(time)
    rows = batch.rows.set_column(at, time, arrow_array(mended / seconds, pa.float64()))
    quality.rows_twice += int(again.sum())
    kept = np.ones(len(every), np.bool_)
    kept[known[again]] = False
    return Batch(rows.filter(arrow_array(kept, pa.bool_())), batch.places[kept])


def _strays(t: NDArray[np.float64], count: int) -> NDArray[np.bool_]:
    """Return which of `count` times after the first do not fit between those beside them, which do."""
    before, here, behind = t[:-2], t[1:-1], t[2:]
    outside = np.zeros(len(t), np.bool_)
    outside[1:-1] = (before <= behind) & ((here < before) | (here > behind))
    alone = outside[1:-1] & ~outside[:-2] & ~outside[2:]
    return np.concatenate([alone, np.zeros(count, np.bool_)])[:count]


def _is_clock(column: "pa.Array[Any]", t: NDArray[np.float64]) -> bool:
    first = np.flatnonzero(np.isfinite(t))
    return len(first) > 0 and pa.types.is_string(column.type) and ":" in str(column[int(first[0])])


def _beyond(t: NDArray[np.float64], clock: _Clock) -> int:
    """Return how many of the rows come before the first that is new."""
    new = np.flatnonzero(t > clock.peak_s)
    if len(new):
        clock.again = False
    return int(new[0]) if len(new) else len(t)


def _stands_twice(
    rows: pa.RecordBatch, known: NDArray[np.int64], t: NDArray[np.float64], row: int, clock: _Clock
) -> bool:
    """Return whether the rows from `row` on stand before, cell by cell, in this batch or the last one."""
    here = rows.slice(int(known[row]), FEW_ROWS)
    for earlier, times in ((rows, t[:row]), clock.before or (rows, t[:0])):
        for place in np.flatnonzero(times == t[row]):
            at = int(known[place]) if earlier is rows else int(place)
            there = earlier.slice(at, here.num_rows)
            if repr(there.to_pydict()) == repr(here.slice(0, there.num_rows).to_pydict()):
                return True
    return False
