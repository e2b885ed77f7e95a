"""Constant friction: a controller's assumption, and the law with closed-form solutions throughout."""

from collections.abc import Sequence
from typing import Literal

from brakelab.plant.friction.law import Law, Positive, RigBrake
from brakelab.plant.jit import Record, kernel


class Constant(Law):
    law: Literal["constant"]
    mu: Positive

    def row(self, brake: RigBrake) -> Sequence[float]:
        return (1.0, self.mu)


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
    """Return the memory unchanged, and the constant."""
    return memory, row[1]
