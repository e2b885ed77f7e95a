"""A drive as a linear system of its unknowns, for `bound.py`: priors, friction, steps."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.studies.accuracy.bound_car import (
    BIAS,
    DEFLECTION_GAIN,
    DEGRESSION,
    DRAG,
    FOLLOWING,
    LOWEST_SPEED,
    MASS,
    MOTOR,
    MU,
    NOISE,
    PEAK,
    PRESSURE,
    PUSH_OUT,
    RADIUS,
    RATE,
    RATIO,
    ROLLING,
    RUBBING,
    SLOPE,
    SPEED_REFERENCE,
    STIFFNESS,
    TRANSFER,
    WINDOW_S,
    M,
    N,
    Trajectory,
    V,
)
from brakelab.studies.accuracy.linear_bound import System

LAG: Final = 10  # windows

PRIOR: Final = np.zeros(N)
"""Before the ten minutes: spread of the drawn cars and error of config/suv.toml; else assumed."""
PRIOR[V], PRIOR[SLOPE] = 0.5, 0.3
PRIOR[BIAS] = 0.05  # assumption
PRIOR[MASS] = 0.017  # drawn within 3 %
PRIOR[DRAG] = 0.05  # assumption
PRIOR[MOTOR] = 0.0  # the cars of the bench report it exactly
PRIOR[ROLLING] = 0.1  # 0.011 configured, 0.010 true
PRIOR[STIFFNESS], PRIOR[RATIO] = 0.09, 0.01  # drawn within 15 %, 1 % an axle
PRIOR[DEGRESSION] = 0.03  # 0.07 configured, 0.10 true
PRIOR[PEAK] = 0.25  # roads
PRIOR[DEFLECTION_GAIN] = 0.04  # 250 kN/m configured, 260 true
PRIOR[TRANSFER] = 0.033  # height drawn within 5 %, 1.5 % off
PRIOR[RADIUS : RADIUS + 4] = 0.0017  # drawn within 0.3 %
PRIOR[PUSH_OUT : PUSH_OUT + 2] = 0.17  # bar, drawn within 0.3
MU_COMMON, MU_AXLE, MU_WHEEL = 0.13, 0.17, 0.02  # left and right are alike: assumption

JUMP_COMMON, JUMP_AXLE = 0.05, 0.03
"""Uncertainty of friction's fall from the end of one application to the beginning of the next; assumed,
it falls by 22 to 28 %."""
SLOPE_WALK: Final = 0.02  # m/s^2 per root second
WHEEL_WALK: Final = 0.002  # of friction, per root second
FOLLOWING_WALK, FOLLOWING_SHARE = 0.1, 0.05
"""Deviation of the pressure from the modelled response to its demand: bar per root second, and of a change.
Assumed."""


class Wander(NamedTuple):
    """Friction's rate on this plant."""

    covariance: Vector
    """Of front and rear [1/s^2], shape (2, 2)."""
    time: float
    """s until it is another"""


def wander_of(trajectory: Trajectory) -> Wander:
    """Return the change of friction in the counted windows."""
    logarithm = np.log(trajectory.mu.reshape(-1, 2, 2).mean(axis=2))
    rate = np.diff(logarithm, axis=0) / WINDOW_S
    rate = rate[trajectory.counted[1:] & trajectory.counted[:-1]]
    later = (rate[LAG:] * rate[:-LAG]).sum(axis=1).mean() / (rate**2).sum(axis=1).mean()
    return Wander(rate.T @ rate / len(rate), -LAG * WINDOW_S / float(np.log(np.clip(later, 0.05, 0.99))))


def _before(rubbing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.vstack([rubbing[:1], rubbing[:-1]])


def system_of(trajectory: Trajectory, shown: Vector, wander: Wander, car_known: bool) -> System:
    """Return a drive with the derivatives `shown`, shape (n, 5, N), as a linear system."""
    n = len(trajectory.speed)
    rubbing = trajectory.pressure.reshape(n, 2, 2).mean(axis=2) > RUBBING
    begins = rubbing & ~_before(rubbing)
    first = begins.any(axis=1) & ~_before(rubbing).any(axis=1)
    change = np.diff(trajectory.pressure.reshape(n, 2, 2).mean(axis=2), axis=0, prepend=0.0)

    move = np.tile(np.eye(N), (n, 1, 1))
    move[:, V] += WINDOW_S * shown[:, 4]
    move[:, V, SLOPE] -= WINDOW_S
    walk = np.zeros((n, N, N))
    walk[:, SLOPE, SLOPE] = SLOPE_WALK**2 * WINDOW_S
    fading = np.exp(-WINDOW_S / wander.time)
    for axle in range(2):
        wheels = slice(MU + 2 * axle, MU + 2 * axle + 2)
        move[rubbing[:, axle], wheels, RATE + axle] = WINDOW_S
        move[:, RATE + axle, RATE + axle] = fading
        walk[:, wheels, wheels] += (begins[:, axle] * JUMP_AXLE**2)[:, None, None]
        for wheel in range(wheels.start, wheels.stop):
            walk[:, wheel, wheel] += rubbing[:, axle] * WHEEL_WALK**2 * WINDOW_S
        move[:, FOLLOWING + axle, FOLLOWING + axle] = rubbing[:, axle]
        if not car_known:
            square = FOLLOWING_WALK**2 * WINDOW_S + (FOLLOWING_SHARE * change[:, axle]) ** 2
            walk[:, FOLLOWING + axle, FOLLOWING + axle] = rubbing[:, axle] * square
    walk[:, MU : MU + 4, MU : MU + 4] += (first * JUMP_COMMON**2)[:, None, None]
    walk[:, RATE:, RATE:] = (1.0 - fading**2) * wander.covariance

    see = np.zeros((n, M, N))
    see[:, :5] = shown
    see[:, 4, BIAS] += 1.0
    see[:, SPEED_REFERENCE, V] = 1.0
    for axle in range(2):
        see[:, PRESSURE + axle, FOLLOWING + axle] = rubbing[:, axle]
    see[trajectory.speed < LOWEST_SPEED] = 0.0
    return System(move, walk, see / NOISE[:, None])


def prior(car_known: bool, wander: Wander) -> Vector:
    """Return the unadapted covariance."""
    p: Vector = np.diag(PRIOR**2)
    if car_known:
        known = [state for state in range(N) if state not in (V, SLOPE)]
        p[known, known] = 0.0
    p[MU : MU + 4, MU : MU + 4] = MU_COMMON**2
    for axle in (0, 2):
        wheels = slice(MU + axle, MU + axle + 2)
        p[wheels, wheels] += MU_AXLE**2
    p[range(MU, MU + 4), range(MU, MU + 4)] += MU_WHEEL**2
    p[RATE:, RATE:] = wander.covariance
    return p


def before_stop(p: Vector, wander: Wander, car_known: bool) -> Vector:
    """Return the knowledge left from a drive for another one on another road."""
    p = p.copy()
    for state in (V, SLOPE, PEAK, FOLLOWING, FOLLOWING + 1, RATE, RATE + 1):
        p[state] = p[:, state] = 0.0
        p[state, state] = 0.0 if car_known and state == PEAK else PRIOR[state] ** 2
    p[RATE:, RATE:] = wander.covariance
    return p
