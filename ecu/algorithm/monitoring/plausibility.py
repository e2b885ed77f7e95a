"""Plausibility of wheel speeds and calliper pressures.

A braked wheel does not turn faster than the car, nor than the other wheels: if all do, the vehicle speed is
wrong. A stuck sensor shows this as soon as the car slows down; its frames are new, intact and on time. A
wheel slower than the car may slide, so it is not judged.

A wheel speed that falls faster than the brake could cause is a sensor fault: a broken wire reads 0. It is
masked out until it agrees with the vehicle speed again, or the car is at standstill. One whose noise, by the
second differences of its samples beside the others', is `NOISY` times the configured one is left out for as
long as it is. Wheels that spin shake, so while one is driven and turns faster than the road nothing is
said of anyone's noise.

A pressure follows the demands that were sent (`ecu.algorithm.hydraulics` models how) if the three others
do. Where more than one does not, another controller brakes, or the demands are not executed: no sensor or
valve is blamed.
"""

import math

import numpy as np

from ecu.algorithm.inputs import driver_accelerates, fresh, motor_torque, others_brake, usable
from ecu.algorithm.lag import lag_gain
from ecu.algorithm.monitoring.witness import compare, judge
from ecu.algorithm.vehicle import corner_speed
from ecu.contract.signals import CALLIPER_PRESSURE, WHEEL_SPEED
from ecu.jit import Record, kernel

PLAUSIBILITY_STATE = np.dtype(
    [
        ("for_s", "f8", (4,)),  # time for which a wheel has been too fast
        ("omega", "f8", (4,)),  # last sample of a wheel [rad/s]
        ("age_s", "f8", (4,)),  # of it
        ("change", "f8", (4,)),  # of it from the sample before, less that of the others [rad/s]
        ("jitter", "f8", (4,)),  # noise [rad/s]
        ("noisy", "u1", (4,)),  # judged by it until it is believed again
        ("fell", "u1", (4,)),  # fell faster than a wheel can
        ("apart_s", "f8", (4,)),  # excess time for which a pressure deviated from its demand
        ("pressure", "u1"),  # one pressure has deviated for too long
        ("sent", "u1"),  # the last demands were valid
    ],
    align=True,
)

FASTER = 1.05  # share above ground speed: radii, cornering and vehicle speed are known better
BRAKED = 100.0  # N m
LEAST_SPEED = 5.0  # m/s
DOUBT_S = 0.3
FALL, FALL_SHARE = 5.0, 1.6  # rad/s, effect of the brake torque on the free wheel
SECOND_DIFFERENCE = 1.95  # mean modulus of a second difference of white noise, over sigma: sqrt(12 / pi)
NOISY, NOISE_S = 6.0, 0.5  # times the configured noise; s
JUMP = 30.0  # times that noise, of a sample: a single one says nothing
OLDEST_S = 0.1  # age of a sample that the next is compared with
ROLLING = 0.06  # of the speed, greatest difference of a rolling wheel
STANDSTILL = 0.1  # m/s
APART, APART_SHARE = 8.0, 0.2  # bar, of the pressure: noise and error of the hydraulics model
FOLLOWS = 0.75  # of that pressure


@kernel
def _over_ground(params: Record, inputs: Record, estimate: Record, i: int) -> float:
    """Return the relative excess of a wheel's speed over the ground speed below it."""
    turns = inputs.value[WHEEL_SPEED + i] * params.wheel_radius[i]
    return turns / corner_speed(params, estimate, estimate.speed, i)


@kernel
def wheel_speed_implausible(
    params: Record, state: Record, witness: Record, inputs: Record, estimate: Record, dt: float
) -> bool:
    """Return whether a wheel has been too fast for `DOUBT_S`, or has fallen too fast.

    Args:
        params: `PARAMS`.
        state: `PLAUSIBILITY_STATE`, overwritten.
        witness: `WITNESS_STATE`; what is published of the wheel speeds is overwritten.
        inputs: `INPUTS` as received.
        estimate: `ESTIMATE` of the last cycle.
        dt: time since the last cycle [s].
    """
    found = False
    total, wheels = 0.0, 0
    for i in range(4):
        if usable(inputs, WHEEL_SPEED + i):
            total += _over_ground(params, inputs, estimate, i)
            wheels += 1
    for i in range(4):
        found = found or state.fell[i] != 0
        over = _over_ground(params, inputs, estimate, i)
        braked = estimate.brake_torque[i] > BRAKED and motor_torque(inputs, i) >= 0.0
        fast = usable(inputs, WHEEL_SPEED + i) and estimate.speed > LEAST_SPEED and over > FASTER
        alone = over * (wheels - 1) > FASTER * (total - over)  # than the mean of the others; no other: 0 > 0
        state.for_s[i] = state.for_s[i] + dt if fast and alone and braked else 0.0
        if braked and wheels > 1 and usable(inputs, WHEEL_SPEED + i):
            beside = max((total - over) / (wheels - 1), 1.0)
            if estimate.speed > LEAST_SPEED and over > beside:
                free = inputs.value[WHEEL_SPEED + i] / over
                compare(witness, WHEEL_SPEED + i, (over / beside - 1.0) * free, (FASTER - 1.0) * free)
        found = found or state.for_s[i] > DOUBT_S
    return found


@kernel
def _common_change(state: Record, inputs: Record) -> float:
    """Return how the wheels' speeds have changed since their last samples [rad/s], without the two extremes.

    NaN: not all four have come.
    """
    total, least, greatest = 0.0, math.inf, -math.inf
    for i in range(4):
        change = inputs.value[WHEEL_SPEED + i] - state.omega[i]
        if not fresh(inputs, WHEEL_SPEED + i):
            return math.nan
        total, least, greatest = total + change, min(least, change), max(greatest, change)
    return 0.5 * (total - least - greatest)


@kernel
def _spins(params: Record, inputs: Record, estimate: Record) -> bool:
    """Return whether any wheel is driven and turns faster than the road."""
    found, accelerates = False, driver_accelerates(inputs)
    for i in range(4):
        driven = accelerates or motor_torque(inputs, i) < -BRAKED
        found = found or (driven and _over_ground(params, inputs, estimate, i) > 1.0 + ROLLING)
    return found


@kernel
def watch_wheels(
    params: Record, state: Record, witness: Record, inputs: Record, estimate: Record, dt: float
) -> None:
    """Overwrite `state.fell`, wheels whose speed has fallen faster than a wheel's can; judge their noise.

    Arguments as for `wheel_speed_implausible`.
    """
    common, spins = _common_change(state, inputs), _spins(params, inputs, estimate)
    for i in range(4):
        state.age_s[i] += dt
        if fresh(inputs, WHEEL_SPEED + i):
            omega = inputs.value[WHEEL_SPEED + i]
            braked = estimate.brake_torque[i] + abs(motor_torque(inputs, i))
            possible = FALL + FALL_SHARE * braked / params.wheel_inertia[i] * state.age_s[i]
            ground = corner_speed(params, estimate, estimate.speed, i)
            known = state.age_s[i] < OLDEST_S and usable(inputs, CALLIPER_PRESSURE + i)
            falls = known and omega < state.omega[i]
            if falls and compare(witness, WHEEL_SPEED + i, omega - state.omega[i], possible) > 1.0:
                state.fell[i] = 1
            elif abs(omega * params.wheel_radius[i] - ground) < ROLLING * ground:
                state.fell[i] = 0
            if math.isfinite(common):
                change = omega - state.omega[i] - common
                jerk = min(abs(change - state.change[i]) / SECOND_DIFFERENCE, JUMP * params.sigma_wheel_speed)
                gain = 0.0 if spins else lag_gain(min(state.age_s[i], OLDEST_S), NOISE_S)
                state.jitter[i] += gain * (jerk - state.jitter[i])
                state.change[i] = change
            state.omega[i], state.age_s[i] = omega, 0.0
        noise = NOISY * params.sigma_wheel_speed
        if state.jitter[i] > noise:
            state.noisy[i] = 1
        if state.noisy[i]:
            judge(witness, WHEEL_SPEED + i, state.jitter[i], noise, DOUBT_S, dt)
            state.noisy[i] = 1 if state.jitter[i] > noise or witness.rejected[WHEEL_SPEED + i] else 0
        if estimate.speed < STANDSTILL:
            state.fell[i] = 0


@kernel
def _gap(inputs: Record, i: int, expected: float, zero: float) -> float:
    """Return the deviation of a pressure from its expected value over the tolerance; NaN: unknown."""
    place = CALLIPER_PRESSURE + i
    gap = abs(inputs.value[place] - zero - expected) / (APART + APART_SHARE * expected)
    return gap if usable(inputs, place) else math.nan


@kernel
def watch_pressures(state: Record, inputs: Record, expected: Record, zero: Record, dt: float) -> None:
    """Overwrite `state.pressure`: pressures that deviated from their demand for `DOUBT_S`.

    Args:
        state: `PLAUSIBILITY_STATE`, overwritten.
        inputs: `INPUTS`.
        expected: modelled response to the demands sent, shape (4,) [bar].
        zero: pressure zeros, shape (4,) [bar].
        dt: time since the last cycle [s].
    """
    others = others_brake(inputs)
    following = 0
    for i in range(4):
        following += 1 if _gap(inputs, i, expected[i], zero[i]) < FOLLOWS else 0
    state.pressure = 0
    for i in range(4):
        if state.sent == 0 or others:
            state.apart_s[i] = 0.0
        elif following == 3 and _gap(inputs, i, expected[i], zero[i]) > 1.0:
            state.apart_s[i] = min(state.apart_s[i] + dt, 2.0 * DOUBT_S)
        else:
            state.apart_s[i] = max(state.apart_s[i] - dt, 0.0)
        if state.apart_s[i] > DOUBT_S:
            state.pressure = 1
