"""Torque of failed brakes, moved to motors and to the wheels that brake.

Torque of failed brakes goes to their own motors up to these motors' greatest demand, the rest to the other
wheels, so that each uses the same share of its load: no rear wheel more grip than a front one that brakes
(ECE R13-H, Annex 5). Beyond `GRIP` torque is added slowly, limited by the resulting yaw moment, `YAW_LIMIT`.
A brake that is sound again relieves the others as its pressure rises.
The demand to a failed brake continues, so that a wrong verdict or a recovery shows.
"""

import numpy as np

from ecu.algorithm.control.distribution import ideal_front_share
from ecu.contract.params import GRAVITY
from ecu.jit import Record, kernel

REPLACEMENT_STATE = np.dtype(
    [
        ("moved", "f8"),  # of the torque of the failed brakes, 0 to 1
        ("grip", "f8"),  # force over load that the other wheels may be demanded
        ("force", "f8", (4,)),  # force demanded of each wheel [N]
        ("share", "f8", (4,)),  # of the load, of the wheels that brake
        ("taken", "f8", (4,)),  # of that share, 0 to 1: a brake that is sound again takes it by degrees
    ],
    align=True,
)

MOVE_S = 0.05
GRIP = 0.6  # reached at once, or the previous value
GRIP_RATE = 0.5  # 1/s beyond it: slip shows before a wheel locks
YAW_LIMIT = 0.15
"""Lateral force of the front tyres that holds the car straight, over their load at rest: 1 % of their
longitudinal grip, and some 20 degrees at the steering wheel."""


@kernel
def _shares(params: Record, state: Record, trailing: float, decel: float, backwards: bool) -> float:
    """Overwrite the shares of the load of the wheels that brake; return their sum."""
    front, total = ideal_front_share(params, -decel if backwards else decel), 0.0
    for i in range(4):
        state.share[i] = 0.5 * state.taken[i] * (front if i < 2 else 1.0 - front)
        if (i < 2) == backwards:
            state.share[i] *= trailing
        total += state.share[i]
    return total


@kernel
def replace_failed(
    params: Record,
    state: Record,
    brakes: Record,
    distribution: Record,
    allowed: Record,
    decel: float,
    backwards: bool,
    dt: float,
) -> None:
    """Move the torque of failed brakes to motors and to the wheels that brake.

    Args:
        params: `PARAMS`.
        state: `REPLACEMENT_STATE`, overwritten.
        brakes: `FAILED_BRAKES_STATE` of this cycle.
        distribution: `DISTRIBUTION_STATE`; `torque` is overwritten.
        allowed: greatest demand to each motor [N m], shape (4,).
        decel: demanded [m/s^2].
        backwards: the car is in reverse.
        dt: time since the last cycle [s].
    """
    step = dt / MOVE_S
    for i in range(4):
        state.taken[i] = 0.0 if brakes.failed[i] else min(state.taken[i] + step, 1.0)
    state.moved = min(state.moved + step, 1.0) if brakes.any else max(state.moved - step, 0.0)
    if state.moved == 0.0 or not decel > 0.0:
        state.grip = max(decel / GRAVITY, GRIP)
        return
    state.grip += GRIP_RATE * dt
    shares = _shares(params, state, distribution.trailing, decel, backwards)
    if shares == 0.0:
        return
    wanted = 0.0
    for i in range(4):
        torque = distribution.torque[i]
        state.force[i] = torque
        if brakes.failed[i]:
            state.force[i] = min(torque, allowed[i]) if params.blending[i] > 0.0 else 0.0
        state.force[i] /= params.wheel_radius[i]
        wanted += torque / params.wheel_radius[i]
        if brakes.failed[i]:
            wanted -= state.force[i]
    wanted = min(wanted, state.grip * shares * params.mass * GRAVITY)
    for i in range(4):
        if not brakes.failed[i]:
            kept = (1.0 - state.taken[i]) * state.force[i]
            state.force[i] += state.moved * (kept + wanted * state.share[i] / shares - state.force[i])
    _limit_yaw(params, state, brakes, distribution)
    for i in range(4):
        if not brakes.failed[i]:
            distribution.torque[i] = state.force[i] * params.wheel_radius[i]


@kernel
def _limit_yaw(params: Record, state: Record, brakes: Record, distribution: Record) -> None:
    """Reduce the forces of one side to the greatest admissible difference from the other, no force below its
    wheel's earlier demand."""
    most = 2.0 * YAW_LIMIT * params.mass * GRAVITY * params.rear_axle / params.track
    apart = state.force[0] + state.force[2] - state.force[1] - state.force[3]
    side = 0 if apart > 0.0 else 1
    added = 0.0
    for i in (side, side + 2):
        if not brakes.failed[i]:
            added += max(state.force[i] - distribution.torque[i] / params.wheel_radius[i], 0.0)
    excess = abs(apart) - most
    if excess <= 0.0 or added <= 0.0:
        return
    left = max(1.0 - excess / added, 0.0)
    for i in (side, side + 2):
        before = distribution.torque[i] / params.wheel_radius[i]
        if not brakes.failed[i] and state.force[i] > before:
            state.force[i] = before + left * (state.force[i] - before)
