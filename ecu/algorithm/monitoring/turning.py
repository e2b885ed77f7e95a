"""Plausibility of yaw rate, lateral acceleration and steering angle: five witnesses of the car's turning.

    yaw rate    psi_dot
    across      a_y / v                                                  steady cornering, bank
    steering    v delta / L (1 ... 0.4)                                  understeer, brakes that pull
    wheels      (v_right - v_left) / track, of either axle               slip, radii

Each is an interval, its tolerance to both sides. The turning is the interval that most of them contain
(K. Marzullo, Maintaining the Time in a Distributed System, 1984); one of the three inputs that lies outside
contradicts the others, if they are two or more. No wheel is judged here.
"""

import math

import numpy as np

from ecu.algorithm.inputs import usable
from ecu.algorithm.monitoring.witness import judge
from ecu.contract.signals import ACCEL_X, ACCEL_Y, STEERING_ANGLE, WHEEL_SPEED, YAW_RATE
from ecu.jit import Record, kernel

YAW, ACROSS, STEERING, FRONT, REAR = range(5)
WITNESSES = 5
TURNING_STATE = np.dtype(
    [
        ("rate", "f8", (WITNESSES,)),  # yaw rate by each witness [rad/s], NaN: silent
        ("tolerance", "f8", (WITNESSES,)),  # of it [rad/s]
    ],
    align=True,
)

LEAST_SPEED = 5.0  # m/s
YAW_ZERO, YAW_SCALE = 0.03, 0.05  # rad/s, of the value
BANK = 1.0  # m/s^2: a road banked by 6 %, roll, zero
STEERING_ZERO, UNDERSTEER = 0.03, 0.6  # rad/s, of the value
PULLS = 0.002  # s^2/m^2, of deceleration and speed: linings of left and right that differ by half
TURNS, SLIP = 0.02, 0.012  # of the wheel speeds: radii; per m/s^2: slip of the two sides
DOUBT_S, COUNTERSTEER_S = 0.2, 1.0


@kernel
def _set(state: Record, of: int, known: bool, rate: float, tolerance: float) -> None:
    state.rate[of], state.tolerance[of] = rate if known else math.nan, tolerance


@kernel
def _difference(params: Record, inputs: Record, left: int) -> float:
    """Return the yaw rate [rad/s] by the wheels of an axle, whose left one is `left`."""
    r, value = params.wheel_radius, inputs.value
    turns: float = abs(value[WHEEL_SPEED + left + 1]) * r[left + 1] - abs(value[WHEEL_SPEED + left]) * r[left]
    return turns / params.track


@kernel
def _agreement(state: Record) -> tuple[int, float, float]:
    """Return how many witnesses agree at most, and the ends of the interval in which they do [rad/s].

    Between two such intervals nobody is contradicted: they are taken for one.
    """
    best, low, high = 0, math.inf, -math.inf
    for i in range(WITNESSES):
        begins, ends, count = state.rate[i] - state.tolerance[i], math.inf, 0
        for j in range(WITNESSES):
            if abs(state.rate[j] - begins) <= state.tolerance[j] * (1.0 + 1e-12):
                count += 1
                ends = min(ends, state.rate[j] + state.tolerance[j])
        if count > best:
            best, low, high = count, begins, ends
        elif count == best and count > 0:
            low, high = min(low, begins), max(high, ends)
    return best, low, high


@kernel
def watch_turning(
    params: Record, state: Record, witness: Record, inputs: Record, speed: float, dt: float
) -> None:
    """Judge yaw rate, lateral acceleration and steering angle.

    Args:
        params: `PARAMS`.
        state: `TURNING_STATE`, overwritten.
        witness: `WITNESS_STATE`; the three inputs' fields are overwritten.
        inputs: `INPUTS` as received.
        speed: of the vehicle [m/s]; below `LEAST_SPEED`, or backwards, nothing is judged.
        dt: time since the last cycle [s].
    """
    if not speed > LEAST_SPEED:
        return
    value = inputs.value
    yaw, across = value[YAW_RATE], value[ACCEL_Y] / speed
    steering = value[STEERING_ANGLE] * speed / params.wheelbase
    turns = (TURNS + SLIP * abs(value[ACCEL_X])) * speed / params.track + YAW_ZERO
    _set(state, YAW, usable(inputs, YAW_RATE), yaw, YAW_ZERO + YAW_SCALE * abs(yaw))
    _set(state, ACROSS, usable(inputs, ACCEL_Y), across, BANK / speed + YAW_SCALE * abs(across))
    reach = STEERING_ZERO + UNDERSTEER * abs(steering) + PULLS * max(-value[ACCEL_X], 0.0) * speed
    _set(state, STEERING, usable(inputs, STEERING_ANGLE), steering, reach)
    for axle in range(2):
        known = usable(inputs, WHEEL_SPEED + 2 * axle) and usable(inputs, WHEEL_SPEED + 2 * axle + 1)
        _set(state, FRONT + axle, known, _difference(params, inputs, 2 * axle), turns)
    agreed, low, high = _agreement(state)
    if agreed < 2:
        return
    for i in range(FRONT):
        apart = state.rate[i] - 0.5 * (low + high)
        place = YAW_RATE if i == YAW else ACCEL_Y if i == ACROSS else STEERING_ANGLE
        unit = 1.0 if i == YAW else speed if i == ACROSS else params.wheelbase / speed
        tolerance = state.tolerance[i] + 0.5 * (high - low)
        doubt_s = COUNTERSTEER_S if i == STEERING else DOUBT_S
        judge(witness, place, apart * unit, tolerance * unit, doubt_s, dt)
