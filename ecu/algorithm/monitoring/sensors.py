"""Cross-checks between sensors: fault bits, and implausible inputs that are masked out.

Accelerometer, wheel speeds and calliper pressures are compared with each other before this cycle's
estimation, by the estimate of the last cycle.
"""

import math

from ecu.algorithm.hydraulics import forget_lateness, learn_lateness
from ecu.algorithm.inputs import LEAST_REQUEST, driver_accelerates, others_brake, requested_decel, usable
from ecu.algorithm.monitoring.accel_error import (
    PROVEN_S,
    STOOD_S,
    accel_doubted,
    accel_unknown,
    all_wheels_scaled,
    correct_accel,
    follow_accel_error,
)
from ecu.algorithm.monitoring.accel_timing import watch_timing
from ecu.algorithm.monitoring.acceleration import watch_acceleration, wheels_deny
from ecu.algorithm.monitoring.carried import OVER_GROUND, over_ground_confirmed
from ecu.algorithm.monitoring.failed_brakes import watch_brakes
from ecu.algorithm.monitoring.lateness import reference_lag
from ecu.algorithm.monitoring.motors import (
    LEAST_SPEED,
    LET_GO_S,
    compare_motors,
    deny_drive,
    watch_motors,
)
from ecu.algorithm.monitoring.plausibility import watch_pressures, watch_wheels, wheel_speed_implausible
from ecu.algorithm.monitoring.pressures import (
    DOUBT_S,
    beyond_noise,
    compare_pressures,
    lasting_difference,
    pressures_doubted,
)
from ecu.algorithm.monitoring.speeds import FOUND_S, SPEED, watch_speeds
from ecu.algorithm.monitoring.turning import watch_turning
from ecu.algorithm.monitoring.wheel_unit import watch_wheel_unit
from ecu.algorithm.monitoring.witness import believe, leave_out, note_named, rejected_faults
from ecu.algorithm.vehicle import tyre_slip
from ecu.contract.faults import (
    ACCEL_IMPLAUSIBLE,
    BRAKE_FAILED,
    IMPLAUSIBLE,
    PRESSURE_NOT_FOLLOWING,
    WHEEL_SPEED_IMPLAUSIBLE,
)
from ecu.contract.records import WATCHED
from ecu.contract.signals import (
    ACCEL_X,
    CALLIPER_PRESSURE,
    HYDRAULIC_READY,
    MOTOR_TORQUE,
    USABLE,
    VEHICLE_SPEED,
    WHEEL_SPEED,
)
from ecu.jit import Record, kernel

ACCEL_X_DRIFTED = IMPLAUSIBLE["accel_x"]
ALL_WHEELS = 0b1111 * IMPLAUSIBLE["wheel_speed_fl"]
PRESSURE_IMPLAUSIBLE = IMPLAUSIBLE["calliper_pressure_fl"]
NAMES = ACCEL_IMPLAUSIBLE | BRAKE_FAILED
BY_TORQUES = sum(IMPLAUSIBLE.values())  # named where this ECU brakes
LEFT_OUT_S = 0.03  # duration of a pressure's deviation from its demand


@kernel
def _watch_motion(p: Record, s: Record, u: Record, dt: float) -> int:
    """Return the fault bits of accelerometer, motors and speeds by the torques, where these are known."""
    faults, estimate = 0, s.estimate
    braking = s.application.braking != 0
    base, slope = s.control.base, s.accel_error.wheels.usual.offset
    watch_acceleration(p, s.acceleration, s.witness, u, estimate, base, slope, braking, dt)
    watch_timing(s.accel_error.timing, s.acceleration, s.witness, u, dt)
    speeds = s.speeds
    heard = usable(u, VEHICLE_SPEED) and not s.witness.rejected[VEHICLE_SPEED]
    over_wheels = speeds.apart[SPEED] if heard and not over_ground_confirmed(speeds.carried) else math.nan
    if s.witness.rejected[ACCEL_X]:
        s.accel_error.apart = 0.0  # it says nothing of motors either
    elif s.acceleration.time == 0.0:
        over_wheels -= max(tyre_slip(p, estimate.accel_x), 0.0)
        across = estimate.accel_y
        follow_accel_error(p, s.accel_error, s.witness, s.acceleration, across, over_wheels, braking)
    if accel_doubted(s.accel_error):
        faults |= ACCEL_X_DRIFTED
    beside_usual = speeds.apart[SPEED] - speeds.base[SPEED] if usable(u, VEHICLE_SPEED) else math.nan
    if all_wheels_scaled(s.accel_error, beside_usual, estimate.accel_x):
        faults |= ALL_WHEELS
    known = s.accel_error.proven_s > PROVEN_S and not wheels_deny(s.acceleration)
    if known and not pressures_doubted(s.pressures):
        watch_motors(p, s.motors, s.witness, u, estimate, base, s.accel_error, s.acceleration, dt)
    asked = braking and requested_decel(p, u) > LEAST_REQUEST
    if asked and s.plausibility.sent and not (driver_accelerates(u) or others_brake(u)):
        compare_motors(p, s.motors, s.witness, u, s.blending, s.accel_error, dt)
        if s.application.duration_s > LET_GO_S and estimate.speed > LEAST_SPEED:
            deny_drive(p, s.motors, s.witness, u, dt)
    if s.accel_error.stood_s > STOOD_S:
        s.speeds.rolled_s = min(s.speeds.rolled_s, FOUND_S)  # who got in presses the tyres
    watch_speeds(p, s.speeds, s.witness, u, estimate, s.guard.acting != 0, dt)
    return faults


@kernel
def _forget_speeds(s: Record) -> None:
    """Believe all speeds again: the car's, by which they were judged, is not known any more."""
    s.speeds.started = 0
    for i in range(4):
        s.plausibility.fell[i] = 0
        believe(s.witness, WHEEL_SPEED + i)
    believe(s.witness, VEHICLE_SPEED)


@kernel
def watch_sensors(p: Record, s: Record, u: Record, dt: float) -> tuple[int, bool]:
    """Return the fault bits of sensors whose readings contradict the others, and whether one is new.

    Args:
        p: `PARAMS`.
        s: `STATE` of `ecu.algorithm.step`; the parts of `monitoring` are overwritten.
        u: `INPUTS`.
        dt: time since the last cycle [s].
    """
    faults = 0
    estimate = s.estimate
    if estimate.started:
        if estimate.torques_known:
            faults |= _watch_motion(p, s, u, dt)
        slope = s.speeds.carried.slope[OVER_GROUND]
        watch_wheel_unit(p, s.wheel_unit, s.witness, u, estimate, slope, s.plausibility.jitter, dt)
        watch_wheels(p, s.plausibility, s.witness, u, estimate, dt)
        watch_turning(p, s.turning, s.witness, u, estimate.speed, dt)
        faults |= rejected_faults(s.witness)
        if wheel_speed_implausible(p, s.plausibility, s.witness, u, estimate, dt):
            faults |= WHEEL_SPEED_IMPLAUSIBLE
    else:
        _forget_speeds(s)
    if s.acceleration.implausible:
        faults |= ACCEL_IMPLAUSIBLE
    wrong = s.pressures.wrong
    right = max(wrong[0], wrong[1], wrong[2], wrong[3]) == 0
    if right and p.transmit and s.plausibility.sent and not others_brake(u):
        learn_lateness(p, s.hydraulics, u, estimate.pressure_zero, s.failed_brakes.failed, dt)
    watch_pressures(s.plausibility, u, s.hydraulics.model, estimate.pressure_zero, dt)
    if s.plausibility.pressure:
        faults |= PRESSURE_NOT_FOLLOWING
    watch_brakes(
        p, s.failed_brakes, u, estimate, s.control, s.hydraulics.model, s.pressures.rest,
        s.plausibility.sent != 0, dt,
    )  # fmt: skip
    if s.failed_brakes.any:
        faults |= BRAKE_FAILED
    contradicted = compare_pressures(
        p, s.pressures, s.witness, u, estimate, s.control, s.failed_brakes, s.hydraulics,
        s.plausibility.sent != 0, dt,
    )  # fmt: skip
    for i in range(4):
        if s.pressures.doubt_s[i] > DOUBT_S:
            faults |= PRESSURE_IMPLAUSIBLE << i
    if contradicted:
        forget_lateness(s.hydraulics)
    named = note_named(s.witness, faults & (NAMES | BY_TORQUES if p.transmit else NAMES))
    return faults, named or contradicted


@kernel
def mask_implausible(p: Record, s: Record, u: Record) -> None:
    """Mask out the implausible of the inputs `u`; correct accelerometer's reading and vehicle speed's age.

    What contradicts torques is masked where this ECU brakes: those of a car that others brake prove nothing.
    """
    if p.transmit:
        _mask_contradicted(p, s, u)
    u.age_ns[VEHICLE_SPEED] += int(1e9 * reference_lag(s.speeds.lateness))
    if abs(u.value[ACCEL_X]) > p.accel_range:
        _distrust(s, u, ACCEL_X)
    heard = _hydraulics_heard(u)
    for i in range(4):
        if s.plausibility.fell[i]:
            _distrust(s, u, WHEEL_SPEED + i)
        _mask_pressure(s, u, i, heard, others_brake(u))


@kernel
def _mask_contradicted(p: Record, s: Record, u: Record) -> None:
    u.value[ACCEL_X] = correct_accel(s.accel_error, u.value[ACCEL_X])
    for place in WATCHED:
        if s.witness.rejected[place]:
            _distrust(s, u, place)
    for i in range(4):
        place = MOTOR_TORQUE + i
        lost = p.blending[i] > 0.0 and not usable(u, place)
        if s.application.braking and (lost or s.witness.rejected[place]):
            u.value[place] = s.blending.asked[0, i]
    if s.acceleration.implausible or accel_unknown(s.accel_error):
        _distrust(s, u, ACCEL_X)


@kernel
def _hydraulics_heard(u: Record) -> bool:
    """Return whether the hydraulic unit, which executes the demands, is alive: any of its signals is."""
    heard = usable(u, HYDRAULIC_READY)
    for i in range(CALLIPER_PRESSURE, CALLIPER_PRESSURE + 4):
        heard = heard or usable(u, i)
    return heard


@kernel
def _mask_pressure(s: Record, u: Record, i: int, heard: bool, others: bool) -> None:
    """Overwrite a pressure by the model's where it is wrong or lost, less what lasts where it is not."""
    place, model = CALLIPER_PRESSURE + i, s.hydraulics.model[i]
    lost = not usable(u, place)
    if not s.plausibility.sent or s.failed_brakes.failed[i] or (lost and not heard):
        return
    if others:
        if s.pressures.wrong[i] and not lost:
            _distrust(s, u, place)
    elif (
        lost
        or s.pressures.wrong[i]
        or s.plausibility.apart_s[i] > LEFT_OUT_S
        or beyond_noise(s.pressures, u.value[place] - s.estimate.pressure_zero[i], model)
    ):
        u.value[place] = model + s.estimate.pressure_zero[i]
        u.verdict[place] |= USABLE
        if lost:
            u.new[place], u.age_ns[place] = 1, 0
        leave_out(s.witness, place)
    elif not s.pressures.honest:
        reading = u.value[place] - lasting_difference(s.pressures, i, model)
        u.value[place] = max(reading, 0.0) if s.estimate.floored[i] else reading


@kernel
def _distrust(s: Record, u: Record, place: int) -> None:
    u.verdict[place] = u.new[place] = 0
    leave_out(s.witness, place)
