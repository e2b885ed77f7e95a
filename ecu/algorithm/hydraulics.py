"""Calliper pressures: the hydraulics' response to the demands sent, corrected by the sensors.

Model. The demands sent, after the dead time of the hydraulics (A.17, A.18: 26 ms for a rise, 15 ms for a
fall; here 25 and 15, half cycles), drive a second-order pressure,

    inertia p'' + damping p' + p = min(rise, fall)

by the trapezoidal rule. The dead time is longer than a cycle, so the coming one is known already.

The sensor's noise (Table 4.1: 1.8 bar) is some 50 N m at a front wheel and multiplies the unknown friction;
only averaging over time reduces it. Where the hydraulics follow the demand, the pressure is predictable and
can be averaged; the variance grows with the change, which covers errors of lag and gain. Where the sensor
disagrees persistently (a fallback, another controller) its samples count alone until both agree again.
"""

import math

import numpy as np

from ecu.algorithm.inputs import fresh
from ecu.algorithm.lag import lag_gain
from ecu.contract.params import BAR
from ecu.contract.signals import CALLIPER_PRESSURE, CYCLE_NS
from ecu.jit import Record, kernel

HYDRAULICS_STATE = np.dtype(
    [
        ("demand", "f8", (3, 4)),  # of the last cycles [bar], the newest in row 0
        ("model", "f8", (4,)),  # pressure by the demands alone [bar]
        ("rate", "f8", (4,)),  # bar/s
        ("value", "f8", (4,)),  # the same pressure, corrected by the sensor [bar]
        ("variance", "f8", (4,)),  # of `value` [bar^2]
        ("gain_variance", "f8", (4,)),  # the same with `SMOOTHED` instead of `SHARE`: gives the gain [bar^2]
        ("disagreement", "f8", (4,)),  # low-passed innovation [bar]
        ("agreed_s", "f8", (4,)),  # time for which model and sensor have agreed
    ],
    align=True,
)

BUILD_UP = (0.00075, 0.037)  # s^2, s (A.17)
RELEASE = (0.00021, 0.045)  # s^2, s (A.18)
CYCLE = 1e-9 * CYCLE_NS
LONGEST_GAP = 100  # cycles
WALK = 0.1  # bar/sqrt(s)
SHARE = 0.15  # of a change, one standard deviation
SMOOTHED = 0.08  # the same, assumed for the gain: noise that motors follow costs more than lag
DISAGREEMENT_LAG = 0.4  # s
TOLERANCE = 3.0  # standard deviations
AGREED_S = 0.3


@kernel
def _advance_half_cycle(state: Record, i: int, target: float) -> None:
    inertia, damping = RELEASE if target < state.model[i] else BUILD_UP
    half = 0.25 * CYCLE
    weight = half * (damping + half) / inertia
    pull = 2.0 * half / inertia * (target - state.model[i])
    rate = (state.rate[i] * (1.0 - weight) + pull) / (1.0 + weight)
    state.model[i] += half * (state.rate[i] + rate)
    state.rate[i] = rate


@kernel
def _advance(state: Record, i: int, sent: float) -> None:
    demand, before = state.demand, state.model[i]
    demand[2, i], demand[1, i], demand[0, i] = demand[1, i], demand[0, i], sent
    _advance_half_cycle(state, i, min(demand[2, i], demand[1, i]))
    _advance_half_cycle(state, i, min(demand[1, i], demand[0, i]))
    change = state.model[i] - before
    state.value[i] += change
    state.variance[i] += WALK**2 * CYCLE + (SHARE * change) ** 2
    state.gain_variance[i] += WALK**2 * CYCLE + (SMOOTHED * change) ** 2


@kernel
def advance_pressures(state: Record, sent: Record) -> None:
    """Move the pressures on by the coming cycle; `sent` [Pa], shape (4,): the demands of the last one."""
    for i in range(4):
        _advance(state, i, sent[i] / BAR)


@kernel
def _correct(state: Record, i: int, measured: float, sigma: float, dt: float) -> None:
    """Fuse a sample less the sensor's zero [bar]; judge whether the pressure follows the demand."""
    innovation = measured - state.value[i]
    gain = lag_gain(dt, DISAGREEMENT_LAG)
    state.disagreement[i] += gain * (innovation - state.disagreement[i])
    averaged = sigma * math.sqrt(0.5 * gain) + math.sqrt(state.variance[i])
    if abs(state.disagreement[i]) > TOLERANCE * averaged:
        state.value[i], state.variance[i] = measured, sigma * sigma
        state.gain_variance[i] = sigma * sigma
        state.disagreement[i] = state.agreed_s[i] = 0.0
        return
    state.agreed_s[i] += dt
    weight = state.gain_variance[i] / (state.gain_variance[i] + sigma * sigma)
    state.value[i] += weight * innovation
    state.gain_variance[i] *= 1.0 - weight
    state.variance[i] = (1.0 - weight) ** 2 * state.variance[i] + (weight * sigma) ** 2


@kernel
def correct_pressures(
    params: Record, state: Record, inputs: Record, sent: Record, zero: Record, failed: Record, dt: float
) -> None:
    """Correct the pressures of this instant by the samples that have come.

    Args:
        params: `PARAMS`.
        state: `HYDRAULICS_STATE`, overwritten.
        inputs: `INPUTS`.
        sent: pressure demands of the last cycle [Pa], shape (4,); missed cycles held them.
        zero: pressure zeros [bar], shape (4,).
        failed: 1 for a failed brake, which follows nothing, shape (4,).
        dt: time since the last cycle [s].
    """
    missed = min(max(round(dt / CYCLE), 1), LONGEST_GAP) - 1
    for i in range(4):
        for _ in range(missed):
            _advance(state, i, sent[i] / BAR)
        place = CALLIPER_PRESSURE + i
        if fresh(inputs, place):
            _correct(state, i, inputs.value[place] - zero[i], params.sigma_pressure / BAR, dt)
        if failed[i]:
            state.agreed_s[i] = 0.0


@kernel
def follows_demand(params: Record, state: Record, i: int) -> bool:
    """Return whether a wheel's pressure has followed the demand for some time; a shadow's counts for none."""
    return params.transmit != 0 and state.agreed_s[i] > AGREED_S
