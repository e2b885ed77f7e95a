"""Friction and ceiling of grip of a car that others brake, from whole brake applications.

What linings ask for and what road and tyres give are two things. In a car that this ECU does not brake, drive
and pressure of each wheel are seldom known, and within an application pedal, engine and grip change together:
its windows alone do not tell them apart. The means of applications do:

    f = L' (1 + (L' / c)^n)^(-1/n) + o        L' = s sum 2 A_i r_i mu_i p_i / (R_i m)

L' is the deceleration that the linings would give; f is the specific force less drag, rolling and reported
torques. Where the torques of the drive and of each brake are known and wheels are measured one by one, mu_i
is the friction as learned window by window, s next to 1. Elsewhere windows teach nothing: mu_i is the
configured friction, or what was learned where they did. The bend stands for wheels that reach their limit one
after the other: wide (n = 2.5, close to a tanh) where they have one speed, else sharper (n = 4). States are
the logarithm of s, that of the ceiling c over `CEILING`, and the unreported drag o, which includes the
accelerometer's zero where no window teaches it, and is next to none where windows teach: an extended Kalman
filter, corrected once an application. An innovation beyond `GATE` standard deviations counts with a variance
that puts it there; an application that was not measured widens nothing.

The law is not quite the car's: the error of a mean is a share of it, and what the drive does unseen. How much
that is differs from car to car, so it is measured: the expectation of innovation times residual is the
variance of a mean, and their average over the last applications counts.
"""

import math

import numpy as np

from ecu.algorithm.estimate import GREATEST_RATIO, LEAST_RATIO
from ecu.algorithm.estimation.joint.drive import other_decel, torque_share
from ecu.algorithm.estimation.joint.layout import BIAS, LEVEL, MASS, V
from ecu.algorithm.estimation.joint.wheel import (
    brake_torque,
    drive_opposes,
    radius,
    unknown_share,
    weigh_linings,
)
from ecu.algorithm.estimation.joint.window import COPIES
from ecu.algorithm.inputs import wheels_mapped
from ecu.contract.signals import ACCEL_X
from ecu.jit import Record, kernel

SCALE, GRIP, OVERRUN = range(3)
CEILING = 14.0  # m/s^2: a first braking at 12 must be possible before any was seen
PRIOR_MEAN = np.array([0.0, 0.0, 0.2])  # the drag in m/s^2
PRIOR = np.array([0.25, 0.4, 0.5])  # standard deviations: an engine drags by 0.1 to 1 m/s^2
STEP = np.array([0.05, 0.03, 0.03])  # between applications
# Priors of scale and drag [m/s^2] beside windows, which teach nearly all; their step.
BESIDE, BESIDE_DRAG, BESIDE_STEP = 0.03, 0.05, 0.006
PAUSE = np.array([0.03, 0.15, 0.1])  # of unknown length: rain, another road, another day
LOWEST_STATE = np.array([-0.7, math.log(3.0 / CEILING), -1.0])
HIGHEST_STATE = np.array([0.6, math.log(30.0 / CEILING), 2.5])  # motors with the accelerator released
NOISE, NOISE_SHARE = 0.2, 0.07  # m/s^2, of the mean of an application, and of the linings' part of it
LEAST_NOISE, GREATEST_NOISE = 0.5, 4.0  # times that variance, as measured
BEFORE, MEMORY = 4.0, 10.0  # applications that the prior of this ratio is worth; that are remembered
GATE = 2.5
LEAST_SPEED, ACROSS = 5.0, 0.4  # m/s, lateral acceleration over gravity: limits of the force balance
ONSET_S = 0.25  # callipers and accelerometer lag behind the pressure
LEAST_S = 0.3  # of an application that is learned from
LEAST_DECEL, LEAST_TOTAL = 0.8, 1.5  # m/s^2, of linings, or of the car: a light braking tells the drag
LONGEST_STEP_S = 0.5  # between samples that are compared
ONE_SPEED_KNEE, WHEELS_KNEE = 2.5, 4.0  # n
BENDS = 0.7  # of the ceiling, beyond which windows no longer teach friction
USUAL = 6.0  # m/s^2, of the linings, before any application

WHOLE_STATE = np.dtype(
    [
        ("x", "f8", (3,)),  # ln scale, ln ceiling over `CEILING`, unreported drag [m/s^2]
        ("p", "f8", (3, 3)),
        ("alone", "u1"),  # nothing but whole applications teaches
        ("bent", "u1"),  # the linings ask for more than road and tyres give freely
        ("knee", "f8"),  # exponent n of the bend
        ("noise_ratio", "f8"),  # variance of an application's mean over the usual one
        ("noise_count", "f8"),  # applications in that, and what its prior is worth
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
        ("usual", "f8"),  # s L of the last application whose linings taught [m/s^2]
        ("driven", "f8"),  # fading integral of the squared deceleration by reported torques [m^2/s^3]
        ("arrived", "f8"),  # likewise of it times that of the car
    ],
    align=True,
)


@kernel
def restore_whole(state: Record, learned: Record) -> None:
    """Restore learned states, less certain by a pause; use the prior where nothing was learned."""
    state.usual, state.knee = USUAL, ONE_SPEED_KNEE
    forget_whole(state)
    if learned.whole_covariance[0] == 0.0:
        return
    place = 0
    for i in range(3):
        state.x[i] = learned.whole[i]
        for j in range(i + 1):
            state.p[i, j] = state.p[j, i] = learned.whole_covariance[place]
            place += 1
        state.p[i, i] = min(state.p[i, i] + PAUSE[i] ** 2, PRIOR[i] ** 2)


@kernel
def forget_whole(state: Record) -> None:
    """Reset to the prior."""
    state.noise_ratio, state.noise_count = 1.0, BEFORE
    for i in range(3):
        state.x[i] = PRIOR_MEAN[i]
        for j in range(3):
            state.p[i, j] = PRIOR[i] ** 2 if i == j else 0.0


@kernel
def keep_whole(state: Record, learned: Record) -> None:
    """Write the present states into `learned`."""
    place = 0
    for i in range(3):
        learned.whole[i] = state.x[i]
        for j in range(i + 1):
            learned.whole_covariance[place] = state.p[i, j]
            place += 1


@kernel
def apply_scale(params: Record, state: Record, learned: Record) -> None:
    """Scale the stored friction by that of whole applications, within its bounds.

    Its standard deviation is that of the windows where these teach: they know the lining, `SCALE` the car.
    """
    scale = math.exp(state.x[SCALE])
    variance = state.p[SCALE, SCALE] if state.alone else 0.0
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
        joint.x[i] += state.x[SCALE]
        for snapshot in range(2):
            joint.kept_x[snapshot, i] += state.x[SCALE]
    state.x[SCALE] = 0.0


@kernel
def begin_whole(params: Record, state: Record, joint: Record) -> None:
    """Begin an application."""
    apart = wheels_mapped(params) and joint.speed_copies <= COPIES and joint.sliding < 4
    alone = not (apart and torques_measured(params, joint) and params.mapped[ACCEL_X])
    if state.alone and not alone:
        _hand_over_scale(state, joint)
    state.alone = 1 if alone else 0
    state.knee = WHEELS_KNEE if apart else ONE_SPEED_KNEE
    state.bent, state.age_s, state.common = 0, 0.0, joint.sampling.common
    _open_mean(state)


@kernel
def _open_mean(state: Record) -> None:
    state.time = state.measured = state.expected = state.linings = state.total = 0.0
    state.by_scale = state.by_grip = 0.0


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
def bend(linings: float, ceiling: float, knee: float) -> tuple[float, float, float]:
    """Return the deceleration f of linings below a ceiling, and its derivatives by ln L and ln c."""
    base = 1.0 + (linings / ceiling) ** knee
    decel = linings * base ** (-1.0 / knee)
    steep = decel / base
    return decel, steep, decel - steep


@kernel
def add_to_whole(params: Record, state: Record, joint: Record) -> None:
    """Add the last window of an application."""
    w = joint.window
    state.age_s += w.time
    step = min(joint.sampling.common - state.common, LONGEST_STEP_S)
    state.common = joint.sampling.common
    held = joint.x[V] > LEAST_SPEED and abs(w.across) < ACROSS and state.age_s > ONSET_S
    share = torque_share(state)
    if (
        not (w.balanced and held)
        or (joint.unmeasured_s > LONGEST_STEP_S and params.mapped[ACCEL_X])
        or drive_opposes(params, joint, share)
    ):
        return
    mass = _mass(params, state, joint)
    linings = math.exp(state.x[SCALE]) * _lining_decel(params, joint, mass)
    ceiling = CEILING * math.exp(state.x[GRIP])
    expected, by_scale, by_grip = bend(linings, ceiling, state.knee)
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


@kernel
def _usual_noise(expected: float) -> float:
    """Return the variance of an application's mean [m^2/s^4], `expected` of the linings [m/s^2]."""
    return NOISE**2 + (NOISE_SHARE * expected) ** 2


@kernel
def _variance(state: Record, by_scale: float, by_grip: float, noise: float) -> float:
    p = state.p
    own = by_scale * by_scale * p[SCALE, SCALE] + by_grip * by_grip * p[GRIP, GRIP] + p[OVERRUN, OVERRUN]
    shared = by_scale * by_grip * p[SCALE, GRIP] + by_scale * p[SCALE, OVERRUN] + by_grip * p[GRIP, OVERRUN]
    variance: float = own + 2.0 * shared + noise
    return variance


@kernel
def _gain(state: Record, i: int, by_scale: float, by_grip: float, total: float) -> float:
    p = state.p
    gain: float = (p[i, SCALE] * by_scale + p[i, GRIP] * by_grip + p[i, OVERRUN]) / total
    return gain


@kernel
def _believe_windows(state: Record) -> None:
    """Limit the variances of scale and drag to what windows leave of them."""
    x, p = state.x, state.p
    for i, sigma in ((SCALE, BESIDE), (OVERRUN, BESIDE_DRAG)):
        most, variance = sigma * sigma, p[i, i]
        if variance > most:
            if i == OVERRUN:
                x[i] *= most / variance  # around nothing
            for j in range(3):
                p[i, j] *= math.sqrt(most / variance)
                p[j, i] = p[i, j]
            p[i, i] = most


@kernel
def end_whole(state: Record) -> None:
    """Correct the states by the mean of this application up to now, if it was measured, and open another."""
    linings = state.linings >= LEAST_DECEL * state.time
    if state.time < LEAST_S or not (linings or state.total >= LEAST_TOTAL * state.time):
        return
    if not state.alone:
        _believe_windows(state)
    x, p = state.x, state.p
    h_scale, h_grip = state.by_scale / state.time, state.by_grip / state.time
    expected = state.expected / state.time
    innovation = state.measured / state.time - expected - x[OVERRUN]
    usual = _usual_noise(expected)
    likely = _variance(state, h_scale, h_grip, state.noise_ratio * usual)
    total = max(likely, (innovation / GATE) ** 2)
    gain = (
        _gain(state, SCALE, h_scale, h_grip, total),
        _gain(state, GRIP, h_scale, h_grip, total),
        _gain(state, OVERRUN, h_scale, h_grip, total),
    )
    for i in range(3):
        x[i] = min(max(x[i] + gain[i] * innovation, LOWEST_STATE[i]), HIGHEST_STATE[i])
        for j in range(3):
            p[i, j] -= gain[i] * gain[j] * total
        p[i, i] += (STEP[i] if state.alone or i == GRIP else BESIDE_STEP) ** 2
    left = 1.0 - (gain[SCALE] * h_scale + gain[GRIP] * h_grip + gain[OVERRUN])
    product = min(innovation * innovation * left, GATE * GATE * likely)
    state.noise_count = min(state.noise_count + 1.0, MEMORY)
    state.noise_ratio += (product / usual - state.noise_ratio) / state.noise_count
    state.noise_ratio = min(max(state.noise_ratio, LEAST_NOISE), GREATEST_NOISE)
    if linings:
        state.usual = state.linings / state.time
    _open_mean(state)


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
    ceiling = CEILING * math.exp(state.x[GRIP])
    scale, variance = math.exp(state.x[SCALE]), state.p[SCALE, SCALE]
    if not state.alone:
        variance = min(variance, BESIDE**2)
    for i in range(4):
        own = state.unshown[i] if state.alone else (estimate.sigma[i] / estimate.mu[i]) ** 2
        estimate.mu[i] *= scale
        estimate.sigma[i] = estimate.mu[i] * math.sqrt(own + variance)
    expected, by_scale, by_grip = bend(state.usual, ceiling, state.knee)
    variance = _variance(state, by_scale, by_grip, state.noise_ratio * _usual_noise(expected))
    if not state.alone:
        variance += (by_scale * estimate.sigma_force) ** 2
    estimate.sigma_force = math.sqrt(variance) / expected
    estimate.overrun = state.x[OVERRUN]
    estimate.sigma_overrun = math.sqrt(state.p[OVERRUN, OVERRUN] + state.noise_ratio * NOISE**2)
    if estimate.torques_known and not state.alone:
        estimate.overrun *= BESIDE_DRAG**2 / max(state.p[OVERRUN, OVERRUN], BESIDE_DRAG**2)
    if state.alone:
        estimate.accel_bias, estimate.mass = 0.0, params.mass
    estimate.torque_share = torque_share(state)
    estimate.grip_limit, estimate.grip_knee = ceiling, state.knee
    estimate.sigma_grip_limit = ceiling * math.sqrt(state.p[GRIP, GRIP])
