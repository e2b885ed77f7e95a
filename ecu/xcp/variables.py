"""What a master can name: every field of outputs, inputs, estimate and configuration, with unit and limits.

Each comes from the table that results, frames and CONFIG files are made of. A field of several values stands
as several variables: of corners by their names, of inputs by theirs, otherwise by numbers.
"""

import math
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from ecu.algorithm.estimate import ESTIMATE, UNITS
from ecu.bus.database import load_database
from ecu.bus.plan import signal_row
from ecu.contract.records import INPUTS, OUTPUTS
from ecu.contract.signals import CORNERS, INPUT_SIGNALS, OUTPUT_SIGNALS, column_names
from ecu.settings.resources import resource
from ecu.xcp.parameters import PARAMETERS, parameters


class Variable(NamedTuple):
    """One number, or one row of numbers, in a record."""

    name: str
    offset: int
    kind: np.dtype[Any]
    """Of one number."""
    length: int
    unit: str
    low: float
    high: float
    meaning: str = ""
    texts: tuple[str, ...] = ()
    """Of the values 0, 1, …; empty: a number."""
    writable: bool = False
    """A master may calibrate it."""


class Record(NamedTuple):
    """One record of a cycle as a master sees it."""

    name: str
    base: int
    """Address of its first byte."""
    dtype: np.dtype[Any]
    variables: tuple[Variable, ...]


def whole_range(kind: np.dtype[Any]) -> tuple[float, float]:
    """Return the least and the greatest value of a type."""
    info: Any = np.finfo(kind) if kind.kind == "f" else np.iinfo(kind)
    return float(info.min), float(info.max)


@cache
def _ranges() -> dict[str, tuple[float, float]]:
    """Return the ranges of the signals of the database that have one, in their units."""
    found = {}
    for message in load_database(resource("dbc/brake_ecu.dbc")).messages:
        for signal in message.signals:
            row = signal_row(signal)[0]
            ends = [float(row["scale"] * row[end] + row["offset"]) for end in ("raw_low", "raw_high")]
            if ends[0] != ends[1]:  # else a number in floating point
                found[signal.name] = (min(ends), max(ends))
    return found


def _outputs() -> Iterator[Variable]:
    for signal in OUTPUT_SIGNALS:
        kind, offset = OUTPUTS.fields[signal.name][:2]  # type: ignore[index]
        for place, name in enumerate(column_names(signal)):
            ends = (_ranges() if signal.message else {}).get(name, whole_range(kind.base))
            yield Variable(name, offset + place * kind.base.itemsize, kind.base, 1, signal.unit, *ends)


def _inputs() -> Iterator[Variable]:
    signals = [signal.name for signal in INPUT_SIGNALS]
    for field in INPUTS.names or ():
        if field == "value":
            for one, signal in zip(_split(INPUTS, field, signals, ""), INPUT_SIGNALS, strict=True):
                yield one._replace(unit=signal.unit, low=signal.low, high=signal.high)
        else:
            unit = "ns" if field.endswith("_ns") else "us" if field.endswith("_us") else "-"
            yield from _split(INPUTS, field, [f"{name}_{field}" for name in signals], unit)


def _estimate() -> Iterator[Variable]:
    for field in ESTIMATE.names or ():
        length = math.prod(ESTIMATE[field].shape)
        places = CORNERS if length == len(CORNERS) else map(str, range(length))
        yield from _split(ESTIMATE, field, [f"{field}_{place}" for place in places], UNITS.get(field, "-"))


def _split(record: np.dtype[Any], field: str, names: Sequence[str], unit: str) -> Iterator[Variable]:
    """Yield the variables of a field; `names` of its values, where it has several."""
    kind, offset = record.fields[field][:2]  # type: ignore[index]
    base = kind.base
    for place in range(math.prod(kind.shape)):
        name = names[place] if kind.shape else field
        yield Variable(name, offset + place * base.itemsize, base, 1, unit, *whole_range(base))


def _parameters() -> Iterator[Variable]:
    for one in parameters():
        kind, offset = PARAMETERS.fields[one.key][:2]  # type: ignore[index]
        low, high = whole_range(kind.base)
        yield Variable(
            one.key,
            offset,
            kind.base,
            math.prod(kind.shape),
            one.unit,
            low if one.low is None else one.low,
            high if one.high is None else one.high,
            one.meaning,
            one.texts,
            one.writable,
        )


RECORDS: Final = (
    Record("outputs", 0x10000, OUTPUTS, tuple(_outputs())),
    Record("inputs", 0x20000, INPUTS, tuple(_inputs())),
    Record("estimate", 0x30000, ESTIMATE, tuple(_estimate())),
    Record("parameters", 0x40000, PARAMETERS, tuple(_parameters())),
)
