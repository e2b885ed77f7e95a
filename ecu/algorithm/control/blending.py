"""Brake blending: division of a wheel's torque between motor and lining (corrected 5.2, 5.3).

    T_EM,plan = sat_0^T_max(f T_b)        T_EHB = T_b - T_EM,plan          f: 0 off, 1 series, else parallel
    T_EM      = sat_0^T_max(T_EM,plan + torque that the lining still lacks of T_EHB)

Corrected: the printed max(0, T_EM - T_max) is always zero, since T_EM is limited already.

The lining demand is the torque that the plan leaves, and the motor adds the torque that the linings still
lack (`friction_torque.py`): it is ten times as fast as the hydraulics (26 ms dead time, 90 % after 0.1 s), so
their sum follows the demand while torque changes hands. The plan must therefore lead: it uses limit and
demand predicted `AHEAD` from now where one falls or the other rises. Towards standstill the limit fades with
the speed below `fade_speed`, which is known before it begins. The motor takes more again at a rate that the
hydraulics follow. Where the plan drops, the last part of the linings' share comes later: the pressure
overshoots a step by 6 %, and a motor that is no longer available cannot compensate for that.

A motor whose limit or torque is unknown, or whose torque falls short of its demand, leaves the plan; its
demand fades, within the limit that it reports, while the linings take over. It is tried again in the next
brake application. Under ABS or ESP, in reverse and at a wheel that the slip guard holds, the motor demand
drops to zero at once.
"""

import math

import numpy as np

from ecu.algorithm.inputs import current, fresh, others_brake, usable
from ecu.algorithm.lag import lag_gain, settled
from ecu.contract.signals import MOTOR_LIMIT, MOTOR_TORQUE, REVERSE
from ecu.jit import Record, kernel

BLENDING_STATE = np.dtype(
    [
        ("limit", "f8", (4,)),  # last known value [N m]
        ("fall", "f8", (4,)),  # of the limit, low-passed [N m/s]
        ("torque", "f8", (4,)),  # last demand [N m]
        ("rise", "f8", (4,)),  # of the demand, low-passed [N m/s]
        ("ceiling", "f8", (4,)),  # greatest motor torque demand [N m]
        ("allowed", "f8", (4,)),  # greatest motor torque planned [N m]
        ("asked", "f8", (3, 4)),  # motor demands of the last cycles [N m], the newest in row 0
        ("short_s", "f8", (4,)),  # time for which the motor has given too little
        ("lost", "u1", (4,)),  # it gave too little in this application
        ("slow", "f8", (4,)),  # plan, low-passed [N m]
        ("lining", "f8", (4,)),  # torque demanded of the lining [N m]
        ("plan", "f8", (4,)),  # rest of the demand [N m]
    ],
    align=True,
)

AHEAD = 0.12  # s: dead time and lag of usual hydraulics, and a margin for the motor
RATE_GAIN = 0.5  # weight of a new sample in a rate
TAKEN = 2000.0  # N m/s, rise of the planned torque
FADE = 6000.0  # N m/s, of the demand to a motor that has left the plan
LATER, LATER_S = 0.16, 0.06  # -, s: settles a step of (A.17) within 1 % in 0.11 s instead of 0.18 s
OLDEST_S = 0.05  # of a limit or torque
SHORT_SHARE, SHORT_TORQUE = 0.15, 50.0  # of the demand, N m: beyond it the motor gives too little
SHORT_S = 0.03


@kernel
def blends(params: Record) -> bool:
    """Return whether any wheel's motor is to brake."""
    return params.blending[0] + params.blending[2] > 0.0


@kernel
def _watch_motor(state: Record, inputs: Record, i: int, dt: float) -> None:
    """Detect a motor that gives less than its limit and all recent demands allow."""
    asked = min(state.asked[0, i], state.asked[1, i], state.asked[2, i], state.limit[i])
    missing = asked - inputs.value[MOTOR_TORQUE + i]
    short = asked > 0.0 and missing > SHORT_SHARE * asked + SHORT_TORQUE
    state.short_s[i] = state.short_s[i] + dt if short else 0.0
    if state.short_s[i] >= SHORT_S:
        state.lost[i] = 1


@kernel
def _follow_limit(state: Record, inputs: Record, fading: float, ahead_s: float, i: int, dt: float) -> None:
    """Update the motor's limit; `fading`: share that the fade at low speed will leave of it."""
    limit: float = inputs.value[MOTOR_LIMIT + i]
    if fresh(inputs, MOTOR_LIMIT + i):
        fall = max((state.limit[i] - limit) / dt, 0.0)
        state.fall[i] = max(fall, settled(state.fall[i] + RATE_GAIN * (fall - state.fall[i])))
        state.limit[i] = limit
    state.ceiling[i] = max(limit - dt * state.fall[i], 0.0)
    ahead = max(min(limit - ahead_s * state.fall[i], fading * limit), 0.0)
    state.allowed[i] = min(ahead, state.allowed[i] + TAKEN * dt)


@kernel
def _fading(params: Record, speed: float, decel: float, ahead_s: float) -> float:
    """Return the share left of a motor's present limit when it fades below `fade_speed`."""
    if not (params.fade_speed > 0.0 and speed > params.fade_speed and decel > 0.0):
        return 1.0
    return min(max(speed - ahead_s * decel, 0.0) / params.fade_speed, 1.0)


@kernel
def update_motors(
    params: Record,
    state: Record,
    inputs: Record,
    guarded: Record,
    speed: float,
    decel: float,
    slowness: float,
    dt: float,
) -> None:
    """Overwrite each motor's greatest demand and greatest planned torque.

    Args:
        params: `PARAMS`.
        state: `BLENDING_STATE`, overwritten.
        inputs: `INPUTS`.
        guarded: wheels whose lining is held back because they slip, shape (4,).
        speed: of the vehicle [m/s].
        decel: demanded [m/s^2], may be NaN.
        slowness: of the hydraulics.
        dt: time since the last cycle [s].
    """
    value = inputs.value
    ahead_s = AHEAD * slowness
    fading = _fading(params, speed, decel, ahead_s)
    forbidden = others_brake(inputs) or value[REVERSE] > 0.5
    for i in range(4):
        known = (
            current(inputs, MOTOR_LIMIT + i, OLDEST_S)
            and current(inputs, MOTOR_TORQUE + i, OLDEST_S)
            and dt > 0.0
        )
        if known:
            _watch_motor(state, inputs, i, dt)
        if forbidden or guarded[i]:
            state.ceiling[i] = state.allowed[i] = 0.0
        elif known and not state.lost[i]:
            _follow_limit(state, inputs, fading, ahead_s, i, dt)
        else:
            if usable(inputs, MOTOR_LIMIT + i):
                state.ceiling[i] = min(state.ceiling[i], value[MOTOR_LIMIT + i])
            state.ceiling[i] = max(state.ceiling[i] - FADE * dt, 0.0)
            state.allowed[i] = 0.0


@kernel
def share_torque(params: Record, state: Record, torque: Record, slowness: float, dt: float) -> None:
    """Overwrite the torque demanded of the linings and planned for the motors.

    Args:
        params: `PARAMS`.
        state: `BLENDING_STATE`, after `update_motors`.
        torque: demanded of the wheels [N m], shape (4,); may be NaN.
        slowness: of the hydraulics.
        dt: time since the last cycle [s].
    """
    gain = lag_gain(dt, LATER_S * slowness)
    for i in range(4):
        demand = max(torque[i], 0.0) if math.isfinite(torque[i]) else 0.0
        rise = max((demand - state.torque[i]) / dt, 0.0) if dt > 0.0 else 0.0
        state.rise[i] = settled(state.rise[i] + RATE_GAIN * (rise - state.rise[i]))
        state.torque[i] = demand
        allowed = max(state.allowed[i] - AHEAD * slowness * state.rise[i], 0.0)
        plan = min(params.blending[i] * demand, allowed)
        later = LATER * max(state.slow[i] - plan, 0.0)
        state.slow[i] = settled(state.slow[i] + gain * (plan - state.slow[i]))
        state.plan[i] = min(plan + later, demand)
        state.lining[i] = torque[i] - state.plan[i]
        if demand == 0.0:
            state.lost[i] = 0


@kernel
def motor_torque_demand(params: Record, state: Record, lag: float, i: int) -> float:
    """Return the demand to a wheel's motor [N m]; `lag` [N m] is the torque its lining still lacks."""
    motor: float = min(max(state.plan[i] + lag, 0.0), state.torque[i], state.ceiling[i])
    if not (params.blending[i] > 0.0 and math.isfinite(motor)):
        motor = 0.0
    state.asked[2, i], state.asked[1, i], state.asked[0, i] = state.asked[1, i], state.asked[0, i], motor
    return motor
