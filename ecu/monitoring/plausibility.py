"""What a wheel speed and a calliper pressure cannot be.

A wheel that brakes does not turn faster than the car. A sensor that keeps its last value looks like that as
soon as the car slows down; its frames are new, intact and on time. A wheel that is slower than the car may
slide, so nothing is said of it.

A pressure follows the demands that were sent (`control/friction_torque.py` models how) if any does. Where all
four do not, somebody else brakes, or nobody listens: nothing is said of a sensor or a valve then.
"""

import numpy as np

from ecu.estimation.motion import corner_speed, motor_torque, usable
from ecu.jit import Record, kernel
from ecu.signals import ABS_ACTIVE, CALLIPER_PRESSURE, ESP_ACTIVE, WHEEL_SPEED

PLAUSIBILITY_STATE = np.dtype(
    [
        ("for_s", "f8", (4,)),  # a wheel has been too fast for this long
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
ALL = 0b1111
APART, APART_SHARE = 8.0, 0.2  # bar, of the pressure: noise, and what the model of the hydraulics leaves


@kernel
def wheel_speed_implausible(
    params: Record, state: Record, inputs: Record, motion: Record, speed: float, torque: Record, dt: float
) -> bool:
    """Return whether a wheel has been too fast for `DOUBT_S`.

    Args:
        params: `PARAMS`.
        state: `PLAUSIBILITY_STATE`, overwritten.
        inputs: `INPUTS`.
        motion: `MOTION_STATE`.
        speed: of the car [m/s].
        torque: of the linings, shape (4,) [N m], >= 0.
        dt: time since the last cycle [s].
    """
    found = False
    for i in range(4):
        ground = corner_speed(params, motion, speed, i)
        turns = inputs.value[WHEEL_SPEED + i] * params.wheel_radius[i]
        braked = torque[i] > BRAKED and motor_torque(inputs, i) >= 0.0
        fast = usable(inputs, WHEEL_SPEED + i) and speed > LEAST_SPEED and turns > FASTER * ground
        state.for_s[i] = state.for_s[i] + dt if fast and braked else 0.0
        found = found or state.for_s[i] > DOUBT_S
    return found


@kernel
def _apart(inputs: Record, i: int, expected: float, zero: float) -> bool:
    place = CALLIPER_PRESSURE + i
    gap = abs(inputs.value[place] - zero - expected)
    return usable(inputs, place) and gap > APART + APART_SHARE * expected


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
    others = inputs.value[ABS_ACTIVE] > 0.5 or inputs.value[ESP_ACTIVE] > 0.5
    apart = 0
    for i in range(4):
        if _apart(inputs, i, expected[i], zero[i]):
            apart |= 1 << i
    state.pressure = 0
    for i in range(4):
        if state.sent == 0 or others or apart == ALL:
            state.apart_s[i] = 0.0
        elif apart >> i & 1:
            state.apart_s[i] = min(state.apart_s[i] + dt, 2.0 * DOUBT_S)
        else:
            state.apart_s[i] = max(state.apart_s[i] - dt, 0.0)
        if state.apart_s[i] > DOUBT_S:
            state.pressure = 1
