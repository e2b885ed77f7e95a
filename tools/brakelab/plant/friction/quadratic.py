"""Second-order response surface over sliding speed and pressure, without memory (2.4.1, Figure 2.6).

Model. With v and p from -1 to 1 between the two bounds of each, and held there,

    mu_b = c_0 + c_1 v + c_2 p + c_3 v^2 + c_4 v p + c_5 p^2

It does not know the temperature.
"""

from collections.abc import Sequence
from typing import Annotated, Final, Literal

from pydantic import AfterValidator

from brakelab.plant.friction.law import Bounds, Law, RigBrake, in_order
from brakelab.plant.jit import Record, kernel

SPEED, PRESSURE, FACTOR = 1, 3, 5  # first index of each in a row
LEAST_RANGE: Final = 1e-9  # of a range, that a quotient is finite

InOrder = Annotated[Bounds, AfterValidator(in_order)]


class Quadratic(Law):
    law: Literal["quadratic"]
    speed: InOrder  # m/s, sliding
    pressure: InOrder  # bar
    factors: tuple[float, float, float, float, float, float]

    def row(self, brake: RigBrake) -> Sequence[float]:
        return (1.0, *self.speed, *(1e5 * bar for bar in self.pressure), *self.factors)


@kernel
def between(value: float, low: float, high: float) -> float:
    """Return where `value` lies from `low` (-1) to `high` (1), within these ends."""
    return min(max(2.0 * (value - low) / max(high - low, LEAST_RANGE) - 1.0, -1.0), 1.0)


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
    """Return the memory unchanged, and friction."""
    v = between(speed, row[SPEED], row[SPEED + 1])
    p = between(pressure, row[PRESSURE], row[PRESSURE + 1])
    level = row[FACTOR] + row[FACTOR + 1] * v + row[FACTOR + 2] * p
    return memory, level + row[FACTOR + 3] * v * v + row[FACTOR + 4] * v * p + row[FACTOR + 5] * p * p
