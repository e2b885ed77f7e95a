"""Ostermeyer's law: friction is a balance of patches that heat builds and friction power destroys.

Model. mu_b' = -p_1 ((F_n r_eff |omega| + p_2) mu_b - p_3 T), F_n = p A_k, T in K.
State: mu_b, not below zero. Inputs: pressure, sliding speed, disc temperature.

Source. 2.1a, 2.2, Table C.3 (corrected: T in kelvin, with degC the error is 66 %; A_k already sums the
pistons of a side). p_1 p_2 is 33 to 195 1/s, so the law forgets its starting value within 0.1 s.
"""

from collections.abc import Sequence
from typing import Final, Literal

from brakelab.plant.friction.law import KELVIN, Law, Positive, RigBrake, linear_step
from brakelab.plant.jit import Record, kernel

RATE: Final = 1
DECAY: Final = 2
BUILD: Final = 3
AREA: Final = 4


class Ostermeyer(Law):
    law: Literal["ostermeyer"]
    p_1: Positive  # 1/(N m)
    p_2: Positive  # N m/s
    p_3: Positive  # N m/(K s)
    start: Positive  # mu_b before the first application

    def row(self, brake: RigBrake) -> Sequence[float]:
        return (self.start, self.p_1, self.p_2, self.p_3, brake.piston_area)


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
    rate = -row[RATE] * (pressure * row[AREA] * speed + row[DECAY])
    drive = row[RATE] * row[BUILD] * (temperature + KELVIN)
    mu = max(linear_step(memory, rate, drive, dt), 0.0)
    return mu, mu
