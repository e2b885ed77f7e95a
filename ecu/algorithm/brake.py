"""Disc brake: torque per pressure (A.19), and the pressure at a calliper by model and sensor together."""

import math

from ecu.contract.params import BAR
from ecu.jit import Record, kernel

DISAGREEMENT_LAG = 0.4  # s
TOLERANCE = 3.0  # standard deviations


@kernel
def brake_gain(params: Record, i: int) -> float:
    """Return a wheel's brake torque per friction and pressure [N m/Pa], 2 A_k r_eff."""
    return 2.0 * params.piston_area[i] * params.effective_radius[i]


@kernel
def brake_gain_per_bar(params: Record, i: int) -> float:
    """Return brake torque per friction and pressure [N m/bar] of a wheel."""
    return 2.0 * BAR * params.piston_area[i] * params.effective_radius[i]


@kernel
def correct_pressure(state: Record, i: int, measured: float, sigma: float, dt: float) -> None:
    """Fuse a calliper pressure sample with its model; judge whether the pressure follows the demand.

    Where model and sensor disagree persistently, the sample alone counts until both agree again.

    Args:
        state: record whose `value` [bar], `variance` [bar^2], `disagreement` [bar] and `agreed_s` [s], shape
            (4,) each, are overwritten; the model of the hydraulics has moved value and variance on.
        i: wheel.
        measured: sample less the sensor's zero [bar].
        sigma: its standard deviation [bar].
        dt: time since the last cycle [s].
    """
    innovation = measured - state.value[i]
    gain = 1.0 - math.exp(-dt / DISAGREEMENT_LAG)
    state.disagreement[i] += gain * (innovation - state.disagreement[i])
    averaged = sigma * math.sqrt(0.5 * gain) + math.sqrt(state.variance[i])
    limit = TOLERANCE * averaged
    if abs(state.disagreement[i]) > limit:
        state.value[i], state.variance[i] = measured, sigma * sigma
        state.disagreement[i] = state.agreed_s[i] = 0.0
        return
    state.agreed_s[i] += dt
    total = state.variance[i] + sigma * sigma
    weight = state.variance[i] / total
    state.value[i] += weight * innovation
    state.variance[i] *= 1.0 - weight
