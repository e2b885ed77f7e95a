"""Tyre: rolling radius, steady-state forces, relaxation.

Model. Magic Formula on one normalised slip (similarity method): the linear forces k_x = C_L slip and
k_y = C_S tan(alpha) are combined to k = |(k_x, k_y)|, the force is D sin{C arctan[Bx - E (Bx - arctan Bx)]}
with Bx = k / (C D), in the direction of (k_x, k_y). So the slip stiffness at the origin is C_L and C_S on
any road, and the force stays within Kamm's circle of radius D. Alternatively Burckhardt's law on the slip
s = k / C_L: c_1 (1 - exp(-c_2 s)) - c_3 s, whose c_1 and c_2 follow from stiffness and peak.

Equations. A.4 (corrected: factor r_0), A.11 (corrected: shape factor C, arctan's bracket), A.13 to A.15;
degressive load dependence C_L = c_L F_z (1 - d_c (F_z/F_z0 - 1)), D = mu F_z (1 - d_mu (F_z/F_z0 - 1)).
"""

import math
from typing import Final

from brakelab.plant.jit import Record, kernel

TRANSITION_SPEED: Final = 2.5
"""m/s, below which slip and relaxation refer to this speed instead, finite at standstill. Assumption."""

BURCKHARDT_ITERATIONS: Final = 5
"""To 1e-6 of the peak on a dry road, 1e-7 on ice."""


@kernel
def rolling_radius(free_radius: float, vertical_stiffness: float, load: float) -> float:
    """Return the effective rolling radius [m] under `load` [N] (A.4, corrected: factor r_0 was missing)."""
    angle = math.acos(max(1.0 - max(load, 0.0) / (free_radius * vertical_stiffness), 0.0))
    if angle < 1e-6:
        return free_radius
    return free_radius * math.sin(angle) / angle


@kernel
def degressive(coefficient: float, degression: float, load: float, nominal_load: float) -> float:
    """Return `coefficient` times load [N], growing less than in proportion; at least 40 % of proportion."""
    return coefficient * load * max(1.0 - degression * (load / nominal_load - 1.0), 0.4)


@kernel
def magic_formula(linear_force: float, peak: float, c: float, e: float) -> float:
    """Return the force [N] where a linear tyre had `linear_force` >= 0 [N] (A.11, corrected), peak D [N]."""
    x = linear_force / (c * peak)
    return peak * math.sin(c * math.atan(x - e * (x - math.atan(x))))


@kernel
def burckhardt(linear_force: float, stiffness: float, peak: float, fall: float) -> float:
    """Return the force [N] where a linear tyre had `linear_force` >= 0 [N], by Burckhardt's law.

    `stiffness` [N] per slip at the origin, `peak` [N], `fall` c_3 / c_1. The peak is c_1 (1 - (1 + ln q) / q)
    with q = c_2 / fall and the stiffness c_1 (c_2 - fall): solved by iteration, each gains a digit or more.
    Beyond slip 1 the tyre slides at a constant force.
    """
    c_1 = peak
    c_2 = stiffness / c_1 + fall
    for _ in range(BURCKHARDT_ITERATIONS):
        q = c_2 / fall
        c_1 = peak / (1.0 - (1.0 + math.log(q)) / q)
        c_2 = stiffness / c_1 + fall
    slip = min(linear_force / stiffness, 1.0)
    return c_1 * (-math.expm1(-c_2 * slip) - fall * slip)


@kernel
def stiffnesses(params: Record, wheel: int, load: float) -> tuple[float, float]:
    """Return C_L [N] per slip and C_S [N] per tan(alpha) of a wheel under `load` [N]."""
    nominal = params.nominal_load[wheel]
    return (
        degressive(params.slip_stiffness[wheel], params.stiffness_degression, load, nominal),
        degressive(params.cornering_stiffness[wheel], params.stiffness_degression, load, nominal),
    )


@kernel
def steady_forces(
    params: Record, c_x: float, c_y: float, peak: float, slip: float, slip_angle: float
) -> tuple[float, float, float]:
    """Return F_L, F_S [N] in steady state and dF_L/dslip [N] >= 0 as a secant, for slip and tan(alpha)."""
    k_x, k_y = slip * c_x, slip_angle * c_y
    k = math.hypot(k_x, k_y)
    if k < 1e-9:
        return k_x, k_y, c_x
    if params.burckhardt_fall > 0.0:
        share = burckhardt(k, c_x, peak, params.burckhardt_fall) / k
    else:
        share = magic_formula(k, peak, params.magic_c, params.magic_e) / k
    return share * k_x, share * k_y, max(share * c_x, 0.0)


@kernel
def relaxation_rate(slip_stiffness: float, carcass_stiffness: float, speed: float) -> float:
    """Return 1/tau [1/s] = K |v| / C (A.14): the length C/K is constant, the time shrinks with speed."""
    return carcass_stiffness * max(abs(speed), TRANSITION_SPEED) / slip_stiffness
