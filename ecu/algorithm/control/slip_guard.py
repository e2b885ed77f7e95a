"""Slip guard: holds the pressure at a wheel beyond its tyre's range, returns it once the wheel recovers.

    lag     = |v_i| - |omega| r                      speed deficit of a wheel [m/s]; slip = -lag / |v_i|
    growth  = -d(|omega| r)/dt - braking of the car  rate of that deficit [m/s^2], median of three samples,
                                                     low-passed
    inertia = I / (2 A_k r_eff mu r)                 pressure that changes that rate by 1 m/s^2 [Pa s^2/m]
    carried = p - inertia (growth + braking)         pressure whose torque the road's force balances (A.3)
    slides  = WHOLLY F / (C_L F_z)                   slip from which a tyre slides wholly, by the brush model;
                                                     F: force that balances `carried`

begins   slip beyond `RANGE` while the lag grows: the cap is the pressure demanded last
cut      while the lag that is coming, in `AHEAD`, is beyond that of `slides`: the cap falls to where the
         wheel comes back to it within `BACK_S`: little where it slips a little, to nothing where it stands.
         Anew only where it is beyond by `SURE` sigma of noise, or little pressure would never return
return   then, at once to `RETURNED` of the pressure that the road carried, which is the least while the wheel
         fell behind and the greatest while it came back; from there slowly, ever faster where the wheel rolls
         beyond it, until the cap no longer acts. Fast where the car is slower than `LEAST_SPEED`. Cap and
         what the road carries go with the wheel's load: little in a swerve is much after it

The rate is the wheel's own against the accelerometer, not against the vehicle speed: a speed that errs, jumps
or stands still caps nothing. A wheel that locks falls behind from sample to sample; a wheel speed that jumps
once, and is scaled or shifted from then on, does not: hence the median. `GROWING` rises with the noise of the
wheel's speed, `NOISE` sigma, by its second differences. A wheel that brakes no more spins up within
`SPIN_UP_S` on ice too; one that does not has a sensor that lies. One that slips by less than `HALF` and
neither falls behind nor comes back for `STEADY_S` is in the stable range of its tyre, or its sensor is
scaled. The pressure of both returns, and is capped again only where the deficit grows anew.

`rear_guard.py` caps rear wheels by what the road carries at others.

While ABS or ESP report activity the cap never falls: two controllers would cut the same wheel. This is no
ABS: it seeks no optimal slip and has no yaw control.

Assumption: all constants; found with simulated vehicles on friction of 0.1 to 1.2.
"""

import math

import numpy as np

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.control.rear_guard import hold_unseen, select_low
from ecu.algorithm.inputs import fresh, usable
from ecu.algorithm.lag import lag_gain, settled
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
        ("pressed", "f8", (4,)),  # pressure as late as `growth`, motors as the pressure of their torque [Pa]
        ("slides", "u1", (4,)),  # it is cut
        ("grip", "f8", (4,)),  # pressure that the road carried at the last slip, at the present load [Pa]
        ("load", "f8", (4,)),  # of the wheel in the last cycle [N]
        ("freed_s", "f8", (4,)),  # time at push-out pressure without spinning up
        ("steady_s", "f8", (4,)),  # time for which it has slipped less than `HALF` and steadily
        ("follows", "u1", (4,)),  # it is capped for the other rear wheel's sake
        ("denied", "u1", (4,)),  # it did not spin up, or slips steadily: that is no wheel that locks
        ("let_go_s", "f8", (4,)),  # time until a wheel whose speed is not known has spun up
        ("acting", "u1"),  # on any wheel
    ],
    align=True,
)

RANGE = 0.10  # slip; braking at 9.5 m/s^2 on a dry road stays below 0.07
GROWING = 10.0  # m/s^2; noise of the wheel speeds and braking as in RANGE stay below 8
RETURNING = -5.0  # m/s^2
STAYS, HALF, STEADY_S = 2.0, 0.5, 0.1  # m/s^2, slip, s
GROWTH_LAG = 0.02  # s
PRESSED_LAG = 0.05  # s: that, the median and a difference
NOISE = 4.0  # sigma
OF_GROWTH = 0.45  # sigma of the low-passed first difference of white noise over its sigma
QUIET = 20.0  # m/s^2 of noise that the cycle of slipping and spinning up itself shows
NOISE_S = 0.5
SPIN_UP_S = 0.3  # lag of the hydraulics, and 15 m/s^2 at an adhesion of 0.05
LEAST_SPEED = 3.0  # m/s
WHOLLY = 3.4  # 3 by the brush model, and what nominal friction and load may be off
LEAST_SLIDING = 0.03  # slip that radii and noise hide
AHEAD = 0.06  # s: dead time and lag of the hydraulics
AGAIN, SURE = 5.0, 2.5  # m/s^2, of a wheel that is capped already; sigma of its growth taken off what comes
COMES_BACK = 0.4  # of the slip to lose: below it a wheel that gains speed shows nothing of the road
MOST_CHANGE = 0.1  # of a wheel's load in a cycle
STANDS = 0.02  # of the ground's speed
BACK_S, LEAST_BACK = 0.15, 6.0  # s, m/s^2
STILL = 0.9  # of what the road carried is carried by a tyre that slips on, until the hydraulics follow
RETURNED = (0.97, 0.97, 0.9, 0.9)  # of `grip`, which is low-passed: the peak is higher
CLIMB, FASTER = 0.25, 7.0  # of `grip` /s, 1/s of what is beyond it
CUT = 400.0 * BAR  # Pa/s; back to a wheel whose sensor lies
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
def _sigma(state: Record, i: int) -> float:
    """Return the standard deviation of the growth of a lag by noise of the wheel's speed [m/s^2]."""
    sigma: float = OF_GROWTH * state.noise[i] / (1e-9 * CYCLE_NS)
    return sigma


@kernel
def _noise(state: Record, i: int) -> float:
    """Return how far noise alone takes the growth of a lag beyond `QUIET` [m/s^2]."""
    return max(NOISE * _sigma(state, i) - QUIET, 0.0)


@kernel
def _grows(state: Record, i: int) -> bool:
    """Return whether a wheel falls behind the car by more than its noise."""
    grows: bool = state.growth[i] > GROWING + _noise(state, i)
    return grows


@kernel
def _doubt(
    params: Record, state: Record, i: int, ground: float, slipping: bool, far: bool, dt: float
) -> None:
    """Overwrite `denied`: a wheel that does not behave as one that locks, until its lag is gone or grows.

    `slipping`: beyond its tyre's range; `far`: beyond `RANGE`.
    """
    capped = state.capped[i] != 0 and slipping
    freed = capped and state.cap[i] <= params.push_out_pressure[i] and state.growth[i] > RETURNING
    steady = capped and far and state.lag[i] < HALF * ground and abs(state.growth[i]) < STAYS
    state.freed_s[i] = state.freed_s[i] + dt if freed else 0.0
    state.steady_s[i] = state.steady_s[i] + dt if steady else 0.0
    if state.freed_s[i] > SPIN_UP_S or state.steady_s[i] > STEADY_S:
        state.denied[i] = 1
    elif not slipping or _grows(state, i):
        state.denied[i] = 0


@kernel
def _cut(state: Record, i: int, carried: float, inertia: float, beyond: float, least: float) -> float:
    """Return the pressure [Pa] at which a wheel comes back; `beyond` [m/s]: lag to lose, `least` [Pa]."""
    back = max(beyond / BACK_S, LEAST_BACK)
    return max(min(state.cap[i], STILL * carried - inertia * back), least)


@kernel
def _remember(state: Record, i: int, carried: float, stands: bool) -> None:
    """Follow the pressure that the road carries while a wheel slips [Pa]; unknown of one that stands."""
    if not state.slides[i]:
        state.slides[i], state.follows[i] = 1, 0
        state.grip[i] = 0.0 if stands else max(state.cap[i], state.pressed[i])
    if not stands:
        comes_back = state.growth[i] < 0.0
        state.grip[i] = max(state.grip[i], carried) if comes_back else min(state.grip[i], carried)


@kernel
def _give_back(state: Record, i: int, carried: float, target: float, watching: bool, dt: float) -> None:
    """Raise the cap of a wheel that slips no more; `target` [m/s]: lag from which it slides wholly."""
    if state.slides[i] or (state.growth[i] < RETURNING and state.lag[i] > COMES_BACK * target):
        state.slides[i], state.grip[i] = 0, max(state.grip[i], carried)
        state.cap[i] = max(state.cap[i], RETURNED[i] * state.grip[i])
    rise = CLIMB * max(state.grip[i], BAR) + FASTER * max(state.cap[i] - state.grip[i], 0.0)
    if state.denied[i]:
        rise = CUT
    elif state.follows[i] or not watching:
        rise = RETURN
    state.cap[i] += rise * dt


@kernel
def _follow_load(state: Record, estimate: Record, other: bool, i: int) -> None:
    """Scale what the road carries at a wheel, and its cap, by its load; `other`: another controller cuts."""
    load = max(estimate.load[i], 1.0)
    change = load / state.load[i] if state.capped[i] and state.load[i] > 0.0 else 1.0
    change = min(max(change, 1.0 if other else 1.0 - MOST_CHANGE), 1.0 + MOST_CHANGE)
    state.cap[i], state.grip[i], state.load[i] = change * state.cap[i], change * state.grip[i], load


@kernel
def guard_slip(
    params: Record,
    state: Record,
    inputs: Record,
    estimate: Record,
    speed: float,
    sent: Record,
    pressure: Record,
    motor: Record,
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
        pressure: of the callipers at the end of the coming cycle, by the demands sent [bar], shape (4,).
        motor: torques demanded of the motors in the last cycle [N m], shape (4,).
        wanted: pressures demanded by the pressure law now [Pa], shape (4,).
        torque: demanded of each wheel's motor and lining together [N m], shape (4,).
        dt: time since the last cycle [s].
    """
    watching = abs(speed) > LEAST_SPEED
    other = _flag(inputs, ABS_ACTIVE) or _flag(inputs, ESP_ACTIVE)
    braking = -math.copysign(1.0, speed) * estimate.accel_x if watching else 0.0
    for i in range(4):
        ground = abs(corner_speed(params, estimate, speed, i)) if watching else 0.0
        _follow_lag(params, state, inputs, ground, braking, i, dt)
        _follow_load(state, estimate, other, i)
        per_torque, radius = 1.0 / (brake_gain(params, i) * params.mu_nominal[i]), params.wheel_radius[i]
        presses = BAR * pressure[i] + per_torque * motor[i]
        late = lag_gain(dt, PRESSED_LAG) * (presses - state.pressed[i])
        state.pressed[i] = settled(state.pressed[i] + late)
        base, lag = max(ground, LEAST_SPEED), state.lag[i]
        far = watching and lag > RANGE * base
        if not (far or state.capped[i]):
            state.denied[i] = state.slides[i] = 0
            state.freed_s[i] = state.steady_s[i] = state.grip[i] = 0.0
            continue
        inertia = per_torque * params.wheel_inertia[i] / radius
        carried = state.pressed[i] - inertia * (state.growth[i] + braking)
        known = carried if state.slides[i] else max(state.grip[i], carried)
        adhesion = known / (per_torque * radius * max(estimate.load[i], 1.0))
        target = min(max(WHOLLY * adhesion / params.slip_stiffness[i], LEAST_SLIDING), RANGE) * base
        slipping = watching and lag > target if state.capped[i] else far
        _doubt(params, state, i, ground, slipping, far, dt)
        begins = far and _grows(state, i)
        if begins and not state.capped[i]:
            state.capped[i], state.cap[i] = 1, sent[i]
        if state.capped[i]:
            beyond = lag + AHEAD * state.growth[i] - target
            sure = lag + AHEAD * (state.growth[i] - SURE * _sigma(state, i)) > target
            again = state.growth[i] > AGAIN + _noise(state, i) and sure
            again = begins or state.slides[i] != 0 or again
            if watching and beyond > 0.0 and again and not state.denied[i]:
                least = params.push_out_pressure[i]
                stands = state.rolled[i] < STANDS * ground
                _remember(state, i, carried, stands)
                if not other:
                    state.cap[i] = least if stands else _cut(state, i, carried, inertia, beyond, least)
            else:
                _give_back(state, i, carried, target, watching, dt)
                if not state.cap[i] < wanted[i]:
                    state.capped[i] = 0
            if not torque[i] > 0.0:
                state.capped[i] = 0
        if not state.capped[i]:
            state.slides[i], state.follows[i], state.grip[i] = 0, 0, 0.0
    if watching and not other:
        for i in range(2, 4):
            hold_unseen(params, state, inputs, estimate, speed, i, dt)
        select_low(state, inputs, sent, wanted)
    state.acting = 0
    for i in range(4):
        state.acting = max(state.acting, state.capped[i])
