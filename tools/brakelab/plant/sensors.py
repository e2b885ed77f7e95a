"""What the car's sensors make of the truth: positions, the body's attitude and white noise.

Noise: Table 4.1; yaw rate and wheel torque are not in it and are assumptions. The accelerometer is fixed to
the body: pitched nose down by theta it reads f_x cos(theta) - f_z sin(theta), f being specific force in road
axes at the sensor's place, so gravity's part on a slope is in the reading. f_z is gravity across the road
and, with a suspension, the body's heave. Attitude is the model's: lagged gradients or, with a suspension, the
integrated pitch and roll.
"""

import math
from typing import Final

from numpy.random import Generator

from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import GRAVITY

SPEED_NOISE: Final = 0.027  # m/s (Table 4.1)
WHEEL_SPEED_NOISE: Final = 0.1  # rad/s (Table 4.1)
ACCEL_NOISE: Final = 0.01  # m/s^2 (Table 4.1)
PRESSURE_NOISE: Final = 1.8  # bar (Table 4.1)
FORCE_NOISE: Final = 10.0  # N (Table 4.1)
YAW_RATE_NOISE: Final = 0.002  # rad/s. Assumption
TORQUE_NOISE: Final = 3.5  # N m. Assumption: the force's noise at the lever of the wheel radius

PASCAL_TO_BAR: Final = 1e-5


@kernel
def body_accelerations(params: Record, state: Record, grade: float) -> tuple[float, float]:
    """Return what a noise-free accelerometer at the sensor's place reads, x and y [m/s^2]."""
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
def measure(params: Record, state: Record, grade: float, noise: Generator, measured: Record) -> None:
    """Overwrite `measured` with noisy readings of `state`. The order of the draws is fixed."""
    accel_x, accel_y = body_accelerations(params, state, grade)
    measured.accel_x = accel_x + ACCEL_NOISE * noise.standard_normal()
    measured.accel_y = accel_y + ACCEL_NOISE * noise.standard_normal()
    measured.yaw_rate = state.yaw_rate + YAW_RATE_NOISE * noise.standard_normal()
    measured.vehicle_speed = state.speed_x + SPEED_NOISE * noise.standard_normal()
    for wheel in range(4):
        measured.wheel_speed[wheel] = state.wheel_speed[wheel] + WHEEL_SPEED_NOISE * noise.standard_normal()
        measured.calliper_pressure[wheel] = (
            PASCAL_TO_BAR * state.pressure[wheel] + PRESSURE_NOISE * noise.standard_normal()
        )
        measured.wheel_force_x[wheel] = state.force_x[wheel] + FORCE_NOISE * noise.standard_normal()
        braking = math.copysign(state.brake_torque[wheel], state.wheel_speed[wheel])
        torque = -braking - state.motor_torque[wheel]
        measured.wheel_torque_y[wheel] = torque + TORQUE_NOISE * noise.standard_normal()
