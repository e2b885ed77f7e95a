"""Brake torque of a corner, and its friction mode while none is observed, shared by all observers."""

import math

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.lag import PERIOD
from ecu.contract.params import BAR
from ecu.contract.signals import CALLIPER_PRESSURE, FAULT, HOLDING, NOMINAL, WHEEL_SPEED
from ecu.jit import Record, kernel

CUT_OFF = 16.0  # Hz, of pressure and slip (4.3.3): all signals lag alike
RATE = -2.0 * math.pi * CUT_OFF  # 1/s
DRIVEN = 0.2  # of the brakes' torque: above it the drive acts against the brakes


@kernel
def update_pressure(
    params: Record, state: Record, mu: Record, zero: Record, inputs: Record, dt: float
) -> None:
    """Overwrite the low-passed pressure above push-out [Pa], and the brake torque (A.19).

    Args:
        params: `PARAMS`.
        state: `FRICTION_STATE`, overwritten.
        mu: frictions, shape (4,).
        zero: pressure zeros [bar], shape (4,).
        inputs: `INPUTS`.
        dt: time since the last cycle [s].
    """
    gain = 1.0 - math.exp(RATE * PERIOD) if dt == PERIOD else 1.0 - math.exp(RATE * dt)
    for i in range(4):
        above = BAR * (inputs.value[CALLIPER_PRESSURE + i] - zero[i]) - params.push_out_pressure[i]
        if math.isfinite(above):
            state.pressure[i] += gain * (above - state.pressure[i])
        state.torque[i] = brake_gain(params, i) * mu[i] * max(state.pressure[i], 0.0)


@kernel
def resting_mode(params: Record, state: Record, learned: Record, good: bool, i: int) -> int:
    """Return the mode of a corner that is not observed; `good`: its inputs are usable."""
    if not good and params.mapped[WHEEL_SPEED + i] and params.mapped[CALLIPER_PRESSURE + i]:
        return FAULT
    return HOLDING if state.observed_s[i] > 0.0 or learned.observed_s[i] > 0.0 else NOMINAL


@kernel
def drives_against(motors: float, brakes: float) -> bool:
    """Return whether motors drive with more than a share of the brakes' torque; sums of the wheels [N m]."""
    return motors < -DRIVEN * brakes
