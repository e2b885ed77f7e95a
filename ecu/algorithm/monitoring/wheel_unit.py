"""What no car lets the unit measure that sends all four wheel speeds: they are left out at once.

jumped    all four change within a sample by the same amount or share, by more than brakes and motors turn a
          wheel by, where they agreed with the car before: wheels that lock or spin differ
stuck     every sample of all four is the last one, while the accelerometer shows `WENT` of another speed
turned    all four turn backwards while the car drives forwards: it would have stood in between

They are believed again by `speeds.py`, where they agree with the others.
"""

import math

import numpy as np

from ecu.algorithm.inputs import MAX_DECEL, driver_accelerates, fresh, motor_torque, usable
from ecu.algorithm.monitoring.witness import compare
from ecu.contract.signals import MOTOR_TORQUE, WHEEL_SPEED
from ecu.jit import Record, kernel

WHEEL_UNIT_STATE = np.dtype(
    [
        ("omega", "f8", (4,)),  # last samples [rad/s]
        ("age_s", "f8"),  # of them
        ("same_s", "f8"),  # time for which all have been the same
        ("went", "f8"),  # change of the car's speed meanwhile, by the accelerometer [m/s]
    ],
    align=True,
)

LEAST_SPEED = 5.0  # m/s
LEAP, ENGINE_LEAP = 2.0, 6.0  # rad/s in a sample; more under an engine whose torque is not reported
BRAKE_SHARE = 1.6  # of the effect of brake and motor on a free wheel
ALIKE = 0.2  # of the change, what the four may differ by
AGREED = 0.1  # of the speed, before the jump
OLDEST_S = 0.1  # of a sample that the next is compared with
SAME_S, WENT = 0.1, 1.0  # s, m/s
BACKWARDS, FORWARDS = 1.0, 3.0  # m/s


@kernel
def _leaps(params: Record, inputs: Record, estimate: Record, i: int, age_s: float) -> float:
    """Return what a wheel's speed may change by in `age_s` [rad/s]."""
    torque = estimate.brake_torque[i] + abs(motor_torque(inputs, i))
    turned = BRAKE_SHARE * torque / params.wheel_inertia[i] + MAX_DECEL / params.wheel_radius[i]
    engine = driver_accelerates(inputs) and not usable(inputs, MOTOR_TORQUE + i)
    leap: float = (ENGINE_LEAP if engine else LEAP) + turned * age_s
    return leap


@kernel
def _jumped(params: Record, state: Record, inputs: Record, estimate: Record) -> bool:
    if estimate.speed < LEAST_SPEED or state.age_s > OLDEST_S:
        return False
    least, most, least_share, most_share = math.inf, -math.inf, math.inf, -math.inf
    leapt, rolled = True, 0.0
    for i in range(4):
        last = state.omega[i]
        change = inputs.value[WHEEL_SPEED + i] - last
        rolled += 0.25 * last * params.wheel_radius[i]
        share = change / last if last != 0.0 else math.inf
        least, most = min(least, change), max(most, change)
        least_share, most_share = min(least_share, share), max(most_share, share)
        leapt = leapt and abs(change) > _leaps(params, inputs, estimate, i, state.age_s)
    amount = most - least < ALIKE * min(abs(most), abs(least))
    share = most_share - least_share < ALIKE * min(abs(most_share), abs(least_share))
    agreed = abs(rolled - estimate.speed) < AGREED * estimate.speed
    return leapt and agreed and (amount or share)


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
def _turned(params: Record, inputs: Record, estimate: Record) -> bool:
    turned = estimate.speed > FORWARDS
    for i in range(4):
        turned = turned and inputs.value[WHEEL_SPEED + i] * params.wheel_radius[i] < -BACKWARDS
    return turned


@kernel
def watch_wheel_unit(
    params: Record,
    state: Record,
    witness: Record,
    inputs: Record,
    estimate: Record,
    slope: float,
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
        dt: time since the last cycle [s].
    """
    state.age_s += dt
    for i in range(4):
        if not (fresh(inputs, WHEEL_SPEED + i) and usable(inputs, WHEEL_SPEED + i)):
            return
    wrong = _jumped(params, state, inputs, estimate) or _turned(params, inputs, estimate)
    _follow_same(state, inputs, estimate, slope)
    stuck = state.same_s > SAME_S and abs(state.went) > WENT
    for i in range(4):
        place = WHEEL_SPEED + i
        if wrong or stuck:
            omega = estimate.speed / params.wheel_radius[i]
            compare(witness, place, inputs.value[place] - omega, AGREED * omega)
            witness.rejected[place] = 1
        if wrong or state.same_s > SAME_S:
            witness.agreed_s[place] = 0.0
        state.omega[i] = inputs.value[place]
    state.age_s = 0.0
