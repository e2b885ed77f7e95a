"""Friction from a table over disc temperature and pressure, as test benches supply it, without memory.

Bilinear between the knots, constant outside. Of any size that fits the row, e.g. 30 by 30.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from brakelab.plant.friction.law import ROW, Law, Positive, RigBrake
from brakelab.plant.jit import Record, kernel

TEMPERATURES: Final = 1  # index of the number of knots
PRESSURES: Final = 2  # likewise
KNOTS: Final = 3  # index of the first knot: temperatures, pressures, then friction

Knots = Annotated[tuple[float, ...], Field(min_length=2)]
Row = Annotated[tuple[Positive, ...], Field(min_length=2)]


class Table(Law):
    law: Literal["table"]
    temperature: Knots  # degC
    pressure: Knots  # bar
    mu: Annotated[tuple[Row, ...], Field(min_length=2)]  # a row per pressure

    @model_validator(mode="after")
    def _rising(self) -> Self:
        for name, knots in (("temperature", self.temperature), ("pressure", self.pressure)):
            if any(low >= high for low, high in pairwise(knots)):
                raise ValueError(f"the knots of {name} must rise")
        columns, rows = len(self.temperature), len(self.pressure)
        if len(self.mu) != rows or any(len(row) != columns for row in self.mu):
            raise ValueError(f"give mu {rows} rows, one per pressure, of {columns}, one per temperature")
        if KNOTS + columns + rows + columns * rows > ROW:
            raise ValueError(f"{columns} temperatures by {rows} pressures are too many: 30 by 30 fit")
        return self

    def row(self, brake: RigBrake) -> Sequence[float]:
        pascal = (1e5 * bar for bar in self.pressure)
        counts = float(len(self.temperature)), float(len(self.pressure))
        return (1.0, *counts, *self.temperature, *pascal, *(mu for line in self.mu for mu in line))


@kernel
def place_of(row: Record, first: int, count: int, value: float) -> tuple[int, float]:
    """Return the knot below `value` among the `count` from `first` on, and the weight of the next one."""
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
    """Return the memory unchanged, and the table's friction."""
    columns, rows = int(row[TEMPERATURES]), int(row[PRESSURES])
    i, along = place_of(row, KNOTS, columns, temperature)
    j, up = place_of(row, KNOTS + columns, rows, pressure)
    low = KNOTS + columns + rows + columns * j + i
    high = low + columns
    below = row[low] + along * (row[low + 1] - row[low])
    above = row[high] + along * (row[high + 1] - row[high])
    return memory, below + up * (above - below)
