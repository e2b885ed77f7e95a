"""Ceiling of grip of the road that the car is on, from wheels that slip.

The force along the car less that of the wheels that roll, over the load of those that slip, is the adhesion n
that they use. Where on the tyre's curve that is, their slip says:

    n = sum N_i mu(s_i, D) / sum N_i       mu(s, D) = D sin(c atan(C s / (c D)))       (A.11, E = 0)

It is solved for the peak D; g D is the ceiling of the brakes' deceleration. Beyond the peak the curve's shape
is an assumption: a measurement counts the less the further its wheels are from it, and the more their slip
changes. Wheels of one side alone say nothing of the road. Where no wheel slips, but the car uses most of the
peak that the observer has learned, that is a measurement too.

A car that brakes harder than the ceiling raises it. What was measured is forgotten with distance, and at once
where it is contradicted: the road is another one.
"""

import math

from ecu.algorithm.estimation.joint.layout import LEVEL, PEAK, STIFFNESS, V
from ecu.algorithm.estimation.joint.wheel import LEAST_OF_PEAK, SHAPE, car_force, peak_adhesion
from ecu.jit import Record, kernel

PRIOR = 0.4  # of ln D: from ice to a dry road; one that is less certain is unknown
KNOWN = 0.5 * PRIOR
FORGETS = 0.02  # 1/sqrt(s). Assumption: half a minute on, a road may be 10 % another one
FLOOR = 0.04  # relative: loads, mass, pitch
OF_SHAPE = 0.5  # of what the curve has fallen from its peak, or has yet to rise. Assumption
LEAST_SHARE = 0.3  # of the peak
OF_CHANGE = 0.5  # of the change of slip in a window: error of a wheel's force, and of the share of the peak
NEAR = 0.8  # of the learned peak that the car uses: there slip shows where the bend is
ROLLING_S, CALM = 1.0, 1.0  # s, m/s^2: what a wheel slips by while it rolls is an error of its radius
LASTS_S = 0.5  # for which an error of the curve's shape is the same
SLIPS = 0.1  # slip that no error of the speed explains; a wheel on a dry road has its peak there
HELD_SLIPS = 0.03  # of one that the slip guard holds: it has slipped more
GATE = 3.0
LEAST_ADHESION, LEAST_SPEED = 0.03, 4.0  # -, m/s
ITERATIONS = 4


@kernel
def _correct(state: Record, measured: float, lasting: float, passing: float, windows: float) -> None:
    """Correct the ceiling by a measured peak adhesion.

    Args:
        state: `JOINT_STATE`, overwritten.
        measured: peak adhesion.
        lasting: relative variance of what is the same in every window: it is never averaged away.
        passing: that of the rest.
        windows: in which that is the same.
    """
    before, innovation = state.ceiling_variance, 0.0
    if before > 0.0:
        innovation = math.log(measured / state.ceiling)
    if before == 0.0 or innovation * innovation > GATE * GATE * (before + lasting + passing):
        state.ceiling, before, innovation = measured, PRIOR**2, 0.0
    gain = before / (before + lasting + passing * windows)
    state.ceiling *= math.exp(gain * innovation)
    state.ceiling_variance = max(before * (1.0 - gain), min(before, lasting))


@kernel
def _share_of_peak(params: Record, state: Record, load: float, peak: float) -> float:
    """Return the adhesion of the wheels that slip, of `load` together, over the peak's."""
    total, scale = 0.0, math.exp(state.x[STIFFNESS])
    for i in range(4):
        if state.slipping[i]:
            linear = params.slip_stiffness[i] * scale * state.measured_slip[i]
            total += state.window.load[i] / load * math.sin(SHAPE * math.atan(linear / (SHAPE * peak)))
    return max(total, LEAST_SHARE)


@kernel
def _raise(state: Record, used: float) -> None:
    """Raise a ceiling that is known to an adhesion that the whole car uses."""
    if 0.0 < state.ceiling < used and state.ceiling_variance > 0.0:
        more = math.log(used / state.ceiling)
        state.ceiling = used
        state.ceiling_variance = min(max(state.ceiling_variance, more * more), PRIOR**2)


@kernel
def follow_ceiling(params: Record, state: Record, held: Record, braking: bool) -> None:
    """Overwrite the ceiling at the end of a window.

    Args:
        params: `PARAMS`.
        state: `JOINT_STATE`; `ceiling`, its relative variance, and each wheel's slip are overwritten.
        held: wheels held by the slip guard, shape (4,).
        braking: a brake application lasts.
    """
    w = state.window
    if state.ceiling_variance > 0.0:
        state.ceiling_variance += FORGETS**2 * w.time
        if state.ceiling_variance > PRIOR**2:
            state.ceiling_variance = 0.0
    speed, calm = state.x[V], False
    if state.released and state.hold_s <= 0.0:
        calm = abs(w.accel) < CALM and state.x[V] > LEAST_SPEED
    known = braking and max(state.unmeasured_s, state.unseen_s) == 0.0 and speed > LEAST_SPEED
    rest, load, slips, doubt, changed = 0.0, 0.0, 0.0, 0.0, 0.0
    left = right = False
    for i in range(4):
        r, load = params.wheel_radius[i], load + w.load[i]
        slip = 1.0 - w.omega[i] * r / max(w.ground[i], LEAST_SPEED)
        if w.omega_samples[i] == 0:
            slip = state.rolling_slip[i]
        elif calm:
            state.rolling_slip[i] += (slip - state.rolling_slip[i]) * min(w.time / ROLLING_S, 1.0)
        slip -= state.rolling_slip[i]
        change, state.measured_slip[i] = slip - state.measured_slip[i], slip
        state.slipping[i] = 1 if slip > (HELD_SLIPS if held[i] else SLIPS) else 0
        if state.slipping[i]:
            slips += w.load[i]
            left, right = left or i % 2 == 0, right or i % 2 == 1
            changed += w.load[i] * abs(change)
        else:
            spins = params.wheel_inertia[i] * speed * change / (w.time * r * r)
            rest -= state.force[i] + spins
            doubt += abs(state.force[i]) * math.sqrt(max(state.p[LEVEL + i, LEVEL + i], 0.0))
            doubt += OF_CHANGE * abs(spins)
    if not known:
        return
    total = -car_force(params, state, w.accel)
    _raise(state, total / load)
    learned = peak_adhesion(state, 1.0)
    if total > NEAR * learned * load:
        relative = math.sqrt(state.p[PEAK, PEAK]) / max(1.0 - 4.0 * state.x[PEAK], LEAST_OF_PEAK)
        _correct(state, learned, FLOOR**2 + relative * relative, 0.0, 1.0)
    if not (left and right and total - rest > LEAST_ADHESION * slips):
        return
    used = math.hypot((total - rest) / slips, w.across)
    peak, share = used, 1.0
    for _ in range(ITERATIONS):
        share = _share_of_peak(params, state, slips, peak)
        peak = used / share
    lasting = FLOOR**2 + (doubt / (total - rest)) ** 2
    shape = OF_SHAPE * (1.0 / share - 1.0)
    passing = shape * shape + (OF_CHANGE * changed / slips) ** 2
    _correct(state, peak, lasting, passing, max(LASTS_S / w.time, 1.0))
