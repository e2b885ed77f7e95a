"""Window means of a few cycles, each sample compared with the prediction at its own time.

Pressure noise multiplying the unknown friction would ruin the filter, and a low-pass on pressure alone would
delay it against the other signals. Means of all signals over the same cycles keep them aligned, with noise
white from window to window, and missing samples are simply not in the mean."""

import math

from ecu.algorithm.estimation.joint.layout import BIAS, DELAY, SLOPE, V
from ecu.algorithm.estimation.joint.motors import follow_motors
from ecu.algorithm.estimation.joint.sampling import (
    ACCEL,
    accelerate_by_speed,
    add_sample,
    add_speed,
    advance_common_time,
    at_common_time,
    close_sampling,
    open_sampling,
)
from ecu.algorithm.estimation.zero import note_rest
from ecu.algorithm.hydraulics import follows_demand
from ecu.algorithm.inputs import current, fresh, motor_torque, motor_torque_known, usable, wheels_mapped
from ecu.algorithm.lag import lag_gain
from ecu.algorithm.vehicle import corner_speed, sin_steering
from ecu.contract.params import BAR, GRAVITY
from ecu.contract.signals import (
    ACCEL_X,
    CALLIPER_PRESSURE,
    MOTOR_TORQUE,
    VEHICLE_SPEED,
    VEHICLE_SPEED_VALID,
    WHEEL_SPEED,
)
from ecu.jit import Record, kernel

OLDEST_S = 0.06  # of an acceleration or torque that is compared
COPIES, LEAST_COMPARED = 20, 2.0  # equal samples in a row, bar: the reading is then a copy
LEAST_ROLLED, COPIED = 10.0, 1e-4  # rad/s; change of a ratio of speeds that are one and the same
NEW_SHARE = 0.2  # share of the model's variance that is independent in the next window
SMOOTHING = 0.2  # s, low-pass of pressure and acceleration in derivatives
STEADY = 5.0  # s, time constant separating varying from lasting acceleration


@kernel
def open_window(state: Record) -> None:
    """Begin a window."""
    w = state.window
    w.time, w.cycles, w.accel, w.lateral, w.across, w.change = 0.0, 0, 0.0, 0.0, 0.0, 0.0
    w.reference, w.reference_change, w.reference_samples, w.balanced = 0.0, 0.0, 0, 0
    open_sampling(state.sampling)
    w.motor_known, w.motor_reported = 1, 0
    for i in range(4):
        w.load[i] = w.motor[i] = w.omega[i] = w.ground[i] = w.pressure[i] = 0.0
        w.tracked[i] = 0.0
        w.omega_samples[i] = w.pressure_samples[i] = w.tracked_cycles[i] = 0


@kernel
def speed_change(state: Record, motion: Record) -> float:
    """Return dv/dt [m/s^2] by the accelerometer, corrected for estimated bias and slope."""
    return motion.accel_x - state.x[BIAS] - state.x[SLOPE] + motion.yaw_rate * motion.lateral_speed


@kernel
def _compare_pressures(state: Record, inputs: Record) -> None:
    """Count the samples in which an axle's pressures are copies of one reading: noise would differ."""
    for axle in range(2):
        left = CALLIPER_PRESSURE + 2 * axle
        pressure = inputs.value[left]
        if fresh(inputs, left) and fresh(inputs, left + 1) and pressure > LEAST_COMPARED:
            state.copies[axle] = state.copies[axle] + 1 if pressure == inputs.value[left + 1] else 0
            if state.copies[axle] == 0:
                state.differs[axle] = 1


@kernel
def compare_wheels(state: Record) -> None:
    """Count the windows in which all wheels had one speed: a logger's only one may stand for all four."""
    w = state.window
    if state.speed_copies < 0 or w.omega[0] < LEAST_ROLLED:
        return
    for i in range(4):
        if w.omega_samples[i] == 0:
            return
    for i in range(3):
        ratio = w.omega[i + 1] / w.omega[0]
        if state.speed_copies == 0:
            state.wheel_ratio[i] = ratio
        elif abs(ratio - state.wheel_ratio[i]) > COPIED:
            state.speed_copies = -1
            return
    state.speed_copies += 1


@kernel
def gather(
    params: Record,
    state: Record,
    inputs: Record,
    motion: Record,
    load: Record,
    hydraulics: Record,
    released: bool,
    dt: float,
) -> None:
    """Advance the speed by `dt` [s] and add this cycle's samples to the window."""
    w, x, value = state.window, state.x, inputs.value
    _compare_pressures(state, inputs)
    change = speed_change(state, motion)
    x[V] = max(x[V] + dt * change, 0.0)
    w.time += dt
    w.cycles += 1
    w.accel += motion.accel_x
    state.sampling.now += dt
    if fresh(inputs, ACCEL_X):
        add_sample(state.sampling, ACCEL, motion.accel_x, 1e-9 * inputs.age_ns[ACCEL_X])
    w.change += change
    gain = lag_gain(dt, SMOOTHING)
    state.smooth_accel += gain * (motion.accel_x - state.smooth_accel)
    state.mean_accel += lag_gain(dt, STEADY) * (motion.accel_x - state.mean_accel)
    follow_motors(state.motors, inputs, dt)
    front_lateral = params.mass * motion.accel_y * params.rear_axle / params.wheelbase
    turning = motion.yaw_rate * x[V]  # a bend shows in both, a bank or a zero in one alone
    w.across += (motion.accel_y if abs(motion.accel_y) < abs(turning) else turning) / GRAVITY
    w.lateral += front_lateral * sin_steering(motion)
    timed, fastest, age = not params.mapped[ACCEL_X], -1.0, 0.0
    for i in range(4):
        w.load[i] += load[i]
        w.motor[i] += motor_torque(inputs, i)
        stale = usable(inputs, MOTOR_TORQUE + i) and not current(inputs, MOTOR_TORQUE + i, OLDEST_S)
        if stale or not motor_torque_known(inputs, i):
            w.motor_known = 0
        if usable(inputs, MOTOR_TORQUE + i):
            w.motor_reported = 1
        place = WHEEL_SPEED + i
        if fresh(inputs, place):
            w.omega[i] += value[place]
            w.ground[i] += corner_speed(params, motion, x[V] - 1e-9 * inputs.age_ns[place] * change, i)
            w.omega_samples[i] += 1
            if timed and abs(value[place]) * params.wheel_radius[i] > fastest:
                fastest, age = abs(value[place]) * params.wheel_radius[i], 1e-9 * inputs.age_ns[place]
        place = CALLIPER_PRESSURE + i
        push_out = params.push_out_pressure[i] / BAR
        if fresh(inputs, place):
            if released:
                note_rest(state.zero, i, value[place])
            above = value[place] - state.zero.value[i] - push_out
            add_sample(state.sampling, i, above, 1e-9 * inputs.age_ns[place])
            w.pressure_samples[i] += 1
        if follows_demand(params, hydraulics, i):
            w.tracked[i] += hydraulics.value[i] - push_out
            w.tracked_cycles[i] += 1
    place = VEHICLE_SPEED
    if fresh(inputs, place) and (value[VEHICLE_SPEED_VALID] > 0.5 or not params.mapped[VEHICLE_SPEED_VALID]):
        delay = params.vehicle_speed_delay + x[DELAY] + 1e-9 * inputs.age_ns[place]
        w.reference += value[place] - (x[V] - delay * change)
        w.reference_change += change
        w.reference_samples += 1
        if timed and not wheels_mapped(params):
            fastest, age = value[place], delay
    if fastest >= 0.0:
        add_speed(state.sampling, fastest, age)


@kernel
def close_window(params: Record, state: Record, hydraulics: Record) -> None:
    """Turn the sums into means."""
    w = state.window
    n = w.cycles
    if not params.mapped[ACCEL_X]:
        accelerate_by_speed(state.sampling)
    close_sampling(state.sampling)
    w.balanced = 1 if advance_common_time(state.sampling) else 0
    w.common_accel = at_common_time(state.sampling, ACCEL)
    gain = 1.0 - math.exp(-w.time / SMOOTHING)
    w.accel /= n
    w.change /= n
    w.lateral /= n
    w.across /= n
    for i in range(4):
        w.load[i] /= n
        w.motor[i] /= n
        if w.omega_samples[i] > 0:
            w.omega[i] /= w.omega_samples[i]
            w.ground[i] /= w.omega_samples[i]
        sampled = state.sampling.samples[i]
        w.pressure[i] = state.sampling.value[i]
        w.common_pressure[i] = at_common_time(state.sampling, i)
        w.pressure_variance[i] = (params.sigma_pressure / BAR) ** 2 / max(sampled, 1)
        if state.copies[i // 2] > COPIES:
            w.pressure_variance[i] *= 2.0  # common noise in both wheels of an axle
        state.follows[i] = 1 if w.tracked_cycles[i] == n and w.pressure_samples[i] > 0 else 0
        if state.follows[i]:
            w.pressure[i] = w.common_pressure[i] = w.tracked[i] / n
            w.pressure_variance[i] = NEW_SHARE * hydraulics.variance[i]
            state.smooth_pressure[i] = w.pressure[i]
        else:
            state.smooth_pressure[i] += gain * (w.pressure[i] - state.smooth_pressure[i])
    if w.reference_samples > 0:
        w.reference /= w.reference_samples
        w.reference_change /= w.reference_samples
