"""Sensors of the car: positions, the body's attitude and their errors.

The accelerometer is fixed to the body: pitched nose down by theta it reads f_x cos(theta) - f_z sin(theta),
f being specific force in road axes at the sensor's place, so gravity's part on a slope is in the reading. f_z
is gravity across the road and, with a suspension, the body's heave. Attitude is the model's: lagged gradients
or, with a suspension, the integrated pitch and roll. Errors: `sensor_errors.py`.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import GRAVITY
from brakelab.plant.sensor_errors import SIGNALS, WHEEL_STEMS

PASCAL_TO_BAR: Final = 1e-5
FIRST_WHEEL: Final = SIGNALS.index("wheel_speed_fl")
PER_WHEEL: Final = len(WHEEL_STEMS)
MOTOR_TORQUE: Final = SIGNALS.index("motor_torque_fl")
STEERING_ANGLE: Final = SIGNALS.index("steering_angle")


@kernel
def body_accelerations(params: Record, state: Record, grade: float) -> tuple[float, float]:
    """Return the readings of a noise-free accelerometer at the sensor's place, x and y [m/s^2]."""
    x = params.sensor_position[0]
    y = params.sensor_position[1]
    z = params.sensor_position[2]
    turning = state.yaw_rate * state.yaw_rate
    road_x = state.accel_x - state.yaw_accel * y - turning * x + state.pitch_accel * z
    road_y = state.accel_y + state.yaw_accel * x - turning * y - state.roll_accel * z
    up = GRAVITY * math.cos(grade) * math.cos(state.bank) + state.vertical_accel
    return (
        road_x * math.cos(state.pitch) - up * math.sin(state.pitch),
        road_y * math.cos(state.roll) + up * math.sin(state.roll),
    )


@kernel
def true_readings(
    params: Record,
    state: Record,
    grade: float,
    steering_angle: float,
    over_ground: bool,
    readings: NDArray[np.float64],
) -> None:
    """Write the readings of error-free sensors into `readings`, shape (len(SIGNALS),), units of the signals.

    `over_ground`: the speed's magnitude, as a satellite receiver knows it, instead of its part along the car.
    """
    readings[0], readings[1] = body_accelerations(params, state, grade)
    readings[2] = state.yaw_rate
    readings[3] = math.hypot(state.speed_x, state.speed_y) if over_ground else state.speed_x
    for wheel in range(4):
        first = FIRST_WHEEL + PER_WHEEL * wheel
        braking = math.copysign(state.brake_torque[wheel], state.wheel_speed[wheel])
        readings[first] = state.wheel_speed[wheel]
        readings[first + 1] = PASCAL_TO_BAR * state.pressure[wheel]
        readings[first + 2] = state.force_x[wheel]
        readings[first + 3] = -braking - state.motor_torque[wheel]
        readings[MOTOR_TORQUE + wheel] = state.motor_torque[wheel]
    readings[STEERING_ANGLE] = steering_angle
