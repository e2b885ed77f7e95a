"""Tables of measurements: read, and refused with one line if invalid."""

import datetime
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from brakelab.arrays import Array
from brakelab.identify.manifest import NAMES, measured_rows, read_manifest
from brakelab.identify.samples import BEYOND, PEAKS, alone, continued
from brakelab.identify.units import COUNTED, UNITS, ZEROS
from brakelab.logs.csv_header import find_header
from brakelab.logs.csv_rows import csv_columns, csv_rows
from brakelab.logs.log_quality import Damage
from brakelab.replay.log import log_hash
from brakelab.results.mdf import load_asammdf
from brakelab.results.outputs import check_outputs, config_files
from ecu.errors import UserError
from ecu.output import say
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
    "particle_concentration": ("concentration", "1/cm^3"),
    "solid_concentration": ("concentration", "1/cm^3"),
    "tunnel_flow": ("flow", "m^3/s"),
}
"""Quantity and unit of the columns of blocks and trips."""
_DATE: Final = re.compile(
    r"(?:(\d{1,4})[-./](\d{1,2})[-./](\d{1,4})[T ]+)?(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d*)?)"
    r"(?: ?([AP])M| ?Z|[+-]\d{2}:?\d{2})?"
)
_EPOCH: Final = datetime.date(2000, 1, 1).toordinal()
"""Seconds are counted from here: of today's dates a microsecond is left."""


def open_campaign(
    manifest: Path, config: Path, axle: str, out: Path, columns: Path | None = None
) -> tuple[Config, tuple[Path, Path, Path]]:
    """Return the configuration, and what measurements of an `axle` will write: `out`, its page and picture.

    Raises:
        UserError: an argument is invalid, or one of them would replace what is read or somebody else's.
    """
    if axle not in ("front", "rear"):
        raise UserError("--axle", axle, "choose front or rear")
    vehicle = load_config(config)
    written = out, out.with_suffix(".md"), out.with_suffix(".svg")
    stated = read_manifest(manifest, columns)
    rows = measured_rows(stated)
    for line, row in stated:
        if (line, row) not in rows:
            said = ", ".join(cell for cell in row.values() if cell)
            say(f"{manifest}: line {line} ({said}) names no file, so it is no measurement; left out")
    files = [manifest.parent / row["file"] for _, row in rows if row.get("file")]
    _refuse_repeated(manifest, rows)
    read = [manifest, *files, *config_files(config), *([columns] if columns else [])]
    check_outputs(out, written, read, toml=True)
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


def read_columns(
    path: Path, names: tuple[str, ...], what: str, counts: Sequence[str] = (), stated: bool = True
) -> dict[str, Array]:
    """Return columns of a CSV, Parquet or MDF4 file, each of shape (n,); NaN where a row has no value.

    A sample that stands alone (`samples.py`) is left out, and said.

    A CSV file may be any that `header_of` reads; where it states units, columns are converted to those of
    `CONTRACT`, and a time that is a date or a time of day becomes seconds. In MDF4 `t` is the time of the
    second of `names`; other channels are interpolated to it.

    Args:
        path: of the file.
        names: of the columns, the first of the time.
        what: the file is one of.
        counts: of `names`, whose peaks may stand alone.
        stated: units that the file states count; else a file of columns states them.

    Raises:
        UserError: it cannot be read, lacks a column, holds a non-number, or time does not rise.
    """
    if not path.is_file():
        raise UserError(str(path), "", f"no such file; the manifest names the file of each {what}, beside it")
    if path.suffix.lower() == ".mf4":
        return _checked(path, _channels(path, names, what), counts)
    if path.suffix.lower() != ".parquet":
        return _checked(path, _csv(path, names, what, stated), counts)
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        reason = str(error).splitlines()[0]
        raise UserError(str(path), "", f"cannot be read as Parquet: {reason}") from None
    _refuse_missing(path, names, table.column_names, what)
    try:
        columns = {name: table[name].cast(pa.float64()).to_numpy(zero_copy_only=False) for name in names}
    except pa.ArrowInvalid:
        raise UserError(str(path), "", f"{', '.join(names)} must be numbers") from None
    return _checked(path, columns, counts)


def _refuse_missing(path: Path, names: tuple[str, ...], found: Sequence[str], what: str) -> None:
    if missing := [name for name in names if name not in found]:
        remedy = f"no such column; a {what} has {', '.join(names)}"
        if len(missing) > 1:  # somebody's own names
            remedy += f", this file {', '.join(found[:20])}; name its own with --columns"
        raise UserError(str(path), missing[0], remedy)


def _csv(path: Path, names: tuple[str, ...], what: str, stated: bool) -> dict[str, Array]:
    found, delimiter, above, units = header_of(path, list(names))
    _refuse_missing(path, names, found, what)
    parts: dict[str, list[Array]] = {name: [] for name in names}
    damage = Damage()
    for lines, batch in csv_rows(path, found, delimiter, list(names), damage, above):
        for name in names:
            cells = batch.column(name)
            values = numbers_in(cells)
            wrong = np.isnan(values) & np.asarray(cells.is_valid())
            wrong[wrong] = [str(cells[int(k)]).strip().lower() != "nan" for k in np.flatnonzero(wrong)]
            if wrong.any():
                place = int(np.argmax(wrong))
                raise UserError(str(path), f"line {lines[place]}, {name}", f"{cells[place]} is no number")
            parts[name].append(values)
    if damage.damaged:
        raise UserError(str(path), damage.first_damaged, "is damaged; mend or remove the line")
    return {
        name: _converted(
            path, name, np.concatenate(values or [np.empty(0)]), units.get(name, "") if stated else ""
        )
        for name, values in parts.items()
    }


def _converted(path: Path, name: str, values: Array, unit: str) -> Array:
    """Return values in the unit of `CONTRACT` from the `unit` that the file states, if it does."""
    quantity, own = CONTRACT.get(name.removesuffix("_fr"), ("", ""))
    if not unit or not quantity or unit == own:
        return values
    units = (UNITS | COUNTED)[quantity]
    known = {one: factor for one, factor in units.items() if factor * units[own] > 0.0}
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


def numbers_in(cells: "pa.Array[Any]") -> Array:
    """Return a column of text as `numbers_of` returns its cells; at once where all are plain numbers."""
    try:
        return np.asarray(cells.cast(pa.float64()).to_numpy(zero_copy_only=False))
    except pa.ArrowInvalid:
        return numbers_of(cells.to_pylist())


def _seconds(cell: str) -> float:
    """Return the time of a cell such as 12.03.2024 10:23:45.120 [s]."""
    found = _DATE.fullmatch(cell.strip().strip('"'))
    if not found:
        return np.nan
    *date, hours, minutes, seconds, half = found.groups()
    days = 0
    if date[0]:
        year, month, day = date if len(date[0]) == 4 else reversed(date)
        try:
            days = datetime.date(int(year), int(month), int(day)).toordinal() - _EPOCH
        except ValueError:  # the month first
            days = datetime.date(int(year), int(day), int(month)).toordinal() - _EPOCH
    hour = int(hours) % 12 + (12 if half == "P" else 0) if half else int(hours)
    return 86400.0 * days + 3600.0 * hour + 60.0 * int(minutes) + float(seconds.replace(",", "."))


def _checked(path: Path, columns: dict[str, Array], counts: Sequence[str]) -> dict[str, Array]:
    """Return columns whose time rises, without samples that stand alone."""
    time, *others = columns
    t = columns[time] = continued(columns[time])
    if not np.all(np.diff(t) > 0.0):
        raise UserError(str(path), time, "must rise from row to row")
    for name in others:
        strange = alone(columns[name], PEAKS if name in counts else BEYOND)
        if not strange.any():
            continue
        place = int(np.argmax(strange))
        more = f", and {count - 1} more" if (count := int(strange.sum())) > 1 else ""
        say(f"{path}: {name} {columns[name][place]:g} at {t[place]:g} s stands alone{more}; left out")
        columns[name] = np.where(strange, np.nan, columns[name])
    return columns


def _channels(path: Path, names: tuple[str, ...], what: str) -> dict[str, Array]:
    load_asammdf(path)
    from asammdf import MDF
    from asammdf.blocks.utils import MdfException

    try:
        with MDF(path) as file:
            _refuse_missing(path, names[1:], list(file.channels_db), what)
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
