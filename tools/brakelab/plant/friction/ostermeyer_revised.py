"""Revised Ostermeyer law: its three parameters vary with pressure and sliding speed. A conjecture.

Model. As `ostermeyer.py`, with p_i = p_i0 + p_ip p + p_iv r_eff |omega|, i = 1, 2, 3: nine parameters.

Source. The thesis names a revision with nine parameters and says that the original three cannot be constant
during a stop and depend on more (2.4.1, 3.6); it gives neither equations nor numbers. That the nine are three
constants, three pressure and three speed slopes is a conjecture. Of them the shipped sets use four: those of
Table C.3 with p_3 and its pressure slope fitted to the published column "Ost. imp." of Table 3.4.
Friction is nearly in proportion to the absolute temperature, to twice what linings have where it is hotter
than any was measured: it stays there as it is at `hottest`.
"""

import math
from collections.abc import Sequence
from typing import Final, Literal

from brakelab.plant.friction.law import KELVIN, Law, Positive, RigBrake, linear_step
from brakelab.plant.jit import Record, kernel

AREA: Final = 1
MEASURED: Final = 2
FIRST: Final = 3

Three = tuple[float, float, float]


class OstermeyerRevised(Law):
    """Each p is (constant, per Pa, per m/s); see `ostermeyer.py` for the units of the constants."""

    law: Literal["ostermeyer_revised"]
    p_1: Three
    p_2: Three
    p_3: Three
    start: Positive  # mu_b before the first application
    hottest: Positive = math.inf  # degC, at which it was measured

    def row(self, brake: RigBrake) -> Sequence[float]:
        return (self.start, brake.piston_area, self.hottest, *self.p_1, *self.p_2, *self.p_3)


@kernel
def parameter(row: Record, number: int, pressure: float, speed: float) -> float:
    """Return p_1, p_2 or p_3 at this pressure [Pa] and sliding speed [m/s], not below zero."""
    place = FIRST + 3 * (number - 1)
    value: float = row[place] + row[place + 1] * pressure + row[place + 2] * speed
    return max(value, 0.0)


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
    """Return friction, twice, `dt` [s] later; see the package for the inputs."""
    p_1 = parameter(row, 1, pressure, speed)
    rate = -p_1 * (pressure * row[AREA] * speed + parameter(row, 2, pressure, speed))
    drive = p_1 * parameter(row, 3, pressure, speed) * (min(temperature, row[MEASURED]) + KELVIN)
    mu = max(linear_step(memory, rate, drive, dt), 0.0)
    return mu, mu
