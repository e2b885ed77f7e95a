"""What a wheel speed cannot be: that of a wheel which brakes and yet turns faster than the car.

A sensor that keeps its last value looks like that as soon as the car slows down; its frames are new, intact
and on time. A wheel that is slower than the car may slide, so nothing is said of it.
"""

import numpy as np

from ecu.estimation.motion import corner_speed, motor_torque, usable
from ecu.jit import Record, kernel
from ecu.signals import WHEEL_SPEED

PLAUSIBILITY_STATE = np.dtype([("for_s", "f8", (4,))], align=True)

FASTER = 1.05  # than the ground below it: radii, curves and the car's speed are known better
BRAKED = 100.0  # N m
LEAST_SPEED = 5.0  # m/s
DOUBT_S = 0.3


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
