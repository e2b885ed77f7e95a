"""Queries of the inputs: availability of signals, motor torques, brake activity, demands.

All functions read `INPUTS` alone, as received or as masked by `monitoring/sensors.py`.
"""

import math

from ecu.contract.params import PEDAL_POINTS
from ecu.contract.signals import (
    ABS_ACTIVE,
    ACCELERATOR_POSITION,
    CALLIPER_PRESSURE,
    DECEL_DEMAND,
    DECEL_DEMAND_VALID,
    ESP_ACTIVE,
    MOTOR_TORQUE,
    PEDAL_POSITION,
    PEDAL_PRESSED,
    USABLE,
    WHEEL_SPEED,
)
from ecu.jit import Record, kernel

MAX_DECEL = 12.0  # m/s^2: beyond the adhesion of any road car
OVERSLEPT_S = 0.1  # longer cycle: what happened in it is unknown
LEAST_REQUEST = 0.05  # m/s^2, below it no brake is demanded
ACCELERATES = 2.0  # % of the accelerator's travel


@kernel
def usable(inputs: Record, place: int) -> bool:
    """Return whether an input is alive, valid and finite."""
    return (inputs.verdict[place] & USABLE) == USABLE and math.isfinite(inputs.value[place])


@kernel
def fresh(inputs: Record, place: int) -> bool:
    """Return whether a valid sample of an input arrived in this cycle."""
    return inputs.new[place] != 0 and math.isfinite(inputs.value[place])


@kernel
def current(inputs: Record, place: int, oldest_s: float) -> bool:
    """Return whether an input is usable and younger than `oldest_s` [s], not held over a gap."""
    young: bool = inputs.age_ns[place] < 1e9 * oldest_s
    return usable(inputs, place) and young


@kernel
def others_brake(inputs: Record) -> bool:
    """Return whether ABS or ESP report activity: pressures then differ from those demanded."""
    return inputs.value[ABS_ACTIVE] > 0.5 or inputs.value[ESP_ACTIVE] > 0.5


@kernel
def motor_torque(inputs: Record, corner: int) -> float:
    """Return the motor torque [N m] of a wheel, positive regenerates; 0 where none is reported."""
    place = MOTOR_TORQUE + corner
    return inputs.value[place] if usable(inputs, place) else 0.0


@kernel
def motor_torque_known(inputs: Record, corner: int) -> bool:
    """Return whether motor torque is reported, or was never above zero: a car without such motors."""
    place = MOTOR_TORQUE + corner
    return usable(inputs, place) or inputs.value[place] == 0.0


@kernel
def share_pressures(params: Record, inputs: Record) -> None:
    """Give a wheel whose pressure is not received that of another, of its own axle if there is one."""
    for i in range(CALLIPER_PRESSURE, CALLIPER_PRESSURE + 4):
        if params.mapped[i] or params.transmit:
            continue
        for across in range(1, 4):
            other = CALLIPER_PRESSURE + ((i - CALLIPER_PRESSURE) ^ across)
            if params.mapped[other]:
                inputs.value[i], inputs.new[i] = inputs.value[other], inputs.new[other]
                inputs.age_ns[i], inputs.verdict[i] = inputs.age_ns[other], inputs.verdict[other]
                break


@kernel
def wheels_mapped(params: Record) -> bool:
    """Return whether any wheel speed is received at all."""
    mapped = 0
    for i in range(4):
        mapped += params.mapped[WHEEL_SPEED + i]
    return mapped > 0


@kernel
def no_wheel_known(inputs: Record) -> bool:
    """Return whether no wheel speed is usable."""
    known = False
    for i in range(4):
        known = known or usable(inputs, WHEEL_SPEED + i)
    return not known


@kernel
def mean_wheel_speed(params: Record, inputs: Record) -> float:
    """Return the mean speed of the wheels [m/s] whose samples are usable, unsigned; NaN: fewer than two."""
    total, wheels = 0.0, 0
    for i in range(4):
        if usable(inputs, WHEEL_SPEED + i):
            total += abs(inputs.value[WHEEL_SPEED + i]) * params.wheel_radius[i]
            wheels += 1
    return total / wheels if wheels > 1 else math.nan


@kernel
def driver_accelerates(inputs: Record) -> bool:
    """Return whether the accelerator is known to be pressed."""
    return usable(inputs, ACCELERATOR_POSITION) and inputs.value[ACCELERATOR_POSITION] > ACCELERATES


@kernel
def pedal_to_decel(params: Record, position: float) -> float:
    """Return the deceleration [m/s^2] of a pedal position [%]: linear between the points of the map."""
    x, y = params.pedal_position, params.pedal_decel
    decel: float = y[0]
    for j in range(1, PEDAL_POINTS):
        if position > x[j - 1] and x[j] > x[j - 1]:
            decel = y[j - 1] + (y[j] - y[j - 1]) * min((position - x[j - 1]) / (x[j] - x[j - 1]), 1.0)
    return decel


@kernel
def pedal_known(params: Record, inputs: Record) -> bool:
    """Return whether the pedal's position, or at least its switch, is received."""
    switch = params.mapped[PEDAL_POSITION] != 0 and usable(inputs, PEDAL_PRESSED)
    return usable(inputs, PEDAL_POSITION) or switch


@kernel
def automated_demand_valid(inputs: Record) -> bool:
    """Return whether an automated driver demands a deceleration and flags it valid."""
    return (
        usable(inputs, DECEL_DEMAND)
        and usable(inputs, DECEL_DEMAND_VALID)
        and inputs.value[DECEL_DEMAND_VALID] > 0.5
    )


@kernel
def requested_decel(params: Record, inputs: Record) -> float:
    """Return the deceleration demanded [m/s^2], NaN where neither pedal nor automated demand is usable."""
    decel = math.nan
    if usable(inputs, PEDAL_POSITION):
        decel = pedal_to_decel(params, inputs.value[PEDAL_POSITION])
    if automated_demand_valid(inputs):
        asked = inputs.value[DECEL_DEMAND]
        decel = asked if math.isnan(decel) else max(decel, asked)
    return min(max(decel, 0.0), MAX_DECEL) if math.isfinite(decel) else math.nan
