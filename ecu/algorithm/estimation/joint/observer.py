"""Joint observer: one filter for speed, tyres, mass, sensors and the friction of all four linings.

A window of a few cycles is one step: the random walk, then corrections by the speed reference, each wheel's
speed and the car's longitudinal balance. The states corrected depend on the driving situation:

friction braking   speed, frictions, tyre stiffness and peak, radii, slope; the rest is considered only
motors alone       everything but friction and pressure offsets: known torque shows mass, drag, stiffness
rolling            speed, radii, slope; bias and drag where motor torque is reported
below 3.4 m/s, sliding, ABS, ESP, driver or motors driving against the brakes: speed and slope only

When a wheel leaves its tyre's range, or most wheels contradict the known tyres, all states but the speed are
restored from a snapshot 0.2 to 0.4 s old.
"""

import math

from ecu.algorithm.estimate import STANDING
from ecu.algorithm.estimation.joint.balance import correct_by_balance, linings_tell, predict_balance
from ecu.algorithm.estimation.joint.bounds import keep_within_bounds
from ecu.algorithm.estimation.joint.drive import KNOWN, measure_drive
from ecu.algorithm.estimation.joint.kalman import (
    clear_derivatives,
    clear_state,
    drift_by_derivatives,
    forget_speed,
)
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    CHANGE,
    DEFLECTION_GAIN,
    DELAY,
    DRAG,
    LEVEL,
    LOAD,
    MASS,
    MOTOR,
    OVERRUN,
    PEAK,
    RADIUS,
    RATE,
    RATIO,
    RATIOS,
    ROLLING,
    SIDE,
    SLOPE,
    STIFFNESS,
    N,
    V,
)
from ecu.algorithm.estimation.joint.prior import (
    PRIOR,
    forget_rate,
    note_change,
    pressure_change,
    set_prior,
    walk,
)
from ecu.algorithm.estimation.joint.reference import correct_by_reference
from ecu.algorithm.estimation.joint.sliding import HOLD_S, share_force, watch_sides, watch_tyres
from ecu.algorithm.estimation.joint.snapshot import restore_snapshot, save_newer_snapshot, save_snapshots
from ecu.algorithm.estimation.joint.speed import (
    DRIVEN_ACCEL,
    LOST_S,
    bridge_gap,
    reverses,
    speed_is_wrong,
    start_speed,
)
from ecu.algorithm.estimation.joint.wheel import APPLIED, brake_torque, drive_opposes, unknown_share
from ecu.algorithm.estimation.joint.wheel_speed import correct_by_wheels
from ecu.algorithm.estimation.joint.window import close_window, compare_wheels, gather, open_window
from ecu.algorithm.estimation.zero import FREE, LARGEST_ZERO, settle_zero
from ecu.algorithm.inputs import (
    LEAST_REQUEST,
    driver_accelerates,
    no_wheel_known,
    others_brake,
    requested_decel,
    usable,
)
from ecu.contract.signals import ACCEL_X, CALLIPER_PRESSURE, WHEEL_SPEED
from ecu.jit import Record, kernel

WINDOW_S = 0.05
LEAST_SPEED = 3.4  # m/s
STRAIGHT = 0.05  # lateral acceleration over gravity: above it wheels roll at unequal loads and angles
VARIES_FROM, VARIES = 0.3, 0.2  # m/s^2: acceleration at which mass is observable, and its change
MOTORS = 100.0  # N m of all motors: above it their torque is evaluated
RELEASE = 0.15  # relative fall in a window: beyond it lags differ too much to learn
SNAPSHOT_S = 0.2

UNEXPLAINED = 0.15  # m/s^2 while rolling: beyond it the car is driven or braked by an unreported torque
TWIN = 3.0  # bar, of a pressure taken from the other side


@kernel
def start_joint(state: Record) -> None:
    """Start from the present states, except the speed."""
    state.started = 0
    open_window(state)
    save_snapshots(state)


@kernel
def _axle_unknown(inputs: Record, left: int) -> bool:
    """Return whether neither pressure of an axle is usable: one alone serves both."""
    pressure = CALLIPER_PRESSURE + left
    return not (usable(inputs, pressure) or usable(inputs, pressure + 1))


@kernel
def _learning_forbidden(params: Record, state: Record, inputs: Record, braking: bool) -> bool:
    against = braking and (driver_accelerates(inputs) or drive_opposes(params, state, 1.0))
    unknown = braking and (_axle_unknown(inputs, 0) or _axle_unknown(inputs, 2))
    return against or unknown or (braking and state.held != 0) or others_brake(inputs) or params.fixed != 0


@kernel
def _watch_release(state: Record, braking: bool) -> None:
    """Restore friction to its value before the release of the brakes, which disturbs it.

    Where one axle gives up its share to the other, the brakes are not released: nothing is learned meanwhile.
    """
    front, rear = pressure_change(state, 0), pressure_change(state, 2)
    falling = braking and min(front, rear) < -RELEASE
    if falling and max(front, rear) < 0.0 and not state.releasing:
        for i in range(LEVEL, LEVEL + 4):
            state.x[i] = state.kept_x[1, i]
        for i in range(CHANGE, CHANGE + 2):
            state.x[i] = state.kept_x[1, i]
    state.releasing = 1 if falling else 0


@kernel
def _accelerates(state: Record) -> bool:
    """Return whether acceleration varies: a constant one cannot separate mass from bias, drag and slope."""
    accel = state.window.accel
    return abs(accel) > VARIES_FROM and abs(accel - state.mean_accel) > VARIES


@kernel
def _choose_free(state: Record, braking: bool, motors: bool, learning: bool) -> None:
    free = state.free
    if not (braking and learning) or state.releasing:
        forget_rate(state)
    for i in range(N):
        free[i] = 0
    free[V], free[SLOPE] = 1, 1 if state.x[V] > STANDING else 0
    if not learning:
        return
    for i in range(4):
        free[RADIUS + i] = 1
        free[LEVEL + i] = 1 if braking and not state.releasing else 0
    free[RATE] = free[CHANGE] = free[CHANGE + 1] = free[LEVEL]
    free[DELAY] = 1
    free[ROLLING] = 1 if state.window.reference_samples > 0 else 0
    if state.releasing:
        return
    if braking:
        free[STIFFNESS] = free[PEAK] = free[OVERRUN] = 1
        free[SIDE] = 1 if state.x[SIDE] != 0.0 else 0
    else:
        free[BIAS] = free[DRAG] = 1 if state.window.motor_reported and state.drive_known > KNOWN else 0
        if motors:
            for i in (STIFFNESS, RATIO, LOAD, PEAK, DEFLECTION_GAIN):
                free[i] = 1
            free[MASS] = free[MOTOR] = 1 if _accelerates(state) else 0


@kernel
def update_joint(
    params: Record,
    state: Record,
    inputs: Record,
    motion: Record,
    load: Record,
    hydraulics: Record,
    braking: bool,
    dt: float,
) -> None:
    """Add this cycle's samples and, at the end of a window, correct the state by them."""
    if state.closed:
        open_window(state)
    state.reset = state.closed = 0
    if not state.started:
        start_speed(params, state, inputs)
        if not state.started:
            return
    if reverses(params, state, inputs, motion, dt):
        return
    _note_measured(state, motion.measured != 0, dt)
    if bridge_gap(params, state, inputs, motion, dt):
        return
    free = not braking and _released(params, state, inputs)
    state.released = 1 if free or _pulls(params, state) else 0
    gather(params, state, inputs, motion, load, hydraulics, state.released != 0, dt)
    if braking and usable(inputs, ACCEL_X):
        share_force(params, state, inputs, motion.accel_x, load)
    state.hold_s = max(state.hold_s - dt, 0.0)
    if state.window.time < WINDOW_S - 0.001:
        return
    close_window(params, state, hydraulics)
    compare_wheels(state)
    _fuse(params, state, inputs, braking)
    if not braking and usable(inputs, ACCEL_X):
        measure_drive(params, state)
    _look_after(params, state, inputs, braking)
    state.closed = 1


@kernel
def _released(params: Record, state: Record, inputs: Record) -> bool:
    """Return whether no friction brake is applied, not even slightly."""
    asked = requested_decel(params, inputs)
    if not params.transmit and asked > LEAST_REQUEST:
        return False
    total = 0.0
    for i in range(4):
        total += state.smooth_pressure[i]
    return total < 4.0 * FREE


@kernel
def _pulls(params: Record, state: Record) -> bool:
    """Return whether a car that others brake speeds up: pressures near zero are then the sensors' own."""
    if params.transmit or state.unmeasured_s > 0.0 or not state.smooth_accel > DRIVEN_ACCEL:
        return False
    above = state.smooth_pressure
    near: bool = max(above[0], above[1], above[2], above[3]) < LARGEST_ZERO
    return near


@kernel
def _note_measured(state: Record, measured: bool, dt: float) -> None:
    """Forget the slope once the accelerometer is lost for good: it may have been the sensor's error."""
    lost = state.unmeasured_s >= LOST_S
    state.unmeasured_s = 0.0 if measured else state.unmeasured_s + dt
    if state.unmeasured_s >= LOST_S and not lost:
        clear_state(state, SLOPE, PRIOR[SLOPE] ** 2)


@kernel
def _drift_by_linings(params: Record, state: Record, time: float) -> None:
    """Tie the speed to friction while the torques stand for the accelerometer: dv/dt = -sum T_i / (r_i m)."""
    h = state.h
    clear_derivatives(state)
    for i in range(4):
        decel = brake_torque(params, state, i, state.window.pressure[i]) / (
            params.wheel_radius[i] * params.mass
        )
        h[LEVEL + i] -= decel
        h[CHANGE + i // 2] -= decel
    drift_by_derivatives(state, time)


@kernel
def _fuse(params: Record, state: Record, inputs: Record, braking: bool) -> None:
    w, x = state.window, state.x
    time = w.time
    motors = 0.0
    for i in range(4):
        if not usable(inputs, WHEEL_SPEED + i):
            state.slides[i] = 0
        if state.released:
            settle_zero(state.zero, i)
        if not usable(inputs, CALLIPER_PRESSURE + i):
            twin = i ^ 1
            w.pressure[i], w.common_pressure[i] = w.pressure[twin], w.common_pressure[twin]
            w.pressure_variance[i] = TWIN**2
        if not braking and state.smooth_pressure[i] < APPLIED:
            w.pressure[i] = w.common_pressure[i] = state.smooth_pressure[i] = 0.0  # noise is no torque
        motors += abs(w.motor[i])
    moving = x[V] > LEAST_SPEED
    state.drive_known = 1.0 - unknown_share(params, state)
    walk(state, braking and moving, time)
    if state.unmeasured_s >= LOST_S and braking and moving:
        _drift_by_linings(params, state, time)
    _watch_release(state, braking)
    balanced = w.balanced != 0 and params.mapped[ACCEL_X] != 0  # dv/dt is what the wheels say already
    learning = moving and state.hold_s <= 0.0 and w.motor_known != 0
    learning = learning and not _learning_forbidden(params, state, inputs, braking)
    if not braking:
        learning = learning and abs(w.across) < STRAIGHT and state.released != 0
    if learning and not braking and motors <= MOTORS:
        learning = balanced and abs(predict_balance(params, state, False)) < UNEXPLAINED
    _choose_free(state, braking, motors > MOTORS, learning)
    before = x[V]
    for place in range(RATIOS):
        state.ratio[place] = math.nan
    state.reference_s += time
    state.untrusted_s += time
    if w.reference_samples > 0:
        state.reference_s = state.unseen_s = 0.0
        correct_by_reference(params, state)
        if no_wheel_known(inputs):
            state.untrusted_s = 0.0
    seen = correct_by_wheels(params, state, before, moving, learning and braking)
    if state.untrusted_s == 0.0:
        state.unseen_s = 0.0
    if state.free[LEVEL]:
        weight = 0.0
        for i in range(4):
            weight += max(state.smooth_pressure[i], 0.0)
        if weight > 4.0 * APPLIED:
            note_change(state, weight)
    watch_tyres(state, learning and braking)
    watch_sides(state, learning and braking and abs(w.across) < STRAIGHT)
    if no_wheel_known(inputs):
        state.free[OVERRUN] = 0  # the wheels' slip tells it from the linings
        seen = linings_tell(params, state, braking)
    if seen and learning and balanced and (braking or w.motor_reported):
        correct_by_balance(params, state, braking)
    state.pressed = max(abs(pressure_change(state, 0)), abs(pressure_change(state, 2)))
    state.last_accel, state.last_smooth_accel = w.accel, state.smooth_accel
    for i in range(4):
        state.motors.last_smooth[i] = state.motors.smooth[i]
        state.last_pressure[i], state.last_smooth[i] = w.pressure[i], state.smooth_pressure[i]


@kernel
def _look_after(params: Record, state: Record, inputs: Record, braking: bool) -> None:
    """Keep snapshots, restore one when a wheel slides, reset when a value is not finite."""
    w, x = state.window, state.x
    total = 0.0
    for i in range(N):
        total += x[i] + state.p[i, i]
    if not math.isfinite(total):
        set_prior(params, state)
        start_joint(state)
        state.reset = 1
        return
    if braking:
        state.untrusted_s = state.contradicted_s = 0.0
    elif speed_is_wrong(params, state, inputs):
        state.started = 0
        state.untrusted_s = 0.0
        forget_speed(state)
    state.kept_s += w.time
    sliding = state.slides[0] + state.slides[1] + state.slides[2] + state.slides[3]
    if sliding > state.sliding and braking and state.hold_s <= 0.0:
        restore_snapshot(state)
    if sliding > 1 or sliding != state.sliding:
        state.hold_s = HOLD_S
    state.sliding = sliding
    if state.hold_s <= 0.0 and not state.releasing and state.kept_s >= SNAPSHOT_S:
        save_newer_snapshot(state)
    state.at_bound = 1 if keep_within_bounds(state) else 0
