"""What no car lets the unit measure that sends all four wheel speeds: they are left out at once.

jumped    all four change by the same amount or share from one sample to the next, and by little before and
          after, where they agreed with the car before. A motor may turn them within a sample, and takes the
          car with them, as its torque and the accelerometer show
stuck     every sample of all four is the last one, while the accelerometer shows `WENT` of another speed
turned    all four turn backwards while the car drives forwards: it would have stood in between; or while the
          brakes slow a car that drives forwards: backwards they push it forwards, on any slope

They are believed again by `speeds.py`, where they agree with the others.
"""

import math

import numpy as np

from ecu.algorithm.estimate import STANDING
from ecu.algorithm.inputs import MAX_DECEL, driver_accelerates, fresh, motor_torque, usable
from ecu.algorithm.monitoring.witness import believe, compare
from ecu.contract.signals import ACCEL_X, REVERSE, VEHICLE_SPEED, WHEEL_SPEED
from ecu.jit import Record, kernel

WHEEL_UNIT_STATE = np.dtype(
    [
        ("omega", "f8", (4,)),  # last samples [rad/s]
        ("before", "f8", (4,)),  # change from the second last to the third last
        ("change", "f8", (4,)),  # from the last to the second last
        ("took_s", "f8"),  # time that this change took; 0: not known
        ("motor", "f8", (4,)),  # torque [N m]
        ("kick", "f8"),  # greatest change of a motor's torque in a sample, fading [N m]
        ("accel", "f8", (2,)),  # readings beside the two last samples [m/s^2]
        ("age_s", "f8"),  # since the last sample
        ("kept_s", "f8"),  # since one differed from the one before
        ("same_s", "f8"),  # time for which all have been the same
        ("went", "f8"),  # change of the car's speed meanwhile, by the accelerometer [m/s]
    ],
    align=True,
)

LEAST_SPEED = 5.0  # m/s
NOISE, QUIET = 5.0, 0.25  # sigma of a sample; of a jump, the changes beside it
ALIKE = 0.2  # of the change, what the four may differ by
AGREED = 0.1  # of the speed, before the jump
OLDEST_S = 0.025  # of a sample that the next is compared with
CALM = 0.5  # m/s^2, change of the reading beside a jump
KICK_SHARE, FADES = 1.6, 0.5  # of a torque's effect on a free wheel; per sample
SAME_S, WENT = 0.1, 1.0  # s, m/s
BACKWARDS, FORWARDS = 1.0, 3.0  # m/s
BRAKED = 1.0  # m/s^2


@kernel
def _noise(params: Record, jitter: Record) -> float:
    """Return what noise changes a mean of the four by [rad/s], at most; `jitter`: of each, as measured."""
    mean = 0.25 * (jitter[0] + jitter[1] + jitter[2] + jitter[3])
    return NOISE * max(mean, params.sigma_wheel_speed)


@kernel
def _calm(state: Record, inputs: Record) -> bool:
    """Return whether the accelerometer has stood still beside the last two samples and this one."""
    least = min(state.accel[0], min(state.accel[1], inputs.value[ACCEL_X]))
    most = max(state.accel[0], max(state.accel[1], inputs.value[ACCEL_X]))
    calm: bool = most - least < CALM
    return calm


@kernel
def _jumped(params: Record, state: Record, inputs: Record, estimate: Record, noise: float) -> bool:
    """Return whether all have jumped by the change before the present sample, beyond `noise` [rad/s]."""
    sure = estimate.measured != 0 and state.took_s > 0.0 and _calm(state, inputs)
    if estimate.speed < LEAST_SPEED or not sure:
        return False
    kick = KICK_SHARE * state.kick / params.wheel_inertia[0]
    leap = noise + (MAX_DECEL / params.wheel_radius[0] + kick) * state.took_s
    least, most, least_share, most_share = math.inf, -math.inf, math.inf, -math.inf
    rolled, before, mean, after = 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        change, first = state.change[i], state.omega[i] - state.change[i]
        rolled += 0.25 * first * params.wheel_radius[i]
        before, mean = before + 0.25 * state.before[i], mean + 0.25 * change
        after += 0.25 * (inputs.value[WHEEL_SPEED + i] - state.omega[i])
        share = change / first if first != 0.0 else math.inf
        least, most = min(least, change), max(most, change)
        least_share, most_share = min(least_share, share), max(most_share, share)
    alike = ALIKE * abs(mean) + noise
    scaled = (most_share - least_share) * rolled / params.wheel_radius[0] < alike
    alone = max(abs(before), abs(after)) < QUIET * abs(mean)
    agreed = abs(rolled - estimate.speed) < AGREED * estimate.speed
    return abs(mean) > leap and alone and agreed and (most - least < alike or scaled)


@kernel
def _follow_same(state: Record, inputs: Record, estimate: Record, slope: float) -> None:
    same = True
    for i in range(4):
        same = same and inputs.value[WHEEL_SPEED + i] == state.omega[i] and state.omega[i] != 0.0
    if same:
        state.same_s += state.age_s
        state.went += (estimate.accel_x - slope) * state.age_s
    else:
        state.same_s = state.went = 0.0


@kernel
def _follow_motors(state: Record, inputs: Record) -> None:
    """Overwrite the greatest change of a motor's torque."""
    state.kick *= FADES
    for i in range(4):
        torque = motor_torque(inputs, i)
        state.kick = max(state.kick, abs(torque - state.motor[i]))
        state.motor[i] = torque


@kernel
def _brakes_slow(params: Record, inputs: Record, estimate: Record) -> bool:
    """Return whether linings and motors slow the car as one that drives forwards."""
    braked = 0.0
    for i in range(4):
        torque = estimate.brake_torque[i] + motor_torque(inputs, i)
        braked += torque / (params.wheel_radius[i] * params.mass)
    drives = driver_accelerates(inputs) or inputs.value[REVERSE] > 0.5
    slow: bool = estimate.measured != 0 and braked > BRAKED and estimate.accel_x < -BRAKED and not drives
    return slow


@kernel
def _turned(params: Record, inputs: Record, estimate: Record) -> bool:
    slow = _brakes_slow(params, inputs, estimate)
    turned, least = estimate.speed > FORWARDS or slow, STANDING if slow else BACKWARDS
    for i in range(4):
        turned = turned and inputs.value[WHEEL_SPEED + i] * params.wheel_radius[i] < -least
    return turned


@kernel
def watch_wheel_unit(
    params: Record,
    state: Record,
    witness: Record,
    inputs: Record,
    estimate: Record,
    slope: float,
    jitter: Record,
    dt: float,
) -> None:
    """Reject all wheel speeds where they cannot be.

    Args:
        params: `PARAMS`.
        state: `WHEEL_UNIT_STATE`, overwritten.
        witness: `WITNESS_STATE`; the wheels' fields are overwritten.
        inputs: `INPUTS` as received.
        estimate: `ESTIMATE` of the last cycle.
        slope: of the road, and the accelerometer's zero [m/s^2].
        jitter: noise of each wheel speed, shape (4,) [rad/s].
        dt: time since the last cycle [s].
    """
    state.age_s += dt
    state.kept_s += dt
    for i in range(4):
        if not (fresh(inputs, WHEEL_SPEED + i) and usable(inputs, WHEEL_SPEED + i)):
            return
    _follow_motors(state, inputs)
    turned = _turned(params, inputs, estimate)
    if turned:
        believe(witness, VEHICLE_SPEED)  # what these wheels have said of it
    noise = _noise(params, jitter)
    wrong = turned or _jumped(params, state, inputs, estimate, noise)
    _follow_same(state, inputs, estimate, slope)
    stuck = state.same_s > SAME_S and abs(state.went) > WENT
    state.took_s = state.kept_s if max(state.age_s, state.kept_s) < OLDEST_S else 0.0
    state.accel[0], state.accel[1] = state.accel[1], inputs.value[ACCEL_X]
    for i in range(4):
        place = WHEEL_SPEED + i
        if wrong or stuck:
            omega = estimate.speed / params.wheel_radius[i]
            compare(witness, place, inputs.value[place] - omega, noise)
            witness.rejected[place] = 1
        if wrong or state.same_s > SAME_S:
            witness.agreed_s[place] = 0.0
        change = inputs.value[place] - state.omega[i]
        state.before[i], state.change[i], state.omega[i] = state.change[i], change, inputs.value[place]
        if change != 0.0:
            state.kept_s = 0.0
    state.age_s = 0.0
