"""Torque to pressure with the friction known, and its compensation while braking (5.4–5.8).

    p_0,dem = T / (2 A_k mu_0 r_eff) + p_push                          (5.4), mu_0: base friction
    e = sat_{+-0.3}((mu - mu_0) / mu_0)                                (5.6)
    p* = p_push + (p_0,dem - p_push) (1 - e + e^2)                     corrected 5.7, 5.8

Corrected: the printed form scales the push-out pressure too. The base changes between applications only, so
a noisy estimate divides nothing. The friction used moves at most `FRICTION_RATE` a second: the loop through
estimator and hydraulics (26 ms dead time) stays slow against both.
"""

import math

import numpy as np

from ecu.jit import Record, kernel

PRESSURE_LAW_STATE = np.dtype(
    [
        ("base", "f8", (4,)),  # mu_0
        ("used", "f8", (4,)),  # friction in use
        ("mu_override", "f8", (4,)),  # the laboratory's ideal controller is given the true friction; NaN: off
    ],
    align=True,
)

GREATEST_CHANGE = 0.3  # relative to the base (5.6)
FRICTION_RATE = 0.5  # 1/s
LEFT_RIGHT_SHARE = 0.10  # of the axle's demand


@kernel
def pressure_for_torque(params: Record, torque: float, mu: float, corner: int) -> float:
    """Return the pressure [Pa] for a brake torque [N m] at friction `mu` (5.4); 0 for no torque."""
    if torque <= 0.0:
        return 0.0
    lever: float = 2.0 * params.piston_area[corner] * params.effective_radius[corner]
    push_out: float = params.push_out_pressure[corner]
    return torque / (lever * mu) + push_out


@kernel
def follow_friction(state: Record, mu: Record, dt: float) -> None:
    """Move the friction in use towards the estimate, within +-30 % of the base."""
    step = FRICTION_RATE * dt
    for i in range(4):
        base: float = state.base[i]
        target = mu[i] if math.isfinite(mu[i]) else base
        target = min(max(target, (1.0 - GREATEST_CHANGE) * base), (1.0 + GREATEST_CHANGE) * base)
        state.used[i] += min(max(target - state.used[i], -step), step)


@kernel
def set_base(state: Record, learned: Record) -> None:
    """Take the learned friction as the base; only between applications."""
    for i in range(4):
        state.base[i] = learned.mu_b[i]
        state.used[i] = learned.mu_b[i]


@kernel
def friction_in_use(state: Record, corner: int) -> float:
    """Return the friction that the law counts on now."""
    override: float = state.mu_override[corner]
    used: float = state.used[corner]
    return override if math.isfinite(override) else used


@kernel
def compensated_pressure(params: Record, state: Record, pressure: float, corner: int) -> float:
    """Return the pressure [Pa] corrected for the friction in use (corrected 5.8)."""
    base: float = state.base[corner]
    if math.isfinite(state.mu_override[corner]):
        factor = base / state.mu_override[corner]
    else:
        e = (state.used[corner] - base) / base
        factor = 1.0 - e + e * e
    push_out: float = min(params.push_out_pressure[corner], pressure)
    compensated: float = push_out + (pressure - push_out) * factor
    return compensated


@kernel
def level_left_right(pressures: Record, base: Record) -> None:
    """Keep what compensation adds to the left/right difference within 10 % of the axle's mean demand."""
    for left in (0, 2):
        right = left + 1
        added = (pressures[left] - base[left]) - (pressures[right] - base[right])
        limit = LEFT_RIGHT_SHARE * 0.5 * (base[left] + base[right])
        excess = 0.0
        if added > limit:
            excess = added - limit
        elif added < -limit:
            excess = added + limit
        pressures[left] -= 0.5 * excess
        pressures[right] += 0.5 * excess
