"""Brake disc as a lumped thermal mass.

Model. tau' = xi T_b |omega| - (delta_0 + delta_1 v)(tau - tau_env) (3.7), air speed v the car's. xi is
constant, as the thesis holds it in Table C.1 (Figure 3.6a has a slope of the heat capacity, but no number).
Wet: rain multiplies delta_1 by WET. Assumption: the thesis shows (Figure 7.15) that rain adds cooling at
high speed, but no figures.

Source. 3.7, Table C.1 (corrected: delta_1 a tenth of the print; as printed a disc cools from 400 to 100 degC
in a minute at 100 km/h). A lump is justified while the Biot number (3.1) is below 0.1.
"""

from typing import Final

from brakelab.plant.jit import kernel

WET: Final = 2.0  # -. Assumption
DISC_SHARE: Final = 0.96  # of the friction power, 3.4
CONDUCTIVITY: Final = 50.0  # W/(m K), grey cast iron. Assumption


@kernel
def cooling_rate(still: float, by_speed: float, speed: float, wetness: float) -> float:
    """Return delta_ht [1/s] at `speed` [m/s]; `wetness` is 0 on a dry day, 1 in rain."""
    return still + by_speed * (1.0 + (WET - 1.0) * wetness) * abs(speed)


@kernel
def disc_step(
    temperature: float, heating: float, cooling: float, power: float, ambient: float, dt: float
) -> float:
    """Return the disc's temperature [degC] a step `dt` later, heated by `power` [W] (xi [K/J])."""
    return temperature + dt * (heating * power - cooling * (temperature - ambient))


def biot_number(heating: float, cooling: float, area: float, radius: float) -> float:
    """Return h r / k (3.1) for a disc cooled at the rate `cooling` [1/s] over `area` [m^2].

    `heating` (xi) [K/J] gives its heat capacity; `radius` [m] is the path of conduction. Corrected: the print
    calls the conductivity k_ht [W/(m K)] a heat transfer coefficient.
    """
    film = cooling * DISC_SHARE / heating / area
    return film * radius / CONDUCTIVITY
