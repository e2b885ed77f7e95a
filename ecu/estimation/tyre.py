"""Tyre kinematics and the linear tyre model of the observer.

Rolling radius (A.4; corrected: the printed form lacks the factor r_0, without which F_Z -> 0 gives 1)

    r_w = r_0 sin(theta) / theta,   theta = arccos(1 - F_Z / (r_0 K_Z))

so that the radius falls by about F_Z / (3 K_Z): 1.2 mm under the load transfer of 4 m/s^2, where slip is 2 %.

Longitudinal slip (A.6), negative while braking: lambda = (r_w omega - v_L) / max(r_w omega, v_L).

Linear tyre model (4.12): F_L = C_L lambda with C_L = c F_Z (F_Z / F_Z0)^-e. The load proportionality
principle (4.35) is e = 0; real tyres gain less than load, which the thesis names as the reason for its
offset at the rear (section 4.5). Towards the peak the secant F_L / lambda falls by `CURVE` F_L / F_Z: at 40 %
of a peak of 1 a brush tyre has lost 15 %, a Magic Formula with C = 1.6 5 %; the mean of both is taken.
"""

import math

from ecu.jit import Record, kernel

# Below this speed slip is not defined [m/s].
MIN_SLIP_SPEED = 1.0
CURVE = 0.25  # loss of the secant per adhesion used


@kernel
def rolling_radius(load: float, unloaded_radius: float, vertical_stiffness: float) -> float:
    """Return the effective rolling radius [m] for a wheel load [N] (A.4, corrected); r_0 without load."""
    deflection = max(load, 0.0) / (unloaded_radius * vertical_stiffness)
    if deflection < 1e-9:
        return unloaded_radius
    theta = math.acos(1.0 - min(deflection, 0.5))
    return unloaded_radius * math.sin(theta) / theta


@kernel
def longitudinal_slip(rolling_speed: float, ground_speed: float) -> float:
    """Return slip (A.6) of a wheel that rolls at r omega over ground [m/s]; 0 below 1 m/s."""
    reference = max(rolling_speed, ground_speed)
    if reference < MIN_SLIP_SPEED:
        return 0.0
    return (rolling_speed - ground_speed) / reference


@kernel
def slip_stiffness(params: Record, corner: int, load: float, force: float) -> float:
    """Return the secant slip stiffness F_L / lambda [N] of a wheel at a load and about a force [N]."""
    relative = load / params.static_load[corner]
    stiffness: float = params.slip_stiffness[corner] * load * relative ** -params.stiffness_degression[corner]
    return stiffness * max(1.0 - CURVE * abs(force) / load, 0.5)
