"""The gain of a disc brake (A.19)."""

from ecu.jit import Record, kernel


@kernel
def brake_gain(params: Record, i: int) -> float:
    """Return a wheel's brake torque per friction and pressure [N m/Pa], 2 A_k r_eff."""
    gain: float = 2.0 * params.piston_area[i] * params.effective_radius[i]
    return gain
