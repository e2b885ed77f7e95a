"""Slip and the linear tyre model of the observer.

Longitudinal slip (A.6), negative while braking: lambda = (r_w omega - v_L) / max(r_w omega, v_L).

Linear tyre model (4.12): F_L = C_L lambda with C_L = c F_Z (F_Z / F_Z0)^-e. The load proportionality
principle (4.35) is e = 0; real tyres gain less than load, which the thesis names as the reason for its
offset at the rear (section 4.5). Towards the peak the secant F_L / lambda falls by `CURVE` F_L / F_Z: at 40 %
of a peak of 1 a brush tyre has lost 15 %, a Magic Formula with C = 1.6 5 %; the mean of both is taken.

As a function of slip this is F_L = C_L lambda / (1 + CURVE C_L |lambda| / F_Z).

Large slip (section 5.4): Burckhardt's law of dry asphalt, F_Z (c_1 (1 - exp(-c_2 s)) - c_3 s), where it lies
below that, from about 5 % of slip on. Its c_2 = 23.99 is taken for a tyre of C_L = 22 F_Z (assumption) and
scales with stiffness. Combined slip: s^2 = lambda^2 + lambda_y^2 stands for lambda, the force has its
direction, and lambda_y = (a_y / g) F_Z / C_L is the slip that carries the car's lateral acceleration, the
same at all wheels (assumption: a steady turn of a nearly neutral car).
"""

import math

from ecu.contract.params import GRAVITY
from ecu.jit import Record, kernel

# Below this speed slip is not defined [m/s].
MIN_SLIP_SPEED = 1.0
CURVE = 0.25  # loss of the secant per adhesion used
BURCKHARDT = 1.2801, 23.99 / 22.0, 0.52  # c_1, c_2 F_Z / C_L and c_3 of dry asphalt


@kernel
def longitudinal_slip(rolling_speed: float, ground_speed: float) -> float:
    """Return slip (A.6) of a wheel that rolls at r omega over ground [m/s]; 0 below 1 m/s."""
    reference = max(rolling_speed, ground_speed)
    if reference < MIN_SLIP_SPEED:
        return 0.0
    return (rolling_speed - ground_speed) / reference


@kernel
def initial_stiffness(params: Record, corner: int, load: float) -> float:
    """Return the slip stiffness dF_L / dlambda [N] of a wheel at no slip and a load [N]."""
    relative = load / params.static_load[corner]
    return params.slip_stiffness[corner] * load * relative ** -params.stiffness_degression[corner]


@kernel
def slip_stiffness(params: Record, corner: int, load: float, force: float) -> float:
    """Return the secant slip stiffness F_L / lambda [N] of a wheel at a load and about a force [N]."""
    return initial_stiffness(params, corner, load) * max(1.0 - CURVE * abs(force) / load, 0.5)


@kernel
def linear_force(load: float, force: float) -> float:
    """Return the force of a linear tyre [N] at the (small) slip at which this tyre transmits `force` [N]."""
    return force / max(1.0 - CURVE * abs(force) / load, 0.5)


@kernel
def tyre_force(stiffness: float, load: float, slip: float, accel_y: float) -> float:
    """Return the longitudinal force [N] of a tyre at any slip; it has the sign of the slip.

    Args:
        stiffness: initial slip stiffness [N], > 0.
        load: wheel load [N], > 0.
        slip: longitudinal slip (A.6).
        accel_y: of the car [m/s^2].
    """
    start = stiffness / load
    total = math.hypot(slip, accel_y / (GRAVITY * start))
    if total < 1e-9:
        return stiffness * slip
    small = start * total / (1.0 + CURVE * start * total)
    c_1, rise, c_3 = BURCKHARDT
    large = c_1 * (1.0 - math.exp(-rise * start * total)) - c_3 * min(total, 1.0)
    return min(small, large) * load * slip / total
