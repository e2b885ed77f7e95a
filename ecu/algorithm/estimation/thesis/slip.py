"""Wheel slip with load-dependent rolling radius (A.4, A.6) and learned radius errors.

Rolling radius: r_i = r(F_Z,i) (1 + d_i) with a free error d_i, learned while the wheels roll nearly free;
without it a radius error of 0.3 % would be 15 % of the slip at 4 m/s^2. Expected slip: the total tyre force m
a_x + drag, shared in proportion to the wheels' torques, over the nominal slip stiffness; it corrects the
wheels for the speed filter and is never used as a measurement. Slip is low-passed at 16 Hz (4.3.3).
"""

import math

import numpy as np

from ecu.algorithm.estimation.friction import CUT_OFF
from ecu.algorithm.estimation.thesis.tyre import longitudinal_slip, slip_stiffness
from ecu.algorithm.inputs import fresh, motor_torque
from ecu.algorithm.vehicle import corner_speed, rolling_radius
from ecu.contract.signals import WHEEL_SPEED
from ecu.jit import Record, kernel

WHEELS_STATE = np.dtype(
    [
        ("radius", "f8", (4,)),  # m
        ("expected_slip", "f8", (4,)),
        ("expected_force", "f8", (4,)),  # N
        ("slip", "f8", (4,)),  # low-passed
        ("since_s", "f8", (4,)),  # time since the last sample [s]
        ("fresh", "u1", (4,)),  # slip was updated in this cycle
    ],
    align=True,
)

RADIUS_START = 0.004  # standard deviation of a radius error before learning
RADIUS_FLOOR = 0.00015
RADIUS_DRIFT = 1e-5  # 1/sqrt(s): temperature and pressure of the tyre
RADIUS_LIMIT = 0.03
# Nearly free rolling: above this speed, below these accelerations and this yaw rate.
FREE_SPEED, FREE_ACCEL, FREE_YAW_RATE = 8.0, 1.0, 0.03


@kernel
def update_radius(params: Record, state: Record, learned: Record, load: Record) -> None:
    """Overwrite `state.radius` [m] from the wheel loads [N] and the learned errors."""
    for i in range(4):
        nominal = rolling_radius(load[i], params.unloaded_radius[i], params.vertical_stiffness[i])
        state.radius[i] = nominal * (1.0 + learned.radius_error[i])


@kernel
def expect_slip(
    params: Record, state: Record, inputs: Record, load: Record, total_force: float, brake_torque: Record
) -> None:
    """Overwrite expected slip and force [N] from the total tyre force [N] and the brake torques [N m]."""
    share_sum, load_sum = 0.0, 0.0
    for i in range(4):
        share_sum += abs(brake_torque[i] + motor_torque(inputs, i))
        load_sum += load[i]
    for i in range(4):
        if share_sum > 50.0:
            share = abs(brake_torque[i] + motor_torque(inputs, i)) / share_sum
        else:
            share = load[i] / load_sum
        force = total_force * share
        slip = force / slip_stiffness(params, i, load[i], force)
        state.expected_force[i] = force
        state.expected_slip[i] = min(max(slip, -0.15), 0.15)


@kernel
def update_slip(
    params: Record, state: Record, motion: Record, inputs: Record, speed: float, accel: float, dt: float
) -> None:
    """Overwrite the low-passed slip from wheel speeds that are new in this cycle."""
    for i in range(4):
        state.since_s[i] += dt
        state.fresh[i] = 0
        if not fresh(inputs, WHEEL_SPEED + i):
            continue
        age = 1e-9 * inputs.age_ns[WHEEL_SPEED + i]
        ground = corner_speed(params, motion, speed - age * accel, i)
        motion.ground_speed[i] = ground
        raw = longitudinal_slip(inputs.value[WHEEL_SPEED + i] * state.radius[i], ground)
        gain = 1.0 - math.exp(-2.0 * math.pi * CUT_OFF * state.since_s[i])
        state.slip[i] += gain * (raw - state.slip[i])
        state.since_s[i] = 0.0
        state.fresh[i] = 1


@kernel
def learn_radius(
    params: Record,
    state: Record,
    learned: Record,
    motion: Record,
    inputs: Record,
    speed: Record,
    braking: bool,
    dt: float,
) -> None:
    """Learn the radius errors while the wheels roll nearly free.

    Without a speed reference the mean of the four is not observable and stays as it is.
    """
    if (
        braking
        or speed.speed < FREE_SPEED
        or abs(motion.accel_x) > FREE_ACCEL
        or abs(motion.accel_y) > FREE_ACCEL
        or abs(motion.yaw_rate) > FREE_YAW_RATE
    ):
        return
    for i in range(4):
        if not fresh(inputs, WHEEL_SPEED + i):
            return
    mean = 0.0
    if speed.reference_s > 0.5:
        for i in range(4):
            mean += 0.25 * (state.slip[i] - state.expected_slip[i])
    for i in range(4):
        slip = longitudinal_slip(inputs.value[WHEEL_SPEED + i] * state.radius[i], motion.ground_speed[i])
        if abs(slip) > 0.05:
            continue
        variance = learned.radius_sigma[i] ** 2 + RADIUS_DRIFT**2 * dt
        noise = (params.sigma_wheel_speed * state.radius[i] / speed.speed) ** 2 + (
            0.3 * state.expected_slip[i]
        ) ** 2
        gain = variance / (variance + noise)
        # A radius taken too large appears as slip.
        error = learned.radius_error[i] - gain * (slip - state.expected_slip[i] - mean)
        learned.radius_error[i] = min(max(error, -RADIUS_LIMIT), RADIUS_LIMIT)
        learned.radius_sigma[i] = max(math.sqrt((1.0 - gain) * variance), RADIUS_FLOOR)
