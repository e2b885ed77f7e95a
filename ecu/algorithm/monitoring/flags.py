"""Flags that stand for longer, or at another time, than they can: they are taken for 0.

reverse        believed if it is set below `ENGAGED` and while the car is slower than `FASTEST_BACK`, as long
               as the wheels do not gain speed where the accelerometer reads forwards: backwards they lose it.
ABS, ESP       stand for `LONGEST_S` without a wheel beyond `SLIPS` of slip; an ESP in a bend for five times
               as long, an ABS that has no brake to release for a third.
accelerator    that does not move through two brakings is at its rest, which is taken off. While the car
               brakes, and the torques of motors, which have been shown to drive it alone, are all reported,
               it says nothing that they do not: where none drives, it is taken for 0 once it
               has been pressed for `THROUGH_S`: a driver who releases the brakes presses it before they are.
"""

import math

import numpy as np

from ecu.algorithm.inputs import (
    ACCELERATES,
    fresh,
    mean_wheel_speed,
    motor_torque,
    motor_torque_known,
    usable,
)
from ecu.algorithm.monitoring.accel_error import PROVEN_S
from ecu.algorithm.monitoring.witness import compare, leave_out
from ecu.algorithm.vehicle import corner_speed
from ecu.contract.faults import IMPLAUSIBLE
from ecu.contract.signals import (
    ABS_ACTIVE,
    ACCEL_X,
    ACCELERATOR_POSITION,
    ESP_ACTIVE,
    MOTOR_TORQUE,
    REVERSE,
    WHEEL_SPEED,
)
from ecu.jit import Record, kernel

FLAGS_STATE = np.dtype(
    [
        ("reverse", "u1"),  # the flag is believed
        ("reverse_was", "u1"),  # it was set in the last cycle
        ("age_s", "f8"),  # since the first cycle
        ("rolled", "f8"),  # mean speed of the wheels, low-passed [m/s]
        ("gain", "f8", (2,)),  # its rate and the acceleration, low-passed [m/s^2]
        ("usual", "f8", (2,)),  # both, low-passed slowly
        ("agreed", "f8"),  # product of their changes, fading [m^2/s^3]
        ("moved", "f8"),  # square of the accelerometer's, fading
        ("abs_s", "f8"),  # time for which it has stood without slip
        ("esp_s", "f8"),
        ("rest", "f8"),  # of the accelerator [%]
        ("brake_s", "f8"),  # duration of this braking
        ("low", "f8"),  # least position in it [%]
        ("still_s", "f8"),  # time for which it was within `STEADY` above that
        ("pressed_s", "f8"),  # time for which it has been pressed in this braking
        ("last", "f8"),  # position through the last braking, NaN: it moved [%]
    ],
    align=True,
)

REVERSE_BIT, ABS_BIT = IMPLAUSIBLE["reverse"], IMPLAUSIBLE["abs_active"]
ESP_BIT, ACCELERATOR_BIT = IMPLAUSIBLE["esp_active"], IMPLAUSIBLE["accelerator_position"]
ENGAGED, FASTEST_BACK = 2.0, 12.0  # m/s
START_S = 1.0  # in which an ECU that starts in a moving car believes the flag
RATE_S, USUAL_S, FADING_S = 0.15, 2.0, 3.0
MOVED = 0.5  # m^2/s^3, from which the sign of the motion is known
FORWARDS = 0.4  # of the square, share that the product has
LONGEST_S, SLIPS = 3.0, 0.05
BENDING, IN_A_BEND = 2.0, 5.0  # m/s^2, times as long
RELEASED = 3.0  # times as fast
LEAST_SPEED = 3.0  # m/s, for slip
STEADY, THROUGH_S = 0.5, 1.0  # %, s
THROUGH = 0.7  # of a braking: a foot moves on before the brakes are released
DRIVES = 60.0  # N m of a motor, beyond its noise


@kernel
def _set(inputs: Record, place: int) -> bool:
    return usable(inputs, place) and inputs.value[place] > 0.5


@kernel
def _follow_direction(params: Record, state: Record, inputs: Record, rolled: float, dt: float) -> None:
    """Update the correlation of the wheels' rate with the acceleration; both without what is constant."""
    if not (math.isfinite(rolled) and usable(inputs, ACCEL_X)):
        return
    before = state.rolled
    state.rolled += (rolled - state.rolled) * min(dt / RATE_S, 1.0)
    rate = (state.rolled - before) / dt if dt > 0.0 else 0.0
    product, square = 0.0, 0.0
    for k in range(2):
        value = rate if k == 0 else inputs.value[ACCEL_X]
        lag = 0.5 * RATE_S if k == 0 else 1.5 * RATE_S  # the rate lags already
        state.gain[k] += (value - state.gain[k]) * min(dt / lag, 1.0)
        state.usual[k] += (state.gain[k] - state.usual[k]) * min(dt / USUAL_S, 1.0)
    rate, accel = state.gain[0] - state.usual[0], state.gain[1] - state.usual[1]
    product, square = rate * accel, accel * accel
    keep = 1.0 - min(dt / FADING_S, 1.0)
    state.agreed, state.moved = keep * state.agreed + dt * product, keep * state.moved + dt * square


@kernel
def _contradict(witness: Record, place: int, evidence: float) -> None:
    """Publish what speaks against a flag that is set, over what denies it."""
    compare(witness, place, max(evidence, 0.0), 1.0)


@kernel
def _watch_reverse(params: Record, state: Record, witness: Record, inputs: Record, dt: float) -> None:
    rolled = mean_wheel_speed(params, inputs)
    _follow_direction(params, state, inputs, rolled, dt)
    reverse = _set(inputs, REVERSE)
    if reverse and not state.reverse_was:
        state.reverse = 0 if rolled > ENGAGED and state.age_s > START_S else 1
    state.age_s += dt
    forwards = state.moved > MOVED and state.agreed > FORWARDS * state.moved
    if rolled > FASTEST_BACK or forwards:
        state.reverse = 0
    if reverse:
        _contradict(witness, REVERSE, rolled / FASTEST_BACK)
        if state.moved > MOVED:
            _contradict(witness, REVERSE, state.agreed / (FORWARDS * state.moved))
    state.reverse_was = 1 if reverse else 0


@kernel
def _some_wheel_slips(params: Record, inputs: Record, estimate: Record) -> bool:
    speed = estimate.speed
    if not abs(speed) > LEAST_SPEED:
        return False
    slips = False
    for i in range(4):
        if usable(inputs, WHEEL_SPEED + i):
            ground = abs(corner_speed(params, estimate, speed, i))
            rolled = abs(inputs.value[WHEEL_SPEED + i]) * params.wheel_radius[i]
            slips = slips or abs(ground - rolled) > SLIPS * ground
    return slips


@kernel
def _stands(stood_s: float, flag: bool, slips: bool, dt: float) -> float:
    """Return for how long a controller's flag has stood without reason [s]; once too long, until it falls."""
    if not flag:
        return 0.0
    if slips and stood_s < LONGEST_S:
        return max(stood_s - dt, 0.0)
    return stood_s + dt


@kernel
def _watch_accelerator(state: Record, inputs: Record, braking: bool, dt: float) -> None:
    position = inputs.value[ACCELERATOR_POSITION]
    if not fresh(inputs, ACCELERATOR_POSITION):
        return
    state.rest = min(state.rest, max(position, 0.0))
    if braking:
        if state.brake_s == 0.0 or position < state.low - STEADY:
            state.still_s = 0.0
        state.low = position if state.brake_s == 0.0 else min(state.low, position)
        state.still_s += dt if position < state.low + STEADY else 0.0
        state.brake_s += dt
    elif state.brake_s > 0.0:
        steady = state.still_s > max(THROUGH_S, THROUGH * state.brake_s)
        if steady and abs(state.low - state.last) < STEADY:
            state.rest = state.low
        if state.brake_s > THROUGH_S:
            state.last = state.low if steady else math.nan
        state.brake_s = 0.0


@kernel
def _none_drives(witness: Record, inputs: Record) -> bool:
    """Return whether every motor reports its torque and is believed, and none drives."""
    none = True
    for i in range(4):
        known = motor_torque_known(inputs, i) and not witness.rejected[MOTOR_TORQUE + i]
        none = none and known and motor_torque(inputs, i) > -DRIVES
    return none


@kernel
def correct_flags(
    params: Record,
    state: Record,
    witness: Record,
    lines: Record,
    inputs: Record,
    estimate: Record,
    application: Record,
    dt: float,
) -> int:
    """Overwrite flags that cannot be in `inputs`; return the fault bits.

    Args:
        params: `PARAMS`.
        state: `FLAGS_STATE`, overwritten.
        witness: `WITNESS_STATE`; what is published of the four is overwritten.
        lines: `ACCEL_ERROR_STATE`.
        inputs: `INPUTS`, whose four values are overwritten.
        estimate: `ESTIMATE` of the last cycle.
        application: `APPLICATION_STATE`.
        dt: time since the last cycle [s].
    """
    faults, value, braking = 0, inputs.value, application.braking != 0
    _watch_reverse(params, state, witness, inputs, dt)
    if _set(inputs, REVERSE) and not state.reverse:
        faults |= REVERSE_BIT
        value[REVERSE] = 0.0
        leave_out(witness, REVERSE)
    slips = _some_wheel_slips(params, inputs, estimate)
    bending = abs(estimate.accel_y) > BENDING
    state.abs_s = _stands(state.abs_s, _set(inputs, ABS_ACTIVE), slips, dt if braking else RELEASED * dt)
    state.esp_s = _stands(state.esp_s, _set(inputs, ESP_ACTIVE), slips, dt / IN_A_BEND if bending else dt)
    if _set(inputs, ABS_ACTIVE):
        _contradict(witness, ABS_ACTIVE, state.abs_s / LONGEST_S)
    if _set(inputs, ESP_ACTIVE):
        _contradict(witness, ESP_ACTIVE, state.esp_s / LONGEST_S)
    if state.abs_s > LONGEST_S:
        faults |= ABS_BIT
        value[ABS_ACTIVE] = 0.0
        leave_out(witness, ABS_ACTIVE)
    if state.esp_s > LONGEST_S:
        faults |= ESP_BIT
        value[ESP_ACTIVE] = 0.0
        leave_out(witness, ESP_ACTIVE)
    _watch_accelerator(state, inputs, braking, dt)
    compare(witness, ACCELERATOR_POSITION, state.rest, ACCELERATES)
    if state.rest > 0.0:
        if state.rest > ACCELERATES:
            faults |= ACCELERATOR_BIT
        value[ACCELERATOR_POSITION] = max(value[ACCELERATOR_POSITION] - state.rest, 0.0)
    pressed = braking and value[ACCELERATOR_POSITION] > ACCELERATES
    state.pressed_s = state.pressed_s + dt if pressed else 0.0
    alone = lines.proven_s > PROVEN_S and estimate.speed > LEAST_SPEED
    if state.pressed_s > THROUGH_S and alone and _none_drives(witness, inputs):
        value[ACCELERATOR_POSITION] = 0.0
    return faults
