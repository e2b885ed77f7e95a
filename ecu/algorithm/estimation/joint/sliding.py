"""Wheels beyond the range of their tyres or on another road: suspended learning and restored states."""

import math

from ecu.algorithm.estimation.joint.kalman import GATE, forget
from ecu.algorithm.estimation.joint.layout import LEVEL, SIDE, STIFFNESS, V
from ecu.algorithm.estimation.joint.prior import LEVEL_WHEEL, PRIOR
from ecu.algorithm.estimation.joint.snapshot import restore_snapshot
from ecu.algorithm.estimation.joint.wheel import car_force
from ecu.algorithm.inputs import fresh
from ecu.contract.signals import WHEEL_SPEED
from ecu.jit import Record, kernel

LARGE_SLIP = 0.12
YIELDING = 0.06  # slip above which the force along the car indicates a wheel's force better than its torque
AGREEING = 0.05  # slip within which a wheel confirms a speed
SLIDING_FLOOR = 5.0  # m/s, least reference speed of that slip
HOLD_S = 0.2
OTHER_TYRES = 2.5  # wheels on the gate at once
UNEVEN, UNEVEN_S = 0.7, 0.5  # squared gates, summed over this time [s], at both axles to the same side
UNEVEN_SIGMA = 0.2  # of SIDE on such a road


@kernel
def _beyond(rolled: float, ground: float, slip: float) -> bool:
    """Return whether a wheel's speed differs from ground speed [m/s] by more than a slip."""
    return abs(rolled - ground) > slip * max(ground, rolled, SLIDING_FLOOR)


@kernel
def share_force(params: Record, state: Record, inputs: Record, accel: float, load: Record) -> None:
    """Share the residual force along the car among the wheels that begin to slide, by their loads."""
    left, loaded = car_force(params, state, accel), 0.0
    for i in range(4):
        rolled = inputs.value[WHEEL_SPEED + i] * params.wheel_radius[i]
        if fresh(inputs, WHEEL_SPEED + i):
            state.beyond_linear[i] = 1 if _beyond(rolled, state.x[V], YIELDING) else 0
        if state.beyond_linear[i]:
            loaded += load[i]
        else:
            left -= state.force[i]
    for i in range(4):
        if state.beyond_linear[i]:
            state.force[i] = left * load[i] / loaded


@kernel
def wheel_slides(params: Record, state: Record, i: int) -> bool:
    """Return whether a wheel locks or spins, so that its speed does not indicate the car's."""
    w = state.window
    return _beyond(w.omega[i] * params.wheel_radius[i], w.ground[i], LARGE_SLIP)


@kernel
def count_wheels(params: Record, state: Record, speed: float) -> tuple[int, int]:
    """Return how many of the wheels that were read roll at a speed [m/s], and how many do not."""
    rolling = slipping = 0
    for i in range(4):
        if state.window.omega_samples[i] > 0:
            rolled = state.window.omega[i] * params.wheel_radius[i]
            slips = 1 if _beyond(rolled, speed, AGREEING) else 0
            rolling, slipping = rolling + 1 - slips, slipping + slips
    return rolling, slipping


@kernel
def wheels_agree(params: Record, state: Record, speed: float) -> bool:
    """Return whether at least three wheels roll at a speed [m/s]."""
    return count_wheels(params, state, speed)[0] > 2


@kernel
def watch_tyres(state: Record, observing: bool) -> None:
    """Restore friction and reset stiffness where most wheels contradict the known tyres alike."""
    against = 0.0
    for i in range(4):
        against += state.signed_ratio[i]
    known = state.p[STIFFNESS, STIFFNESS] < (0.5 * PRIOR[STIFFNESS]) ** 2
    if observing and known and abs(against) > OTHER_TYRES * GATE * GATE:
        restore_snapshot(state)
        forget(state, STIFFNESS, PRIOR[STIFFNESS] ** 2)


@kernel
def suspend_learning(state: Record) -> None:
    """Suspend learning: a wheel is beyond its tyre's range, even if this filter does not detect it."""
    if state.hold_s <= 0.0:
        restore_snapshot(state)
    state.hold_s = HOLD_S


@kernel
def side_share(side: float, i: int) -> float:
    """Return the derivative of the logarithm of a tyre's stiffness by SIDE.

    The road takes from the side that has less; before one is seen, SIDE is the tyres' own.
    """
    left = i % 2 == 0
    if side == 0.0:
        return 0.5 if left else -0.5
    if left:
        return 1.0 if side < 0.0 else 0.0
    return -1.0 if side > 0.0 else 0.0


@kernel
def watch_sides(state: Record, observing: bool) -> None:
    """Restore friction and learn what the road takes where one side's wheels alone contradict the tyres.

    Each braked wheel of a road that grips less on one side slips more at equal torque. Linings may differ
    likewise until it is known by how much; that does not change at once.
    """
    p, ratio, uneven = state.p, state.signed_ratio, state.uneven
    for left in (0, 2):
        i, j, axle = LEVEL + left, LEVEL + left + 1, left // 2
        known = p[i, i] + p[j, j] - 2.0 * p[i, j] < 0.5 * LEVEL_WHEEL**2
        apart = (ratio[left] - ratio[left + 1]) / (GATE * GATE) if observing and known else 0.0
        uneven[axle] = (1.0 - state.window.time / UNEVEN_S) * uneven[axle] + apart
    if min(abs(uneven[0]), abs(uneven[1])) > UNEVEN and uneven[0] * uneven[1] > 0.0:
        restore_snapshot(state)
        forget(state, SIDE, UNEVEN_SIGMA**2)
        state.x[SIDE] = math.copysign(0.5 * UNEVEN_SIGMA, uneven[0])
        uneven[0] = uneven[1] = 0.0
