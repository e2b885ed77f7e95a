"""Outputs of the joint observer to the rest of the ECU, and its states that are stored between drives.

Kept are the states that outlive a drive, with their whole covariance: what a car's pressures cannot tell
apart stays together after a restart as well. What may have changed in between (load, tyres, weather) is less
sure then; the peak belongs to the road and is forgotten."""

import math

import numpy as np

from ecu.algorithm.estimation.friction import GREATEST_RATIO, LEAST_RATIO, resting_mode
from ecu.algorithm.estimation.joint.kalman import clear_state
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    CHANGE,
    DELAY,
    DRAG,
    LEVEL,
    MASS,
    MEAN,
    PASSING,
    PEAK,
    RADIUS,
    RATE,
    ROLLING,
    STIFFNESS,
    N,
)
from ecu.algorithm.estimation.joint.observer import WINDOW_S, start_joint
from ecu.algorithm.estimation.joint.pressure import follows
from ecu.algorithm.estimation.joint.prior import limit_variance, set_prior, widen_levels
from ecu.algorithm.estimation.joint.wheel import brake_lever, friction
from ecu.algorithm.inputs import usable
from ecu.contract.signals import CALLIPER_PRESSURE, OBSERVING, WHEEL_SPEED
from ecu.jit import Record, kernel

KEPT = np.array([i for i in range(N) if i not in PASSING])

# Standard deviations that a pause of unknown length adds.
PAUSE = np.zeros(N)
PAUSE[STIFFNESS] = 0.05
PAUSE[RADIUS : RADIUS + 4] = PAUSE[ROLLING] = 0.0003
PAUSE[BIAS], PAUSE[MASS], PAUSE[DRAG] = 0.005, 0.005, 0.02
PAUSE[DELAY] = 0.001
LEVEL_PAUSE = 0.03  # of all levels alike


@kernel
def restore_joint(params: Record, state: Record, learned: Record) -> None:
    """Begin with what was learned; with the prior where nothing was."""
    set_prior(params, state)
    x, p = state.x, state.p
    if learned.joint_known:
        prior = np.diag(p).copy()
        peak = prior[PEAK]
        place = 0
        for k in range(len(KEPT)):
            i = KEPT[k]
            x[i] = learned.joint[i]
            for m in range(k + 1):
                p[i, KEPT[m]] = p[KEPT[m], i] = learned.joint_covariance[place]
                place += 1
            p[i, i] += PAUSE[i] ** 2
        widen_levels(state, LEVEL_PAUSE**2, 0.0, 0.0)
        for i in KEPT:
            limit_variance(state, i, prior[i])
        clear_state(state, PEAK, peak)
    start_joint(state)


@kernel
def keep_joint(params: Record, state: Record, learned: Record) -> None:
    """Write what is known now into `learned`."""
    learned.joint_known, state.unkept_s = 1, 0.0
    place = 0
    for k in range(len(KEPT)):
        i = KEPT[k]
        learned.joint[i] = state.x[i]
        if LEVEL <= i < LEVEL + 4:
            level = state.x[i] + state.x[MEAN + (i - LEVEL) // 2]  # what an application has shown so far
            learned.joint[i] = min(max(level, math.log(LEAST_RATIO)), math.log(GREATEST_RATIO))
        for m in range(k + 1):
            learned.joint_covariance[place] = state.p[i, KEPT[m]]
            place += 1
    for i in range(4):
        mu = params.mu_nominal[i] * math.exp(learned.joint[LEVEL + i])
        learned.mu_b[i], learned.sigma_mu_b[i] = mu, mu * _sigma(params, state, i, False)


@kernel
def hand_over_level(observed: Record, learned: Record) -> None:
    """At the end of a braking: count what it observed."""
    learned.brakings += 1
    for i in range(4):
        learned.observed_s[i] += observed.observed_s[i]
        observed.observed_s[i] = 0.0


@kernel
def _at_bound(ratio: float) -> bool:
    return ratio < 1.001 * LEAST_RATIO or ratio > 0.999 * GREATEST_RATIO


@kernel
def friction_now(state: Record, i: int) -> float:
    """Return ln of friction over nominal: what the middle of the last window had, moved on by its rate."""
    ahead = 0.5 * WINDOW_S + (0.0 if state.closed else state.window.time)
    moved: float = state.x[LEVEL + i] + state.x[CHANGE + i // 2] + state.x[RATE] * ahead
    return moved


@kernel
def _sigma(params: Record, state: Record, i: int, now: bool) -> float:
    """Return the standard deviation of ln friction: of the level, or of what it is `now`."""
    p, level, change = state.p, LEVEL + i, CHANGE + i // 2
    variance = p[level, level]
    if now:
        variance += 2.0 * p[level, change] + p[change, change]
    if _at_bound(math.exp(state.x[level])):
        variance = max(variance, params.sigma_mu_initial**2)
    return math.sqrt(max(variance, 0.0))


@kernel
def _sigma_force(params: Record, state: Record) -> float:
    """Return the relative standard deviation of the force of all linings together, at equal pressures."""
    h, total, variance = state.h, 0.0, 0.0
    for i in range(LEVEL, LEVEL + 4):
        h[i] = brake_lever(params, i - LEVEL) * friction(params, state, i - LEVEL)
        h[i] /= params.wheel_radius[i - LEVEL]
        total += h[i]
    for i in range(LEVEL, LEVEL + 4):
        for j in range(LEVEL, LEVEL + 4):
            variance += h[i] * h[j] * state.p[i, j]
    return math.sqrt(max(variance, 0.0)) / total


@kernel
def publish_friction(
    params: Record,
    state: Record,
    published: Record,
    learned: Record,
    inputs: Record,
    braking: bool,
    dt: float,
) -> None:
    """Overwrite friction, its standard deviation and mode of every corner from the joint observer."""
    published.reset = state.reset
    if state.closed:
        state.sigma_force = _sigma_force(params, state)
    for i in range(4):
        mu = params.mu_nominal[i] * math.exp(friction_now(state, i))
        sigma = _sigma(params, state, i, True)
        if state.observed[i] and follows(state.pressures, i):
            above = max(state.smooth_pressure[i], 1.0)
            sigma = math.sqrt(sigma * sigma + state.pressures.variance[i] / (above * above))
        published.mu[i], published.sigma[i] = mu, mu * sigma
        good = usable(inputs, WHEEL_SPEED + i) and usable(inputs, CALLIPER_PRESSURE + i)
        if braking and state.observed[i] and good:
            published.observed_s[i] += dt
            published.mode[i] = OBSERVING
        else:
            published.mode[i] = resting_mode(params, published, learned, good, i)
