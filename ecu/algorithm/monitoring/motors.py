"""Plausibility of motor torques by the car's motion, once they have proven to drive the car alone.

    e = a + resistances + sum (T_motor + T_lining) / (r m)        of any slope; 0 if all are right

Beyond the doubt of mass, linings and accelerometer while the driver does not accelerate, they contradict
the motion: one of them, if the torque of the other wheel of its axle in its place explains the error, else
all. An error that the wheels' own deceleration shows too is the accelerometer's (`accel_error.py`).

The torque of a motor that brakes for the ECU is compared with what was demanded of it. One that is left out
is believed again once the torques explain how the car is driven, or after a restart.
"""

import math

import numpy as np

from ecu.algorithm.inputs import driver_accelerates, motor_torque, others_brake, usable
from ecu.algorithm.lag import lag_gain
from ecu.algorithm.monitoring.witness import AGAIN_S, judge
from ecu.contract.params import GRAVITY
from ecu.contract.signals import ACCEL_X, MOTOR_TORQUE
from ecu.jit import Record, kernel

MOTORS_WATCH_STATE = np.dtype(
    [
        ("error", "f8"),  # e, low-passed [m/s^2]
        ("doubt", "f8"),  # of it
        ("decel", "f8", (4,)),  # by each motor, low-passed [m/s^2]
        ("gap", "f8", (4,)),  # from the demands of the last cycles, low-passed [N m]
    ],
    align=True,
)

LAG = 0.2  # s
LEAST_SPEED = 5.0  # m/s
ACCEL, MOTORS, LININGS = 0.25, 0.1, 0.4  # m/s^2; of the force by motors, by linings
DRIVE = 0.2  # of what motors drive by, that is error of the mass too
EXPLAINS = 0.3  # of the error, what a single motor that lies leaves
DOUBT_S = 0.5
DRIVEN, AGAIN, AGAIN_SHARE = 1.0, 0.1, 0.08  # m/s^2, m/s^2, of it
GAP, GAP_SHARE = 20.0, 0.06  # N m, of the demand
GAP_LAG, GAP_DOUBT_S = 0.15, 0.2  # s


@kernel
def watch_motors(
    params: Record,
    state: Record,
    witness: Record,
    inputs: Record,
    estimate: Record,
    base: Record,
    accel_offset: float,
    dt: float,
) -> None:
    """Judge the motor torques.

    Args:
        params: `PARAMS`.
        state: `MOTORS_WATCH_STATE`, overwritten.
        witness: `WITNESS_STATE`; the four torques' fields are overwritten.
        inputs: `INPUTS` as received.
        estimate: `ESTIMATE` of the last cycle.
        base: friction at the start of this application, shape (4,).
        accel_offset: zero of the accelerometer by the wheels [m/s^2].
        dt: time since the last cycle [s].
    """
    speed, gain = estimate.speed, lag_gain(dt, LAG)
    resistance = params.drag_area * speed * speed / params.mass + params.rolling_resistance * GRAVITY
    reading = inputs.value[ACCEL_X] / (1.0 + GRAVITY * params.pitch_gradient)
    error, doubt = reading + resistance, ACCEL
    for i in range(4):
        lever = params.wheel_radius[i] * params.mass
        lining = estimate.brake_torque[i] * base[i] / estimate.mu[i] / lever
        motor = motor_torque(inputs, i) / lever
        error += motor + lining
        doubt += LININGS * lining
        doubt += DRIVE * max(-motor, 0.0)
        state.decel[i] += gain * (motor - state.decel[i])
    state.error += gain * (error - state.error)
    state.doubt += gain * (doubt - state.doubt)
    apart = state.error
    if apart * accel_offset > 0.0:
        apart -= math.copysign(min(abs(accel_offset), abs(apart)), apart)
    moves = speed > LEAST_SPEED and estimate.measured != 0 and estimate.backwards == 0
    if not (moves and usable(inputs, ACCEL_X)) or others_brake(inputs):
        return
    driven = -(state.decel[0] + state.decel[1] + state.decel[2] + state.decel[3])
    explained = abs(apart) < AGAIN + AGAIN_SHARE * driven
    if driven > DRIVEN and (explained or driver_accelerates(inputs)):
        _believe_again(witness, explained, dt)
    elif not driver_accelerates(inputs):
        _judge_motors(params, state, witness, inputs, apart, dt)


@kernel
def _believe_again(witness: Record, explained: bool, dt: float) -> None:
    for place in range(MOTOR_TORQUE, MOTOR_TORQUE + 4):
        witness.agreed_s[place] = witness.agreed_s[place] + dt if explained else 0.0
        if witness.agreed_s[place] > AGAIN_S:
            witness.rejected[place], witness.doubted_s[place] = 0, 0.0


@kernel
def _judge_motors(
    params: Record, state: Record, witness: Record, inputs: Record, apart: float, dt: float
) -> None:
    """Judge those that are believed, by what the deceleration is apart from that by all torques [m/s^2]."""
    alone = -1
    for i in range(4):
        mate = i + 1 if i % 2 == 0 else i - 1
        left = apart + state.decel[mate] - state.decel[i]
        if abs(left) < EXPLAINS * abs(apart) and abs(state.decel[i]) > abs(state.decel[mate]):
            alone = i
    for i in range(4):
        place = MOTOR_TORQUE + i
        if usable(inputs, place) and not witness.rejected[place]:
            unit = params.mass * params.wheel_radius[i]
            tolerance = (state.doubt + MOTORS * abs(state.decel[i])) * unit
            judge(witness, place, (apart if alone in (-1, i) else 0.0) * unit, tolerance, DOUBT_S, dt)


@kernel
def compare_motors(
    params: Record, state: Record, witness: Record, inputs: Record, blending: Record, dt: float
) -> None:
    """Judge the torques of motors that brake, by the demands that were sent.

    Args:
        params: `PARAMS`.
        state: `MOTORS_WATCH_STATE`, overwritten.
        witness: `WITNESS_STATE`; the four torques' fields are overwritten.
        inputs: `INPUTS` as received.
        blending: `BLENDING_STATE` of the last cycle.
        dt: time since the last cycle [s].
    """
    gain = lag_gain(dt, GAP_LAG)
    for i in range(4):
        place, asked = MOTOR_TORQUE + i, blending.asked
        if params.blending[i] == 0.0 or witness.rejected[place] or not usable(inputs, place):
            continue
        most = max(asked[0, i], asked[1, i], asked[2, i])
        least = min(asked[0, i], asked[1, i], asked[2, i], max(blending.limit[i], 0.0))
        torque = inputs.value[place]
        state.gap[i] += gain * (torque - min(max(torque, least), most) - state.gap[i])
        judge(witness, place, state.gap[i], GAP + GAP_SHARE * most, GAP_DOUBT_S, dt)
