"""Estimates of the joint observer: its states turned into `ESTIMATE`."""

import math

from ecu.algorithm.estimate import GREATEST_RATIO, LEAST_RATIO, remembered_exp
from ecu.algorithm.estimation.friction import resting_mode
from ecu.algorithm.estimation.joint.ceiling import KNOWN
from ecu.algorithm.estimation.joint.kalman import GATE
from ecu.algorithm.estimation.joint.layout import (
    BALANCE_RATIO,
    BIAS,
    CHANGE,
    LEVEL,
    MASS,
    OVERRUN,
    RATE,
    REFERENCE_RATIO,
    STIFFNESS,
    WHEEL_RATIO,
    V,
)
from ecu.algorithm.estimation.joint.observer import WINDOW_S
from ecu.algorithm.estimation.joint.wheel import weigh_linings
from ecu.algorithm.estimation.zero import tell_zeros
from ecu.algorithm.inputs import usable
from ecu.contract.params import GRAVITY
from ecu.contract.signals import CALLIPER_PRESSURE, OBSERVING, WHEEL_SPEED
from ecu.jit import Record, kernel

_NOW, _LEVEL, _STIFFNESS, _MASS = 0, 4, 8, 9
"""Places of `remembered_exp`."""


@kernel
def friction_now(state: Record, i: int) -> float:
    """Return ln of friction over nominal: at the middle of the last window, extrapolated by its rate."""
    ahead = 0.5 * WINDOW_S + (0.0 if state.closed else state.window.time)
    return state.x[LEVEL + i] + state.x[CHANGE + i // 2] + state.x[RATE] * ahead


@kernel
def _at_bound(ratio: float) -> bool:
    return ratio < 1.001 * LEAST_RATIO or ratio > 0.999 * GREATEST_RATIO


@kernel
def sigma_friction(params: Record, state: Record, i: int, ratio: float, now: bool) -> float:
    """Return the standard deviation of ln friction: of the level, or, with `now`, of its present value.

    `ratio`: of the level to the nominal friction.
    """
    p, level, change = state.p, LEVEL + i, CHANGE + i // 2
    variance = p[level, level]
    if now:
        variance += 2.0 * p[level, change] + p[change, change]
    if _at_bound(ratio):
        variance = max(variance, params.sigma_mu_initial**2)
    return math.sqrt(max(variance, 0.0))


@kernel
def _sigma_force(params: Record, state: Record) -> float:
    """Return the relative standard deviation of the force of all linings together, at equal pressures."""
    h, total, variance = state.h, weigh_linings(params, state), 0.0
    for i in range(LEVEL, LEVEL + 4):
        for j in range(LEVEL, LEVEL + 4):
            variance += h[i] * h[j] * state.p[i, j]
    return math.sqrt(max(variance, 0.0)) / total


@kernel
def _tell_friction(
    params: Record,
    state: Record,
    hydraulics: Record,
    estimate: Record,
    learned: Record,
    inputs: Record,
    braking: bool,
    dt: float,
) -> None:
    """Overwrite friction, its standard deviation and mode of every corner."""
    if state.closed:
        state.sigma_force = _sigma_force(params, state)
    estimate.sigma_force = state.sigma_force
    for i in range(4):
        mu = params.mu_nominal[i] * remembered_exp(estimate, _NOW + i, friction_now(state, i))
        ratio = remembered_exp(estimate, _LEVEL + i, state.x[LEVEL + i])
        sigma = sigma_friction(params, state, i, ratio, True)
        if state.observed[i] and state.follows[i]:
            above = max(state.smooth_pressure[i], 1.0)
            sigma = math.sqrt(sigma * sigma + hydraulics.variance[i] / (above * above))
        estimate.mu[i], estimate.sigma[i] = mu, mu * sigma
        good = usable(inputs, WHEEL_SPEED + i) and usable(inputs, CALLIPER_PRESSURE + i)
        by_wheel = good and state.observed[i] != 0
        by_balance = usable(inputs, CALLIPER_PRESSURE + i) and math.isfinite(state.ratio[BALANCE_RATIO])
        if braking and (by_wheel or by_balance):
            estimate.observed_s[i] += dt
        if braking and by_wheel:
            estimate.mode[i] = OBSERVING
        else:
            estimate.mode[i] = resting_mode(params, estimate, learned, good, i)


@kernel
def _test_ratio(state: Record, place: int) -> float:
    ratio: float = state.ratio[place] / (GATE * GATE)
    return ratio if state.started else math.nan


@kernel
def tell_joint(
    params: Record,
    state: Record,
    hydraulics: Record,
    estimate: Record,
    learned: Record,
    inputs: Record,
    braking: bool,
    dt: float,
) -> None:
    """Overwrite the estimate of car, tyres and linings by this observer's states.

    Args:
        params: `PARAMS`.
        state: `JOINT_STATE`, after `update_joint`.
        hydraulics: `HYDRAULICS_STATE` of this cycle.
        estimate: `ESTIMATE`, already holding inertial signals and pressures.
        learned: `LEARNED`.
        inputs: `INPUTS`.
        braking: a brake application lasts that may teach friction.
        dt: time since the last cycle [s].
    """
    x = state.x
    estimate.started, estimate.reset, estimate.at_bound = state.started, state.reset, state.at_bound
    estimate.speed, estimate.k_f = x[V], remembered_exp(estimate, _STIFFNESS, x[STIFFNESS])
    estimate.mass = params.mass * remembered_exp(estimate, _MASS, x[MASS])
    estimate.accel_bias, estimate.overrun = x[BIAS], x[OVERRUN]
    _tell_friction(params, state, hydraulics, estimate, learned, inputs, braking, dt)
    estimate.test_ratio_balance = _test_ratio(state, BALANCE_RATIO)
    estimate.test_ratio_speed = _test_ratio(state, REFERENCE_RATIO)
    tell_zeros(state.zero, estimate)
    if 0.0 < state.ceiling_variance < KNOWN**2:
        estimate.grip_limit = GRAVITY * state.ceiling
        estimate.sigma_grip_limit = estimate.grip_limit * math.sqrt(state.ceiling_variance)
    for i in range(4):
        estimate.slip[i], estimate.force[i] = state.slip[i], state.force[i]
        estimate.test_ratio[i] = _test_ratio(state, WHEEL_RATIO + i)
