"""An accelerometer that jumps or sticks: what neither the wheels nor the torques confirm.

Three say how hard the car brakes, each as a mean over a block of 0.1 s:

    a   the accelerometer, in road axes, cornering removed
    w   the wheels: dv/dt of v = mean(omega r) (1 - a / (g C)), the slip that the force needs taken off, and
        of mean(omega r) itself: tyres may be stiffer than C; what is less counts
    f   the torques: -(sum of linings and motors) / (r m), with the friction that the braking began with

A slope is in w and not in a or f; a lining that changes is in a and w alike, and not in f. So where a has
moved against both, to the same side, the sensor is wrong. The last three blocks are set against four that end
0.1 s before them; what w and f may err by grows with the range that f ran through in 1.2 s:

    |a - w| > LEAST + (SLIP + SLIP_BY_SPEED v) range(f)        |a - f| > LEAST + FORCE range(f)

A reading beyond any road (`SLOPE`) that the torques deny for a second is wrong as well, whatever it was
before. From then on it is not used until it agrees with the wheels as it did before, or the car stands: on
what slope, nobody knows. Nothing is said of wheels that slide, under ABS or ESP, or of a car whose forces are
not known (no motor torque is reported, brakes released). A bias that was always there, or comes slowly, is
not seen.

Assumption: all constants; found with the simulated vehicle, whose sound sensor stays below a third of `LEAST`
in all shipped scenarios.
"""

import numpy as np

from ecu.estimation.motion import motor_torque, usable
from ecu.jit import Record, kernel
from ecu.params import GRAVITY
from ecu.signals import (
    ABS_ACTIVE,
    ACCEL_X,
    CALLIPER_PRESSURE,
    ESP_ACTIVE,
    MOTOR_TORQUE,
    REVERSE,
    WHEEL_SPEED,
)

A, W, F, ROLLED = range(4)
KINDS = 4
BLOCKS = 12
ACCELERATION_STATE = np.dtype(
    [
        ("time", "f8"),  # of the block that is gathered [s]
        ("cycles", "i8"),
        ("good", "u1"),  # every cycle of it tells something
        ("sum", "f8", (KINDS,)),
        # Of the last blocks, the newest in row 0: a [m/s^2], v [m/s], f [m/s^2], mean of omega r [m/s].
        ("mean", "f8", (BLOCKS, KINDS)),
        ("good_blocks", "i8"),  # in a row
        ("beyond", "i8"),  # blocks in a row that are beyond any road
        ("agreed", "i8"),  # blocks in a row that agree again
        ("usual", "f8"),  # a - w before the jump [m/s^2]
        ("implausible", "u1"),
    ],
    align=True,
)

BLOCK_S = 0.1
LONGEST_BLOCK_S = 0.125  # cycles were missed
OLDEST_S = 0.06  # of a reading
LEAST_SPEED = 3.0  # m/s
ROLLING = 0.06  # of the speed, that a rolling wheel differs by at most
LEAST = 0.25  # m/s^2
SLIP, SLIP_BY_SPEED = 0.1, 0.01  # -, s/m
FORCE = 0.3  # friction may be wrong by so much
GREATEST_ACCEL = 15.0  # m/s^2: no tyre on a road holds more
SLOPE = 2.0  # m/s^2, of a slope of 20 %
DENIED = 1.0  # m/s^2
SECOND = 10  # blocks
AGAIN, AGREED = 0.5, 2  # of LEAST, blocks
STANDSTILL = 0.1  # m/s


@kernel
def _tells(params: Record, inputs: Record, speed: float, braking: bool) -> bool:
    """Return whether this cycle's readings are of now and the forces known."""
    value = inputs.value
    oldest = 1e9 * OLDEST_S
    told = speed > LEAST_SPEED and usable(inputs, ACCEL_X) and inputs.age_ns[ACCEL_X] < oldest
    reported = False
    for i in range(4):
        wheel = WHEEL_SPEED + i
        rolls = abs(value[wheel] * params.wheel_radius[i] - speed) < ROLLING * speed
        told = told and rolls and usable(inputs, wheel) and inputs.age_ns[wheel] < oldest
        told = told and usable(inputs, CALLIPER_PRESSURE + i)
        reported = reported or usable(inputs, MOTOR_TORQUE + i)
    works = value[ABS_ACTIVE] > 0.5 or value[ESP_ACTIVE] > 0.5 or value[REVERSE] > 0.5
    return told and (braking or reported) and not works


@kernel
def _gather(
    params: Record,
    state: Record,
    inputs: Record,
    motion: Record,
    friction: Record,
    base: Record,
    braking: bool,
) -> None:
    value = inputs.value
    force, wheels = 0.0, 0.0
    for i in range(4):
        radius = params.wheel_radius[i]
        lining = friction.torque[i] * base[i] / friction.mu[i] if braking else 0.0
        force -= (lining + motor_torque(inputs, i)) / (radius * params.mass)
        wheels += 0.25 * value[WHEEL_SPEED + i] * radius
    reading = value[ACCEL_X] / (1.0 + GRAVITY * params.pitch_gradient)
    state.sum[A] += reading + motion.yaw_rate * motion.lateral_speed
    state.sum[W] += wheels * (1.0 - reading / (GRAVITY * params.slip_stiffness[0]))
    state.sum[F] += force
    state.sum[ROLLED] += wheels
    state.cycles += 1


@kernel
def _close_block(state: Record) -> None:
    for k in range(BLOCKS - 1, 0, -1):
        for j in range(KINDS):
            state.mean[k, j] = state.mean[k - 1, j]
    for j in range(KINDS):
        state.mean[0, j] = state.sum[j] / state.cycles
        state.sum[j] = 0.0
    sound = state.good != 0 and state.time < LONGEST_BLOCK_S
    state.good_blocks = state.good_blocks + 1 if sound else 0
    state.time, state.cycles, state.good = 0.0, 0, 1


@kernel
def _now(mean: Record, j: int) -> float:
    now: float = (mean[0, j] + mean[1, j] + mean[2, j]) / 3.0
    return now


@kernel
def _before(mean: Record, j: int) -> float:
    before: float = 0.25 * (mean[4, j] + mean[5, j] + mean[6, j] + mean[7, j])
    return before


@kernel
def _beside_wheels(mean: Record, j: int) -> float:
    """Return a - dv/dt now, v in column `j` [m/s^2]."""
    beside: float = _now(mean, A) - (mean[0, j] - mean[2, j]) / (2.0 * BLOCK_S)
    return beside


@kernel
def _usually_beside_wheels(mean: Record, j: int) -> float:
    """Return a - dv/dt before, of a straight line through four blocks [m/s^2]."""
    change = (3.0 * (mean[4, j] - mean[7, j]) + mean[5, j] - mean[6, j]) / (10.0 * BLOCK_S)
    beside: float = _before(mean, A) - change
    return beside


@kernel
def _moved_against_wheels(mean: Record) -> float:
    """Return by how much a has moved against the wheels, of whatever stiffness [m/s^2]."""
    slipping = _beside_wheels(mean, W) - _usually_beside_wheels(mean, W)
    rolling = _beside_wheels(mean, ROLLED) - _usually_beside_wheels(mean, ROLLED)
    if slipping * rolling <= 0.0:
        return 0.0
    return slipping if abs(slipping) < abs(rolling) else rolling


@kernel
def _judge(state: Record) -> None:
    """Compare the last blocks with those before, or with what was usual before the sensor jumped."""
    mean = state.mean
    against_wheels = _beside_wheels(mean, W)
    against_force = _now(mean, A) - _now(mean, F)
    if state.implausible:
        agrees = state.good_blocks >= 3 and abs(against_wheels - state.usual) < AGAIN * LEAST
        state.agreed = state.agreed + 1 if agrees else 0
        if state.agreed >= AGREED:
            state.implausible, state.good_blocks = 0, 0
        return
    if state.good_blocks < 8:
        state.beyond = 0
        return
    denied = DENIED + FORCE * abs(_now(mean, F))
    up, down = (
        min(against_wheels - SLOPE, against_force - denied),
        max(against_wheels + SLOPE, against_force + denied),
    )
    state.beyond = state.beyond + 1 if up > 0.0 or down < 0.0 else 0
    least, greatest = mean[0, F], mean[0, F]
    for k in range(1, BLOCKS):
        least, greatest = min(least, mean[k, F]), max(greatest, mean[k, F])
    moved = greatest - least
    wheels = _moved_against_wheels(mean)
    force = against_force - (_before(mean, A) - _before(mean, F))
    wheels_err = LEAST + (SLIP + SLIP_BY_SPEED * _now(mean, W)) * moved
    force_err = LEAST + FORCE * moved
    jumped = (wheels > wheels_err and force > force_err) or (wheels < -wheels_err and force < -force_err)
    if jumped or state.beyond >= SECOND:
        state.implausible, state.agreed = 1, 0
        state.usual = _usually_beside_wheels(mean, W) if jumped else 0.0


@kernel
def watch_acceleration(
    params: Record,
    state: Record,
    inputs: Record,
    motion: Record,
    friction: Record,
    base: Record,
    speed: float,
    braking: bool,
    dt: float,
) -> None:
    """Overwrite `state.implausible` from this cycle's readings.

    Args:
        params: `PARAMS`.
        state: `ACCELERATION_STATE`, overwritten.
        inputs: `INPUTS`.
        motion: `MOTION_STATE` of the last cycle.
        friction: `FRICTION_STATE` of the last cycle.
        base: friction that this braking began with, shape (4,).
        speed: of the car [m/s].
        braking: a brake application lasts.
        dt: time since the last cycle [s].
    """
    if speed < STANDSTILL:
        state.implausible = 0
    if not _tells(params, inputs, speed, braking):
        state.good = 0
    _gather(params, state, inputs, motion, friction, base, braking)
    state.time += dt
    if state.time > BLOCK_S - 0.001:
        _close_block(state)
        _judge(state)
