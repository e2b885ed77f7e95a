"""The last word before the bus: a limiter that trusts nobody.

For each corner, given the demand of the uncompensated law and the compensated one:

1. not finite, or moving against the uncompensated demand: the uncompensated demand counts until the
   compensated one comes back;
2. T(p, nominal friction) stays within 0.6–1.6 of the torque demanded;
3. 0–180 bar, and no more than the accumulator holds or the slip guard lets through;
4. rise at most `max_pressure_rate` (at least 1500 bar/s: an emergency stop is not delayed); a fall is
   unlimited while the demand falls or to stay below 2 and 3, and as slow as a rise while it does not.

Small on purpose, so that it can be tested exhaustively.
"""

import math

import numpy as np

from ecu.estimation.motion import usable
from ecu.jit import Record, kernel
from ecu.params import BAR
from ecu.signals import ACCUMULATOR_PRESSURE

LIMITER_STATE = np.dtype(
    [
        ("pressure", "f8", (4,)),  # last output [Pa]
        ("uncompensated", "f8", (4,)),  # last uncompensated demand [Pa]
        ("wanted", "f8", (4,)),  # last compensated demand [Pa]
        ("limited", "u1"),
        ("starved", "u1"),  # the accumulator holds less than is demanded
    ],
    align=True,
)

LEAST_TORQUE, GREATEST_TORQUE = 0.6, 1.6
# A demand that rises while its compensated twin falls by more than this in one cycle is a fault [Pa].
AGAINST_DEMAND = 5e5
EMPTY = 10.0 * BAR  # far below the gas pressure of any accumulator


@kernel
def reads_empty(inputs: Record) -> bool:
    """Return whether an accumulator tells a pressure at which nothing would brake."""
    told: bool = usable(inputs, ACCUMULATOR_PRESSURE)
    return told and BAR * inputs.value[ACCUMULATOR_PRESSURE] <= EMPTY


@kernel
def available_pressure(params: Record, inputs: Record) -> float:
    """Return the highest pressure [Pa] that the hydraulics can give: the accumulator's, where it is known.

    One that reads empty limits nothing: if it is, there is nothing to hold back; if the sensor lies, all is.
    """
    available: float = params.max_pressure
    if usable(inputs, ACCUMULATOR_PRESSURE) and not reads_empty(inputs):
        available = min(BAR * inputs.value[ACCUMULATOR_PRESSURE], available)
    return available


@kernel
def limit_pressure(
    params: Record,
    state: Record,
    corner: int,
    wanted: float,
    uncompensated: float,
    torque: float,
    ceiling: float,
    dt: float,
) -> float:
    """Return the pressure [Pa] that may be sent; all arguments may be NaN.

    Args:
        params: `PARAMS`.
        state: `LIMITER_STATE`, overwritten.
        corner: 0–3.
        wanted: compensated pressure [Pa].
        uncompensated: pressure by the base friction [Pa].
        torque: friction torque demanded of the corner [N m].
        ceiling: highest pressure that the corner may have [Pa]; what cannot be one counts as `max_pressure`.
        dt: time since the last cycle [s].
    """
    if not 0.0 <= ceiling <= params.max_pressure:
        ceiling = params.max_pressure
    if not (math.isfinite(torque) and torque > 0.0):
        state.pressure[corner] = state.uncompensated[corner] = state.wanted[corner] = 0.0
        return 0.0
    lever = 2.0 * params.piston_area[corner] * params.effective_radius[corner]
    torque_pressure = torque / (lever * params.mu_nominal[corner])
    push_out = params.push_out_pressure[corner]
    if not (math.isfinite(uncompensated) and uncompensated >= 0.0):
        uncompensated = push_out + torque_pressure
    demand_change = uncompensated - state.uncompensated[corner]
    wanted_change = wanted - state.wanted[corner]
    against = state.wanted[corner] > 0.0 and (
        (demand_change >= 0.0 and wanted_change < -AGAINST_DEMAND)
        or (demand_change <= 0.0 and wanted_change > AGAINST_DEMAND)
    )
    state.uncompensated[corner] = uncompensated
    if math.isfinite(wanted) and not against:
        state.wanted[corner] = pressure = wanted
    else:
        pressure = uncompensated
        state.limited = 1

    low = min(push_out + LEAST_TORQUE * torque_pressure, params.max_pressure)
    high = min(push_out + GREATEST_TORQUE * torque_pressure, params.max_pressure)
    bounded: float = min(max(pressure, low), high)
    if abs(bounded - pressure) > 1.0:
        state.limited = 1
    bounded, high = min(bounded, ceiling), min(high, ceiling)

    last = state.pressure[corner]
    if not 0.0 <= last <= params.max_pressure:
        last = 0.0
    step = params.max_pressure_rate * dt if 0.0 < dt < 1.0 else 0.0
    if bounded > last + step:
        bounded = last + step
    elif bounded < last - step and demand_change >= 0.0:
        bounded = min(last - step, high)
    state.pressure[corner] = bounded
    return bounded
