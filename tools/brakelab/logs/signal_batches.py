"""Rows of signal files as they stand there: Parquet, CSV and MDF4, by the names that are wanted."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brakelab.logs.column_map import SECONDS, FileUse, MappedFile, resolve, seconds_of, time_column
from brakelab.logs.csv_header import CsvHeader, distinct, find_header, split_title
from brakelab.logs.csv_rows import csv_columns, csv_rows
from brakelab.logs.log_quality import SignalQuality
from brakelab.logs.mdf_channels import channel_units, open_channels, read_channels
from ecu.contract.signals import INPUT
from ecu.errors import UserError

BLOCK_ROWS: Final = 1 << 16
MDF_TIME: Final = "t"


class Batch(NamedTuple):
    """Some rows of a file."""

    rows: pa.RecordBatch
    places: NDArray[np.int64]
    """Of each row: its line in a CSV file, else its number from 0, shape (rows,)."""


def is_csv(path: Path) -> bool:
    """Return whether a file is CSV by its name."""
    return path.suffix.lower() == ".csv"


def _is_mdf(path: Path) -> bool:
    return path.suffix.lower() == ".mf4"


def plain_batches(path: Path, quality: SignalQuality) -> Iterator[Batch]:
    """Yield the rows of a file with the contract's names; the first has no row, but all names of the file."""
    if _is_mdf(path):
        return _mdf_rows(path, None, quality)
    return _csv_batches(path, quality) if is_csv(path) else _parquet_rows(path, None, quality)


class Columns(NamedTuple):
    """Columns of a file of whatever program."""

    names: list[str]
    units: dict[str, str]
    """As the file spells them, by name."""
    titles: dict[str, str]
    """Names by the heading of the column."""
    header: CsvHeader | None
    """Of a CSV file."""


def columns_of(path: Path) -> Columns:
    """Return the columns of a file; time among them, but in MDF4. Raises UserError for a file without any."""
    if is_csv(path):
        header = find_header(path)
        units = dict(zip(header.names, header.units, strict=True))
        titles = dict(zip(reversed(header.titles), reversed(header.names), strict=True))
        devices = [(name.partition("\\")[0], name) for name in header.names]  # INCA: signal\device:raster
        short = [name for name, _ in devices]
        titles |= {name: whole for name, whole in devices if short.count(name) == 1}
        return Columns(header.names, units, titles, header)
    if _is_mdf(path):
        units = channel_units(path)
        return Columns([*units], units, {}, None)
    try:
        schema = pq.read_schema(path)
    except (pa.ArrowInvalid, OSError) as error:
        raise UserError(str(path), "", f"no readable Parquet file ({error}); write it again") from None
    twice = [title for title in schema.names if schema.names.count(title) > 1]
    if twice:
        raise UserError(str(path), "columns", f"column {twice[0]} stands twice; keep one")
    index = _index_of_times(schema)
    parts = [split_title("t" if title == index else title) for title in schema.names]
    names = distinct([name for name, _ in parts])
    stated = [(field.metadata or {}).get(b"unit", b"").decode() for field in schema]
    units = {name: unit or behind for name, unit, (_, behind) in zip(names, stated, parts, strict=True)}
    return Columns(names, units, dict(zip(schema.names, names, strict=True)), None)


def mapped_batches(path: Path, quality: SignalQuality, mapped: MappedFile) -> tuple[FileUse, Iterator[Batch]]:
    """Return the mapped columns of a file, and its rows. Raises UserError for a map that does not fit it."""
    columns = columns_of(path)
    if _is_mdf(path):
        if mapped.content.time is not None:
            raise UserError(str(mapped.path), "time", f"{path} has a time of its own; remove this key")
        known = columns._replace(names=[MDF_TIME, *columns.names])
        use = resolve(mapped, path, known.names, {**columns.units, MDF_TIME: "s"}, {})
    else:
        use = resolve(mapped, path, columns.names, columns.units, columns.titles)
    return use, rows_of(path, columns, use.names, quality)


def time_of(path: Path, columns: Columns) -> tuple[str, float]:
    """Return the column of time of a file and its unit in s. Raises UserError: it has none."""
    if _is_mdf(path):
        return MDF_TIME, 1.0
    time = time_column(None, str(path), path, columns.names, columns.titles)
    return time, seconds_of(columns.units[time] or "s") or 1.0


def rows_of(path: Path, columns: Columns, wanted: Sequence[str], quality: SignalQuality) -> Iterator[Batch]:
    """Yield the rows of a file, the columns `wanted` of it."""
    quality.columns_twice = [name for name in wanted if f"{name}#2" in columns.names]
    if columns.header is not None:
        return _headed_csv_batches(path, columns.header, list(wanted), quality)
    if _is_mdf(path):
        return _mdf_rows(path, [name for name in wanted if name != MDF_TIME], quality)
    titles = {name: title for title, name in columns.titles.items()}
    rows = _parquet_rows(path, [titles[name] for name in wanted], quality)
    return (
        Batch(one.rows.rename_columns([columns.titles[title] for title in one.rows.schema.names]), one.places)
        for one in rows
    )


def _headed_csv_batches(
    path: Path, header: CsvHeader, wanted: list[str], quality: SignalQuality
) -> Iterator[Batch]:
    rows = csv_rows(path, header.names, header.delimiter, wanted, quality, header.lines, decimal_comma=True)
    for lines, batch in rows:
        yield Batch(batch, lines)


def _mdf_rows(path: Path, wanted: list[str] | None, quality: SignalQuality) -> Iterator[Batch]:
    """Yield rows of the channels `wanted`; None: of the inputs, after a batch of all names."""
    channels = open_channels(path, INPUT if wanted is None else wanted)
    try:
        quality.zero_ns = channels.measurement.start_ns()
        if wanted is None:
            inputs = [name for places in channels.groups.values() for name in places]
            yield _names_only(["t", *inputs, *channels.unknown])
        yield from _numbered(read_channels(path, channels, quality))
    finally:
        channels.measurement.close()


def _numbered(batches: Iterator[pa.RecordBatch]) -> Iterator[Batch]:
    done = 0
    for batch in batches:
        yield Batch(batch, np.arange(done, done + batch.num_rows))
        done += batch.num_rows


def _names_only(names: list[str]) -> Batch:
    """Return no row of these columns: unknown ones are listed, not read."""
    rows = pa.RecordBatch.from_arrays([pa.array([], pa.null())] * len(names), names=names)
    return Batch(rows, np.empty(0, np.int64))


def _parquet_rows(path: Path, wanted: list[str] | None, quality: SignalQuality) -> Iterator[Batch]:
    """Yield rows of the columns `wanted`; None: of the inputs, after a batch of all names."""
    done, time = 0, None
    try:
        with pq.ParquetFile(path) as source:
            if wanted is None:
                names = source.schema_arrow.names
                time = _index_of_times(source.schema_arrow)
                yield _names_only(["t" if name == time else name for name in names])
                _note_start(source, quality)
                wanted = [name for name in names if name in ("t", time) or name in INPUT]
            for batch in _numbered(map(_in_seconds, source.iter_batches(BLOCK_ROWS, columns=wanted))):
                done += batch.rows.num_rows
                called = ["t" if name == time else name for name in batch.rows.schema.names]
                yield batch._replace(rows=batch.rows.rename_columns(called))
    except (pa.ArrowInvalid, OSError, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0].rstrip(".")
        if not done:
            remedy = f"no readable Parquet file ({reason}); write it again"
            raise UserError(str(path), "", remedy) from None
        quality.cut = f"row {done}: cannot be read ({reason}), the rest is missing"


def _index_of_times(schema: pa.Schema) -> str | None:
    """Return the column that pandas wrote of an index of times, None: there is none, or a column t."""
    index = (schema.pandas_metadata or {}).get("index_columns", [])
    if len(index) != 1 or not isinstance(index[0], str) or "t" in schema.names:
        return None
    return index[0] if pa.types.is_temporal(schema.field(index[0]).type) else None


def _in_seconds(batch: pa.RecordBatch) -> pa.RecordBatch:
    """Return a batch whose dates and durations are numbers [s], dates since 1970."""
    import pyarrow.compute as pc  # as long as much else of a short replay

    columns = [
        pc.multiply(column.cast(pa.int64()).cast(pa.float64(), safe=False), SECONDS[column.type.unit])
        if pa.types.is_timestamp(column.type) or pa.types.is_duration(column.type)
        else column
        for column in batch.columns
    ]
    return pa.RecordBatch.from_arrays(columns, names=batch.schema.names)


def _note_start(source: pq.ParquetFile, quality: SignalQuality) -> None:
    """Note the date of t = 0 where the metadata has that of the first row, as our own files do."""
    start = (source.metadata.metadata or {}).get(b"start_time_ns", b"").decode("ascii", "replace")
    if start.isdecimal() and source.metadata.num_rows and "t" in source.schema_arrow.names:
        first = next(source.iter_batches(1, columns=["t"])).column(0)[0].as_py()
        if isinstance(first, float):
            quality.zero_ns = int(start) - round(first * 1e6) * 1000


def _csv_batches(path: Path, quality: SignalQuality) -> Iterator[Batch]:
    names, delimiter = csv_columns(path)
    yield _names_only(names)
    wanted = [name for name in names if name == "t" or name in INPUT]
    for lines, rows in csv_rows(path, names, delimiter, wanted, quality):
        yield Batch(rows, lines)
