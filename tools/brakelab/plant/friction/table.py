"""Friction from a table over disc temperature and pressure: no memory, what a test bench hands over.

Bilinear between the knots, constant outside.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from brakelab.plant.friction.law import Law, Positive, RigBrake
from brakelab.plant.jit import Record, kernel

TEMPERATURES: Final = 6
PRESSURES: Final = 3
TEMPERATURE: Final = 1
PRESSURE: Final = TEMPERATURE + TEMPERATURES
MU: Final = PRESSURE + PRESSURES

Row = Annotated[tuple[Positive, ...], Field(min_length=TEMPERATURES, max_length=TEMPERATURES)]


class Table(Law):
    law: Literal["table"]
    temperature: Annotated[tuple[float, ...], Field(min_length=TEMPERATURES, max_length=TEMPERATURES)]  # degC
    pressure: Annotated[tuple[float, ...], Field(min_length=PRESSURES, max_length=PRESSURES)]  # bar
    mu: Annotated[tuple[Row, ...], Field(min_length=PRESSURES, max_length=PRESSURES)]  # a row per pressure

    @model_validator(mode="after")
    def _rising(self) -> Self:
        for name, knots in (("temperature", self.temperature), ("pressure", self.pressure)):
            if any(low >= high for low, high in pairwise(knots)):
                raise ValueError(f"the knots of {name} must rise")
        return self

    def row(self, brake: RigBrake) -> Sequence[float]:
        pascal = (1e5 * bar for bar in self.pressure)
        return (1.0, *self.temperature, *pascal, *(mu for line in self.mu for mu in line))


@kernel
def place_of(row: Record, first: int, count: int, value: float) -> tuple[int, float]:
    """Return the knot below `value` among the `count` from `first` on, and the share of the next one."""
    knot = 0
    while knot < count - 2 and value >= row[first + knot + 1]:
        knot += 1
    part = (value - row[first + knot]) / (row[first + knot + 1] - row[first + knot])
    return knot, min(max(part, 0.0), 1.0)


@kernel
def step(
    row: Record,
    memory: float,
    pressure: float,
    speed: float,
    slowing: float,
    temperature: float,
    dt: float,
) -> tuple[float, float]:
    """Return the memory as it was, and the table's friction."""
    i, along = place_of(row, TEMPERATURE, TEMPERATURES, temperature)
    j, up = place_of(row, PRESSURE, PRESSURES, pressure)
    low = MU + TEMPERATURES * j + i
    high = low + TEMPERATURES
    below = row[low] + along * (row[low + 1] - row[low])
    above = row[high] + along * (row[high + 1] - row[high])
    return memory, below + up * (above - below)
