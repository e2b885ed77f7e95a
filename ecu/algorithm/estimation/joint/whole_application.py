"""Friction and ceiling of grip of a car that others brake, from whole brake applications.

What linings ask for and what road and tyres give are two things. In a car that this ECU does not brake, drive
and pressure of each wheel are seldom known, and within an application pedal, engine and grip change together:
its windows alone do not tell them apart. The means of applications do (`whole_filter.py`), with

    L = sum 2 A_i r_i mu_i p_i / (R_i m)

Where the torques of the drive and of each brake are known and wheels are measured one by one, mu_i is the
friction as learned window by window, s next to 1 and the unreported drag next to none. Elsewhere windows
teach nothing: mu_i is the configured friction, or what was learned where they did; the unreported drag
includes the accelerometer's zero. An application that was not measured widens nothing.

What linings ask for reaches the road while wheels roll with the car, whatever the ceiling. So where wheels
are measured one by one, nothing is bent until two of them have slipped in this application: a control of slip
that reports nothing takes their pressure from then on, and lets them roll now and then.
"""

import math

import numpy as np

from ecu.algorithm.estimate import GREATEST_RATIO, LEAST_RATIO
from ecu.algorithm.estimation.joint.drive import other_decel, torque_share
from ecu.algorithm.estimation.joint.layout import BIAS, LEVEL, MASS, V
from ecu.algorithm.estimation.joint.sliding import count_wheels
from ecu.algorithm.estimation.joint.wheel import (
    brake_torque,
    drive_opposes,
    radius,
    unknown_share,
    weigh_linings,
)
from ecu.algorithm.estimation.joint.whole_filter import (
    BESIDE,
    BESIDE_DRAG,
    FALL,
    FILTER_STATE,
    KNEE,
    NOISE,
    OVERRUN,
    POWER,
    SCALE,
    believe_windows,
    bend,
    ceiling_of,
    correct_by_coasting,
    correct_by_mean,
    per_power,
    published_ceiling,
    restore_filter,
    variance_of_mean,
)
from ecu.algorithm.estimation.joint.window import COPIES
from ecu.algorithm.inputs import (
    LEAST_REQUEST,
    driver_accelerates,
    requested_decel,
    usable,
    wheels_mapped,
)
from ecu.contract.signals import ACCEL_X, ACCELERATOR_POSITION
from ecu.jit import Record, kernel

LEAST_SPEED, ACROSS = 5.0, 0.4  # m/s, lateral acceleration over gravity: limits of the force balance
ONSET_S = 0.25  # callipers and accelerometer lag behind the pressure
LEAST_S = 0.3  # of an application that is learned from
LEAST_DECEL, LEAST_TOTAL = 0.8, 1.5  # m/s^2, of linings, or of the car: a light braking tells the drag
LONGEST_STEP_S = 0.5  # between samples that are compared
# After the accelerator or the brakes were released: the drive and the sensors lag; later the brake pedal may
# have moved, which brings motors before pressure.
COASTS_FROM_S, COASTS_TO_S = 0.35, 1.35
BENDS = 0.7  # of the ceiling, beyond which windows no longer teach friction
USUAL = 6.0  # m/s^2, of the linings, before any application
UNSEEN, ROLLED, SLIPPED = range(3)  # what wheels have done in an application

WHOLE_STATE = np.dtype(
    [
        ("filter", FILTER_STATE),
        ("alone", "u1"),  # nothing but whole applications teaches
        ("wheels", "u1"),  # what they have done in this application
        ("bent", "u1"),  # the linings ask for more than road and tyres give freely
        ("coasting_s", "f8"),  # since a pedal was last pressed
        ("unshown", "f8", (4,)),  # variance of ln friction of a lining against that of all together
        ("age_s", "f8"),  # of the application
        ("common", "f8"),  # time of the last comparison [s]
        ("time", "f8"),  # for which it could be measured [s]
        ("measured", "f8"),  # integrals over that: f [m/s^2 s]
        ("expected", "f8"),  # s L below the ceiling
        ("linings", "f8"),  # s L
        ("total", "f8"),  # deceleration of the car
        ("by_scale", "f8"),  # derivatives of `expected`
        ("by_grip", "f8"),
        ("by_power", "f8"),
        ("by_fall", "f8"),
        ("usual", "f8"),  # s L of the last application whose linings taught [m/s^2]
        ("driven", "f8"),  # fading integral of the squared deceleration by reported torques [m^2/s^3]
        ("arrived", "f8"),  # likewise of it times that of the car
    ],
    align=True,
)


@kernel
def restore_whole(state: Record, learned: Record) -> None:
    """Restore learned states, less certain by a pause; use the prior where nothing was learned."""
    state.usual = USUAL
    restore_filter(state.filter, learned)


@kernel
def apply_scale(params: Record, state: Record, learned: Record) -> None:
    """Scale the stored friction by that of whole applications, within its bounds.

    Its standard deviation is that of the windows where these teach: they know the lining, `SCALE` the car.
    """
    scale = math.exp(state.filter.value[SCALE])
    variance = state.filter.covariance[SCALE, SCALE] if state.alone else 0.0
    for i in range(4):
        ratio = scale * learned.mu_b[i] / params.mu_nominal[i]
        relative = learned.sigma_mu_b[i] / learned.mu_b[i]
        learned.mu_b[i] = params.mu_nominal[i] * min(max(ratio, LEAST_RATIO), GREATEST_RATIO)
        learned.sigma_mu_b[i] = learned.mu_b[i] * math.sqrt(relative * relative + variance)


@kernel
def torques_measured(params: Record, joint: Record) -> bool:
    """Return whether the drive is known, and the pressure of each wheel by a sensor of its own."""
    apart: bool = joint.differs[0] != 0 and joint.differs[1] != 0
    return apart and unknown_share(params, joint) == 0.0


@kernel
def _hand_over_scale(state: Record, joint: Record) -> None:
    """Turn the scale into friction of the linings, from which windows go on."""
    for i in range(LEVEL, LEVEL + 4):
        joint.x[i] += state.filter.value[SCALE]
        for snapshot in range(2):
            joint.kept_x[snapshot, i] += state.filter.value[SCALE]
        joint.calm_x[i] += state.filter.value[SCALE]
    state.filter.value[SCALE] = 0.0


@kernel
def _wheels_apart(params: Record, joint: Record) -> bool:
    """Return whether wheels are measured one by one."""
    apart: bool = wheels_mapped(params) and joint.speed_copies <= COPIES and joint.sliding < 4
    return apart


@kernel
def _windows_teach(params: Record, state: Record, joint: Record) -> bool:
    measured = torques_measured(params, joint) and torque_share(state) == 1.0
    teach: bool = _wheels_apart(params, joint) and measured and params.mapped[ACCEL_X] != 0
    return teach


@kernel
def begin_whole(params: Record, state: Record, joint: Record) -> None:
    """Begin an application."""
    alone = not _windows_teach(params, state, joint)
    if state.alone and not alone:
        _hand_over_scale(state, joint)
    state.alone = 1 if alone else 0
    state.wheels, state.bent = UNSEEN, 0
    state.age_s, state.coasting_s, state.common = 0.0, 0.0, joint.sampling.common
    _open_mean(state)


@kernel
def _open_mean(state: Record) -> None:
    state.time = state.measured = state.expected = state.linings = state.total = 0.0
    state.by_scale = state.by_grip = state.by_power = state.by_fall = 0.0


@kernel
def _mass(params: Record, state: Record, joint: Record) -> float:
    mass: float = params.mass
    return mass if state.alone else mass * math.exp(joint.x[MASS])


@kernel
def _lining_decel(params: Record, joint: Record, mass: float) -> float:
    total = 0.0
    for i in range(4):
        r, _ = radius(params, joint, i, joint.window.load[i])
        total += max(brake_torque(params, joint, i, joint.window.common_pressure[i]), 0.0) / (r * mass)
    return total


@kernel
def _can_be_judged(params: Record, joint: Record) -> bool:
    """Return whether the last window shows the force balance of the car."""
    lost = joint.unmeasured_s > LONGEST_STEP_S and params.mapped[ACCEL_X]
    w = joint.window
    judged: bool = w.balanced != 0 and joint.x[V] > LEAST_SPEED and abs(w.across) < ACROSS
    return judged and not lost


@kernel
def _all_reaches_the_road(params: Record, state: Record, joint: Record) -> bool:
    """Return whether wheels that are measured one by one have rolled with the car all this application."""
    rolling, slipping = count_wheels(params, joint, joint.x[V])
    if slipping > 1:
        state.wheels = SLIPPED
    elif state.wheels == UNSEEN and rolling > 2:
        state.wheels = ROLLED
    return state.wheels == ROLLED and _wheels_apart(params, joint)


@kernel
def add_to_whole(params: Record, state: Record, joint: Record) -> None:
    """Add the last window of an application."""
    w = joint.window
    state.age_s += w.time
    step = min(joint.sampling.common - state.common, LONGEST_STEP_S)
    state.common = joint.sampling.common
    share = torque_share(state)
    judged = state.age_s > ONSET_S and _can_be_judged(params, joint)
    if not judged or drive_opposes(params, joint, share):
        return
    mass = _mass(params, state, joint)
    linings = math.exp(state.filter.value[SCALE]) * _lining_decel(params, joint, mass)
    ceiling = ceiling_of(state.filter)
    if _all_reaches_the_road(params, state, joint):
        expected, by_scale, by_grip, by_fall = linings, linings, 0.0, 0.0
    else:
        expected, by_scale, by_grip, by_fall = bend(linings, ceiling, state.filter.value[FALL])
    state.bent = 1 if linings > BENDS * ceiling else 0
    state.time += step
    state.measured -= step * other_decel(params, joint, mass, share)
    if not state.alone:
        state.measured += step * joint.x[BIAS]
    state.linings += step * linings
    state.total -= step * w.common_accel
    state.expected += step * expected
    state.by_scale += step * by_scale
    state.by_grip += step * by_grip
    state.by_power += step * per_power(joint.x[V])
    state.by_fall += step * by_fall


@kernel
def end_whole(state: Record) -> None:
    """Correct the states by the mean of this application up to now, if it was measured, and open another."""
    linings = state.linings >= LEAST_DECEL * state.time
    if state.time < LEAST_S or not (linings or state.total >= LEAST_TOTAL * state.time):
        return
    if not state.alone:
        believe_windows(state.filter)
    correct_by_mean(
        state.filter,
        state.measured / state.time,
        state.expected / state.time,
        state.by_scale / state.time,
        state.by_grip / state.time,
        state.by_power / state.time,
        state.by_fall / state.time,
        state.alone != 0,
    )
    if linings:
        state.usual = state.linings / state.time
    _open_mean(state)


@kernel
def add_coasting(params: Record, state: Record, joint: Record, inputs: Record) -> bool:
    """Learn the unreported drag from the last window, without brakes; return whether it shows it."""
    known = usable(inputs, ACCELERATOR_POSITION)
    if not known or driver_accelerates(inputs) or requested_decel(params, inputs) > LEAST_REQUEST:
        state.coasting_s = 0.0
        return False
    state.coasting_s += joint.window.time
    coasts = COASTS_FROM_S <= state.coasting_s <= COASTS_TO_S
    if not coasts or _windows_teach(params, state, joint) or not _can_be_judged(params, joint):
        return False
    drag = -other_decel(params, joint, params.mass, torque_share(state))
    correct_by_coasting(state.filter, drag, joint.x[V], joint.window.time)
    return True


@kernel
def _compare_linings(params: Record, state: Record, joint: Record) -> None:
    """Overwrite `unshown`: the force of all linings together says nothing of how they share it."""
    p, share, total = joint.p, joint.h, weigh_linings(params, joint)
    for i in range(LEVEL, LEVEL + 4):
        variance = p[i, i]
        for j in range(LEVEL, LEVEL + 4):
            variance -= 2.0 * share[j] / total * p[i, j]
            for k in range(LEVEL, LEVEL + 4):
                variance += share[j] * share[k] / (total * total) * p[j, k]
        state.unshown[i - LEVEL] = max(variance, 0.0)


@kernel
def tell_whole(params: Record, state: Record, joint: Record, estimate: Record) -> None:
    """Overwrite friction, drag and ceiling of the estimate, and how well the next braking is known.

    A lining's standard deviation contains what whole applications alone do not show: front against rear.
    """
    if state.alone and joint.closed:
        _compare_linings(params, state, joint)
    x, p = state.filter.value, state.filter.covariance
    scale, variance = math.exp(x[SCALE]), p[SCALE, SCALE]
    if not state.alone:
        variance = min(variance, BESIDE**2)
    for i in range(4):
        own = state.unshown[i] if state.alone else (estimate.sigma[i] / estimate.mu[i]) ** 2
        estimate.mu[i] *= scale
        estimate.sigma[i] = estimate.mu[i] * math.sqrt(own + variance)
    expected, by_scale, by_grip, by_fall = bend(state.usual, ceiling_of(state.filter), x[FALL])
    variance = variance_of_mean(state.filter, expected, by_scale, by_grip, by_fall)
    if not state.alone:
        variance += (by_scale * estimate.sigma_force) ** 2
    estimate.sigma_force = math.sqrt(variance) / expected
    estimate.overrun, estimate.overrun_power = x[OVERRUN], x[POWER]
    estimate.sigma_overrun = math.sqrt(p[OVERRUN, OVERRUN] + state.filter.noise_ratio * NOISE**2)
    if estimate.torques_known and not state.alone:
        known = BESIDE_DRAG**2 / max(p[OVERRUN, OVERRUN], BESIDE_DRAG**2)
        estimate.overrun *= known
        estimate.overrun_power *= known
    if state.alone:
        estimate.accel_bias, estimate.mass = 0.0, params.mass
    estimate.torque_share = torque_share(state)
    estimate.grip_limit, estimate.sigma_grip_limit = published_ceiling(state.filter)
    estimate.grip_knee, estimate.grip_fall = KNEE, x[FALL]
    if state.filter.at_bound:
        estimate.at_bound = 1
