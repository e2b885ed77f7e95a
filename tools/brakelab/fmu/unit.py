"""What an FMU is made of: its variables with units, and the calls by which it steps."""

import math
from collections.abc import Sequence
from functools import cache
from typing import Final, Literal, NamedTuple

from brakelab.fmu.image import Call, Memory
from ecu.bus.database import load_database
from ecu.settings.resources import resource

BASE: Final[dict[str, dict[str, float]]] = {
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s^2": {"m": 1, "s": -2},
    "s": {"s": 1},
    "us": {"s": 1, "factor": 1e-6},
    "bar": {"kg": 1, "m": -1, "s": -2, "factor": 1e5},
    "W/kg": {"m": 2, "s": -3},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N m": {"kg": 1, "m": 2, "s": -2},
    "K": {"K": 1},
    "degC": {"K": 1, "offset": 273.15},
    "kg": {"kg": 1},
    "g": {"kg": 1, "factor": 1e-3},
    "mm": {"m": 1, "factor": 1e-3},
    "%": {"factor": 0.01},
    "1/km": {"m": -1, "factor": 1e-3},
    "mg/km": {"kg": 1, "m": -1, "factor": 1e-9},
}
"""Exponents of the SI units, factor and offset to them, of each unit of the contract but "-"."""

Kind = Literal["TIME", "INPUT", "OUTPUT", "PARAMETER"]


class Variable(NamedTuple):
    """A variable; its value reference is its place in `Unit.variables`."""

    name: str
    kind: Kind
    unit: str
    offset: int
    """Of its value in the memory: a double, of a parameter a byte."""
    description: str = ""
    place: int = 0
    """Of an input among the inputs or outputs of the ECU."""
    low: float = -math.inf
    """Range of an input."""
    high: float = math.inf


class Unit(NamedTuple):
    """One FMU before it is written."""

    name: str
    """Model identifier, and name of its library."""
    description: str
    text: str
    """File of c/ that says how it steps."""
    variables: Sequence[Variable]
    memory: Memory
    calls: Sequence[Call]
    origin: str
    """What it was made of, as text for people."""
    taken_at: int = 0
    """Offset in the memory of the values by place that the vehicle hears."""


TIME: Final = Variable("time", "TIME", "s", 0, "Simulation time")


class Stated(NamedTuple):
    """Description and range of a signal, as the contract's database states them."""

    description: str = ""
    low: float = -math.inf
    high: float = math.inf


@cache
def _statements() -> dict[str, Stated]:
    found = {}
    for message in load_database(resource("dbc/brake_ecu.dbc")).messages:
        for signal in message.signals:
            text = (signal.comment or "").partition(" Not available:")[0].rstrip(".")
            low = -math.inf if signal.minimum is None else float(signal.minimum)
            high = math.inf if signal.maximum is None else float(signal.maximum)
            found[signal.name] = Stated(text, low, high)
    return found


def stated(name: str) -> Stated:
    """Return what the contract's database states of a signal by name; of one that it lacks, nothing."""
    return _statements().get(name, Stated())
