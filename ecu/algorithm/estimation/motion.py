"""Inertial and steering signals in road axes, before any filter.

The accelerometer is fixed to the body and off the centre of gravity (ISO 8855: pitch theta positive nose
down), so it reads

    a_s = a_x cos(theta) - g sin(theta) - psi_dot^2 x_s

With the quasi-static pitch theta = -k a_x (k: `pitch_gradient`) this is a_s = a_x (1 + g k) to first order.
At 8 m/s^2 and 2 deg/g that is 0.28 m/s^2. On a slope the reading contains gravity, so m a_x is
the sum of tyre forces and drag on any slope (corrected 4.16); speed needs the slope removed (`speed.py`).

The lateral speed at the centre of gravity is that of a rear axle with a small slip angle: v_y = l_r psi_dot -
v_x a_y / (c_alpha g). In steady cornering yaw rate and lateral acceleration follow from each other, a_y = v_x
psi_dot.
"""

import numpy as np

from ecu.algorithm.estimate import STANDING
from ecu.algorithm.inputs import motor_torque, usable
from ecu.algorithm.vehicle import set_steering
from ecu.contract.params import GRAVITY
from ecu.contract.signals import (
    ACCEL_X,
    ACCEL_Y,
    REVERSE,
    STEERING_ANGLE,
    WHEEL_SPEED,
    YAW_RATE,
)
from ecu.jit import Record, kernel

SLOPE = 2.0  # m/s^2, of a slope of 20 %
TURNS = 2.0  # m/s
LEAST_CORNERING_SPEED = 5.0  # m/s, above which lateral acceleration yields the yaw rate

MOTION_STATE = np.dtype(
    [
        ("accel_x", "f8"),  # specific force in road axes at the centre of gravity [m/s^2]
        ("accel_x_model", "f8"),  # the same by the torques of brakes and motors and by drag
        ("measured", "u1"),  # `accel_x` is measured, otherwise modelled
        ("backwards", "u1"),  # in reverse
        ("accel_y", "f8"),
        ("yaw_rate", "f8"),  # rad/s
        ("steering", "f8"),  # rad at the road wheel, and its cosine and sine
        ("cos_steering", "f8"),
        ("sin_steering", "f8"),
        ("lateral_speed", "f8"),  # m/s
        ("ground_speed", "f8", (4,)),  # of each wheel in its rolling direction per (A.5) [m/s]
    ],
    align=True,
)


@kernel
def _drives_backwards(params: Record, inputs: Record, speed: float) -> bool:
    """Return whether the car is in reverse gear, or rolls back by wheel speed sensors with direction.

    One that was faster than `TURNS` [m/s] forwards stands before it does.
    """
    back = 0
    for i in range(4):
        place = WHEEL_SPEED + i
        if usable(inputs, place) and inputs.value[place] * params.wheel_radius[i] < -STANDING:
            back += 1
    reverse: bool = usable(inputs, REVERSE) and inputs.value[REVERSE] > 0.5
    return reverse or (back > 2 and speed < TURNS)


@kernel
def speed_backwards(params: Record, inputs: Record, motion: Record, speed: float, dt: float) -> float:
    """Return the speed [m/s], negative, of a car in reverse, from the previous one.

    It is that of the fastest wheel, with or without direction in its sensor. Wheels that slow faster than the
    accelerometer allows on a slope have begun to lock.
    """
    slower: float = abs(speed) - (abs(motion.accel_x) + SLOPE) * dt
    for i in range(4):
        if usable(inputs, WHEEL_SPEED + i):
            slower = max(slower, abs(inputs.value[WHEEL_SPEED + i]) * params.wheel_radius[i])
    return -slower


@kernel
def update_motion(params: Record, state: Record, inputs: Record, speed: float, brake_torque: Record) -> None:
    """Overwrite accelerations, yaw rate, steering and lateral speed; unknown quantities count as zero.

    Longitudinal acceleration is modelled while its sensor is lost; brake torques [N m] oppose travel.
    """
    value = inputs.value
    set_steering(state, value[STEERING_ANGLE] if usable(inputs, STEERING_ANGLE) else 0.0)
    yaw, across = usable(inputs, YAW_RATE), usable(inputs, ACCEL_Y)
    state.yaw_rate = value[YAW_RATE] if yaw else 0.0
    state.accel_y = value[ACCEL_Y] if across else state.yaw_rate * speed
    if across and not yaw and speed > LEAST_CORNERING_SPEED:
        state.yaw_rate = state.accel_y / speed
    state.backwards = 1 if _drives_backwards(params, inputs, speed) else 0
    against = -1.0 if state.backwards else 1.0 if speed > STANDING else 0.0
    force = -params.drag_area * speed * abs(speed)
    for i in range(4):
        force -= (against * brake_torque[i] + motor_torque(inputs, i)) / params.wheel_radius[i]
    state.accel_x_model = force / params.mass
    state.accel_x, state.measured = state.accel_x_model, 0
    if usable(inputs, ACCEL_X):
        reading = value[ACCEL_X] + state.yaw_rate**2 * params.imu_x
        state.accel_x, state.measured = reading / (1.0 + GRAVITY * params.pitch_gradient), 1
    slip_angle = state.accel_y / (params.cornering_stiffness * GRAVITY)
    state.lateral_speed = params.rear_axle * state.yaw_rate - speed * slip_angle


@kernel
def tell_motion(state: Record, estimate: Record) -> None:
    """Overwrite accelerations, yaw rate, steering and lateral speed in `estimate`."""
    estimate.accel_x, estimate.accel_x_model = state.accel_x, state.accel_x_model
    estimate.measured, estimate.backwards = state.measured, state.backwards
    estimate.accel_y, estimate.yaw_rate = state.accel_y, state.yaw_rate
    estimate.steering, estimate.lateral_speed = state.steering, state.lateral_speed
    estimate.cos_steering, estimate.sin_steering = state.cos_steering, state.sin_steering
