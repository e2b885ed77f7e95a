"""Bounds of what the joint observer learns: beyond them a fault was learned, not a car."""

import math

import numpy as np

from ecu.algorithm.estimate import GREATEST_RATIO, LEAST_RATIO
from ecu.algorithm.estimation.joint.kalman import clear_derivatives, variance_by_derivatives
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    CHANGE,
    DEFLECTION_GAIN,
    DELAY,
    DRAG,
    LEVEL,
    LOAD,
    MASS,
    MOTOR,
    OVERRUN,
    PEAK,
    RADIUS,
    RATIO,
    ROLLING,
    SLOPE,
    STIFFNESS,
    N,
)
from ecu.algorithm.estimation.joint.prior import OVERRUN_MEAN, OVERRUN_SIGMA, derive_axles
from ecu.jit import Record, kernel

LOWEST_VALUE, HIGHEST_VALUE = np.full(N, -np.inf), np.full(N, np.inf)
LOWEST_VALUE[LEVEL : LEVEL + 4], HIGHEST_VALUE[LEVEL : LEVEL + 4] = (
    math.log(LEAST_RATIO),
    math.log(GREATEST_RATIO),
)
LEFT_RIGHT = 0.2  # of an axle's two levels: its linings are of one batch, and one that is oiled is found
FRONT_REAR = 0.4  # of the axles' frictions within an application: fade on a steep descent
AT_BOUND = 0.95  # of it
PARTED = 3.0  # sigma, of what they may have been apart before
LOWEST_VALUE[STIFFNESS], HIGHEST_VALUE[STIFFNESS] = math.log(0.4), math.log(2.5)
LOWEST_VALUE[RADIUS : RADIUS + 4], HIGHEST_VALUE[RADIUS : RADIUS + 4] = -0.02, 0.02
LOWEST_VALUE[BIAS], HIGHEST_VALUE[BIAS] = -0.6, 0.6
LOWEST_VALUE[SLOPE], HIGHEST_VALUE[SLOPE] = -4.0, 4.0
LOWEST_VALUE[MASS], HIGHEST_VALUE[MASS] = math.log(0.85), math.log(1.30)
LOWEST_VALUE[PEAK], HIGHEST_VALUE[PEAK] = -1.0, 0.2
LOWEST_VALUE[RATIO], HIGHEST_VALUE[RATIO] = -0.4, 0.4
LOWEST_VALUE[LOAD], HIGHEST_VALUE[LOAD] = -0.3, 0.3
LOWEST_VALUE[DEFLECTION_GAIN], HIGHEST_VALUE[DEFLECTION_GAIN] = -1.2, 1.2
LOWEST_VALUE[MOTOR], HIGHEST_VALUE[MOTOR] = math.log(0.6), math.log(1.6)
LOWEST_VALUE[DRAG], HIGHEST_VALUE[DRAG] = math.log(0.5), math.log(2.0)
LOWEST_VALUE[ROLLING], HIGHEST_VALUE[ROLLING] = -0.03, 0.03
LOWEST_VALUE[DELAY], HIGHEST_VALUE[DELAY] = -0.1, 0.1
LOWEST_VALUE[OVERRUN], HIGHEST_VALUE[OVERRUN] = (
    OVERRUN_MEAN - 4.0 * OVERRUN_SIGMA,
    OVERRUN_MEAN + 4.0 * OVERRUN_SIGMA,
)


@kernel
def _parted(apart: float, most: float) -> bool:
    return abs(apart) > most * (1.0 + 1e-9)


@kernel
def _bring_together(state: Record, apart: float, most: float) -> bool:
    """Return states that are `apart`, by derivatives `state.h`, to `most`; return whether they could be."""
    x, h, ph, free, variance = state.x, state.h, state.ph, state.free, variance_by_derivatives(state)
    if not variance > 0.0:
        return False
    back = (math.copysign(most, apart) - apart) / variance
    for j in range(N):
        if free[j] or h[j] != 0.0:
            x[j] += ph[j] * back
    return True


@kernel
def _keep_sides_alike(state: Record, left: int) -> bool:
    """Return the levels of an axle to within `LEFT_RIGHT` of each other; return whether they had parted."""
    apart = state.x[left] - state.x[left + 1]
    if not _parted(apart, LEFT_RIGHT):
        return False
    clear_derivatives(state)
    state.h[left], state.h[left + 1] = 1.0, -1.0
    return _bring_together(state, apart, LEFT_RIGHT)


@kernel
def _keep_axles_alike(state: Record) -> bool:
    """Return the axles' frictions to within `FRONT_REAR` of the ratio that they had before this application.

    Return whether they had parted. Linings of front and rear fade together or slowly; what moves them apart
    faster is an axle's slip: of other tyres, or of wheel speeds that lie. Where a level is at its bound, the
    changes contain what it lacks: then nothing is said.
    """
    apart, most = 0.0, math.hypot(FRONT_REAR, PARTED * state.sigma_axles)
    for i in range(4):
        level = state.x[LEVEL + i]
        if not AT_BOUND * LOWEST_VALUE[LEVEL] < level < AT_BOUND * HIGHEST_VALUE[LEVEL]:
            return False
        apart += (0.5 if i < 2 else -0.5) * (level - state.before[i])
    apart += state.x[CHANGE] - state.x[CHANGE + 1]
    if not _parted(apart, most):
        return False
    derive_axles(state)
    state.h[CHANGE], state.h[CHANGE + 1] = 1.0, -1.0
    return _bring_together(state, apart, most)


@kernel
def keep_within_bounds(state: Record) -> bool:
    """Return learned states to their bounds; return whether any had left them.

    The other states follow by their covariances and explain the remainder; otherwise they would drift for as
    long as the bound acts. Peak and slope belong to the road: at their bounds they are no fault.
    """
    x, p, free, found = state.x, state.p, state.free, False
    for i in range(N):
        if x[i] < LOWEST_VALUE[i] or x[i] > HIGHEST_VALUE[i]:
            back = min(max(x[i], LOWEST_VALUE[i]), HIGHEST_VALUE[i]) - x[i]
            for j in range(N):
                if j != i and free[i] and free[j] and p[i, i] > 0.0:
                    x[j] += p[j, i] / p[i, i] * back
            x[i] += back
            found = found or (i != PEAK and i != SLOPE)
    for left in (LEVEL, LEVEL + 2):
        found = _keep_sides_alike(state, left) or found
    if free[CHANGE]:
        found = _keep_axles_alike(state) or found
    return found
