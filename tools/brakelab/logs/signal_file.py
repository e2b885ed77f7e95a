"""Reads decoded signals: Parquet or CSV with `t` [s] and columns with the contract's input names, or MDF4.

Rates may be mixed: null or NaN in a cell means that there is no new sample. Times are cut to whole
microseconds relative to the first row, so that 0.1 + 0.2 and 0.3 are one instant; of several samples of one
input at one instant the last counts.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from brakelab.arrays import arrow_array, median
from brakelab.logs.column_map import ColumnUse, FileUse, MappedFile
from brakelab.logs.lag import without_lags
from brakelab.logs.log_quality import MAX_JUMP_NS, SignalQuality
from brakelab.logs.row_order import in_order, place_of
from brakelab.logs.sample_block import FEW_ROWS, SampleBlock, refuse_one_instant
from brakelab.logs.signal_batches import Batch, is_csv, mapped_batches, plain_batches
from ecu.bus.freshness import input_freshness
from ecu.contract.records import RecordArray
from ecu.contract.signals import INPUT, INPUT_SIGNALS
from ecu.errors import UserError

SLOWEST_STEP: Final = 1.1  # s, above: no input would stay alive, so t is probably not in seconds
SLOWEST_S: Final = 0.3
"""Between samples of a signal that still counts as one."""
LATEST_S: Final = 9e9  # the year 2255 as Unix time
_SHOWN: Final = 20  # names in a line
_REMEDY: Final = f"give t [s] and columns such as {', '.join(list(INPUT)[:3])} (contract input names)"

_OR_MAP: Final = ", or the map of columns that `map suggest` proposes: --map MAP"


def freshness_at_any_rate(timeouts: Mapping[int, float] | None = None) -> RecordArray:
    """Return FRESHNESS per input, nothing received yet: a signal file promises no rate.

    Time-outs follow the rate of the samples, down to `SLOWEST_S` between them, or are those that a map states
    [s], by place.
    """
    any_rate = {place: (0.0, signal.timeout_s) for place, signal in enumerate(INPUT_SIGNALS)}
    freshness = input_freshness(any_rate, {})
    freshness["patience_ns"] = np.maximum(freshness["patience_ns"], round(1e9 * SLOWEST_S))
    for place, timeout_s in (timeouts or {}).items():
        for name in ("timeout_ns", "least_timeout_ns", "patience_ns"):
            freshness[place][name] = round(1e9 * timeout_s)
    return freshness


def read_signals(
    path: Path, quality: SignalQuality, mapped: MappedFile | None = None
) -> Iterator[SampleBlock]:
    """Yield a signal file in blocks of rows; `quality` is kept up to date.

    `mapped` says which of its columns are inputs; without it they have the contract's names and units.

    Cells that are no number and rows without `t` are left out and counted. Raises UserError with file, row
    and column for a `t` that falls, jumps or is not in seconds, an infinite value, a column without any
    number, and a file without any known column or row.
    """
    blocks = _read(path, quality, mapped)
    lags = {} if mapped is None else mapped.lags
    yield from without_lags(blocks, lags) if lags else blocks


def _read(path: Path, quality: SignalQuality, mapped: MappedFile | None) -> Iterator[SampleBlock]:
    use: FileUse | None = None
    batches: Iterator[Batch]
    if mapped is None:
        batches = plain_batches(path, quality)
    else:
        use, batches = mapped_batches(path, quality, mapped)
    origin_ns: int | None = None
    last_ns = 0
    time, seconds = ("t", 1.0) if use is None else (use.time, use.seconds)
    for batch, places in in_order(path, batches, time, seconds, quality):
        if use is None:
            known_columns = _known_columns(path, batch.schema.names, quality)
            use = FileUse("t", 1.0, [ColumnUse(name, INPUT[name]) for name in known_columns])
        t = _column(path, batch, use.time, places, quality)
        if use.seconds != 1.0:
            t = t * use.seconds
        known = np.isfinite(t)
        if not known.all():
            if not known.any():
                remedy = "time is missing or not finite; give t in seconds in every row"
                raise UserError(str(path), f"{place_of(path, places[0])}, t", remedy)
            missing = np.flatnonzero(~known)
            quality.note_damage(len(missing), f"{place_of(path, places[missing[0]])}, t (missing)")
            batch, places, t = batch.filter(arrow_array(known, pa.bool_())), places[known], t[known]
        if not len(t):
            continue
        check_seconds(path, "t", t, "" if mapped is None else f"; or state time_unit in {mapped.path}")
        if origin_ns is None:
            origin = float(t[0])
            origin_ns = last_ns = round(origin * 1e6) * 1000
        t_ns = origin_ns + np.rint((t - origin) * 1e6).astype(np.int64) * 1000
        steps = np.diff(t_ns, prepend=last_ns)
        falling = np.flatnonzero(steps < 0)
        if len(falling):
            row = int(falling[0])
            raise UserError(
                str(path),
                f"{place_of(path, places[row])}, t",
                f"time falls by {-1e-9 * steps[row]:g} s to {t[row]:g} s; sort the rows, or split the file"
                " here if its clock was set back",
            )
        quality.stamps_repeated += int(np.count_nonzero(steps[quality.rows == 0 :] == 0))
        _check_span(path, t_ns, last_ns, origin_ns, places, quality.rows)
        last_ns = int(t_ns[-1])
        values = np.empty((len(t), len(use.columns)))
        for column, (name, _, factor, offset) in enumerate(use.columns):
            values[:, column] = _column(path, batch, name, places, quality)
            if factor != 1.0 or offset:
                values[:, column] = values[:, column] * factor + offset
            infinite = np.flatnonzero(np.isinf(values[:, column]))
            if len(infinite):
                raise UserError(
                    str(path),
                    f"{place_of(path, places[infinite[0]])}, {name}",
                    "infinite value; write null or NaN where there is no sample",
                )
        refuse_one_instant(path, place_of(path, places[0]), t_ns, values)
        quality.rows += len(t)
        quality.samples += int(np.count_nonzero(~np.isnan(values)))
        inputs = np.array([one.place for one in use.columns], np.int64)
        yield SampleBlock(np.array(t), t_ns, inputs, values)
    if quality.rows == 0:
        remedy = quality.cut or f"no row that can be read; {_REMEDY}"
        raise UserError(str(path), quality.first_damaged or place_of(path, 2 * is_csv(path)), remedy)


def check_seconds(path: Path, name: str, t: NDArray[np.float64], or_else: str) -> None:
    """Refuse times that cannot be in seconds, with the column's `name` and what else would do.

    Raises:
        UserError: they cannot.
    """
    step = median(np.diff(t)) if len(t) > FEW_ROWS else 0.0
    found = f"the rows are {step:g} s apart" if step > SLOWEST_STEP else ""
    if np.abs(t).max() > LATEST_S:
        found = f"a value is {t[np.abs(t).argmax()]:g} s"
    if found:
        remedy = f"convert it from ms, us or ns, or give every sample{or_else}"
        raise UserError(str(path), name, f"{name} is in seconds, but {found}; {remedy}")


def _check_span(
    path: Path,
    t_ns: NDArray[np.int64],
    last_ns: int,
    origin_ns: int,
    places: NDArray[np.int64],
    rows: int,
) -> None:
    """Refuse a jump, and gaps that add up to a result of far more rows than the file has."""
    jumps = np.flatnonzero(np.diff(t_ns, prepend=last_ns) > MAX_JUMP_NS)
    if len(jumps):
        raise UserError(
            str(path),
            f"{place_of(path, places[jumps[0]])}, t",
            "time jumps by more than an hour; mend the row or split the file here",
        )
    seconds = np.arange(rows, rows + len(t_ns)) * 1_000_000_000
    empty = np.flatnonzero(t_ns - origin_ns > MAX_JUMP_NS + seconds)
    if len(empty):
        raise UserError(
            str(path),
            f"{place_of(path, places[empty[0]])}, t",
            "so far less than a row a second and more than an hour without any; split the file at its gaps",
        )


def _known_columns(path: Path, names: list[str], quality: SignalQuality) -> list[str]:
    where = place_of(path, 1) if is_csv(path) else "columns"
    if "t" not in names:
        raise UserError(str(path), where, f"column t is missing; {_REMEDY}{_OR_MAP}")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UserError(str(path), where, f"column {twice[0]} stands twice; keep one")
    known = [name for name in names if name in INPUT]
    quality.unknown_columns = [name for name in names if name not in INPUT and name != "t"]
    if not known:
        shown = f"{', '.join(names[:_SHOWN])}{', …' if len(names) > _SHOWN else ''}"
        raise UserError(str(path), where, f"no known input among {shown}; {_REMEDY}{_OR_MAP}")
    return known


def _column(
    path: Path, batch: pa.RecordBatch, name: str, places: NDArray[np.int64], quality: SignalQuality
) -> NDArray[np.float64]:
    column = batch.column(name)
    if pa.types.is_null(column.type):
        return np.full(batch.num_rows, np.nan)
    try:
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), np.float64)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        if not pa.types.is_string(column.type):
            remedy = f"type {column.type} is no number; write float64"
            raise UserError(str(path), name, remedy) from None
    values = np.full(len(column), np.nan)
    wrong: list[int] = []
    for row, cell in enumerate(column.to_pylist()):
        try:
            values[row] = float(cell) if cell is not None else np.nan
        except ValueError:
            wrong.append(row)
    if wrong:
        place = f"{place_of(path, places[wrong[0]])}, {name}"
        reason = f"{str(column[wrong[0]])[:_SHOWN]!r} is no number"
        if len(wrong) == len(column) - column.null_count:
            raise UserError(str(path), place, f"{reason}; leave the cell empty if unknown")
        quality.note_damage(len(wrong), f"{place} ({reason})")
    return values
