"""Pressure law: pressure for a torque at the known friction, compensated while braking (5.4–5.8).

    p_0,dem = T / (2 A_k mu_0 r_eff) + p_push                          (5.4), mu_0: base friction
    e = sat_{+-0.3}((mu - mu_0) / mu_0)                                (5.6)
    p* = p_push + (p_0,dem - p_push) (1 - e + e^2)                     corrected 5.7, 5.8: "second-order"
    p* = p_push + (p_0,dem - p_push) / (1 + e)                         exact form: "inverse"

Corrected: the printed form scales the push-out pressure too, and takes T_b where the motors brake as well; T
is the torque of the lining alone (5.4). The second order leaves a torque error of e^3, 2.7 % at the limit,
and reverses beyond it; the inverse has no such limit. "off" takes nominal friction always. The base changes
between applications only, so that a noisy estimate never is a divisor. The friction used moves at most
`FRICTION_RATE` a second: the loop through estimator and hydraulics (26 ms dead time) stays slow against both.
Where a pressure is unavailable, or more is demanded than road and tyres give, it falls no further: that would
gain nothing.

Many linings rub harder as speed falls and start the next application lower again (assumption; the simulated
car's rear linings by a sixth). So the base is the learned friction times the ratio of initial to final
friction of the last application, and the estimate, at first still the final one, is followed once it was
observed for `EARLY_S`.
"""

import math

import numpy as np

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.control.confirmed_friction import (
    CONFIRMED_STATE,
    confirmed_friction,
    least_friction,
)
from ecu.algorithm.estimate import GREATEST_RATIO, LEAST_RATIO, well_observed
from ecu.contract.params import INVERSE, OFF
from ecu.jit import Record, kernel

PRESSURE_LAW_STATE = np.dtype(
    [
        ("base", "f8", (4,)),  # mu_0
        ("used", "f8", (4,)),  # friction in use
        ("mu_override", "f8", (4,)),  # true friction, for the laboratory's ideal controller alone; NaN: off
        ("early", "f8", (4,)),  # friction soon after this application began, 0: not observed yet
        ("start", "f8", (4,)),  # initial over final friction of the last application
        ("confirmed", CONFIRMED_STATE),
        ("cut", "u1", (4,)),  # the last pressure was cut by limiter or slip guard
        ("limit_s", "f8"),  # time for which the deceleration has not been reached
        ("at_limit", "u1"),  # it was too long in this application
        ("beyond_s", "f8"),  # time for which more than the ceiling of grip has been demanded [s]
        ("beyond_grip", "u1"),  # it is too long: pressure is not raised any further
    ],
    align=True,
)

SURE = 0.05
GREATEST_CHANGE = 0.3  # relative to the base (5.6)
FRICTION_RATE = 0.5  # 1/s
LIMIT_S = 0.3
EARLY_S = 0.6  # of observing
LARGEST_START = 0.25  # relative


@kernel
def pressure_for_torque(params: Record, torque: float, mu: float, corner: int) -> float:
    """Return the pressure [Pa] for a brake torque [N m] at friction `mu` (5.4); 0 for no torque."""
    if torque <= 0.0:
        return 0.0
    push_out: float = params.push_out_pressure[corner]
    return torque / (brake_gain(params, corner) * mu) + push_out


@kernel
def _target(params: Record, state: Record, estimate: Record, i: int) -> float:
    """Return the friction of wheel i that the law moves towards."""
    base: float = state.base[i]
    target: float = estimate.mu[i] if math.isfinite(estimate.mu[i]) else base
    if estimate.observed_s[i] < EARLY_S and state.start[i] != 1.0:
        target = state.used[i]
        if state.confirmed.back == 0.0:
            return target
    doubt = max(estimate.sigma[i] / max(estimate.mu[i], 0.1) - SURE, 0.0)
    if target > base:
        target = max(target * math.exp(-2.0 * doubt), base)
    target = confirmed_friction(state.confirmed, target, i, base)
    return min(max(target, LEAST_RATIO * params.mu_nominal[i]), GREATEST_RATIO * params.mu_nominal[i])


@kernel
def follow_friction(params: Record, state: Record, estimate: Record, dt: float) -> None:
    """Move the friction in use towards the estimate, within its admissible range.

    An estimate above the base counts only as far as it is certain: too much torque is preferred to too
    little, and as far as the deceleration confirms it. While it still is the final friction of the last
    application, whose initial friction differed, what is in use stays, less what is taken back.
    """
    if params.compensation == OFF:
        return
    step, confirmed = FRICTION_RATE * dt, state.confirmed
    confirmed.heading = confirmed.in_use = 0.0
    for i in range(4):
        if state.early[i] == 0.0 and estimate.observed_s[i] >= EARLY_S:
            state.early[i] = estimate.mu[i]
        base: float = state.base[i]
        target = _target(params, state, estimate, i)
        if state.cut[i] or state.beyond_grip:
            target = max(target, state.used[i])
        target = least_friction(confirmed, target, state.used[i], i, base, dt)
        state.used[i] += min(max(target - state.used[i], -step), step)
        confirmed.heading += 0.25 * base / target
        confirmed.in_use += 0.25 * base / state.used[i]


@kernel
def set_base(params: Record, state: Record, learned: Record) -> None:
    """Take the learned friction, as far as it is confirmed, as the base; only between applications."""
    for i in range(4):
        base = confirmed_friction(state.confirmed, learned.mu_b[i], i, learned.mu_b[i]) * state.start[i]
        state.base[i] = params.mu_nominal[i] if params.compensation == OFF else base
        state.used[i] = state.base[i]


@kernel
def learn_start(state: Record, estimate: Record, learned: Record) -> None:
    """Store the ratio of initial to final friction of a brake application, where both are known."""
    for i in range(4):
        known = state.early[i] > 0.0 and well_observed(estimate, i)
        if known:
            change = state.early[i] / learned.mu_b[i]
            state.start[i] = min(max(change, 1.0 - LARGEST_START), 1.0 + LARGEST_START)
        state.early[i] = 0.0


@kernel
def friction_in_use(state: Record, corner: int) -> float:
    """Return the friction that the law currently uses."""
    override: float = state.mu_override[corner]
    used: float = state.used[corner]
    return override if math.isfinite(override) else used


@kernel
def compensated_pressure(params: Record, state: Record, pressure: float, corner: int) -> float:
    """Return the pressure [Pa] corrected for the friction in use (corrected 5.8)."""
    base: float = state.base[corner]
    used = friction_in_use(state, corner)
    if params.compensation == INVERSE or math.isfinite(state.mu_override[corner]):
        factor = base / used
    else:
        e = min(max((used - base) / base, -GREATEST_CHANGE), GREATEST_CHANGE)
        factor = 1.0 - e + e * e
    push_out: float = min(params.push_out_pressure[corner], pressure)
    return push_out + (pressure - push_out) * factor


@kernel
def watch_limit(
    params: Record, state: Record, estimate: Record, guarded: Record, slips: bool, decel: float, dt: float
) -> None:
    """Report what has kept the car from the demanded deceleration for `LIMIT_S`.

    More than road and tyres give (`beyond_grip`) explains what is missing; otherwise linings or hydraulics do
    (`at_limit`, until the application ends).

    Args:
        params: `PARAMS`.
        state: `PRESSURE_LAW_STATE`; the last four fields are overwritten.
        estimate: `ESTIMATE`, for friction and the ceiling of grip.
        guarded: wheels held by the slip guard, shape (4,): not a limit of compensation.
        slips: a wheel or an axle is held back by its slip; otherwise the ceiling counts with one sigma more.
        decel: demanded [m/s^2], NaN: unknown.
        dt: time since the last cycle [s].
    """
    asked, mu = decel > 0.0, estimate.mu
    beyond = decel > estimate.grip_limit + (0.0 if slips else estimate.sigma_grip_limit)
    state.beyond_s = state.beyond_s + dt if beyond else 0.0
    state.beyond_grip = 1 if state.beyond_s > LIMIT_S else 0
    short = False
    for i in range(4):
        e = (mu[i] - state.base[i]) / state.base[i]
        faded = params.compensation != OFF and e < -GREATEST_CHANGE
        short = short or faded or (state.cut[i] != 0 and guarded[i] == 0)
    state.limit_s = state.limit_s + dt if short and asked and not beyond else 0.0
    if not asked:
        state.at_limit = 0
    elif state.limit_s > LIMIT_S:
        state.at_limit = 1
