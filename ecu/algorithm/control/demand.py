"""Deceleration demand: pedal map, automated demand, holding the car at standstill.

a_dem = max(pedal map, valid decel_demand), while the car is held: at least `hold_decel`

A car that has stood for 0.5 s with a brake demand is held until the pedal is back at rest and no automated
demand is left, or until the accelerator is pressed; then the holding demand fades out. It is enough for the
steepest grade of the configuration, see `new_params`. There is no creep function: without a request there is
no brake demand.

A pedal whose position is lost while its switch still works keeps its last position until the switch opens;
one pressed only afterwards demands `SECONDARY_DECEL`.

An automated demand ends at once where `decel_demand_valid` is 0. One that is not available or out of range,
or whose flag is, stays as it was for `DEMAND_GAP` while frames arrive, as one whose frames stay away; then it
is lost.
"""

import math

import numpy as np

from ecu.algorithm.inputs import (
    LEAST_REQUEST,
    MAX_DECEL,
    automated_demand_valid,
    mean_wheel_speed,
    pedal_known,
    pedal_to_decel,
    requested_decel,
    usable,
)
from ecu.contract.faults import DEMAND_LOST
from ecu.contract.params import PEDAL_POINTS
from ecu.contract.signals import (
    ACCELERATOR_POSITION,
    ALIVE,
    DECEL_DEMAND,
    DECEL_DEMAND_VALID,
    PEDAL_POSITION,
    PEDAL_PRESSED,
    USABLE,
    WHEEL_SPEED,
)
from ecu.jit import Record, kernel

DEMAND_STATE = np.dtype(
    [
        ("standing_s", "f8"),  # time at standstill [s]
        ("held", "u1"),
        ("hold", "f8"),  # holding demand [m/s^2], fades in and out
        ("pedal", "f8"),  # last known or assumed position [%]
        ("automated", "f8"),  # last automated demand followed [m/s^2], 0: none, or withdrawn
        ("gap_s", "f8"),  # time since then, without a usable one [s]
    ],
    align=True,
)

STANDSTILL = 0.3  # m/s
STANDING_TIME = 0.5  # s
ACCELERATOR_PRESSED = 3.0  # %
SECONDARY_DECEL = 2.44  # m/s^2, of a secondary braking system (ECE R13-H, Annex 3, 2.2)
DEMAND_GAP = 0.1  # s, time-out of decel_demand
HOLD_RATE = 5.0  # m/s^3: released within 0.7 s, as fast as a foot changes the pedal


@kernel
def _position_for(params: Record, decel: float) -> float:
    """Return the pedal position [%] that demands a deceleration [m/s^2]."""
    x, y = params.pedal_position, params.pedal_decel
    for j in range(1, PEDAL_POINTS):
        if y[j] >= decel and y[j] > y[j - 1]:
            return x[j - 1] + (x[j] - x[j - 1]) * (decel - y[j - 1]) / (y[j] - y[j - 1])
    return x[PEDAL_POINTS - 1]


@kernel
def hold_pedal(params: Record, state: Record, inputs: Record) -> None:
    """Substitute a lost pedal position by the last one, as far as the switch confirms it.

    Args:
        params: `PARAMS`.
        state: `DEMAND_STATE`; `pedal` is overwritten.
        inputs: the trusted `INPUTS`.
    """
    if usable(inputs, PEDAL_POSITION):
        state.pedal = inputs.value[PEDAL_POSITION]
        return
    if not pedal_known(params, inputs):
        return
    if inputs.value[PEDAL_PRESSED] < 0.5:
        state.pedal = 0.0
    elif pedal_to_decel(params, state.pedal) < LEAST_REQUEST:
        state.pedal = _position_for(params, SECONDARY_DECEL)
    inputs.value[PEDAL_POSITION], inputs.verdict[PEDAL_POSITION] = state.pedal, USABLE


@kernel
def hold_automated(state: Record, inputs: Record, dt: float) -> int:
    """Substitute an automated demand that is lost but not withdrawn by the last one; return the fault bit.

    Args:
        state: `DEMAND_STATE`; `automated` and `gap_s` are overwritten.
        inputs: the trusted `INPUTS`.
        dt: time since the last cycle [s].
    """
    withdrawn = usable(inputs, DECEL_DEMAND_VALID) and inputs.value[DECEL_DEMAND_VALID] < 0.5
    if withdrawn or automated_demand_valid(inputs):
        state.automated = 0.0 if withdrawn else inputs.value[DECEL_DEMAND]
        state.gap_s = 0.0
        return 0
    if state.automated < LEAST_REQUEST:
        return 0
    state.gap_s += dt
    arrive = inputs.verdict[DECEL_DEMAND] & inputs.verdict[DECEL_DEMAND_VALID] & ALIVE
    if arrive and state.gap_s < DEMAND_GAP:
        inputs.value[DECEL_DEMAND], inputs.verdict[DECEL_DEMAND] = state.automated, USABLE
        inputs.value[DECEL_DEMAND_VALID], inputs.verdict[DECEL_DEMAND_VALID] = 1.0, USABLE
        return 0
    return DEMAND_LOST


@kernel
def _stands(params: Record, inputs: Record, speed: float) -> bool:
    """Return whether wheels and vehicle speed [m/s, NaN: unknown] indicate standstill."""
    for i in range(4):
        if not usable(inputs, WHEEL_SPEED + i):
            return False
    return mean_wheel_speed(params, inputs) < STANDSTILL and not abs(speed) >= STANDSTILL


@kernel
def update_demand(params: Record, state: Record, inputs: Record, speed: float, dt: float) -> float:
    """Return the deceleration demanded [m/s^2], NaN where neither pedal nor demand is usable.

    Args:
        params: `PARAMS`.
        state: `DEMAND_STATE`, overwritten.
        inputs: `INPUTS`.
        speed: of the vehicle [m/s], NaN: unknown.
        dt: time since the last cycle [s].
    """
    asked = requested_decel(params, inputs)
    if math.isnan(asked):
        return asked
    state.standing_s = state.standing_s + dt if _stands(params, inputs, speed) else 0.0
    driving_off = (
        usable(inputs, ACCELERATOR_POSITION) and inputs.value[ACCELERATOR_POSITION] > ACCELERATOR_PRESSED
    )
    if driving_off or asked < LEAST_REQUEST:
        state.held = 0
    elif state.standing_s >= STANDING_TIME:
        state.held = 1
    target = params.hold_decel if state.held else 0.0
    state.hold += min(max(target - state.hold, -HOLD_RATE * dt), HOLD_RATE * dt)
    held: float = state.hold
    return min(max(asked, held), MAX_DECEL)
