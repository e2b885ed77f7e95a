"""What an FMU is made of: its variables with units, and the calls by which it steps."""

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
    """Of an input among those of the ECU."""


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


TIME: Final = Variable("time", "TIME", "s", 0, "Simulation time")


@cache
def _comments() -> dict[str, str]:
    """Return what the contract's database says of its signals, by name."""
    found = {}
    for message in load_database(resource("dbc/brake_ecu.dbc")).messages:
        for signal in message.signals:
            found[signal.name] = (signal.comment or "").partition(" Not available:")[0].rstrip(".")
    return found


def described(name: str) -> str:
    """Return the description of a signal of the contract, empty: its database has none."""
    return _comments().get(name, "")
