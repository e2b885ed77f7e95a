"""ILVO: the contact area grows with collected debris and falls with sliding and with heat.

Model. mu_b = (kappa_0 + kappa_1 T) alpha with T in K (3.11, 3.12),
alpha' = a mu_b sigma r_eff |omega| + b |omega'| - c sigma (T - T_0).
State: alpha, 1 at the start of an application, not below zero.
Inputs: pressure, sliding speed, slowing, disc temperature.

Source. 3.22c (corrected: b acts on the braking deceleration with a positive sign, so that debris adds contact
as the text has it; the a-term carries kappa alpha = mu_b, and a is negative, as 3.9 put into 3.13 gives).
sigma is the stress on the pad, p A_k / A_pad (3.21), or the line pressure; T_0 is absolute zero or 20 degC.
Both are open in the print; the sets R1 and R2 choose differently and fit Table 3.4 equally well.

Validity. Replayed dynamometer stops up to 100 km/h, not a vehicle: the c-term has no factor alpha, so contact
can vanish when hot, and with the law's own pressure the fall of friction with heat is lost.
"""

from collections.abc import Sequence
from typing import Final, Literal

from brakelab.plant.friction.law import KELVIN, Law, RigBrake, linear_step
from brakelab.plant.jit import Record, kernel

KAPPA_0: Final = 1
KAPPA_1: Final = 2
SPEED: Final = 3
DEBRIS: Final = 4
HEAT: Final = 5
STRESS: Final = 6
ZERO: Final = 7


class Ilvo(Law):
    law: Literal["ilvo"]
    kappa_0: float
    kappa_1: float  # 1/K
    speed_gain: float  # m/N (a)
    debris: float  # s (b)
    heat_loss: float  # m^2/(N K s) (c)
    stress: Literal["pad", "line"]
    heat_zero: float  # K

    def row(self, brake: RigBrake) -> Sequence[float]:
        stress = brake.piston_area / brake.pad_area if self.stress == "pad" else 1.0
        return (
            1.0,
            self.kappa_0,
            self.kappa_1,
            self.speed_gain,
            self.debris,
            self.heat_loss,
            stress,
            self.heat_zero,
        )


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
    kelvin = temperature + KELVIN
    kappa = row[KAPPA_0] + row[KAPPA_1] * kelvin
    stress = row[STRESS] * pressure
    rate = row[SPEED] * kappa * stress * speed
    drive = row[DEBRIS] * slowing - row[HEAT] * stress * (kelvin - row[ZERO])
    contact = max(linear_step(memory, rate, drive, dt), 0.0)
    return contact, kappa * contact
