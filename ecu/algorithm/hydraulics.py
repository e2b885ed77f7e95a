"""Calliper pressures: the hydraulics' response to the demands sent, corrected by the sensors.

Model. The demands sent, after the dead time of the hydraulics for a rise and for a fall (by default A.17,
A.18: 26 and 15 ms; here in half cycles), drive a second-order pressure,

    inertia p'' + lag p' + p = min(rise, fall)        p' within the limits of the unit, where it has any

by the trapezoidal rule. No dead time is shorter than a cycle, so the coming one is known already. Where the
rise is the sooner of both, the larger counts.

The sensor's noise (Table 4.1: 1.8 bar) is some 50 N m at a front wheel and multiplies the unknown friction;
only averaging over time reduces it. Where the hydraulics follow the demand, the pressure is predictable and
can be averaged; the variance grows with the change, which covers errors of lag and gain. Where the sensor
disagrees persistently (a fallback, another controller) its samples count alone until both agree again.
"""

import math

import numpy as np

from ecu.algorithm.inputs import fresh
from ecu.algorithm.lag import lag_gain
from ecu.contract.params import BAR, FALL, RISE
from ecu.contract.signals import CALLIPER_PRESSURE, CYCLE_NS
from ecu.jit import Record, kernel

LONGEST_DEAD_TIME = 0.3  # s
CYCLE = 1e-9 * CYCLE_NS
KEPT = round(LONGEST_DEAD_TIME / CYCLE) + 1  # demands

HYDRAULICS_STATE = np.dtype(
    [
        ("history", "f8", (KEPT, 4)),  # demands of the last cycles [bar], the newest in row 0
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

LONGEST_GAP = 100  # cycles
WALK = 0.1  # bar/sqrt(s)
SHARE = 0.15  # of a change, one standard deviation
SMOOTHED = 0.08  # the same, assumed for the gain: noise that motors follow costs more than lag
DISAGREEMENT_LAG = 0.4  # s
TOLERANCE = 3.0  # standard deviations
AGREED_S = 0.3


@kernel
def _half_cycles(dead_time: float) -> int:
    return min(max(int(2.0 * dead_time / CYCLE + 0.5), 2), 2 * KEPT - 2)


@kernel
def _advance_half_cycle(params: Record, state: Record, i: int, target: float) -> None:
    direction = FALL if target < state.model[i] else RISE
    inertia, lag = params.pressure_inertia[direction], params.pressure_lag[direction]
    half = 0.25 * CYCLE
    weight = half * (lag + half) / inertia
    pull = 2.0 * half / inertia * (target - state.model[i])
    rate = (state.rate[i] * (1.0 - weight) + pull) / (1.0 + weight)
    rate = min(max(rate, -params.pressure_rate[FALL]), params.pressure_rate[RISE])
    state.model[i] += half * (state.rate[i] + rate)
    state.rate[i] = rate


@kernel
def _advance(params: Record, state: Record, i: int, sent: float) -> None:
    demand, before = state.history, state.model[i]
    rising, falling = _half_cycles(params.dead_time[RISE]), _half_cycles(params.dead_time[FALL])
    for k in range(KEPT - 1, 0, -1):
        demand[k, i] = demand[k - 1, i]
    demand[0, i] = sent
    for passed in (1, 2):
        rise, fall = demand[(rising - passed) // 2, i], demand[(falling - passed) // 2, i]
        target = min(rise, fall) if rising >= falling else max(rise, fall)
        _advance_half_cycle(params, state, i, target)
    change = state.model[i] - before
    state.value[i] += change
    state.variance[i] += WALK**2 * CYCLE + (SHARE * change) ** 2
    state.gain_variance[i] += WALK**2 * CYCLE + (SMOOTHED * change) ** 2


@kernel
def advance_pressures(params: Record, state: Record, sent: Record) -> None:
    """Move the pressures on by the coming cycle; `sent` [Pa], shape (4,): the demands of the last one."""
    for i in range(4):
        _advance(params, state, i, sent[i] / BAR)


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
            _advance(params, state, i, sent[i] / BAR)
        place = CALLIPER_PRESSURE + i
        if fresh(inputs, place):
            _correct(state, i, inputs.value[place] - zero[i], params.sigma_pressure / BAR, dt)
        if failed[i]:
            state.agreed_s[i] = 0.0


@kernel
def follows_demand(params: Record, state: Record, i: int) -> bool:
    """Return whether a wheel's pressure has followed the demand for some time; a shadow's counts for none."""
    return params.transmit != 0 and state.agreed_s[i] > AGREED_S
