"""Plausibility of the accelerometer: jumps and stuck readings that neither wheels nor torques confirm.

Three sources give the deceleration, each as a mean over a block of 0.1 s:

    a   the accelerometer, in road axes, cornering removed
    w   the wheels: dv/dt of v = mean(omega r) (1 - a / (g C)), corrected for the slip that the force
        needs, and of mean(omega r) itself: tyres may be stiffer than C; the lesser counts
    f   the torques: -(sum of linings and motors) / (r m), with the friction at the start of the application

A slope affects w but not a or f; a change of friction affects a and w alike, but not f. So where a has moved
against both, to the same side, the sensor is wrong. The last three blocks are set against four that end 0.1 s
before them; the tolerance grows with the noise of the sensors and with the range of f over 1.2 s:

    |a - w| > least + (SLIP + SLIP_BY_SPEED v) range(f)        |a - f| > least + FORCE range(f)

with least = max(LEAST_ERROR, NOISE sigma), sigma of a - w by the configured noise of the sensors.

A reading beyond any road (`SLOPE`) that the torques contradict for a second is wrong as well, regardless of
its history. From then on it is not used until it agrees with the wheels as before or on the slope that was
known (one that was late agreed with nothing just before), or with the torques, where friction may be off by
`FORCE`; each at `SHOWN` of the acceleration at the jump, for a scale shows at none less; the longer the more
often it has been wrong. At standstill it is used again, on an unknown slope. Where the drive torque is
unreported or uncertain, the torques neither contradict nor confirm: a reading beyond any road by the wheels
alone is doubted until it no longer is. One that reads forwards for `OPPOSED` blocks while the linings brake
and the wheels slow down is wrong whatever the speed is taken for, which it may have misled. Otherwise no
verdict is given while wheels slide or ABS or ESP act. A constant or slowly growing bias is not detected.

Assumption: all constants; found with the simulated vehicle, whose sound sensor stays below a third of
`LEAST_ERROR` in all shipped scenarios.
"""

import numpy as np

from ecu.algorithm.inputs import driver_accelerates, motor_torque_known, others_brake, usable
from ecu.algorithm.monitoring.accel_blocks import (
    BLOCK_S,
    BLOCKS,
    KINDS,
    ROLLED,
    SHOWN,
    A,
    F,
    W,
    before,
    close_block,
    force_moved,
    gather_block,
    now,
    wheels_accel,
)
from ecu.algorithm.monitoring.witness import compare, compare_both
from ecu.contract.signals import ACCEL_X, CALLIPER_PRESSURE, MOTOR_TORQUE, REVERSE, WHEEL_SPEED
from ecu.jit import Record, kernel

ACCELERATION_STATE = np.dtype(
    [
        ("time", "f8"),  # of the block that is gathered [s]
        ("cycles", "i8"),
        ("good", "u1"),  # every cycle of it is usable
        ("known", "u1"),  # the drive's torque is reported and certain in every cycle of it
        ("readings", "i8"),  # new samples in it
        ("sum", "f8", (KINDS,)),
        # Of the last blocks, the newest in row 0: a [m/s^2], v [m/s], f [m/s^2], mean of omega r [m/s].
        ("mean", "f8", (BLOCKS, KINDS)),
        ("good_blocks", "i8"),  # in a row
        ("known_blocks", "i8"),  # in a row
        ("compared_blocks", "i8"),  # the same, also since it was believed again
        ("sigma", "f8"),  # of a - w by the sensors' noise [m/s^2]
        ("beyond", "i8"),  # consecutive blocks beyond any road
        ("opposed", "i8"),  # consecutive blocks in which it reads forwards while the linings slow the wheels
        ("agreed", "i8"),  # consecutive blocks that agree again
        ("times", "i8"),  # that it has become implausible, at most `OFTEN`
        ("usual", "f8"),  # a - w before the jump [m/s^2]
        ("usual_slope", "f8"),  # of the road, as it was known then [m/s^2]
        ("usual_force", "f8"),  # a - f before the jump [m/s^2]
        ("shown_at", "f8"),  # magnitude of the wheels' acceleration at the jump [m/s^2]
        ("implausible", "u1"),
    ],
    align=True,
)

OLDEST_S = 0.06  # of a reading
LEAST_SPEED = 3.0  # m/s
ROLLING = 0.06  # of the speed, greatest difference of a rolling wheel
LEAST_ERROR, NOISE = 0.25, 6.0  # m/s^2, times sigma
FORCE = 0.3  # possible error of friction
KNOWN_MOTORS = 0.1  # greatest relative error of a motor torque that still yields a force
SLOPE, STEEP = 2.0, 1.5  # m/s^2, of a slope of 20 %, of 15 %
DENIED = 1.0  # m/s^2
SECOND, OPPOSED = 10, 3  # blocks
AGAIN, AGREED = 0.5, 2  # of LEAST_ERROR; blocks after the first time, twice as many after each further
OFTEN = 6
STANDSTILL = 0.1  # m/s
COMPARED = 4  # blocks of which the reading and dv/dt are, and the one before


@kernel
def _tells(params: Record, witness: Record, inputs: Record, speed: float) -> bool:
    """Return whether this cycle's readings are current and believed, and the linings' pressures known."""
    value = inputs.value
    oldest = 1e9 * OLDEST_S
    known = speed > LEAST_SPEED and usable(inputs, ACCEL_X) and inputs.age_ns[ACCEL_X] < oldest
    for i in range(4):
        wheel = WHEEL_SPEED + i
        rolls = abs(value[wheel] * params.wheel_radius[i] - speed) < ROLLING * speed
        known = (
            known
            and rolls
            and usable(inputs, wheel)
            and not witness.rejected[wheel]
            and inputs.age_ns[wheel] < oldest
        )
        known = known and usable(inputs, CALLIPER_PRESSURE + i)
    works = others_brake(inputs) or value[REVERSE] > 0.5
    return known and not works


@kernel
def _drive_known(params: Record, inputs: Record) -> bool:
    reported, known = False, params.sigma_motor_torque <= KNOWN_MOTORS
    for i in range(4):
        reported = reported or usable(inputs, MOTOR_TORQUE + i)
        known = known and motor_torque_known(inputs, i)
    return reported and known


@kernel
def _beside_wheels(mean: Record, j: int) -> float:
    """Return a - dv/dt now, v in column `j` [m/s^2]."""
    return now(mean, A) - wheels_accel(mean, j)


@kernel
def wheels_deny(state: Record) -> bool:
    """Return whether the wheels' deceleration confirms the reading on no usual road, or says nothing."""
    return state.good_blocks < 3 or abs(_beside_wheels(state.mean, W)) > STEEP


@kernel
def _usually_beside_wheels(mean: Record, j: int) -> float:
    """Return a - dv/dt before, of a straight line through four blocks [m/s^2]."""
    change = (3.0 * (mean[4, j] - mean[7, j]) + mean[5, j] - mean[6, j]) / (10.0 * BLOCK_S)
    return before(mean, A) - change


@kernel
def _moved_against_wheels(mean: Record) -> float:
    """Return by how much a has moved against the wheels, for any tyre stiffness [m/s^2]."""
    slipping = _beside_wheels(mean, W) - _usually_beside_wheels(mean, W)
    rolling = _beside_wheels(mean, ROLLED) - _usually_beside_wheels(mean, ROLLED)
    if slipping * rolling <= 0.0:
        return 0.0
    return slipping if abs(slipping) < abs(rolling) else rolling


@kernel
def _agrees(state: Record, witness: Record) -> bool:
    """Return whether a doubted reading agrees as before."""
    mean = state.mean
    least = AGAIN * max(LEAST_ERROR, NOISE * state.sigma)
    against_wheels = _beside_wheels(mean, W)
    if state.known_blocks < 3:
        on_a_road: bool = compare(witness, ACCEL_X, against_wheels, SLOPE) < 1.0
        return on_a_road and state.good_blocks >= SECOND
    if abs(wheels_accel(mean, W)) < SHOWN * state.shown_at:
        return False
    against_force = now(mean, A) - now(mean, F)
    unsure = FORCE * max(-now(mean, F), 0.0)
    by_force = state.known_blocks >= SECOND and abs(against_force - state.usual_force) + unsure < least
    by_wheels: bool = compare(witness, ACCEL_X, against_wheels - state.usual, least) < 1.0
    apart = abs(against_wheels - (state.usual if by_wheels else state.usual_slope))
    return by_force or apart + force_moved(mean, COMPARED)[1] < least


@kernel
def _jumped(state: Record, witness: Record) -> bool:
    """Return whether the reading has moved against wheels and torques."""
    mean = state.mean
    moved, slip = force_moved(mean, BLOCKS)
    wheels = _moved_against_wheels(mean)
    force = now(mean, A) - now(mean, F) - (before(mean, A) - before(mean, F))
    noise = max(LEAST_ERROR, NOISE * state.sigma)
    wheels_err = noise + slip
    force_err = noise + FORCE * moved
    compare_both(witness, ACCEL_X, wheels, wheels_err, force, force_err)
    up: bool = wheels > wheels_err and force > force_err
    return up or (wheels < -wheels_err and force < -force_err)


@kernel
def _beyond_any_road(state: Record, witness: Record) -> bool:
    mean = state.mean
    against_wheels = _beside_wheels(mean, W)
    if state.known_blocks < 8:
        beyond: bool = compare(witness, ACCEL_X, against_wheels, SLOPE + NOISE * state.sigma) > 1.0
        return beyond
    against_force = now(mean, A) - now(mean, F)
    denied = DENIED + FORCE * abs(now(mean, F))
    compare_both(witness, ACCEL_X, against_wheels, SLOPE, against_force, denied)
    up: bool = against_wheels > SLOPE and against_force > denied
    return up or (against_wheels < -SLOPE and against_force < -denied)


@kernel
def _opposes_the_brakes(state: Record) -> bool:
    """Return whether the reading is forwards although linings brake and the wheels slow down."""
    mean = state.mean
    slows = mean[0, ROLLED] < mean[2, ROLLED] and mean[0, ROLLED] > LEAST_SPEED
    opposes: bool = slows and mean[0, F] < -DENIED and mean[0, A] > DENIED
    return opposes


@kernel
def _judge(state: Record, witness: Record, slope: float, slowed: bool) -> None:
    """Compare the last blocks with those before, or with the values before the sensor jumped.

    `slowed`: by its linings, forwards, and its driver does not accelerate.
    """
    mean = state.mean
    state.opposed = state.opposed + 1 if slowed and _opposes_the_brakes(state) else 0
    if state.implausible:
        agrees = state.good_blocks >= 3 and _agrees(state, witness)
        state.agreed = state.agreed + 1 if agrees else 0
        if state.agreed >= AGREED << (state.times - 1):
            state.implausible, state.good_blocks, state.known_blocks = 0, 0, 0
        return
    jumped = False
    if state.good_blocks < 8:
        state.beyond = 0
    else:
        state.beyond = state.beyond + 1 if _beyond_any_road(state, witness) else 0
        jumped = state.known_blocks >= 8 and _jumped(state, witness)
    if jumped or state.beyond >= SECOND or state.opposed >= OPPOSED:
        state.implausible, state.agreed, state.times = 1, 0, min(state.times + 1, OFTEN)
        state.usual_slope = slope
        state.shown_at = abs(wheels_accel(mean, W)) if jumped else 0.0
        state.usual = _usually_beside_wheels(mean, W) if jumped else 0.0
        state.usual_force = before(mean, A) - before(mean, F) if jumped else 0.0


@kernel
def watch_acceleration(
    params: Record,
    state: Record,
    witness: Record,
    inputs: Record,
    estimate: Record,
    base: Record,
    slope: float,
    braking: bool,
    dt: float,
) -> None:
    """Overwrite `state.implausible` from this cycle's readings.

    Args:
        params: `PARAMS`.
        state: `ACCELERATION_STATE`, overwritten.
        witness: `WITNESS_STATE`; what is published of the accelerometer is overwritten.
        inputs: `INPUTS`.
        estimate: `ESTIMATE` of the last cycle.
        base: friction at the start of this application, shape (4,).
        slope: of the road, as it was last known [m/s^2].
        braking: a brake application lasts.
        dt: time since the last cycle [s].
    """
    if estimate.speed < STANDSTILL:
        state.implausible = 0
    if not _tells(params, witness, inputs, estimate.speed):
        state.good = 0
    if not _drive_known(params, inputs):
        state.known = 0
    gather_block(params, state, inputs, estimate, base, braking)
    state.time += dt
    if state.time > BLOCK_S - 0.001:
        close_block(params, state)
        if witness.rejected[ACCEL_X]:
            return
        reverses = estimate.backwards or inputs.value[REVERSE] > 0.5
        _judge(state, witness, slope, braking and not (reverses or driver_accelerates(inputs)))
