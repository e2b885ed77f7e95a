"""Slip guard: holds the pressure at a wheel beyond its tyre's range, returns it once the wheel recovers.

    lag    = |v_i| - |omega| r                       speed deficit of a wheel [m/s]; slip = -lag / |v_i|
    growth = -d(|omega| r)/dt - braking of the car   rate of that deficit [m/s^2], median of three samples,
                                                     low-passed

begins   slip beyond `RANGE` while the lag grows: the cap is the pressure demanded last
cut      slip beyond `RANGE` that grows, or beyond `HALF` and the wheel is not coming back: the cap falls
hold     slip beyond `RANGE` that stays, or the wheel comes back: the cap stays
return   slip within `RANGE` or steady, or the car slower than `LEAST_SPEED`: the cap rises until it no longer
         acts

The rate is the wheel's own against the accelerometer, not against the vehicle speed: a speed that errs, jumps
or stands still caps nothing. A wheel that locks falls behind from sample to sample; a wheel speed that jumps
once, and is scaled or shifted from then on, does not: hence the median. `GROWING` rises with the noise of the
wheel's speed, `NOISE` sigma, by its second differences. A wheel that brakes no more spins up within
`SPIN_UP_S` on ice too; one that does not has a sensor that lies. One that slips by less than `HALF` and
neither falls behind nor comes back for `STEADY_S` is in the stable range of its tyre, or its sensor is
scaled. The pressure of both returns, and is capped again only where the deficit grows anew.

While ABS or ESP report activity the cap never falls: two controllers would cut the same wheel. This is no
ABS: it seeks no optimal slip, has no yaw control and treats each wheel alone.

Assumption: all constants; found with the simulated vehicle on friction of 0.2 to 1.2.
"""

import math

import numpy as np

from ecu.algorithm.inputs import fresh, usable
from ecu.algorithm.lag import lag_gain
from ecu.algorithm.monitoring.plausibility import SECOND_DIFFERENCE
from ecu.algorithm.vehicle import corner_speed
from ecu.contract.params import BAR
from ecu.contract.signals import ABS_ACTIVE, CYCLE_NS, ESP_ACTIVE, WHEEL_SPEED
from ecu.jit import Record, kernel

SLIP_GUARD_STATE = np.dtype(
    [
        ("capped", "u1", (4,)),
        ("cap", "f8", (4,)),  # Pa, where capped
        ("lag", "f8", (4,)),  # last known [m/s]
        ("rolled", "f8", (4,)),  # |omega| r of the last sample [m/s], NaN before the first
        ("fall", "f8", (4,)),  # of that speed since the sample before [m/s]
        ("noise", "f8", (4,)),  # of that speed [m/s]
        ("growth", "f8", (4,)),  # m/s^2
        ("latest", "f8", (4,)),  # of the last sample alone [m/s^2]
        ("before", "f8", (4,)),  # of the sample before that
        ("age", "f8", (4,)),  # of the lag [s]
        ("freed_s", "f8", (4,)),  # time at push-out pressure without spinning up
        ("steady_s", "f8", (4,)),  # time for which it has slipped less than `HALF` and steadily
        ("denied", "u1", (4,)),  # it did not spin up, or slips steadily: that is no wheel that locks
        ("acting", "u1"),  # on any wheel
    ],
    align=True,
)

RANGE = 0.10  # slip; braking at 9.5 m/s^2 on a dry road stays below 0.07
GROWING = 10.0  # m/s^2; noise of the wheel speeds and braking as in RANGE stay below 8
RETURNING = -5.0  # m/s^2
STAYS, HALF, STEADY_S = 2.0, 0.5, 0.1  # m/s^2, slip, s
GROWTH_LAG = 0.02  # s
NOISE = 4.0  # sigma
OF_GROWTH = 0.45  # sigma of the low-passed first difference of white noise over its sigma
QUIET = 20.0  # m/s^2 of noise that the cycle of slipping and spinning up itself shows
NOISE_S = 0.5
SPIN_UP_S = 0.3  # lag of the hydraulics, and 15 m/s^2 at an adhesion of 0.05
LEAST_SPEED = 3.0  # m/s
CUT = 400.0 * BAR  # Pa/s
RETURN = 150.0 * BAR  # Pa/s


@kernel
def _flag(inputs: Record, place: int) -> bool:
    return usable(inputs, place) and inputs.value[place] > 0.5


@kernel
def _follow_lag(
    params: Record, state: Record, inputs: Record, ground: float, braking: float, i: int, dt: float
) -> None:
    """Update the lag by a new wheel speed; a wheel whose speed is lost has no lag.

    `braking` [m/s^2]: deceleration of the car.
    """
    state.age[i] += dt
    if fresh(inputs, WHEEL_SPEED + i) and state.age[i] > 0.0:
        rolled = abs(inputs.value[WHEEL_SPEED + i]) * params.wheel_radius[i]
        fall, age = state.rolled[i] - rolled, state.age[i]
        if math.isfinite(fall):
            gain = lag_gain(age, GROWTH_LAG)
            before, last, latest = state.before[i], state.latest[i], fall / age - braking
            state.before[i], state.latest[i] = last, latest
            middle = max(min(before, last), min(max(before, last), latest))
            state.growth[i] += gain * (middle - state.growth[i])
            jerk = abs(fall - state.fall[i]) / SECOND_DIFFERENCE
            state.noise[i] += lag_gain(age, NOISE_S) * (jerk - state.noise[i])
            state.fall[i] = fall
        state.lag[i], state.rolled[i], state.age[i] = ground - rolled, rolled, 0.0
    if not (usable(inputs, WHEEL_SPEED + i) and math.isfinite(state.lag[i] + state.growth[i])):
        state.lag[i] = state.growth[i] = state.latest[i] = state.before[i] = 0.0
        state.noise[i] = state.fall[i] = 0.0
        state.rolled[i] = math.nan


@kernel
def _grows(state: Record, i: int) -> bool:
    """Return whether a wheel falls behind the car by more than its noise."""
    noise = NOISE * OF_GROWTH * state.noise[i] / (1e-9 * CYCLE_NS)
    grows: bool = state.growth[i] > GROWING + max(noise - QUIET, 0.0)
    return grows


@kernel
def _doubt(params: Record, state: Record, i: int, ground: float, slipping: bool, dt: float) -> None:
    """Overwrite `denied`: a wheel that does not behave as one that locks, until its lag is gone or grows."""
    capped = state.capped[i] != 0 and slipping
    freed = capped and state.cap[i] <= params.push_out_pressure[i] and state.growth[i] > RETURNING
    steady = capped and state.lag[i] < HALF * ground and abs(state.growth[i]) < STAYS
    state.freed_s[i] = state.freed_s[i] + dt if freed else 0.0
    state.steady_s[i] = state.steady_s[i] + dt if steady else 0.0
    if state.freed_s[i] > SPIN_UP_S or state.steady_s[i] > STEADY_S:
        state.denied[i] = 1
    elif not slipping or _grows(state, i):
        state.denied[i] = 0


@kernel
def guard_slip(
    params: Record,
    state: Record,
    inputs: Record,
    estimate: Record,
    speed: float,
    sent: Record,
    wanted: Record,
    torque: Record,
    dt: float,
) -> None:
    """Overwrite the set of capped wheels and their pressure caps.

    Args:
        params: `PARAMS`.
        state: `SLIP_GUARD_STATE`, overwritten.
        inputs: `INPUTS`.
        estimate: `ESTIMATE`.
        speed: of the car [m/s], negative backwards, NaN where it is not known.
        sent: pressures demanded in the last cycle [Pa], shape (4,).
        wanted: pressures demanded by the pressure law now [Pa], shape (4,).
        torque: demanded of each wheel's motor and lining together [N m], shape (4,).
        dt: time since the last cycle [s].
    """
    watching = abs(speed) > LEAST_SPEED
    other = _flag(inputs, ABS_ACTIVE) or _flag(inputs, ESP_ACTIVE)
    state.acting = 0
    braking = -math.copysign(1.0, speed) * estimate.accel_x if watching else 0.0
    for i in range(4):
        ground = abs(corner_speed(params, estimate, speed, i)) if watching else 0.0
        _follow_lag(params, state, inputs, ground, braking, i, dt)
        slipping = watching and state.lag[i] > RANGE * max(ground, LEAST_SPEED)
        _doubt(params, state, i, ground, slipping, dt)
        slipping = slipping and state.denied[i] == 0
        if slipping and not state.capped[i] and _grows(state, i):
            state.capped[i], state.cap[i] = 1, sent[i]
        falls = min(state.growth[i], state.latest[i]) > STAYS
        if state.lag[i] > HALF * ground:
            falls = state.growth[i] > RETURNING
        if slipping and falls and not other:
            state.cap[i] = max(state.cap[i] - CUT * dt, params.push_out_pressure[i])
        if not slipping:
            state.cap[i] += (CUT if state.denied[i] else RETURN) * dt
            if not state.cap[i] < wanted[i]:
                state.capped[i] = 0
        if not torque[i] > 0.0:
            state.capped[i] = 0
        state.acting = max(state.acting, state.capped[i])
