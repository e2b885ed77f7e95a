"""Torque of the lining at a pressure, and its lag behind its demand, which motors can compensate.

Torque is 2 A_k r_eff mu (p - p_0) (A.19) with the friction of the pressure law: only the lag of the pressure
is modelled (`ecu.algorithm.hydraulics`), neither errors of the law nor its limits.
"""

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.control.pressure_law import friction_in_use
from ecu.contract.params import BAR
from ecu.jit import Record, kernel


@kernel
def lining_torque(params: Record, pressure: float, law: Record, i: int) -> float:
    """Return the torque [N m] of a wheel's lining at a pressure [Pa]; `law`: `PRESSURE_LAW_STATE`."""
    pushing = max(pressure - params.push_out_pressure[i], 0.0)
    return brake_gain(params, i) * friction_in_use(law, i) * pushing


@kernel
def lagging_torque(params: Record, pressure: Record, law: Record, wanted: float, i: int) -> float:
    """Return the torque that a wheel's lining lacks of its demand at the end of the coming cycle [N m].

    Args:
        params: `PARAMS`.
        pressure: pressures at the end of the coming cycle [bar], shape (4,).
        law: `PRESSURE_LAW_STATE`, for the friction.
        wanted: pressure demanded now [Pa].
        i: wheel.
    """
    push_out = params.push_out_pressure[i]
    missing = max(wanted - push_out, 0.0) - max(BAR * pressure[i] - push_out, 0.0)
    return brake_gain(params, i) * friction_in_use(law, i) * missing
