"""Wear of the simulated pads, by a law of its own: Archard's with a temperature-activated regime.

Both pads of a calliper together lose, by normal force and sliding distance (independent of friction, after
Archard),

    m' = k u (p / p_r)^n_p (v / v_r)^n_v H(tau_c) R(m) 2 p A_k v        v = r_eff |omega|
    H = 1 + h / (1 + exp(-(tau_c - tau_h) / w))       above tau_h the binder of the lining goes
    R = 1 + r exp(-m / m_r)                           a new lining runs in
    tau_c = tau + f 2 p A_k v                         the contact is hotter than the disc, by the power

u is unknown on board: the lot of the lining, and air and dirt of the day. Wear in mm is
m / (2 rho A): pads without chamfers.

Source: the shape is Archard's; that heat raises it is in refs [93-101] of the thesis, whose own laws are
linear in integrals of energy instead (7.13). All numbers (`WearLaw`) are assumptions, near the 0.1 to 0.2
g/MJ of Table 7.1.
"""

import math
from typing import Final

from brakelab.plant.friction.law import NotNegative, Positive, Section
from brakelab.plant.jit import Record, kernel

MEGA: Final = 1e-6
REFERENCE_PRESSURE: Final = 20e5  # Pa
REFERENCE_SPEED: Final = 5.0  # m/s, of sliding
WEAR_ROW: Final = 11
(RATE, BY_PRESSURE, BY_SPEED, HOT, HOT_FROM, HOT_WIDTH, FLASH, RUN_IN, RUN_IN_MASS, AREA, DENSITY) = range(11)


class WearLaw(Section):
    """Numbers of the law for one lining."""

    rate: Positive = 0.035
    """k, g per MJ of normal force times distance."""
    by_pressure: float = 0.10
    by_speed: float = 0.12
    hot: NotNegative = 2.0
    hot_from: Positive = 230.0  # degC
    hot_width: Positive = 40.0  # K
    flash: NotNegative = 0.9e-3  # K/W
    run_in: NotNegative = 0.5
    run_in_mass: Positive = 6.0  # g
    density: Positive = 2500.0  # kg/m^3

    def row(self, pad_area: float) -> tuple[float, ...]:
        """Return the law's numbers for its kernel, for pads of `pad_area` [m^2]."""
        law = (self.rate, self.by_pressure, self.by_speed, self.hot, self.hot_from, self.hot_width)
        return (*law, self.flash, self.run_in, self.run_in_mass, pad_area, self.density)


@kernel
def wear_rate(row: Record, force: float, speed: float, pressure: float, heat: float) -> float:
    """Return the wear rate of a run-in lining [g/s].

    `force` 2 p A_k [N], `speed` of sliding [m/s], `pressure` above push-out [Pa], `heat` of the disc [degC].
    """
    if force <= 0.0 or speed <= 0.0:
        return 0.0
    work = force * speed
    contact = heat + row[FLASH] * work
    activated = 1.0 + row[HOT] / (1.0 + math.exp(-(contact - row[HOT_FROM]) / row[HOT_WIDTH]))
    shape = (pressure / REFERENCE_PRESSURE) ** row[BY_PRESSURE] * (speed / REFERENCE_SPEED) ** row[BY_SPEED]
    return MEGA * row[RATE] * work * shape * activated


@kernel
def running_in(row: Record, mass: float) -> float:
    """Return the factor on the wear of a lining that has lost `mass` [g]."""
    return 1.0 + row[RUN_IN] * math.exp(-mass / row[RUN_IN_MASS])


@kernel
def pad_wear(row: Record, mass: float) -> float:
    """Return the wear [mm] that corresponds to `mass` [g] of both pads."""
    return mass / (2.0 * row[DENSITY] * row[AREA])


@kernel
def advance_wear(params: Record, state: Record, dt: float) -> None:
    """Wear the pads of the four brakes for `dt` [s]."""
    for wheel in range(4):
        pressure = state.pressure[wheel] - params.push_out_pressure[wheel]
        if pressure <= 0.0:
            continue
        row, mass = params.wear_row[wheel], state.pad_wear_mass[wheel]
        rate = wear_rate(
            row,
            2.0 * pressure * params.piston_area[wheel],
            params.effective_radius[wheel] * abs(state.wheel_speed[wheel]),
            pressure,
            state.disc_temperature[wheel],
        )
        state.pad_wear_mass[wheel] = mass + dt * params.wear_scale[wheel] * running_in(row, mass) * rate
