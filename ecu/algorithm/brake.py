"""Disc brake: torque per pressure (A.19)."""

from ecu.contract.params import BAR
from ecu.jit import Record, kernel


@kernel
def brake_gain(params: Record, i: int) -> float:
    """Return a wheel's brake torque per friction and pressure [N m/Pa], 2 A_k r_eff."""
    return 2.0 * params.piston_area[i] * params.effective_radius[i]


@kernel
def brake_gain_per_bar(params: Record, i: int) -> float:
    """Return brake torque per friction and pressure [N m/bar] of a wheel."""
    return BAR * brake_gain(params, i)
