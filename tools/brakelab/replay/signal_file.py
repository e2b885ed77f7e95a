"""Reads decoded signals: Parquet or CSV with `t` [s] and columns with the contract's input names, or MDF4.

Rates may be mixed: null or NaN in a cell means that there is no new sample. Times are cut to whole
microseconds relative to the first row, so that 0.1 + 0.2 and 0.3 are one instant.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brakelab.replay.log_quality import MAX_JUMP_NS
from brakelab.replay.mdf_channels import open_channels, read_channels
from ecu.bus.freshness import input_freshness
from ecu.errors import UserError
from ecu.records import RecordArray
from ecu.signals import INPUT, INPUT_SIGNALS

BLOCK_ROWS: Final = 1 << 16
FEW_ROWS: Final = 10  # too few to judge their distance
SLOWEST_STEP: Final = 0.9  # s, above: no input would stay alive, so t is probably not in seconds
LATEST: Final = 9e9  # s, the year 2255 as Unix time
_REMEDY: Final = f"give t [s] and columns such as {', '.join(list(INPUT)[:3])} (contract input names)"


class SampleBlock(NamedTuple):
    """Rows of a signal file, in the order of time."""

    t: NDArray[np.float64]
    """As it stands in the file [s], shape (rows,)."""
    t_ns: NDArray[np.int64]
    places: NDArray[np.int64]
    """Place of each column in `inputs.value`, shape (columns,)."""
    values: NDArray[np.float64]
    """NaN: no sample, shape (rows, columns), units of the contract."""


@dataclass
class SignalQuality:
    """What was found in a signal file."""

    rows: int = 0
    samples: int = 0
    unknown_columns: list[str] = field(default_factory=list)
    zero_ns: int = 0
    """Date of t = 0 as Unix time, if the file says so."""


def freshness_at_any_rate() -> RecordArray:
    """Return FRESHNESS per input, nothing received yet: a signal file promises no rate."""
    any_rate = {place: (0.0, signal.timeout_s) for place, signal in enumerate(INPUT_SIGNALS)}
    return input_freshness(any_rate, {})


def row_place(path: Path, row: int) -> str:
    """Return how a user finds data row `row` (from 0): a line of a CSV file, a row of a Parquet file."""
    return f"line {row + 2}" if path.suffix == ".csv" else f"row {row}"


def read_signals(path: Path, quality: SignalQuality) -> Iterator[SampleBlock]:
    """Yield a signal file in blocks of rows; `quality` is kept up to date.

    Raises UserError with file, row and column for a `t` that is missing, falls, jumps or is not in seconds,
    an infinite value, a cell that is no number, and a file without any known column.
    """
    if path.suffix.lower() == ".mf4":
        batches = _mdf_batches(path, quality)
    else:
        batches = _csv_batches(path) if path.suffix == ".csv" else _parquet_batches(path)
    origin: float | None = None
    last_ns = 0
    columns: list[str] = []
    for batch in batches:
        if not columns:
            columns = _known_columns(path, batch.schema.names, quality)
        if batch.num_rows == 0:
            continue
        t = _column(path, batch, "t", quality.rows)
        missing = np.flatnonzero(~np.isfinite(t))
        if len(missing):
            place = row_place(path, quality.rows + int(missing[0]))
            raise UserError(
                str(path), f"{place}, t", "time is missing or not finite; give t in seconds in every row"
            )
        _check_unit(path, t)
        if origin is None:
            origin = float(t[0])
            last_ns = round(origin * 1e6) * 1000 - 1
        t_ns = round(origin * 1e6) * 1000 + np.rint((t - origin) * 1e6).astype(np.int64) * 1000
        falling = np.flatnonzero(np.diff(t_ns, prepend=last_ns) <= 0)
        if len(falling):
            row = int(falling[0])
            raise UserError(
                str(path),
                f"{row_place(path, quality.rows + row)}, t",
                f"time does not rise ({t[row]:g} s); sort the rows and keep one row for each instant",
            )
        _check_span(path, t_ns, last_ns, round(origin * 1e6) * 1000, quality.rows)
        last_ns = int(t_ns[-1])
        values = np.empty((len(t), len(columns)))
        for column, name in enumerate(columns):
            values[:, column] = _column(path, batch, name, quality.rows)
            infinite = np.flatnonzero(np.isinf(values[:, column]))
            if len(infinite):
                raise UserError(
                    str(path),
                    f"{row_place(path, quality.rows + int(infinite[0]))}, {name}",
                    "infinite value; write null or NaN where there is no sample",
                )
        quality.rows += len(t)
        quality.samples += int(np.count_nonzero(~np.isnan(values)))
        yield SampleBlock(np.array(t), t_ns, np.array([INPUT[name] for name in columns], np.int64), values)
    if quality.rows == 0:
        raise UserError(str(path), row_place(path, 0), f"no rows; {_REMEDY}")


def _check_unit(path: Path, t: NDArray[np.float64]) -> None:
    step = float(np.median(np.diff(t))) if len(t) > FEW_ROWS else 0.0
    found = f"the rows are {step:g} s apart" if step > SLOWEST_STEP else ""
    if np.abs(t).max() > LATEST:
        found = f"a value is {t[np.abs(t).argmax()]:g} s"
    if found:
        remedy = f"t is in seconds, but {found}; convert it from ms, us or ns, or give every sample"
        raise UserError(str(path), "t", remedy)


def _check_span(path: Path, t_ns: NDArray[np.int64], last_ns: int, origin_ns: int, rows: int) -> None:
    """Refuse a jump, and gaps that add up to a result of far more rows than the file has."""
    jumps = np.flatnonzero(np.diff(t_ns, prepend=last_ns) > MAX_JUMP_NS)
    if len(jumps):
        raise UserError(
            str(path),
            f"{row_place(path, rows + int(jumps[0]))}, t",
            "time jumps by more than an hour; mend the row or split the file here",
        )
    seconds = np.arange(rows, rows + len(t_ns)) * 1_000_000_000
    empty = np.flatnonzero(t_ns - origin_ns > MAX_JUMP_NS + seconds)
    if len(empty):
        raise UserError(
            str(path),
            f"{row_place(path, rows + int(empty[0]))}, t",
            "so far less than a row a second and more than an hour without any; split the file at its gaps",
        )


def _known_columns(path: Path, names: list[str], quality: SignalQuality) -> list[str]:
    where = row_place(path, -1) if path.suffix == ".csv" else "columns"
    if "t" not in names:
        raise UserError(str(path), where, f"column t is missing; {_REMEDY}")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UserError(str(path), where, f"column {twice[0]} stands twice; keep one")
    known = [name for name in names if name in INPUT]
    quality.unknown_columns = [name for name in names if name not in INPUT and name != "t"]
    if not known:
        raise UserError(str(path), where, f"no known input among {', '.join(names)}; {_REMEDY}")
    return known


def _column(path: Path, batch: pa.RecordBatch, name: str, row: int) -> NDArray[np.float64]:
    column = batch.column(name)
    if pa.types.is_null(column.type):
        return np.full(batch.num_rows, np.nan)
    if pa.types.is_string(column.type):  # CSV: the type was not guessed, so that a bad cell has its line
        return _numbers(path, column, name, row)
    try:
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), np.float64)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        raise UserError(str(path), name, f"type {column.type} is no number; write float64") from None


def _numbers(path: Path, column: "pa.Array[Any]", name: str, row: int) -> NDArray[np.float64]:
    try:
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), np.float64)
    except pa.ArrowInvalid:
        pass
    values = np.full(len(column), np.nan)
    for i, cell in enumerate(column.to_pylist()):
        if cell is not None:
            try:
                values[i] = float(cell)
            except ValueError:
                place = f"{row_place(path, row + i)}, {name}"
                raise UserError(
                    str(path), place, f"{cell!r} is no number; leave the cell empty if unknown"
                ) from None
    return values


def _parquet_batches(path: Path) -> Iterator[pa.RecordBatch]:
    try:
        with pq.ParquetFile(path) as source:
            wanted = [name for name in source.schema_arrow.names if name == "t" or name in INPUT]
            unread = [name for name in source.schema_arrow.names if name not in wanted]
            nothing = pa.array([], pa.null())
            # An empty batch with every name first: unknown columns are listed, not read.
            yield pa.RecordBatch.from_arrays([nothing] * (len(wanted) + len(unread)), names=wanted + unread)
            yield from source.iter_batches(BLOCK_ROWS, columns=wanted)
    except FileNotFoundError:
        raise UserError(str(path), "", "no such file; give an existing Parquet or CSV file") from None
    except (pa.ArrowInvalid, OSError) as error:
        reason = str(error).splitlines()[0]
        raise UserError(
            str(path), "", f"no readable Parquet file ({reason}); write it again or name it .csv"
        ) from None


def _mdf_batches(path: Path, quality: SignalQuality) -> Iterator[pa.RecordBatch]:
    channels = open_channels(path)
    try:
        quality.zero_ns = channels.measurement.start_ns()
        names = ["t", *(name for places in channels.groups.values() for name in places), *channels.unknown]
        nothing = pa.array([], pa.null())
        yield pa.RecordBatch.from_arrays([nothing] * len(names), names=names)
        yield from read_channels(path, channels)
    finally:
        channels.measurement.close()


def _csv_batches(path: Path) -> Iterator[pa.RecordBatch]:
    try:
        with path.open("rb") as stream:
            header = stream.readline().decode("utf-8", "replace").strip().lstrip("\ufeff")
    except OSError as error:
        raise UserError(
            str(path), "", f"cannot be read ({error.strerror}); give an existing CSV file"
        ) from None
    if not header:
        raise UserError(str(path), "line 1", f"the file is empty; {_REMEDY}")
    names = [name.strip().strip('"') for name in header.split(",")]
    damaged: list[int] = []

    def note(row: pa_csv.InvalidRow) -> Literal["skip", "error"]:
        damaged.append(row.number if row.number is not None else 0)
        return "error"

    types = dict.fromkeys(names, pa.string())
    try:
        with pa_csv.open_csv(
            path,
            read_options=pa_csv.ReadOptions(column_names=names, skip_rows=1, use_threads=False),
            parse_options=pa_csv.ParseOptions(invalid_row_handler=note),
            convert_options=pa_csv.ConvertOptions(
                column_types=types, null_values=["", "null", "NULL", "NA"], strings_can_be_null=True
            ),
        ) as source:
            yield pa.RecordBatch.from_arrays([pa.array([], pa.null())] * len(names), names=names)
            yield from source
    except pa.ArrowInvalid as error:
        place = f"line {damaged[0]}" if damaged else "line 2"
        remedy = (
            f"a row needs {len(names)} cells like the first line" if damaged else str(error).splitlines()[0]
        )
        raise UserError(str(path), place, remedy) from None
