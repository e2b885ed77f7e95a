"""The car's speed where no filter step tells it: at the start, in reverse, after nobody saw the car move."""

import math

from ecu.algorithm.estimation.joint.kalman import forget_speed
from ecu.algorithm.estimation.joint.layout import V
from ecu.algorithm.estimation.joint.sliding import HOLD_S
from ecu.algorithm.estimation.joint.window import open_window
from ecu.algorithm.estimation.motion import speed_backwards
from ecu.algorithm.inputs import (
    OVERSLEPT_S,
    driver_accelerates,
    mean_wheel_speed,
    motor_torque,
    usable,
    wheels_mapped,
)
from ecu.contract.signals import ACCEL_X, VEHICLE_SPEED
from ecu.jit import Record, kernel

LOST_S = 0.3  # without an accelerometer: longer than between two frames of a slow one
MISLED, MISLED_S = 0.06, 0.4  # of the speed, s for which an accelerometer that is wrong may have misled it
UNSEEN_ACCEL = 12.0  # m/s^2, greatest that nobody saw
BELIEVED_AFTER, AT_LAST = 3.0, 15.0  # s without a wheel that shows the speed, brakes released
SAME = 1.0  # m/s, change of the wheels' distance from the speed: the accelerometer's error over that time
DRIVEN_ACCEL, DRIVEN = 0.5, 100.0  # m/s^2, N m of all motors


@kernel
def start_speed(params: Record, state: Record, inputs: Record) -> None:
    """Start with the wheels' speed, or the speed over ground where no wheel is mapped."""
    speed = mean_wheel_speed(params, inputs)
    if not wheels_mapped(params) and usable(inputs, VEHICLE_SPEED):
        speed = inputs.value[VEHICLE_SPEED]
    if math.isnan(speed):
        return
    state.x[V] = speed
    state.started, state.hold_s = 1, HOLD_S


@kernel
def reverses(params: Record, state: Record, inputs: Record, motion: Record, dt: float) -> bool:
    """Take the speed from the wheels in reverse; return whether the car moves backwards."""
    if motion.backwards:
        state.x[V] = speed_backwards(params, inputs, motion, state.x[V], dt)
        state.reversing = 1
        return True
    if state.reversing:
        speed = mean_wheel_speed(params, inputs)
        state.x[V] = speed if math.isfinite(speed) else abs(state.x[V])
        state.reversing = 0
        forget_speed(state)
        open_window(state)
    return False


@kernel
def bridge_gap(params: Record, state: Record, inputs: Record, motion: Record, dt: float) -> bool:
    """Carry the speed over a time in which nobody tells how the car moves, and take it from the wheels then.

    Dead reckoning over such a gap proves no slip: wheels that differ from it by less than the car may have
    been braked by meanwhile tell its speed, and learning is held for a while. Returns whether this cycle
    belongs to the gap.
    """
    speed = mean_wheel_speed(params, inputs)
    known = motion.measured != 0 or math.isfinite(speed) or usable(inputs, VEHICLE_SPEED)
    if not known and state.unseen_s == 0.0:
        state.unseen_s = min(1e-9 * inputs.age_ns[ACCEL_X], LOST_S)
    if not known or dt > OVERSLEPT_S:
        state.unseen_s += dt
    reach = UNSEEN_ACCEL * state.unseen_s
    seen = reach > 0.0 and abs(speed - state.x[V]) < reach
    if known and not seen:
        return False
    state.x[V] = speed if seen else max(state.x[V] + dt * motion.accel_x, 0.0)
    state.unseen_s, state.hold_s = 0.0 if seen else state.unseen_s, HOLD_S
    state.sampling.now += dt
    forget_speed(state)
    open_window(state)
    return True


@kernel
def doubt_speed(params: Record, state: Record, inputs: Record) -> None:
    """Let the wheels tell the speed that an accelerometer has misled, which is now found wrong."""
    speed = mean_wheel_speed(params, inputs)
    if abs(speed - state.x[V]) > MISLED * state.x[V]:
        state.unseen_s = max(state.unseen_s, MISLED_S)


@kernel
def retake_speed(state: Record, reckoned: float) -> None:
    """Take the dead `reckoned` speed [m/s] where an input that is now found wrong has misled the filter."""
    if abs(reckoned - state.x[V]) > MISLED * reckoned:
        state.x[V] = reckoned
        forget_speed(state)


@kernel
def _driven(inputs: Record, accel: float) -> bool:
    total = 0.0
    for i in range(4):
        total += motor_torque(inputs, i)
    return driver_accelerates(inputs) or total < -DRIVEN or accel > DRIVEN_ACCEL


@kernel
def speed_is_wrong(params: Record, state: Record, inputs: Record) -> bool:
    """Return whether the wheels, which all differ from the speed for long, show it nevertheless.

    Wheels that nothing drives or brakes roll. Driven ones may spin, all of them: then they do not change
    their speed as the accelerometer says.
    """
    w, total, wheels = state.window, 0.0, 0
    for i in range(4):
        if w.omega_samples[i] > 0:
            total += w.omega[i] * params.wheel_radius[i]
            wheels += 1
    apart = total / max(wheels, 1) - state.x[V]
    if state.untrusted_s == 0.0 or state.contradicted_s == 0.0:
        state.contradicted_s, state.distance_least, state.distance_most = 0.0, apart, apart
    if state.untrusted_s == 0.0:
        return False
    state.distance_least = min(state.distance_least, apart)
    state.distance_most = max(state.distance_most, apart)
    same = state.distance_most - state.distance_least < SAME
    if wheels == 0 or same or state.unmeasured_s >= LOST_S or not _driven(inputs, w.accel):
        state.contradicted_s += w.time
    else:
        state.contradicted_s = 0.0
    return state.contradicted_s > BELIEVED_AFTER or state.untrusted_s > AT_LAST
