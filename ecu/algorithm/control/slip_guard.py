"""Slip guard: holds the pressure at a wheel beyond its tyre's range, returns it once the wheel recovers.

    lag    = |v_i| - |omega| r                       speed deficit of a wheel [m/s]; slip = -lag / |v_i|
    growth = d lag / dt, low-passed                  rate of that deficit [m/s^2]

begins   slip beyond `RANGE` while the lag grows: the cap is the pressure demanded last
cut      slip beyond `RANGE` and the wheel is not coming back: the cap falls
hold     slip beyond `RANGE`, the wheel comes back: the cap stays
return   slip within `RANGE`, or the car slower than `LEAST_SPEED`: the cap rises until it no longer acts

The deficit must grow, so a vehicle speed wrong by a tenth caps nothing. While ABS or ESP report activity the
cap never falls: two controllers would cut the same wheel. This is no ABS: it seeks no optimal slip, has no
yaw control and treats each wheel alone.

Assumption: all constants; found with the simulated vehicle on friction of 0.2 to 1.2.
"""

import math

import numpy as np

from ecu.algorithm.inputs import fresh, usable
from ecu.algorithm.vehicle import corner_speed
from ecu.contract.params import BAR
from ecu.contract.signals import ABS_ACTIVE, ESP_ACTIVE, WHEEL_SPEED
from ecu.jit import Record, kernel

SLIP_GUARD_STATE = np.dtype(
    [
        ("capped", "u1", (4,)),
        ("cap", "f8", (4,)),  # Pa, where capped
        ("lag", "f8", (4,)),  # last known [m/s]
        ("growth", "f8", (4,)),  # m/s^2
        ("age", "f8", (4,)),  # of the lag [s]
        ("acting", "u1"),  # on any wheel
    ],
    align=True,
)

RANGE = 0.10  # slip; braking at 9.5 m/s^2 on a dry road stays below 0.07
GROWING = 10.0  # m/s^2; noise of the wheel speeds and braking as in RANGE stay below 8
RETURNING = -5.0  # m/s^2
GROWTH_LAG = 0.02  # s
LEAST_SPEED = 3.0  # m/s
CUT = 400.0 * BAR  # Pa/s
RETURN = 200.0 * BAR  # Pa/s


@kernel
def _flag(inputs: Record, place: int) -> bool:
    return usable(inputs, place) and inputs.value[place] > 0.5


@kernel
def _follow_lag(params: Record, state: Record, inputs: Record, ground: float, i: int, dt: float) -> None:
    """Update the lag by a new wheel speed; a wheel whose speed is lost has no lag."""
    state.age[i] += dt
    if fresh(inputs, WHEEL_SPEED + i) and state.age[i] > 0.0:
        lag = ground - abs(inputs.value[WHEEL_SPEED + i]) * params.wheel_radius[i]
        gain = 1.0 - math.exp(-state.age[i] / GROWTH_LAG)
        state.growth[i] += gain * ((lag - state.lag[i]) / state.age[i] - state.growth[i])
        state.lag[i], state.age[i] = lag, 0.0
    if not (usable(inputs, WHEEL_SPEED + i) and math.isfinite(state.growth[i])):
        state.lag[i] = state.growth[i] = 0.0


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
    for i in range(4):
        ground = abs(corner_speed(params, estimate, speed, i)) if watching else 0.0
        _follow_lag(params, state, inputs, ground, i, dt)
        slipping = watching and state.lag[i] > RANGE * max(ground, LEAST_SPEED)
        if slipping and not state.capped[i] and state.growth[i] > GROWING:
            state.capped[i], state.cap[i] = 1, sent[i]
        if slipping and state.growth[i] > RETURNING and not other:
            state.cap[i] = max(state.cap[i] - CUT * dt, params.push_out_pressure[i])
        if not slipping:
            state.cap[i] += RETURN * dt
            if not state.cap[i] < wanted[i]:
                state.capped[i] = 0
        if not torque[i] > 0.0:
            state.capped[i] = 0
        state.acting = max(state.acting, state.capped[i])
