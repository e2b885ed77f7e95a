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

import math

import numpy as np

from ecu.algorithm.inputs import (
    driver_accelerates,
    fresh,
    motor_torque,
    motor_torque_known,
    others_brake,
    usable,
)
from ecu.algorithm.monitoring.witness import compare, compare_both
from ecu.algorithm.vehicle import tyre_slip
from ecu.contract.params import GRAVITY
from ecu.contract.signals import ACCEL_X, CALLIPER_PRESSURE, MOTOR_TORQUE, REVERSE, WHEEL_SPEED
from ecu.jit import Record, kernel

A, W, F, ROLLED = range(4)
KINDS = 4
BLOCKS = 12
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

BLOCK_S = 0.1
LONGEST_BLOCK_S = 0.125  # cycles were missed
OLDEST_S = 0.06  # of a reading
LEAST_SPEED = 3.0  # m/s
ROLLING = 0.06  # of the speed, greatest difference of a rolling wheel
LEAST_ERROR, NOISE = 0.25, 6.0  # m/s^2, times sigma
SLIP, SLIP_BY_SPEED = 0.1, 0.01  # -, s/m
FORCE = 0.3  # possible error of friction
KNOWN_MOTORS = 0.1  # greatest relative error of a motor torque that still yields a force
SLOPE, STEEP = 2.0, 1.5  # m/s^2, of a slope of 20 %, of 15 %
DENIED = 1.0  # m/s^2
SECOND, OPPOSED = 10, 3  # blocks
SHOWN = 0.5  # of the acceleration at which it jumped: a scale shows at no lesser one
AGAIN, AGREED = 0.5, 2  # of LEAST_ERROR; blocks after the first time, twice as many after each further
OFTEN = 6
STANDSTILL = 0.1  # m/s


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
def _gather(
    params: Record,
    state: Record,
    inputs: Record,
    estimate: Record,
    base: Record,
    braking: bool,
) -> None:
    value = inputs.value
    force, wheels = 0.0, 0.0
    for i in range(4):
        radius = params.wheel_radius[i]
        lining = estimate.brake_torque[i] * base[i] / estimate.mu[i] if braking else 0.0
        force -= (lining + motor_torque(inputs, i)) / (radius * params.mass)
        wheels += 0.25 * value[WHEEL_SPEED + i] * radius
    reading = value[ACCEL_X] / (1.0 + GRAVITY * params.pitch_gradient)
    state.sum[A] += reading + estimate.yaw_rate * estimate.lateral_speed
    state.sum[W] += wheels * (1.0 + tyre_slip(params, reading))
    state.sum[F] += force
    state.sum[ROLLED] += wheels
    state.readings += 1 if fresh(inputs, ACCEL_X) else 0
    state.cycles += 1


@kernel
def _close_block(params: Record, state: Record) -> None:
    turns = 0.5 * params.wheel_radius[0] * params.sigma_wheel_speed
    variance = 0.6 * params.sigma_accel**2 + 2.0 * (turns / (2.0 * BLOCK_S)) ** 2
    state.sigma = math.sqrt(variance / max(state.readings, 1))
    for k in range(BLOCKS - 1, 0, -1):
        for j in range(KINDS):
            state.mean[k, j] = state.mean[k - 1, j]
    for j in range(KINDS):
        state.mean[0, j] = state.sum[j] / state.cycles
        state.sum[j] = 0.0
    sound = state.good != 0 and state.time < LONGEST_BLOCK_S
    state.good_blocks = state.good_blocks + 1 if sound else 0
    state.known_blocks = state.known_blocks + 1 if sound and state.known else 0
    state.compared_blocks = state.compared_blocks + 1 if sound and state.known else 0
    state.time, state.cycles, state.readings, state.good, state.known = 0.0, 0, 0, 1, 1


@kernel
def _now(mean: Record, j: int) -> float:
    return (mean[0, j] + mean[1, j] + mean[2, j]) / 3.0


@kernel
def _before(mean: Record, j: int) -> float:
    return 0.25 * (mean[4, j] + mean[5, j] + mean[6, j] + mean[7, j])


@kernel
def _wheels_accel(mean: Record, j: int) -> float:
    """Return dv/dt now, v in column `j` [m/s^2]."""
    return (mean[0, j] - mean[2, j]) / (2.0 * BLOCK_S)


@kernel
def rolled_accel(state: Record) -> float:
    """Return d(omega r)/dt over the last blocks, of all wheels [m/s^2]; 0 without two of them."""
    mean = state.mean
    return float((mean[0, ROLLED] - mean[2, ROLLED]) / (2.0 * BLOCK_S))


@kernel
def _beside_wheels(mean: Record, j: int) -> float:
    """Return a - dv/dt now, v in column `j` [m/s^2]."""
    return _now(mean, A) - _wheels_accel(mean, j)


@kernel
def wheels_deny(state: Record) -> bool:
    """Return whether the wheels' deceleration confirms the reading on no usual road, or says nothing."""
    return state.good_blocks < 3 or abs(_beside_wheels(state.mean, W)) > STEEP


@kernel
def _usually_beside_wheels(mean: Record, j: int) -> float:
    """Return a - dv/dt before, of a straight line through four blocks [m/s^2]."""
    change = (3.0 * (mean[4, j] - mean[7, j]) + mean[5, j] - mean[6, j]) / (10.0 * BLOCK_S)
    return _before(mean, A) - change


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
    if abs(_wheels_accel(mean, W)) < SHOWN * state.shown_at:
        return False
    against_force = _now(mean, A) - _now(mean, F)
    unsure = FORCE * max(-_now(mean, F), 0.0)
    by_force = state.known_blocks >= SECOND and abs(against_force - state.usual_force) + unsure < least
    by_wheels: bool = compare(witness, ACCEL_X, against_wheels - state.usual, least) < 1.0
    return by_force or by_wheels or abs(against_wheels - state.usual_slope) < least


@kernel
def _jumped(state: Record, witness: Record) -> bool:
    """Return whether the reading has moved against wheels and torques."""
    mean = state.mean
    least, greatest = mean[0, F], mean[0, F]
    for k in range(1, BLOCKS):
        least, greatest = min(least, mean[k, F]), max(greatest, mean[k, F])
    moved = greatest - least
    wheels = _moved_against_wheels(mean)
    force = _now(mean, A) - _now(mean, F) - (_before(mean, A) - _before(mean, F))
    noise = max(LEAST_ERROR, NOISE * state.sigma)
    wheels_err = noise + (SLIP + SLIP_BY_SPEED * _now(mean, W)) * moved
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
    against_force = _now(mean, A) - _now(mean, F)
    denied = DENIED + FORCE * abs(_now(mean, F))
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
        state.shown_at = abs(_wheels_accel(mean, W)) if jumped else 0.0
        state.usual = _usually_beside_wheels(mean, W) if jumped else 0.0
        state.usual_force = _before(mean, A) - _before(mean, F) if jumped else 0.0


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
    _gather(params, state, inputs, estimate, base, braking)
    state.time += dt
    if state.time > BLOCK_S - 0.001:
        _close_block(params, state)
        if witness.rejected[ACCEL_X]:
            state.implausible = 0  # as a whole: it has a name
            return
        reverses = estimate.backwards or inputs.value[REVERSE] > 0.5
        _judge(state, witness, slope, braking and not (reverses or driver_accelerates(inputs)))
