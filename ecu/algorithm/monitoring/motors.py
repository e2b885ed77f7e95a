"""Plausibility of motor torques by the car's motion, once they have proven to drive the car alone.

    e = a + resistances + sum (T_motor + T_lining) / (r m)        of any slope; 0 if all are right

Beyond the doubt of mass, linings and accelerometer while the driver does not accelerate, they contradict
the motion: one of them, if the torque of the other wheel of its axle in its place explains the error, else
all. An error that the wheels' own deceleration shows too is the accelerometer's (`accel_error.py`).

While they drive, whether the driver accelerates or not, what the accelerometer reads beside the torques has a
mean at each force (`accel_error.py`), in which errors of mass and drag are. What it has moved by from that is
the motors', unless the wheels show it too: that of one, whose difference from its mate has moved as much.

The torque of a motor that brakes for the ECU is compared with what was demanded of it, and with the share of
it that the motor usually reports; one that does not may not drive while the brakes are applied. One that is
left out is believed again once the torques explain how the car is driven, or after a restart.
"""

import math

import numpy as np

from ecu.algorithm.inputs import driver_accelerates, motor_torque, motor_torque_known, others_brake, usable
from ecu.algorithm.lag import lag_gain
from ecu.algorithm.monitoring.accel_blocks import BLOCK_S
from ecu.algorithm.monitoring.accel_error import (
    USUAL,
    accel_doubted,
    torques_tolerance,
    usual_known,
    wheels_confirm,
)
from ecu.algorithm.monitoring.acceleration import KNOWN_MOTORS
from ecu.algorithm.monitoring.error_line import moved_offset
from ecu.algorithm.monitoring.witness import AGAIN_S, FASTEST_DOUBT, believe, compare, judge
from ecu.contract.params import GRAVITY
from ecu.contract.signals import ACCEL_X, MOTOR_TORQUE
from ecu.jit import Record, kernel

MOTORS_WATCH_STATE = np.dtype(
    [
        ("error", "f8"),  # e, low-passed [m/s^2]
        ("doubt", "f8"),  # of it
        ("decel", "f8", (4,)),  # by each motor, low-passed [m/s^2]
        ("gap", "f8", (4,)),  # from the demands of the last cycles, low-passed [N m]
        ("share", "f8", (4,)),  # of a demand that the motor usually reports, less 1
        ("share_s", "f8", (4,)),  # learning time of that [s]
        ("unequal", "f8", (2,)),  # left less right motor of an axle over both, as usual
        ("unequal_s", "f8"),  # learning time of that [s]
        ("moved_s", "f8"),  # time for which the torques contradict their usual error [s]
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
USUAL_GAP, USUAL_GAP_SHARE = 10.0, 0.03  # likewise, beside the usual share
SHARE_S, FEWEST_S = 60.0, 2.0
DRIVES_ON, LET_GO_S = 15.0, 0.5  # N m, less than keeps a car rolling; s
LEAST_ASKED, STEADY = 100.0, 0.05  # N m, of it
MOVED_S = 0.4
ALONE = 0.5  # of the tolerance, where the mate confirms it
GAP_LAG, GAP_DOUBT_S = 0.15, 0.2  # s


@kernel
def watch_motors(
    params: Record,
    state: Record,
    witness: Record,
    inputs: Record,
    estimate: Record,
    base: Record,
    lines: Record,
    blocks: Record,
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
        lines: `ACCEL_ERROR_STATE`.
        blocks: `ACCELERATION_STATE`.
        dt: time since the last cycle [s].
    """
    speed, gain = estimate.speed, lag_gain(dt, LAG)
    resistance = params.drag_area * speed * speed / params.mass + params.rolling_resistance * GRAVITY
    reading = inputs.value[ACCEL_X] / (1.0 + GRAVITY * params.pitch_gradient)
    error, doubt, known = reading + resistance, ACCEL, True
    for i in range(4):
        known = known and motor_torque_known(inputs, i)
        lever = params.wheel_radius[i] * params.mass
        lining = estimate.brake_torque[i] * base[i] / estimate.mu[i] / lever
        motor = motor_torque(inputs, i) / lever
        error += motor + lining
        doubt += LININGS * lining
        doubt += DRIVE * max(-motor, 0.0)
        state.decel[i] += gain * (motor - state.decel[i])
    state.error += gain * (error - state.error)
    state.doubt += gain * (doubt - state.doubt)
    apart, accel_offset = state.error, moved_offset(lines.wheels)
    if apart * accel_offset > 0.0:
        apart -= math.copysign(min(abs(accel_offset), abs(apart)), apart)
    moves = speed > LEAST_SPEED and estimate.measured != 0 and estimate.backwards == 0
    moves = moves and known and usable(inputs, ACCEL_X)
    if not moves or others_brake(inputs) or accel_doubted(lines):
        return
    driven = -(state.decel[0] + state.decel[1] + state.decel[2] + state.decel[3])
    tolerance = torques_tolerance(params, lines, blocks.mean)
    if blocks.time == 0.0 and usual_known(lines):
        _judge_moved(params, state, witness, inputs, lines, blocks, tolerance)
    explained = abs(apart) < AGAIN + AGAIN_SHARE * driven
    explained = explained and not (usual_known(lines) and abs(lines.apart) > USUAL * tolerance)
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
def _alone(state: Record, apart: float, usual: bool) -> int:
    """Return the motor whose difference from its mate has moved by `apart` [m/s^2]; -1: none.

    `usual`: the differences are as usual, and are learned.
    """
    alone = -1
    state.unequal_s = min(state.unequal_s + BLOCK_S, SHARE_S) if usual else state.unequal_s
    for left in (0, 2):
        differs = state.decel[left] - state.decel[left + 1]
        both = abs(state.decel[left]) + abs(state.decel[left + 1])
        axle = left // 2
        if usual and both > DRIVEN:
            state.unequal[axle] += (differs / both - state.unequal[axle]) * BLOCK_S / state.unequal_s
        moved = differs - state.unequal[axle] * both
        if abs(apart - moved) < EXPLAINS * abs(apart):
            alone = left
        elif abs(apart + moved) < EXPLAINS * abs(apart):
            alone = left + 1
    return alone


@kernel
def _judge_moved(
    params: Record,
    state: Record,
    witness: Record,
    inputs: Record,
    lines: Record,
    blocks: Record,
    tolerance: float,
) -> None:
    """Judge the torques, once a block, by what they have moved by from their usual error."""
    apart = lines.apart
    alone = _alone(state, apart, abs(apart) < USUAL * ALONE * tolerance)
    if alone >= 0:
        tolerance *= ALONE
    ratio = abs(apart) / tolerance
    trusted = blocks.implausible == 0 and blocks.known_blocks > 1 and not accel_doubted(lines)
    moved = ratio > 1.0 and trusted and not wheels_confirm(lines, blocks.mean, apart)
    state.moved_s = max(state.moved_s + (min(ratio, FASTEST_DOUBT) if moved else -1.0) * BLOCK_S, 0.0)
    for i in range(4):
        place = MOTOR_TORQUE + i
        if moved and alone in (-1, i) and usable(inputs, place):
            unit = params.mass * params.wheel_radius[i]
            compare(witness, place, apart * unit, tolerance * unit)
            if state.moved_s > MOVED_S:
                witness.rejected[place] = 1


@kernel
def _follow_share(state: Record, i: int, share: float, dt: float) -> None:
    """Update the usual share, less 1, unless this one is none."""
    if abs(share) < GAP_SHARE:
        state.share_s[i] = min(state.share_s[i] + dt, SHARE_S)
        state.share[i] += (share - state.share[i]) * dt / state.share_s[i]


@kernel
def compare_motors(
    params: Record,
    state: Record,
    witness: Record,
    inputs: Record,
    blending: Record,
    lines: Record,
    dt: float,
) -> None:
    """Judge the torques of motors that brake, by the demands that were sent.

    One that gives far less, and whose torque was as usual while it drove, is short: its limit is wrong.

    Args:
        params: `PARAMS`.
        state: `MOTORS_WATCH_STATE`, overwritten.
        witness: `WITNESS_STATE`; the four torques' fields are overwritten.
        inputs: `INPUTS` as received.
        blending: `BLENDING_STATE` of the last cycle; `lost` is overwritten.
        lines: `ACCEL_ERROR_STATE`.
        dt: time since the last cycle [s].
    """
    gain = lag_gain(dt, GAP_LAG)
    drove = usual_known(lines) and state.moved_s == 0.0
    for i in range(4):
        place, asked = MOTOR_TORQUE + i, blending.asked
        if params.blending[i] == 0.0 or witness.rejected[place] or not usable(inputs, place):
            continue
        most = max(asked[0, i], asked[1, i], asked[2, i])
        least = min(asked[0, i], asked[1, i], asked[2, i], max(blending.limit[i], 0.0))
        torque, usual = inputs.value[place], 1.0 + state.share[i]
        gap = torque - min(max(torque, usual * least), usual * most)
        state.gap[i] += gain * (gap - state.gap[i])
        tolerance = GAP + GAP_SHARE * most
        short = drove and gap < -tolerance
        if state.share_s[i] > FEWEST_S:
            tolerance = USUAL_GAP + USUAL_GAP_SHARE * most
        judge(witness, place, state.gap[i], tolerance, GAP_DOUBT_S, dt)
        if short and witness.rejected[place]:
            blending.lost[i], state.gap[i] = 1, 0.0
            believe(witness, place)
        steady = least > (1.0 - STEADY) * most and most > LEAST_ASKED
        if steady and abs(state.gap[i]) < USUAL * tolerance:
            _follow_share(state, i, 2.0 * torque / (least + most) - 1.0, dt)


@kernel
def deny_drive(params: Record, state: Record, witness: Record, inputs: Record, dt: float) -> None:
    """Judge the torques of motors that do not brake, `LET_GO_S` after the driver let the accelerator go.

    Args:
        params: `PARAMS`.
        state: `MOTORS_WATCH_STATE`, overwritten.
        witness: `WITNESS_STATE`; the four torques' fields are overwritten.
        inputs: `INPUTS` as received.
        dt: time since the last cycle [s].
    """
    if params.sigma_motor_torque > KNOWN_MOTORS:
        return
    gain = lag_gain(dt, GAP_LAG)
    for i in range(4):
        place = MOTOR_TORQUE + i
        if params.blending[i] == 0.0 and usable(inputs, place) and not witness.rejected[place]:
            state.gap[i] += gain * (inputs.value[place] - state.gap[i])
            judge(witness, place, min(state.gap[i], 0.0), DRIVES_ON, GAP_DOUBT_S, dt)
