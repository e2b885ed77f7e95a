"""Friction as a product of curves over pressure, sliding speed, disc temperature and distance.

Model. With the sliding distance w of the pads in this application, and memory m = 1 - exp(-w / way),

    mu_b = mu (p / 30 bar)^pressure (v / 5 m/s)^speed (1 - fall ((tau - best) / 100 K)^2) (1 + bite m)

p and v within 5 to 150 bar and 0.5 to 20 m/s, the factor of the temperature at least 0.6.

Source. Response surfaces over pressure, speed and temperature as in section 2.4; the form is an assumption.
Between two bounds a number is drawn uniformly per car; the nominal car has their mean.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Final, Literal, Self

from numpy.random import Generator
from pydantic import AfterValidator, BeforeValidator

from brakelab.plant.friction.law import Bounds, Law, Positive, RigBrake, as_bounds, in_order
from brakelab.plant.jit import Record, kernel

MU, PRESSURE, SPEED, FALL, BEST, BITE, WAY = range(1, 8)
REFERENCE_PRESSURE: Final = 30e5  # Pa
REFERENCE_SPEED: Final = 5.0  # m/s, sliding
PRESSURES: Final = (5e5, 150e5)
SPEEDS: Final = (0.5, 20.0)
LEAST_OF_HEAT: Final = 0.6

Drawn = Annotated[Bounds, BeforeValidator(as_bounds), AfterValidator(in_order)]


class Surface(Law):
    law: Literal["surface"]
    mu: Positive
    pressure: Drawn
    """Exponent."""
    speed: Drawn
    """Exponent."""
    fall: Drawn
    """Share lost at 100 K from the best temperature."""
    best: Drawn
    """degC"""
    bite: Drawn
    """Gained, or lost, within an application."""
    way: Drawn
    """m, of the pads on the disc."""

    def row(self, brake: RigBrake) -> Sequence[float]:
        numbers = (self.pressure, self.speed, self.fall, self.best, self.bite, self.way)
        return (0.0, self.mu, *(0.5 * (low + high) for low, high in numbers))

    def drawn(self, random: Generator) -> Self:
        names = ("pressure", "speed", "fall", "best", "bite", "way")
        return self.model_copy(update={name: (random.uniform(*getattr(self, name)),) * 2 for name in names})


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
    """Return memory and friction `dt` [s] later; see the package for the inputs."""
    memory += (1.0 - memory) * (1.0 - math.exp(-speed * dt / row[WAY]))
    pressed = min(max(pressure, PRESSURES[0]), PRESSURES[1]) / REFERENCE_PRESSURE
    slides = min(max(speed, SPEEDS[0]), SPEEDS[1]) / REFERENCE_SPEED
    away = (temperature - row[BEST]) / 100.0
    heat = max(1.0 - row[FALL] * away * away, LEAST_OF_HEAT)
    mu = row[MU] * pressed ** row[PRESSURE] * slides ** row[SPEED] * heat * (1.0 + row[BITE] * memory)
    return memory, mu
