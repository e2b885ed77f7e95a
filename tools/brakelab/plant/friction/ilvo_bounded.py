"""ILVO for a vehicle: every term needs pressure and contact, and the contact area is bounded.

Model. mu_b = kappa(tau) alpha, kappa a table over disc temperature (linear between knots, constant outside),
alpha' = p alpha (2 b kappa A_k r_eff / I - a kappa r_eff |omega| - c (tau - 20 degC)), 0.85 <= alpha <= 1.2,
alpha = 1 at the start of an application. A_k, r_eff and I in the debris term are the rig's.

Source. 3.11, 3.22c re-identified to the measured column of Table 3.4 (corrected: debris term positive and
driven by the brake torque instead of the deceleration, heat term in proportion to alpha, both bounded, so
that friction neither vanishes when hot nor grows while the motors brake). kappa is fitted, six knots to six
published means, so Table 3.4 is no validation of it; a, b and c are those of the set R2.
"""

from collections.abc import Sequence
from typing import Annotated, Final, Literal

from pydantic import Field

from brakelab.plant.friction.law import Law, NotNegative, RigBrake
from brakelab.plant.jit import Record, kernel

CONTACT_MIN: Final = 0.85
CONTACT_MAX: Final = 1.20
REFERENCE_TEMPERATURE: Final = 20.0  # degC
KNOTS: Final = 9

DEBRIS: Final = 1
SPEED: Final = 2
HEAT: Final = 3
KNOT: Final = 4  # temperatures, then kappa

Knots = Annotated[tuple[float, ...], Field(min_length=KNOTS, max_length=KNOTS)]


class IlvoBounded(Law):
    law: Literal["ilvo_bounded"]
    temperature: Knots  # degC
    kappa: Knots
    speed_loss: NotNegative  # m/N (a)
    debris: NotNegative  # s (b)
    heat_loss: NotNegative  # m^2/(N K s) (c)

    def row(self, brake: RigBrake) -> Sequence[float]:
        gain = self.debris * brake.gain(self.rig_mass)
        return (1.0, gain, self.speed_loss, self.heat_loss, *self.temperature, *self.kappa)


@kernel
def adhesion(row: Record, temperature: float) -> float:
    """Return kappa at `temperature` [degC]."""
    k = KNOT
    while k < KNOT + KNOTS - 2 and temperature >= row[k + 1]:
        k += 1
    part = min(max((temperature - row[k]) / (row[k + 1] - row[k]), 0.0), 1.0)
    return row[k + KNOTS] + part * (row[k + KNOTS + 1] - row[k + KNOTS])


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
    """Return contact area and friction `dt` [s] later; see the package for the inputs."""
    kappa = adhesion(row, temperature)
    growth = row[DEBRIS] * kappa - row[SPEED] * kappa * speed
    growth -= row[HEAT] * (temperature - REFERENCE_TEMPERATURE)
    contact = min(max(memory * (1.0 + dt * pressure * growth), CONTACT_MIN), CONTACT_MAX)
    return contact, kappa * contact
