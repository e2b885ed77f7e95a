"""Manifests and tables of measurements: read, and refused with one line if invalid."""

import codecs
import csv
import datetime
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from brakelab.arrays import Array
from brakelab.identify.units import UNITS, ZEROS
from brakelab.logs.csv_header import find_header
from brakelab.logs.csv_rows import csv_columns, csv_rows
from brakelab.logs.log_quality import Damage
from brakelab.replay.log import log_hash
from brakelab.results.mdf import load_asammdf
from brakelab.results.outputs import check_outputs, config_files
from ecu.errors import UserError
from ecu.settings.config import Config, load_config

WARMEST_COLD: Final = 250.0
"""degC: a disc that is never cooler is given in K."""
LOWEST_TEMPERATURE: Final = -60.0  # degC
CONTRACT: Final = {
    "t": ("time", "s"),
    "omega": ("speed", "rad/s"),
    "vehicle_speed": ("speed", "m/s"),
    "calliper_pressure": ("pressure", "bar"),
    "brake_torque": ("torque", "N m"),
    "disc_temperature": ("temperature", "degC"),
}
"""Quantity and unit of the columns of blocks and trips."""
NAMES: Final = ("file", "block", "trip", "test", "programme", "road_energy")
"""Columns of a manifest that measure nothing."""
UTF16: Final = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_DECIMAL: Final = re.compile(r"^([-+]?\d+),(\d+)$")
_DATE: Final = re.compile(
    r"(?:(\d{1,4})[-./](\d{1,2})[-./](\d{1,4})[T ]+)?(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d*)?)"
)
_EPOCH: Final = datetime.date(2000, 1, 1).toordinal()
"""Seconds are counted from here: of today's dates a microsecond is left."""


def read_manifest(path: Path) -> list[tuple[int, dict[str, str]]]:
    """Return the rows of a CSV manifest, each with its line in the file; decimal commas are points.

    Raises:
        UserError: it cannot be read.
    """
    try:
        given = path.read_bytes()
    except OSError as error:
        raise UserError(str(path), "", f"cannot be read ({error.strerror}); give a CSV manifest") from None
    if given[:2] not in UTF16 and b"\0" in given:
        raise UserError(str(path), "", "is no text; give a CSV manifest, which names the measured files")
    text = _decoded(given)
    names = text.partition("\n")[0]
    delimiter = max(",;\t", key=names.count)
    rows = csv.DictReader(io.StringIO(text), delimiter=delimiter)
    return [(rows.line_num, _cells(row)) for row in rows]


def _cells(row: dict[str, str]) -> dict[str, str]:
    return {name.strip(): _DECIMAL.sub(r"\1.\2", (cell or "").strip()) for name, cell in row.items() if name}


def _decoded(given: bytes) -> str:
    """Return text of whatever a spreadsheet writes: UTF-8 with or without a mark, UTF-16, Windows-1252."""
    if given[:2] in UTF16:
        return given.decode("utf-16", "replace")
    try:
        return given.decode("utf-8-sig")
    except UnicodeDecodeError:
        return given.decode("cp1252", "replace")


def open_campaign(
    manifest: Path, config: Path, axle: str, out: Path
) -> tuple[Config, tuple[Path, Path, Path]]:
    """Return the configuration, and what measurements of an `axle` will write: `out`, its page and picture.

    Raises:
        UserError: an argument is invalid, or one of them would replace what is read or somebody else's.
    """
    if axle not in ("front", "rear"):
        raise UserError("--axle", axle, "choose front or rear")
    vehicle = load_config(config)
    written = out, out.with_suffix(".md"), out.with_suffix(".svg")
    rows = read_manifest(manifest)
    files = [manifest.parent / row["file"] for _, row in rows if row.get("file")]
    _refuse_repeated(manifest, rows)
    check_outputs(out, written, [manifest, *files, *config_files(config)], toml=True)
    return vehicle, written


def _refuse_repeated(manifest: Path, rows: Sequence[tuple[int, dict[str, str]]]) -> None:
    """Refuse a measurement that counts twice: a file of the same bytes with the same masses or counts."""
    first: dict[tuple[str, ...], int] = {}
    for line, row in rows:
        path = manifest.parent / row.get("file", "")
        if path.is_file():
            measured = (log_hash(path), *(cell for name, cell in row.items() if name not in NAMES))
            if (before := first.setdefault(measured, line)) != line:
                remedy = f"the same measurement as line {before}; leave one of them out"
                raise UserError(str(manifest), f"line {line}", remedy)


def read_columns(path: Path, names: tuple[str, ...], what: str) -> dict[str, Array]:
    """Return columns of a CSV, Parquet or MDF4 file, each of shape (n,); NaN where a row has no value.

    A CSV file may be any that `header_of` reads; where it states units, columns are converted to those of
    `CONTRACT`, and a time that is a date or a time of day becomes seconds. In MDF4 `t` is the time of the
    second of `names`; other channels are interpolated to it.

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
    if path.suffix.lower() != ".parquet":
        columns = _csv(path, names, what)
        _check_time(path, columns["t"])
        return columns
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        reason = str(error).splitlines()[0]
        raise UserError(str(path), "", f"cannot be read as Parquet: {reason}") from None
    if missing := [name for name in names if name not in table.column_names]:
        raise UserError(str(path), missing[0], f"no such column; a {what} has {', '.join(names)}")
    try:
        columns = {name: table[name].cast(pa.float64()).to_numpy(zero_copy_only=False) for name in names}
    except pa.ArrowInvalid:
        raise UserError(str(path), "", f"{', '.join(names)} must be numbers") from None
    _check_time(path, columns["t"])
    return columns


def _csv(path: Path, names: tuple[str, ...], what: str) -> dict[str, Array]:
    found, delimiter, above, units = header_of(path, list(names))
    if missing := [name for name in names if name not in found]:
        raise UserError(str(path), missing[0], f"no such column; a {what} has {', '.join(names)}")
    parts: dict[str, list[Array]] = {name: [] for name in names}
    damage = Damage()
    for lines, batch in csv_rows(path, found, delimiter, list(names), damage, above):
        for name in names:
            cells = batch.column(name)
            values = numbers_of(cells.to_pylist())
            wrong = np.isnan(values) & np.asarray(cells.is_valid())
            wrong[wrong] = [str(cells[int(k)]).strip().lower() != "nan" for k in np.flatnonzero(wrong)]
            if wrong.any():
                place = int(np.argmax(wrong))
                raise UserError(str(path), f"line {lines[place]}, {name}", f"{cells[place]} is no number")
            parts[name].append(values)
    if damage.damaged:
        raise UserError(str(path), damage.first_damaged, "is damaged; mend or remove the line")
    return {
        name: _converted(path, name, np.concatenate(values or [np.empty(0)]), units.get(name, ""))
        for name, values in parts.items()
    }


def _converted(path: Path, name: str, values: Array, unit: str) -> Array:
    """Return values in the unit of `CONTRACT` from the `unit` that the file states, if it does."""
    quantity, own = CONTRACT.get(name.removesuffix("_fr"), ("", ""))
    if not unit or not quantity or unit == own:
        return values
    known = {one: factor for one, factor in UNITS[quantity].items() if factor * UNITS[quantity][own] > 0.0}
    if unit not in known:
        raise UserError(str(path), name, f"unit {unit!r} unknown; one of {', '.join(known)}")
    return np.asarray((values - ZEROS.get(unit, 0.0)) * (known[unit] / known[own]))


def header_of(path: Path, names: list[str]) -> tuple[list[str], str, int, dict[str, str]]:
    """Return columns of a CSV file, separator, number of lines above the rows, and units where it states
    them.

    Lines may stand above the names and units below them or in brackets behind; `names` are those looked for.

    Raises:
        UserError: it is UTF-16, or has no names above rows of numbers.
    """
    found, delimiter = csv_columns(path)
    if set(names) <= set(found) and _numbers_follow(path, delimiter):
        return found, delimiter, 1, {}
    try:
        header = find_header(path)
    except UserError:
        if set(names) <= set(found):
            return found, delimiter, 1, {}
        raise
    titled = set(names) <= set(header.titles)
    columns = header.titles if titled else header.names
    return columns, header.delimiter, header.lines, dict(zip(columns, header.units, strict=False))


def _numbers_follow(path: Path, delimiter: str) -> bool:
    """Return whether the second line has a number, so that it states no units."""
    with path.open("rb") as stream:
        stream.readline()
        cells = stream.readline().decode("latin-1").replace(",", "." if delimiter != "," else ",")
    return bool(np.isfinite(numbers_of(cells.strip().split(delimiter))).any())


def numbers_of(cells: Sequence[str | None]) -> Array:
    """Return cells of text as numbers, shape (n,): of a date or a time of day its seconds, of another NaN."""

    def number(cell: str | None) -> float:
        try:
            return float(cell) if cell else np.nan
        except ValueError:
            return _seconds(cell or "")

    return np.array([number(cell) for cell in cells])


def _seconds(cell: str) -> float:
    """Return the time of a cell such as 12.03.2024 10:23:45.120 [s]."""
    found = _DATE.fullmatch(cell.strip().strip('"'))
    if not found:
        return np.nan
    *date, hours, minutes, seconds = found.groups()
    days = 0
    if date[0]:
        year, month, day = date if len(date[0]) == 4 else reversed(date)
        try:
            days = datetime.date(int(year), int(month), int(day)).toordinal() - _EPOCH
        except ValueError:  # the month first
            days = datetime.date(int(year), int(day), int(month)).toordinal() - _EPOCH
    return 86400.0 * days + 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)


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
    if low > WARMEST_COLD or high > hottest or low < LOWEST_TEMPERATURE:
        raise UserError(str(path), name, f"{low:.0f} to {high:.0f} cannot be degC; convert it")
