"""Plausibility of wheel speeds and calliper pressures.

A wheel that brakes does not turn faster than the car, nor than the other wheels: if all do, the car's speed
is wrong. A sensor that keeps its last value looks like that as soon as the car slows down; its frames are
new, intact and on time. A wheel that is slower than the car may slide, so nothing is said of it.

A wheel whose speed falls by more than its brake could make it has no wheel behind that reading: wires break
to 0. It is left out until it agrees with the car again, or the car stands.

A pressure follows the demands that were sent (`control/friction_torque.py` models how) if the three others
do. Where more than one does not, somebody else brakes, or nobody listens: nothing is said of a sensor or a
valve then.
"""

import math

import numpy as np

from ecu.algorithm.inputs import fresh, motor_torque, others_brake, usable
from ecu.algorithm.vehicle import corner_speed
from ecu.contract.signals import CALLIPER_PRESSURE, WHEEL_SPEED
from ecu.jit import Record, kernel

PLAUSIBILITY_STATE = np.dtype(
    [
        ("for_s", "f8", (4,)),  # a wheel has been too fast for this long
        ("omega", "f8", (4,)),  # last sample of a wheel [rad/s]
        ("age_s", "f8", (4,)),  # of it
        ("fell", "u1", (4,)),  # faster than a wheel can
        ("apart_s", "f8", (4,)),  # a pressure has not been what was demanded, longer than it was
        ("pressure", "u1"),  # one has been for too long
        ("sent", "u1"),  # the last demands were valid
    ],
    align=True,
)

FASTER = 1.05  # than the ground below it: radii, curves and the car's speed are known better
BRAKED = 100.0  # N m
LEAST_SPEED = 5.0  # m/s
DOUBT_S = 0.3
FALL, FALL_SHARE = 8.0, 3.0  # rad/s, of what the brake's torque does to the free wheel
OLDEST_S = 0.1  # of a sample that the next is compared with
ROLLING = 0.06  # of the speed, that a rolling wheel differs by at most
STANDSTILL = 0.1  # m/s
APART, APART_SHARE = 8.0, 0.2  # bar, of the pressure: noise, and what the model of the hydraulics leaves
FOLLOWS = 0.75  # of that


@kernel
def _over_ground(params: Record, inputs: Record, estimate: Record, i: int) -> float:
    """Return how fast a wheel turns over what the ground below it does."""
    turns = inputs.value[WHEEL_SPEED + i] * params.wheel_radius[i]
    return turns / corner_speed(params, estimate, estimate.speed, i)


@kernel
def wheel_speed_implausible(
    params: Record, state: Record, inputs: Record, estimate: Record, dt: float
) -> bool:
    """Return whether a wheel has been too fast for `DOUBT_S`, or has fallen too fast.

    Args:
        params: `PARAMS`.
        state: `PLAUSIBILITY_STATE`, overwritten.
        inputs: `INPUTS`, as they came.
        estimate: `ESTIMATE` of the last cycle.
        dt: time since the last cycle [s].
    """
    found = False
    total, wheels = 0.0, 0
    for i in range(4):
        if usable(inputs, WHEEL_SPEED + i):
            total += _over_ground(params, inputs, estimate, i)
            wheels += 1
    for i in range(4):
        found = found or state.fell[i] != 0
        over = _over_ground(params, inputs, estimate, i)
        braked = estimate.brake_torque[i] > BRAKED and motor_torque(inputs, i) >= 0.0
        fast = usable(inputs, WHEEL_SPEED + i) and estimate.speed > LEAST_SPEED and over > FASTER
        alone = over * (wheels - 1) > FASTER * (total - over)  # than the others' mean; no other: 0 > 0
        state.for_s[i] = state.for_s[i] + dt if fast and alone and braked else 0.0
        found = found or state.for_s[i] > DOUBT_S
    return found


@kernel
def watch_wheels(params: Record, state: Record, inputs: Record, estimate: Record, dt: float) -> None:
    """Overwrite `state.fell`: whose speed has fallen faster than a wheel's can.

    Arguments as for `wheel_speed_implausible`.
    """
    for i in range(4):
        state.age_s[i] += dt
        if fresh(inputs, WHEEL_SPEED + i):
            omega = inputs.value[WHEEL_SPEED + i]
            braked = estimate.brake_torque[i] + abs(motor_torque(inputs, i))
            possible = FALL + FALL_SHARE * braked / params.wheel_inertia[i] * state.age_s[i]
            ground = corner_speed(params, estimate, estimate.speed, i)
            known = state.age_s[i] < OLDEST_S and usable(inputs, CALLIPER_PRESSURE + i)
            if known and state.omega[i] - omega > possible:
                state.fell[i] = 1
            elif abs(omega * params.wheel_radius[i] - ground) < ROLLING * ground:
                state.fell[i] = 0
            state.omega[i], state.age_s[i] = omega, 0.0
        if estimate.speed < STANDSTILL:
            state.fell[i] = 0


@kernel
def _gap(inputs: Record, i: int, expected: float, zero: float) -> float:
    """Return how far a pressure is from what is expected of it, over what is too far; NaN: not known."""
    place = CALLIPER_PRESSURE + i
    gap = abs(inputs.value[place] - zero - expected) / (APART + APART_SHARE * expected)
    return gap if usable(inputs, place) else math.nan


@kernel
def watch_pressures(state: Record, inputs: Record, expected: Record, zero: Record, dt: float) -> None:
    """Overwrite `state.pressure`: whether a pressure has been apart from its demand for `DOUBT_S`.

    Args:
        state: `PLAUSIBILITY_STATE`, overwritten.
        inputs: `INPUTS`.
        expected: pressures by the demands that were sent, shape (4,) [bar].
        zero: what the sensors read without pressure, shape (4,) [bar].
        dt: time since the last cycle [s].
    """
    others = others_brake(inputs)
    following = 0
    for i in range(4):
        following += 1 if _gap(inputs, i, expected[i], zero[i]) < FOLLOWS else 0
    state.pressure = 0
    for i in range(4):
        if state.sent == 0 or others:
            state.apart_s[i] = 0.0
        elif following == 3 and _gap(inputs, i, expected[i], zero[i]) > 1.0:
            state.apart_s[i] = min(state.apart_s[i] + dt, 2.0 * DOUBT_S)
        else:
            state.apart_s[i] = max(state.apart_s[i] - dt, 0.0)
        if state.apart_s[i] > DOUBT_S:
            state.pressure = 1
