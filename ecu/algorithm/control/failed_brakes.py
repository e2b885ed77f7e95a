"""Failed callipers and circuits: their detection, and redistribution of their torque.

A pressure far below its demand means a failed brake or a failed sensor. The car's deceleration tells which:
lining force by the expected pressures, less that by acceleration (4.16), equals the force owed by the
suspected wheels, or zero.

    failed       pressure below `FOLLOWING` of the modelled response to the demands, and more than half of the
                 force that these wheels owe is missing, both for `SURE_S`
    sound again  the pressure follows, or early in another application no force is missing, for `SURE_S`

The expected force uses the friction at the start of the application, corrected by its change while all
pressures follow: friction learned with a wheel believed failed would confirm that belief.

Torque of failed brakes goes to their own motors up to these motors' greatest demand, the rest to the other
wheels, so that each uses the same share of its load: no rear wheel more grip than a front one that brakes
(ECE R13-H, Annex 5). Beyond `GRIP` torque is added slowly, limited by the resulting yaw moment, `YAW_LIMIT`.
A brake that is sound again relieves the others as its pressure rises.
The demand to a failed brake continues, so that a wrong verdict or a recovery shows.
"""

import math

import numpy as np

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.control.distribution import ideal_front_share
from ecu.algorithm.inputs import motor_torque, others_brake, usable
from ecu.contract.params import BAR, GRAVITY
from ecu.contract.signals import CALLIPER_PRESSURE
from ecu.jit import Record, kernel

FAILED_BRAKES_STATE = np.dtype(
    [
        ("failed", "u1", (4,)),
        ("any", "u1"),
        ("owed", "f8", (4,)),  # lining force by the modelled response to the demands [N], low-passed
        ("given", "f8"),  # force of all linings by the acceleration [N], low-passed
        ("scale", "f8"),  # delivered over owed force while all pressures follow, in this application
        ("settled_s", "f8"),  # time for which the forces could be judged in this application
        ("doubt_s", "f8", (4,)),  # time for which the verdict has been contradicted
        ("moved", "f8"),  # of the torque of the failed brakes, 0 to 1
        ("grip", "f8"),  # force over load that the other wheels may be demanded
        ("force", "f8", (4,)),  # force demanded of each wheel [N]
        ("share", "f8", (4,)),  # of the load, of the wheels that brake
        ("taken", "f8", (4,)),  # of that share, 0 to 1: a brake that is sound again takes it by degrees
    ],
    align=True,
)

LEAST = 8.0  # bar expected, below it nothing is judged
FOLLOWING = 0.5  # of the expected pressure
MISSING = 0.5  # of the owed force
SURE_S = 0.05
LAG = 0.05  # s: lag of hydraulics, tyres and accelerometer behind the modelled pressure
SETTLED_FROM, SETTLED = 0.05, 0.1  # of the weight, of the force
SCALE_S, LARGEST_SCALE = 0.3, 1.5
AGAIN_S = 0.3  # of an application, in which the previous verdict is re-examined
MOVE_S = 0.05
GRIP = 0.6  # reached at once, or the previous value
GRIP_RATE = 0.5  # 1/s beyond it: slip shows before a wheel locks
YAW_LIMIT = 0.15
"""Lateral force of the front tyres that holds the car straight, over their load at rest: 1 % of their
longitudinal grip, and some 20 degrees at the steering wheel."""


@kernel
def lining_force(params: Record, law: Record, pressure: float, i: int) -> float:
    """Return the force [N] of a wheel's lining at a pressure [bar]."""
    lever: float = brake_gain(params, i) / params.wheel_radius[i]
    return lever * law.base[i] * max(BAR * pressure - params.push_out_pressure[i], 0.0)


@kernel
def watch_brakes(
    params: Record,
    state: Record,
    inputs: Record,
    estimate: Record,
    law: Record,
    expected: Record,
    zero: Record,
    sent: bool,
    dt: float,
) -> None:
    """Overwrite `state.failed`.

    Args:
        params: `PARAMS`.
        state: `FAILED_BRAKES_STATE`.
        inputs: `INPUTS`.
        estimate: `ESTIMATE` of the last cycle.
        law: `PRESSURE_LAW_STATE`, for the friction.
        expected: pressures that follow from the demands sent, shape (4,) [bar].
        zero: pressure zeros, shape (4,) [bar]; NaN: the reading shows no failure.
        sent: the demands were valid; otherwise, and while another controller brakes, nothing is judged.
        dt: time since the last cycle [s].
    """
    gain = 1.0 - math.exp(-dt / LAG)
    weight = params.mass * GRAVITY
    given = -estimate.tyre_force - params.rolling_resistance * weight
    due, total, suspected, braked = 0.0, 0.0, 0.0, False
    for i in range(4):
        force = lining_force(params, law, expected[i], i)
        state.owed[i] += gain * (force - state.owed[i])
        given -= motor_torque(inputs, i) / params.wheel_radius[i]
        due += force
        total += state.owed[i]
        braked = braked or expected[i] > LEAST
        if _lacks(inputs, expected[i], zero[i], i):
            suspected += state.owed[i]
    state.given += gain * (given - state.given)
    if not braked:
        state.settled_s, state.scale = 0.0, 1.0
    judged = sent and not others_brake(inputs) and estimate.measured != 0 and estimate.backwards == 0
    judged = judged and total > SETTLED_FROM * weight and abs(due - total) < SETTLED * total
    if judged:
        state.settled_s += dt
        if suspected == 0.0 and state.any == 0:
            scale = min(max(state.given / total, 1.0 / LARGEST_SCALE), LARGEST_SCALE)
            state.scale += dt / SCALE_S * (scale - state.scale)
    missing = state.scale * total - state.given > MISSING * state.scale * suspected
    state.any = 0
    for i in range(4):
        known = judged and expected[i] > LEAST and usable(inputs, CALLIPER_PRESSURE + i)
        stays = state.failed[i] != 0 and state.settled_s > AGAIN_S
        fails = _lacks(inputs, expected[i], zero[i], i) and (missing or stays)
        state.doubt_s[i] = state.doubt_s[i] + dt if known and fails != (state.failed[i] != 0) else 0.0
        if state.doubt_s[i] >= SURE_S:
            state.failed[i], state.doubt_s[i] = 1 if fails else 0, 0.0
        state.any = max(state.any, state.failed[i])


@kernel
def _lacks(inputs: Record, expected: float, zero: float, i: int) -> bool:
    reading = inputs.value[CALLIPER_PRESSURE + i] - zero
    below = -LEAST < reading < FOLLOWING * expected  # a brake that gives nothing reads no suction
    return expected > LEAST and usable(inputs, CALLIPER_PRESSURE + i) and below


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
    distribution: Record,
    allowed: Record,
    decel: float,
    backwards: bool,
    dt: float,
) -> None:
    """Move the torque of failed brakes to motors and to the wheels that brake.

    Args:
        params: `PARAMS`.
        state: `FAILED_BRAKES_STATE`, after `watch_brakes`.
        distribution: `DISTRIBUTION_STATE`; `torque` is overwritten.
        allowed: greatest demand to each motor [N m], shape (4,).
        decel: demanded [m/s^2].
        backwards: the car is in reverse.
        dt: time since the last cycle [s].
    """
    step = dt / MOVE_S
    for i in range(4):
        state.taken[i] = 0.0 if state.failed[i] else min(state.taken[i] + step, 1.0)
    state.moved = min(state.moved + step, 1.0) if state.any else max(state.moved - step, 0.0)
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
        if state.failed[i]:
            state.force[i] = min(torque, allowed[i]) if params.blending[i] > 0.0 else 0.0
        state.force[i] /= params.wheel_radius[i]
        wanted += torque / params.wheel_radius[i]
        if state.failed[i]:
            wanted -= state.force[i]
    wanted = min(wanted, state.grip * shares * params.mass * GRAVITY)
    for i in range(4):
        if not state.failed[i]:
            kept = (1.0 - state.taken[i]) * state.force[i]
            state.force[i] += state.moved * (kept + wanted * state.share[i] / shares - state.force[i])
    _limit_yaw(params, state, distribution)
    for i in range(4):
        if not state.failed[i]:
            distribution.torque[i] = state.force[i] * params.wheel_radius[i]


@kernel
def _limit_yaw(params: Record, state: Record, distribution: Record) -> None:
    """Reduce the forces of one side to the greatest admissible difference from the other, no force below its
    wheel's earlier demand."""
    most = 2.0 * YAW_LIMIT * params.mass * GRAVITY * params.rear_axle / params.track
    apart = state.force[0] + state.force[2] - state.force[1] - state.force[3]
    side = 0 if apart > 0.0 else 1
    added = 0.0
    for i in (side, side + 2):
        if not state.failed[i]:
            added += max(state.force[i] - distribution.torque[i] / params.wheel_radius[i], 0.0)
    excess = abs(apart) - most
    if excess <= 0.0 or added <= 0.0:
        return
    left = max(1.0 - excess / added, 0.0)
    for i in (side, side + 2):
        before = distribution.torque[i] / params.wheel_radius[i]
        if not state.failed[i] and state.force[i] > before:
            state.force[i] = before + left * (state.force[i] - before)
