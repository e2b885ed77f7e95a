"""Who brakes a wheel: motor or lining (corrected 5.2, 5.3).

    T_EM,plan = sat_0^T_max(f T_b)        T_EHB = T_b - T_EM,plan          f: 0 off, 1 series, else parallel
    T_EM      = sat_0^T_max(T_b - T_lining)

Corrected: in print max(0, T_EM - T_max) is zero always, T_EM having been cut already.

The linings are asked for what the motor is planned to leave, and the motor gives what they do not give yet
(`friction_torque.py`): it is ten times as fast as the hydraulics (26 ms dead time, 90 % after 0.1 s), so their
sum follows the demand while torque changes hands. For that the plan has to be early: it goes by what the limit
will be `AHEAD` from now where it falls, as it does towards standstill, and lets the motor take more again at a
rate that the hydraulics follow. A motor whose limit or torque is unknown, or which does not give what it is
asked for, is planned for no longer; its demand fades while the linings take over. Under ABS or ESP, and in
reverse, it is zero at once. A motor that failed a braking is tried again in the next one.
"""

import math

import numpy as np

from ecu.estimation.motion import fresh, usable
from ecu.jit import Record, kernel
from ecu.signals import ABS_ACTIVE, ESP_ACTIVE, MOTOR_LIMIT, MOTOR_TORQUE, REVERSE

BLENDING_STATE = np.dtype(
    [
        ("limit", "f8", (4,)),  # last one known [N m]
        ("rate", "f8", (4,)),  # of the limit where it falls, low-passed, <= 0 [N m/s]
        ("ceiling", "f8", (4,)),  # the motor may be asked for this much [N m]
        ("allowed", "f8", (4,)),  # the plan may count on this much [N m]
        ("asked", "f8", (3, 4)),  # motor demands of the last cycles [N m], the newest in row 0
        ("short_s", "f8", (4,)),  # for this long the motor has given too little
        ("lost", "u1", (4,)),  # it gave too little in this braking
        ("lining", "f8", (4,)),  # torque that the lining is asked for [N m]
    ],
    align=True,
)

AHEAD = 0.12  # s: dead time and lag of the hydraulics, and something for the motor to fill
RATE_LAG = 0.5  # share of the old rate that a new sample leaves
RISE = 2000.0  # N m/s, of what the plan counts on
FADE = 6000.0  # N m/s, of the demand to a motor that is planned for no longer
OLDEST_S = 0.05  # of a limit or torque
SHORT_SHARE, SHORT_TORQUE = 0.15, 50.0  # of the demand, N m: the motor gives too little
SHORT_S = 0.03


@kernel
def blends(params: Record) -> bool:
    """Return whether any wheel's motor is to brake."""
    return params.blending[0] + params.blending[2] > 0.0


@kernel
def _current(inputs: Record, place: int) -> bool:
    current: bool = usable(inputs, place) and inputs.age_ns[place] < 1e9 * OLDEST_S
    return current


@kernel
def _watch_motor(state: Record, inputs: Record, i: int, dt: float) -> None:
    """Find a motor that gives less than its limit and all the last demands promised."""
    asked = min(state.asked[0, i], state.asked[1, i], state.asked[2, i], state.limit[i])
    missing = asked - inputs.value[MOTOR_TORQUE + i]
    state.short_s[i] = state.short_s[i] + dt if missing > SHORT_SHARE * asked + SHORT_TORQUE else 0.0
    if state.short_s[i] >= SHORT_S:
        state.lost[i] = 1


@kernel
def _follow_limit(state: Record, inputs: Record, i: int, dt: float) -> None:
    limit: float = inputs.value[MOTOR_LIMIT + i]
    if fresh(inputs, MOTOR_LIMIT + i):
        falling = min((limit - state.limit[i]) / dt, 0.0)
        state.rate[i] = RATE_LAG * state.rate[i] + (1.0 - RATE_LAG) * falling
        state.limit[i] = limit
    state.ceiling[i] = max(limit + dt * state.rate[i], 0.0)
    ahead = max(limit + AHEAD * state.rate[i], 0.0)
    state.allowed[i] = min(ahead, state.allowed[i] + RISE * dt)


@kernel
def update_motors(state: Record, inputs: Record, dt: float) -> None:
    """Overwrite what each motor may be asked for and planned with; `state` is `BLENDING_STATE`."""
    value = inputs.value
    forbidden = value[ABS_ACTIVE] > 0.5 or value[ESP_ACTIVE] > 0.5 or value[REVERSE] > 0.5
    for i in range(4):
        known = _current(inputs, MOTOR_LIMIT + i) and _current(inputs, MOTOR_TORQUE + i) and dt > 0.0
        if known:
            _watch_motor(state, inputs, i, dt)
        if forbidden:
            state.ceiling[i] = state.allowed[i] = 0.0
        elif known and not state.lost[i]:
            _follow_limit(state, inputs, i, dt)
        else:
            state.ceiling[i] = max(state.ceiling[i] - FADE * dt, 0.0)
            state.allowed[i] = 0.0


@kernel
def blend(params: Record, state: Record, torque: float, lining: float, i: int) -> float:
    """Return the torque to ask of a wheel's motor [N m] and set that of its lining, `state.lining`.

    Args:
        params: `PARAMS`.
        state: `BLENDING_STATE`, after `update_motors`.
        torque: demanded of the wheel [N m], may be NaN.
        lining: what the lining will give at the end of the coming cycle [N m].
        i: wheel.
    """
    state.lining[i] = torque
    motor = 0.0
    if not torque > 0.0:
        state.lost[i] = 0
    elif params.blending[i] > 0.0:
        state.lining[i] = torque - min(params.blending[i] * torque, state.allowed[i])
        motor = min(max(torque - lining, 0.0), state.ceiling[i])
    if not math.isfinite(motor):
        motor = 0.0
    state.asked[2, i], state.asked[1, i], state.asked[0, i] = state.asked[1, i], state.asked[0, i], motor
    return motor
