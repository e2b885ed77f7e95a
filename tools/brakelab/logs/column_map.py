"""Signal maps of files that hold decoded signals: which column or channel is which input of the ECU.

    rolling_radius = 0.327       # m, where the file has wheel speeds in km/h
    [inputs]
    accel_x = { column = "InlineAcc", factor = -1 }

A value is (cell · factor + offset) in `unit`, the file's own where the map has none, and is converted to the
contract's unit. docs/signal-maps.md explains it with examples.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Final, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ecu.bus.signal_map import Seconds
from ecu.bus.units import conversion
from ecu.contract.signals import INPUT, INPUT_SIGNALS
from ecu.errors import UserError, closest
from ecu.settings.described import describe_keys
from ecu.settings.toml_file import Unit, describe, read_toml

TIMES: Final = (
    *("t", "time", "timestamp", "timestamps", "interval", "zeit", "elapsed time", "offset", "uhrzeit"),
    *("zeitstempel", "datetime", "date time", "time of day", "utc", "t_s", "time_s"),
)
"""Names of the column of time, in lower case."""
LONGEST_LAG_S: Final = 0.5
"""By which an input may come late or early."""
SECONDS: Final = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6,
                  "μs": 1e-6, "ns": 1e-9, "min": 60.0}  # fmt: skip


def seconds_of(unit: str) -> float | None:
    """Return a unit of time [s], None: of no time; a time of day, `hh:mm:ss`, is read as seconds."""
    unit = unit.strip().lower()
    return 1.0 if "h:m" in unit.replace("hh", "h") else SECONDS.get(unit)


class _Table(BaseModel):
    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, json_schema_extra=describe_keys
    )


class MappedColumn(_Table):
    """Source of one input."""

    column: str
    """Name of the column or channel, with or without its unit."""
    unit: str | None = None
    """Of the value after factor and offset; the file's own if it is not given."""
    factor: Annotated[float, Unit("-")] = 1.0
    """Of the value in the file; -1 turns its sign."""
    offset: float = 0.0
    """Added after the factor, in `unit`."""
    timeout: Seconds | None = None
    """After it the input is stale, if not by the rate of its samples."""
    lag: Annotated[float, Field(ge=-LONGEST_LAG_S, le=LONGEST_LAG_S), Unit("s")] = 0.0
    """By which its samples come later than what they tell; they count as taken so much earlier."""


class ColumnMap(_Table):
    """Content of a map of columns."""

    time: str | None = None
    """Column of time; found by its name if it is not given."""
    time_unit: Literal["s", "ms", "us", "ns", "min"] | None = None
    """Of the column of time; the file's own, or s."""
    rolling_radius: Annotated[float, Field(gt=0.1, lt=2.0), Unit("m")] | None = None
    """With which the logger made speeds of wheel rotations, where they are in km/h or m/s."""
    inputs: Annotated[dict[str, MappedColumn], Field(min_length=1)]
    """Sources, by name of the input."""


class MappedFile(NamedTuple):
    """A map of columns and where it is from."""

    path: Path
    content: ColumnMap

    @property
    def timeouts(self) -> dict[int, float]:
        """Time-outs that the map states [s], by place of the input."""
        inputs = self.content.inputs
        return {INPUT[name]: one.timeout for name, one in inputs.items() if one.timeout is not None}

    @property
    def lags(self) -> dict[int, float]:
        """Lags that the map states [s], by place of the input."""
        return {INPUT[name]: one.lag for name, one in self.content.inputs.items() if one.lag}


class ColumnUse(NamedTuple):
    """A column of a file as an input: value = cell · factor + offset, in the contract's unit."""

    column: str
    place: int
    """In `inputs.value`."""
    factor: float = 1.0
    offset: float = 0.0


class FileUse(NamedTuple):
    """Columns read of a file."""

    time: str
    """Column of time."""
    seconds: float
    """A unit of time in s."""
    columns: list[ColumnUse]

    @property
    def names(self) -> list[str]:
        """Columns that are read, each once, time first."""
        return list(dict.fromkeys([self.time, *(use.column for use in self.columns)]))


def maps_columns(path: Path) -> bool:
    """Return whether a map names columns of signal files, not signals of a database."""
    inputs = read_toml(path).get("inputs")
    return isinstance(inputs, dict) and any(
        isinstance(one, dict) and "column" in one for one in inputs.values()
    )


def read_column_map(path: Path) -> MappedFile:
    """Return a map of columns; raises UserError that names the key."""
    try:
        content = ColumnMap.model_validate(read_toml(path))
    except ValidationError as error:
        raise describe(error, str(path), ColumnMap) from None
    for name in content.inputs:
        if name not in INPUT:
            hint = closest(name, [*INPUT]) or f"; there are {', '.join([*INPUT][:5])}, …"
            raise UserError(str(path), f"inputs.{name}", f"no such input{hint}")
    return MappedFile(path, content)


def resolve(
    mapped: MappedFile, log: Path, names: Sequence[str], units: Mapping[str, str], titles: Mapping[str, str]
) -> FileUse:
    """Return the columns that are read of a file.

    Args:
        mapped: the map.
        log: the file.
        names: of its columns.
        units: of its columns as the file spells them, by name.
        titles: other names of its columns, by what stands there.

    Raises:
        UserError: a column is not there, or has no unit or one that does not convert.
    """
    path, content = mapped
    time = time_column(content, str(path), log, names, titles)
    unit = content.time_unit or units.get(time, "") or "s"
    seconds = seconds_of(unit)
    if seconds is None:
        raise UserError(
            str(path), "time_unit", f"missing; {log} has {time} in {unit!r}: give s, ms, us or ns"
        )
    uses = []
    for target, one in content.inputs.items():
        key = f"inputs.{target}"
        column = _found(one.column, str(path), f"{key}.column", log, names, titles)
        given, place = one.unit or units.get(column, ""), INPUT[target]
        wanted = INPUT_SIGNALS[place].unit
        if not given.strip() and wanted not in ("-", "%"):
            remedy = f"missing; {log} does not say the unit of {column}: {target} is in {wanted}"
            raise UserError(str(path), f"{key}.unit", remedy)
        factor, offset = conversion(given, wanted, content.rolling_radius, str(path), f"{key}.unit")
        uses.append(ColumnUse(column, place, one.factor * factor, one.offset * factor + offset))
    return FileUse(time, seconds, uses)


def time_column(
    content: ColumnMap | None, where: str, log: Path, names: Sequence[str], titles: Mapping[str, str]
) -> str:
    """Return the column of time. Raises UserError that names `where`: there is none."""
    if content is not None and content.time is not None:
        return _found(content.time, where, "time", log, names, titles)
    found = [name for wanted in TIMES for name in names if name.strip().lower() == wanted]
    if not found:
        there = f"no column of {log} is called t, time or timestamp: {_shown(names)}"
        remedy = f'missing; {there}; give that of time such a name, its unit in brackets: "time [s]"'
        raise UserError(where, "time", remedy)
    return found[0]


def _found(
    wanted: str, where: str, key: str, log: Path, names: Sequence[str], titles: Mapping[str, str]
) -> str:
    if wanted in names:
        return wanted
    if wanted in titles:
        return titles[wanted]
    hint = closest(wanted, [*names]) or f"; it has {_shown(names)}"
    raise UserError(where, key, f"no column {wanted!r} in {log}{hint}")


def _shown(names: Sequence[str]) -> str:
    return f"{', '.join(names[:12])}{', …' if len(names) > 12 else ''}"
