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

Lateness. While all pressures rise, or fall, each shows by how much it is later than its model,

    behind = (model - measured) / model'

of which the second least counts: two brakes that give nothing are not late. Once it is known to `SURE` and by
its standard deviation beyond `ALLOWED`, all times of the model are stretched; less may be an error of gain or
zero.
"""

import math

import numpy as np

from ecu.algorithm.inputs import fresh
from ecu.algorithm.lag import lag_gain, settled
from ecu.contract.params import BAR, FALL, RISE
from ecu.contract.signals import CALLIPER_PRESSURE, CYCLE_NS
from ecu.jit import Record, kernel

LONGEST_DEAD_TIME = 0.3  # s
CYCLE = 1e-9 * CYCLE_NS
HALF = 0.25 * CYCLE  # s, of a half cycle
KEPT = round(LONGEST_DEAD_TIME / CYCLE) + 1  # demands

HYDRAULICS_STATE = np.dtype(
    [
        ("history", "f8", (4, KEPT)),  # demands of the last cycles [bar], in a ring
        ("newest", "i8", (4,)),  # place of the last one in it
        ("model", "f8", (4,)),  # pressure by the demands alone [bar]
        ("rate", "f8", (4,)),  # bar/s
        ("value", "f8", (4,)),  # the same pressure, corrected by the sensor [bar]
        ("variance", "f8", (4,)),  # of `value` [bar^2]
        ("gain_variance", "f8", (4,)),  # the same with `SMOOTHED` instead of `SHARE`: gives the gain [bar^2]
        ("disagreement", "f8", (4,)),  # low-passed innovation [bar]
        ("agreed_s", "f8", (4,)),  # time for which model and sensor have agreed
        ("late", "f8", (2,)),  # lateness beyond that of CONFIG, of a rise and a fall [s]
        ("late_known", "f8", (2,)),  # 1 / variance of it, without what was unknown before [1/s^2]
        ("late_kept", "f8", (2, 2)),  # both, as the brakes were released last
    ],
    align=True,
)

Response = tuple[int, float, float]
"""To a rise or a fall: dead time in half cycles, weights of the rate and of what is missing [1/s]."""
LONGEST_GAP = 100  # cycles
WALK = 0.1  # bar/sqrt(s)
RELEASED = 0.5  # bar
SHARE = 0.15  # of a change, one standard deviation
SMOOTHED = 0.08  # the same, assumed for the gain: noise that motors follow costs more than lag
DISAGREEMENT_LAG = 0.4  # s
TOLERANCE = 3.0  # standard deviations
AGREED_S = 0.3
STEEP, LOW = 40.0, 30.0  # bar/s, bar: slower, or above it, errors of zero and gain are taken for lateness
UNKNOWN, SURE, SUREST = 0.03, 0.01, 0.004  # s, standard deviations: at first, to be used, to follow a change
CORRELATED = 10.0  # samples that count as one: errors of gain and shape last
ALLOWED = 0.015  # s
LEAST_STRETCH, LARGEST_STRETCH = 0.4, 6.0


@kernel
def _is_known(state: Record, direction: int) -> bool:
    known: bool = SURE * SURE * state.late_known[direction] >= 1.0
    return known


@kernel
def stretch(params: Record, state: Record, direction: int) -> float:
    """Return the factor on the unit's times of CONFIG by which pressures have shown to follow.

    That of the other direction where only that was shown.
    """
    shown = direction if _is_known(state, direction) else 1 - direction
    late: float = state.late[shown]
    beyond = max(abs(late) - ALLOWED, 0.0)
    if not _is_known(state, shown) or beyond * beyond * state.late_known[shown] < 1.0:
        return 1.0
    return 1.0 + late / (params.dead_time[shown] + params.pressure_lag[shown])


@kernel
def slowness(params: Record, state: Record) -> float:
    """Return the lateness of a rise over that of (A.17), as it has shown to be."""
    slow: float = params.slowness * stretch(params, state, RISE)
    return slow


@kernel
def lateness(params: Record, state: Record, direction: int) -> float:
    """Return by how much pressures follow a steady change of their demands later [s]; NaN: not known."""
    if not _is_known(state, direction):
        return math.nan
    late: float = params.dead_time[direction] + params.pressure_lag[direction] + state.late[direction]
    return late


@kernel
def _behind(
    params: Record, state: Record, inputs: Record, zero: Record, failed: Record, direction: int
) -> tuple[float, float]:
    """Return by how much the pressures are behind their models [s] and the information in it [1/s^2].

    None where not every pressure moves so.
    """
    least = second = math.inf
    known = 0.0
    for i in range(4):
        rate = abs(state.rate[i])
        moves = rate > STEEP and state.model[i] < LOW and (state.rate[i] < 0.0) == (direction == FALL)
        if failed[i] or not moves or not fresh(inputs, CALLIPER_PRESSURE + i):
            return 0.0, 0.0
        missing = state.model[i] + zero[i] - inputs.value[CALLIPER_PRESSURE + i]
        behind = missing / state.rate[i]
        second = min(second, max(least, behind))
        least = min(least, behind)
        known += rate * rate
    return second, known * BAR * BAR / (CORRELATED * params.sigma_pressure**2)


@kernel
def learn_lateness(
    params: Record, state: Record, inputs: Record, zero: Record, failed: Record, dt: float
) -> None:
    """Learn by how much the pressures are later than CONFIG says; the ECU alone brakes.

    Arguments as for `correct_pressures`, `inputs` before what is implausible was masked out.
    """
    if dt > 1.5 * CYCLE:  # the missed cycles are made up for later
        return
    if max(state.model[0], state.model[1], state.model[2], state.model[3]) < RELEASED:
        for direction in (RISE, FALL):
            state.late_kept[0, direction] = state.late[direction]
            state.late_kept[1, direction] = state.late_known[direction]
    for direction in (RISE, FALL):
        behind, known = _behind(params, state, inputs, zero, failed, direction)
        if known == 0.0:
            continue
        usual = params.dead_time[direction] + params.pressure_lag[direction]
        now = usual * stretch(params, state, direction)
        found = now - usual + min(max(behind, -now), 2.0 * now)
        state.late_known[direction] = min(state.late_known[direction] + known, 1.0 / SUREST**2)
        late = state.late[direction]
        late += known / (state.late_known[direction] + 1.0 / UNKNOWN**2) * (found - late)
        state.late[direction] = min(max(late, (LEAST_STRETCH - 1.0) * usual), (LARGEST_STRETCH - 1.0) * usual)


@kernel
def forget_lateness(state: Record) -> None:
    """Take back what this application has taught of lateness: its readings were wrong."""
    for direction in (RISE, FALL):
        state.late[direction] = state.late_kept[0, direction]
        state.late_known[direction] = state.late_kept[1, direction]


@kernel
def _half_cycles(dead_time: float) -> int:
    return min(max(int(2.0 * dead_time / CYCLE + 0.5), 2), 2 * KEPT - 2)


@kernel
def _delayed(state: Record, i: int, half_cycles: int) -> float:
    """Return the demand of a wheel as old as that [bar], 0: of the coming cycle."""
    place = state.newest[i] - half_cycles // 2
    demand: float = state.history[i, place if place >= 0 else place + KEPT]
    return demand


@kernel
def _response(params: Record, state: Record, direction: int) -> Response:
    slow = stretch(params, state, direction)
    inertia = slow * slow * params.pressure_inertia[direction]
    lag = slow * params.pressure_lag[direction]
    dead = _half_cycles(slow * params.dead_time[direction])
    return dead, HALF * (lag + HALF) / inertia, 2.0 * HALF / inertia


@kernel
def _advance_half_cycle(
    params: Record, state: Record, i: int, target: float, rise: Response, fall: Response
) -> None:
    _, weight, pull = fall if target < state.model[i] else rise
    rate = (state.rate[i] * (1.0 - weight) + pull * (target - state.model[i])) / (1.0 + weight)
    rate = min(max(rate, -params.pressure_rate[FALL]), params.pressure_rate[RISE])
    state.model[i] = settled(state.model[i] + HALF * (state.rate[i] + rate))
    state.rate[i] = settled(rate)


@kernel
def _advance(params: Record, state: Record, i: int, sent: float, rise: Response, fall: Response) -> None:
    rising, falling = rise[0], fall[0]
    before = state.model[i]
    state.newest[i] = state.newest[i] + 1 if state.newest[i] + 1 < KEPT else 0
    state.history[i, state.newest[i]] = sent
    for passed in (1, 2):
        risen, fallen = _delayed(state, i, rising - passed), _delayed(state, i, falling - passed)
        target = min(risen, fallen) if rising >= falling else max(risen, fallen)
        _advance_half_cycle(params, state, i, target, rise, fall)
    change = state.model[i] - before
    state.value[i] += change
    state.variance[i] += WALK**2 * CYCLE + (SHARE * change) ** 2
    state.gain_variance[i] += WALK**2 * CYCLE + (SMOOTHED * change) ** 2


@kernel
def advance_pressures(params: Record, state: Record, sent: Record) -> None:
    """Move the pressures on by the coming cycle; `sent` [Pa], shape (4,): the demands of the last one."""
    rise, fall = _response(params, state, RISE), _response(params, state, FALL)
    for i in range(4):
        _advance(params, state, i, sent[i] / BAR, rise, fall)


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
    for _ in range(missed):
        advance_pressures(params, state, sent)
    for i in range(4):
        place = CALLIPER_PRESSURE + i
        if fresh(inputs, place):
            _correct(state, i, inputs.value[place] - zero[i], params.sigma_pressure / BAR, dt)
        if failed[i]:
            state.agreed_s[i] = 0.0


@kernel
def follows_demand(params: Record, state: Record, i: int) -> bool:
    """Return whether a wheel's pressure has followed the demand for some time; a shadow's counts for none."""
    return params.transmit != 0 and state.agreed_s[i] > AGREED_S
