"""Zero and scale of the accelerometer that have drifted, by the wheels' deceleration and by the torques.

    a - dw/dt = c + s dw/dt      c: zero and slope of the road, walks by `SLOPE_WALK`; s: scale error
    a - f     = b + k f          b: zero; k: scale error, while no brake is applied and the motors alone drive

of the blocks of `accel_blocks.py`. Each is a Kalman filter of two states: a slope does not come and go with
the force. Errors of mass, motors, drag and pitch are in them from the start, so what counts is what they have
moved by from what is usual. That of the torques is a slow filter of the same blocks, which learns none that
has moved by half of the tolerance; it is as uncertain as the present force is unlike those seen. That of the
wheels is a mean, whose scale stands still where it has moved by half of `SCALE_DOUBT`.

A zero moves b and c alike, a scale k and s: what has moved in both is taken off the reading, once the forces
seen tell a zero from a scale. A c without b is a slope; a b without c is no zero of the accelerometer
(`motors.py`), an s without k none of its scale. What both lines have moved by, where the car is now, tells
the accelerometer's name before that; it is left out until then. A scale that the vehicle speed shows too is
taken off beyond `SOUND`. Who gets in at a standstill changes b and k: then they are learned anew. A reading
that is off by more than `GROSS` at once is not followed: it is implausible as a whole.

What the reading differs from the second line's mean by is kept for the motors (`motors.py`). A scale of the
first line alone is that of all wheel speeds: reported, but used, for slip and radius are ratios of speeds;
what it makes of the reading is nothing then.
"""

import math

import numpy as np

from ecu.algorithm.monitoring.accel_blocks import BLOCK_S, ROLLED, SHOWN, A, F, W, smooth_accel
from ecu.algorithm.monitoring.accel_timing import ACCEL_TIMING_STATE
from ecu.algorithm.monitoring.error_line import (
    LINE_STATE,
    SCALE_MOST,
    correct_line,
    learn_offset,
    learn_scale,
    lesser,
    moved_offset,
    moved_scale,
    sigma_line,
    widen_line,
)
from ecu.algorithm.monitoring.witness import compare
from ecu.contract.params import GRAVITY
from ecu.contract.signals import ACCEL_X, MOTOR_TORQUE, WHEEL_SPEED
from ecu.jit import Record, kernel

ACCEL_ERROR_STATE = np.dtype(
    [
        ("wheels", LINE_STATE),  # c, s
        ("torques", LINE_STATE),  # b, k
        ("apart", "f8"),  # reading less the torques' deceleration, beside the usual, low-passed [m/s^2]
        ("proven_s", "f8"),  # time for which the motors' torques alone have driven the car, at most `SURE_S`
        ("doubted_s", "f8"),  # time for which both lines have moved to the same side, at most `REPORTED_S`
        ("reported", "u1"),  # that has lasted
        ("shown_at", "f8"),  # force at which it did [m/s^2]: a scale shows at none less
        ("rolls_s", "f8"),  # time for which the scale of the wheels' line alone has moved, at most `ROLLS_S`
        ("rolls_wrong", "u1"),  # that has lasted: all wheel speeds may be scaled
        ("rolls_shown", "u1"),  # it has, while the car speeds up this time
        ("rolls_confirmed", "u1"),  # the vehicle speed shows it too
        ("rolls_times", "i8"),  # how often in a row it has, while the car sped up
        ("stood_s", "f8"),
        ("zero_off", "f8"),  # taken off the reading [m/s^2]
        ("scale_off", "f8"),  # of it
        ("scaled_s", "f8"),  # time for which wheels and another witness have shown it, at most `REPORTED_S`
        ("scale_beyond", "f8"),  # of it, by the speed over ground too, beyond `SOUND`: not reported yet
        ("ground", "f8"),  # what the vehicle speed usually reads above the wheels, of it
        ("ground_s", "f8"),  # learning time of that [s]
        ("timing", ACCEL_TIMING_STATE),
    ],
    align=True,
)

OFFSET_START, SCALE_START, SCALE_KNOWN = 0.5, 0.04, 0.035  # m/s^2, -, -
LEAST_SHOWN = 2.0  # m/s^2, below which a scale does not show
ACROSS = 2.0  # m/s^2, above which tyres drag by more than 0.03
SLOPE_WALK, SCALE_WALK = 0.1, 0.01  # m/s^2 and - per root second
ZERO_WALK, TORQUE_WALK = 0.03, 0.003  # likewise, of b and k
NOISE, TORQUE_NOISE = 0.15, 0.1  # m/s^2, of a block's difference
USUAL_WALK, USUAL_SCALE_WALK = 0.001, 0.0001  # as above, of the usual line: it follows within minutes
USUAL_NOISE = 0.15  # m/s^2: errors of its blocks last for some
SLIP, SLIP_BY_SPEED = 0.1, 0.01  # of a change of force, -, s/m
STEADY = 1.0  # m/s^2 in 0.2 s, beyond which tyre forces still build up
GROSS = 1.5  # m/s^2
SLOPE_S, SCALE_S = 10.0, 120.0  # memory of the usual c and s
FEWEST_S, FEWEST_SCALE_S, FEWEST_REPORTED_S = 2.0, 3.0, 5.0
APART_S = 0.5
KNOWN_OFFSET = 0.06  # m/s^2, standard deviation: forces of one size do not tell a zero from a scale
UNSEEN, UNSEEN_SHARE, WIND = 0.1, 0.03, 0.25  # m/s^2, of the force, of the drag: what torques may differ by
MOVED, REPORTED_S, SIGMAS = 0.1, 0.4, 2.0  # m/s^2, s, of the usual line
ROLLS, ROLLS_S, ROLLS_TIMES = 0.05, 1.0, 3  # of the speed; s; -
ROLLS_FREE = 1.0  # m/s^2
UNMOVED = 0.4  # of that, what the torques show of it
STANDS, STOOD_S = 0.1, 10.0  # m/s, s
ZERO_DOUBT = 0.18  # m/s^2; sound cars stay below 0.1
SCALE_DOUBT, SOUND = 0.033, 0.02  # of the lesser of both; sound cars stay below 0.032
PROVING, ENGINE, ENGINE_ZERO = 1.0, 0.2, 0.25  # m/s^2; of it, m/s^2: what an unreported engine exceeds
PROVEN_S, SURE_S, REFUTES = 0.5, 3.0, 5.0  # s, s; times as fast as it is proven
USUAL = 0.5  # of that, within which the torques are as usual
CONFIRMED, KEPT = 0.5, 0.4  # of the zero, what the wheels must show of it too; of a doubt, what keeps it


@kernel
def accel_doubted(state: Record) -> bool:
    """Return whether zero or scale of the accelerometer are known to have drifted."""
    return state.reported != 0 or state.zero_off != 0.0 or state.scale_off != 0.0


@kernel
def accel_unknown(state: Record) -> bool:
    """Return whether the accelerometer errs, and it is not known whether its zero or its scale does."""
    return state.reported != 0 and state.zero_off == 0.0 and state.scale_off == 0.0


@kernel
def _scale_usual(line: Record, moved: float) -> bool:
    """Return whether a scale that has `moved` from the usual one may still be that."""
    return bool(line.scale_s < FEWEST_SCALE_S or abs(moved) < USUAL * SCALE_DOUBT)


@kernel
def _follow_wheels(state: Record, mean: Record) -> None:
    """Correct c and s by the last block."""
    line = state.wheels
    widen_line(line.now, SLOPE_WALK, SCALE_WALK)
    change = abs(mean[0, F] - mean[2, F])
    h = smooth_accel(mean)
    if abs(h) < LEAST_SHOWN:
        h = 0.0  # noise of the wheels would show as a scale
        doubted = accel_doubted(state) or state.rolls_wrong != 0 or line.now.p[1] > SCALE_KNOWN**2
        if not doubted and _scale_usual(line, moved_scale(line)):
            learn_scale(line, SCALE_S)  # while it brakes, a slope that began with it is in the scale
    rolled = (mean[0, W] - mean[1, W]) / BLOCK_S
    innovation = 0.5 * (mean[0, A] + mean[1, A]) - rolled - line.now.offset - line.now.scale * h
    if change > STEADY or abs(innovation) > GROSS:
        return
    correct_line(
        line.now, h, innovation, NOISE + (SLIP + SLIP_BY_SPEED * mean[0, W]) * change / (2.0 * BLOCK_S)
    )


@kernel
def wheels_confirm(state: Record, mean: Record, moved: float) -> bool:
    """Return whether the wheels show what the reading has moved by [m/s^2], at the present deceleration."""
    h, beside = smooth_accel(mean), moved_offset(state.wheels)
    if abs(h) > LEAST_SHOWN:
        beside += moved_scale(state.wheels) * h
    return bool(beside * moved > CONFIRMED * moved * moved)


@kernel
def _unsure(state: Record, mean: Record) -> float:
    """Return by how much more the torques may differ from their usual line at a force unlike those seen."""
    return SIGMAS * sigma_line(state.torques.usual, mean[0, F])


@kernel
def torques_tolerance(params: Record, state: Record, mean: Record) -> float:
    """Return what the torques' deceleration may differ from its usual one by [m/s^2]."""
    drag: float = params.drag_area * mean[0, W] * mean[0, W] / params.mass
    return UNSEEN + UNSEEN_SHARE * abs(mean[0, F]) + WIND * drag + _unsure(state, mean)


@kernel
def _torques_moved(state: Record, mean: Record) -> float:
    """Return what the torques' line has moved by at the present force [m/s^2]."""
    return moved_offset(state.torques) + moved_scale(state.torques) * mean[0, F]


@kernel
def usual_known(state: Record) -> bool:
    """Return whether it is known what reading and torques usually differ by."""
    return bool(state.torques.offset_s > FEWEST_REPORTED_S)


@kernel
def _zero_known(state: Record) -> bool:
    """Return whether the forces seen tell a zero from a scale."""
    torques = state.torques
    return bool(torques.offset_s > FEWEST_S and torques.usual.p[0] < KNOWN_OFFSET**2)


@kernel
def _compare_scales(params: Record, state: Record, mean: Record, witness: Record) -> None:
    """Overwrite `rolls_wrong`: the wheels' line has moved by a scale, and the torques of motors deny it."""
    moved, force = moved_scale(state.wheels), mean[0, F]
    if state.wheels.scale_s < FEWEST_SCALE_S or not usual_known(state):
        return
    if force < 0.5 * LEAST_SHOWN:
        state.rolls_shown = 0
    if force < LEAST_SHOWN:
        return
    alone = abs(state.apart) + _unsure(state, mean) < UNMOVED * abs(moved) * force
    if alone:
        for i in range(4):
            turns = mean[0, ROLLED] / params.wheel_radius[i]
            compare(witness, WHEEL_SPEED + i, -moved * turns, ROLLS * turns)
    stands = alone and abs(moved) > (KEPT if state.rolls_wrong else 1.0) * ROLLS
    state.rolls_s = min(max(state.rolls_s + (BLOCK_S if stands else -BLOCK_S), 0.0), ROLLS_S)
    if state.rolls_s > ROLLS_S - 0.5 * BLOCK_S:
        state.rolls_times += 1 - state.rolls_shown
        state.rolls_wrong = state.rolls_shown = 1
    elif state.rolls_s == 0.0:
        state.rolls_wrong = state.rolls_times = 0


@kernel
def all_wheels_scaled(state: Record, over_ground: float, accel: float) -> bool:
    """Return whether all wheel speeds are known to be scaled alike: the vehicle speed confirms it.

    Without one, only what is found `ROLLS_TIMES` in a row is: a slope that begins as the car speeds up looks
    like it.

    Args:
        state: `ACCEL_ERROR_STATE`, overwritten.
        over_ground: what the vehicle speed reads above the wheels, of it, beside the usual; NaN: silent.
        accel: of the car [m/s^2]; beyond `ROLLS_FREE` slip is in the difference.
    """
    if not state.rolls_wrong:
        state.rolls_confirmed = 0
        return False
    moved = moved_scale(state.wheels)
    shows = abs(moved) > KEPT * ROLLS and over_ground * moved > CONFIRMED * moved * moved
    if abs(accel) < ROLLS_FREE:
        state.rolls_confirmed = 1 if shows else 0
    return bool(state.rolls_times >= ROLLS_TIMES if math.isnan(over_ground) else state.rolls_confirmed != 0)


@kernel
def _compare_lines(state: Record, mean: Record, witness: Record) -> None:
    """Overwrite `reported`: both lines have moved to the same side at the present force and deceleration."""
    if not usual_known(state):
        return
    moved, doubt = _torques_moved(state, mean), MOVED + _unsure(state, mean)
    agree = wheels_confirm(state, mean, moved) and state.rolls_wrong == 0
    if agree:
        compare(witness, ACCEL_X, moved, doubt)
    stands = abs(moved) > (KEPT if state.reported else 1.0) * doubt
    if stands and (agree or state.reported != 0):
        state.doubted_s = min(state.doubted_s + BLOCK_S, REPORTED_S)
    elif not state.reported or abs(mean[0, F]) > SHOWN * state.shown_at:
        state.doubted_s = max(state.doubted_s - BLOCK_S, 0.0)
    lasts = state.doubted_s > (0.0 if state.reported else REPORTED_S - 0.5 * BLOCK_S)
    state.shown_at = abs(mean[0, F]) if not state.reported else state.shown_at
    state.reported = 1 if lasts else 0


@kernel
def _follow_torques(params: Record, state: Record, mean: Record, witness: Record) -> None:
    """Correct b and k by the last block, and find the zero."""
    line, force, speed = state.torques, mean[0, F], mean[0, W]
    resistance = params.drag_area * speed * speed / params.mass + params.rolling_resistance * GRAVITY
    left = mean[0, A] - force + resistance
    if force > PROVING:
        engine = ENGINE * force + ENGINE_ZERO
        if abs(left) < engine:
            state.proven_s = min(state.proven_s + BLOCK_S, SURE_S)
        elif left - max(moved_offset(state.wheels), 0.0) > engine:
            state.proven_s = max(state.proven_s - REFUTES * BLOCK_S, 0.0)
    beside = left - line.usual.offset - line.usual.scale * force
    state.apart += ((beside if usual_known(state) else 0.0) - state.apart) * BLOCK_S / APART_S
    innovation = left - line.now.offset - line.now.scale * force
    if abs(innovation) > GROSS or state.proven_s < PROVEN_S:
        return
    widen_line(line.now, ZERO_WALK, TORQUE_WALK)
    correct_line(line.now, force, innovation, TORQUE_NOISE)
    _compare_scales(params, state, mean, witness)
    _compare_lines(state, mean, witness)
    usual = abs(state.apart) < USUAL * torques_tolerance(params, state, mean)
    usual = usual and abs(_torques_moved(state, mean)) < USUAL * (MOVED + _unsure(state, mean))
    if usual and state.zero_off == 0.0 and state.reported == 0:
        widen_line(line.usual, USUAL_WALK, USUAL_SCALE_WALK)
        correct_line(line.usual, force, beside, USUAL_NOISE)
        line.offset_s += BLOCK_S
        if abs(moved_offset(line)) < 0.5 * ZERO_DOUBT:
            learn_offset(state.wheels, SLOPE_S)
    zero = moved_offset(line)
    confirmed = _zero_known(state) and moved_offset(state.wheels) * zero > CONFIRMED * zero * zero
    confirmed = confirmed and state.rolls_wrong == 0
    if confirmed:
        compare(witness, ACCEL_X, zero, ZERO_DOUBT)
    doubt = ZERO_DOUBT if state.zero_off == 0.0 else KEPT * ZERO_DOUBT
    state.zero_off = zero if confirmed and abs(zero) > doubt else 0.0


@kernel
def _scale_by_ground(state: Record, above: float) -> float:
    """Return what wheels and vehicle speed both show of the scale, and the torques some of; else 0."""
    if math.isnan(above):
        return 0.0
    if _scale_usual(state.wheels, above - state.ground):
        state.ground_s = min(state.ground_s + BLOCK_S, SCALE_S)
        state.ground += (above - state.ground) * BLOCK_S / state.ground_s
    shown = lesser(moved_scale(state.wheels), moved_scale(state.wheels) - above + state.ground)
    return shown if moved_scale(state.torques) * shown > KEPT * shown * shown else 0.0


@kernel
def follow_accel_error(
    params: Record, state: Record, witness: Record, blocks: Record, across: float, above: float, braking: bool
) -> None:
    """Overwrite what is to be taken off the accelerometer's reading.

    Args:
        params: `PARAMS`.
        state: `ACCEL_ERROR_STATE`, overwritten.
        witness: `WITNESS_STATE`; what is published of the accelerometer is overwritten.
        blocks: `ACCELERATION_STATE`, whose last block was closed in this cycle.
        across: lateral acceleration [m/s^2].
        above: what the vehicle speed reads above the wheels without their slip, of it; NaN: silent.
        braking: a brake application lasts.
    """
    wheels, torques = state.wheels, state.torques
    if wheels.now.p[0] == 0.0:
        wheels.now.p[0], wheels.now.p[1] = OFFSET_START**2, SCALE_START**2
        torques.now.p[0], torques.now.p[1] = OFFSET_START**2, SCALE_MOST**2
        torques.usual.p[:] = torques.now.p
    state.stood_s = state.stood_s + BLOCK_S if abs(blocks.mean[0, ROLLED]) < STANDS else 0.0
    doubted = accel_doubted(state)
    for i in range(4):
        doubted = doubted or witness.rejected[MOTOR_TORQUE + i] != 0
    if state.stood_s > STOOD_S and not doubted:
        torques.offset_s, torques.now.p[1] = 0.0, SCALE_MOST**2
        torques.usual.p[0], torques.usual.p[1], torques.usual.p[2] = OFFSET_START**2, SCALE_MOST**2, 0.0
    if blocks.good_blocks > 3:
        _follow_wheels(state, blocks.mean)
    if blocks.known_blocks > 1 and not braking and abs(across) < ACROSS:
        _follow_torques(params, state, blocks.mean, witness)
    else:
        state.apart = 0.0
    by_wheels, by_ground = moved_scale(wheels), _scale_by_ground(state, above)
    if wheels.scale_s < FEWEST_SCALE_S or not _zero_known(state):
        return
    shown = lesser(by_wheels, moved_scale(torques))
    shown = by_ground if abs(by_ground) > abs(shown) else shown
    compare(witness, ACCEL_X, shown * LEAST_SHOWN, SCALE_DOUBT * LEAST_SHOWN)
    still = state.scale_off != 0.0 and abs(by_wheels) > KEPT * SCALE_DOUBT
    shows = BLOCK_S if abs(shown) > SCALE_DOUBT else -BLOCK_S
    state.scaled_s = min(max(state.scaled_s + shows, 0.0), REPORTED_S)
    state.scale_off = by_wheels if still or state.scaled_s > REPORTED_S - 0.5 * BLOCK_S else 0.0
    state.scale_beyond = math.copysign(max(abs(by_ground) - SOUND, 0.0), by_ground)


@kernel
def correct_accel(state: Record, reading: float) -> float:
    """Return the reading [m/s^2] less what zero and scale are known to have drifted by."""
    scale = state.scale_off if state.scale_off != 0.0 else state.scale_beyond
    return float((reading - state.zero_off) / (1.0 + scale))
