"""The ECU's mode and the faults that the inputs show.

starting   until every needed input was seen, at most one second
ready      inputs good, no brake demand
active     brakes are demanded or applied
degraded   a needed input is lost: friction is held or nominal, braking continues
failed     neither pedal, nor its switch, nor demand arrives: demand 0, flagged invalid, the hydraulic
           fallback takes over; not a shadow for which none of them is mapped, since nobody asks it
"""

import numpy as np

from ecu.algorithm.inputs import automated_demand_valid, motor_torque_known, pedal_known, usable
from ecu.contract.faults import (
    DEGRADING,
    HYDRAULICS_NOT_READY,
    IMU_LOST,
    MOTOR_TORQUE_LOST,
    PEDAL_IMPLAUSIBLE,
    PEDAL_LOST,
    PRESSURE_LOST,
    REQUEST_LOST,
    STEERING_LOST,
    WHEEL_SPEED_LOST,
)
from ecu.contract.signals import (
    ACCEL_X,
    ACCEL_Y,
    ACTIVE,
    CALLIPER_PRESSURE,
    DECEL_DEMAND,
    DEGRADED,
    FAILED,
    HYDRAULIC_READY,
    PEDAL_POSITION,
    PEDAL_PRESSED,
    READY,
    STARTING,
    STEERING_ANGLE,
    WHEEL_SPEED,
    YAW_RATE,
)
from ecu.jit import Record, kernel

MODE_STATE = np.dtype([("age_s", "f8"), ("complete", "u1")], align=True)

START_UP = 1.0  # s
PEDAL_REST = 5.0  # %


@kernel
def _lost(params: Record, inputs: Record, place: int) -> bool:
    return params.mapped[place] != 0 and not usable(inputs, place)


@kernel
def _asked_by_nobody(params: Record) -> bool:
    """Return whether this is a shadow without any source of a demand: a recorded car, say."""
    shadow: bool = params.transmit == 0
    return shadow and params.mapped[PEDAL_POSITION] == 0 and params.mapped[DECEL_DEMAND] == 0


@kernel
def input_faults(params: Record, inputs: Record) -> int:
    """Return the fault bits that the inputs as received show."""
    faults = 0
    for i in range(4):
        if not usable(inputs, WHEEL_SPEED + i):
            faults |= WHEEL_SPEED_LOST
        if not usable(inputs, CALLIPER_PRESSURE + i):
            faults |= PRESSURE_LOST
        if not motor_torque_known(inputs, i):
            faults |= MOTOR_TORQUE_LOST
    if not usable(inputs, ACCEL_X):
        faults |= IMU_LOST
    if _lost(params, inputs, PEDAL_POSITION):
        faults |= PEDAL_LOST
    for place in (STEERING_ANGLE, YAW_RATE, ACCEL_Y):
        if _lost(params, inputs, place):
            faults |= STEERING_LOST
    if (
        usable(inputs, PEDAL_POSITION)
        and usable(inputs, PEDAL_PRESSED)
        and inputs.value[PEDAL_POSITION] > PEDAL_REST
        and inputs.value[PEDAL_PRESSED] < 0.5
    ):
        faults |= PEDAL_IMPLAUSIBLE
    if usable(inputs, HYDRAULIC_READY) and inputs.value[HYDRAULIC_READY] < 0.5:
        faults |= HYDRAULICS_NOT_READY
    return faults


@kernel
def request_lost(params: Record, trusted: Record) -> int:
    """Return the fault bit of a request that is unknown, by the inputs with held demands substituted."""
    known = pedal_known(params, trusted) or automated_demand_valid(trusted) or _asked_by_nobody(params)
    return 0 if known else REQUEST_LOST


@kernel
def speaks(params: Record, mode: int) -> bool:
    """Return whether the demands of this cycle are flagged valid."""
    armed: bool = params.transmit != 0
    return armed and mode != STARTING and mode != FAILED


@kernel
def decide_mode(state: Record, faults: int, braking: bool, dt: float) -> int:
    """Return the mode for this cycle's faults."""
    state.age_s += dt
    if (faults & (DEGRADING | REQUEST_LOST)) == 0:
        state.complete = 1
    if not state.complete and state.age_s < START_UP:
        return STARTING
    if faults & REQUEST_LOST:
        return FAILED
    if faults & DEGRADING:
        return DEGRADED
    return ACTIVE if braking else READY
