"""The driver and the road: a script of phases becomes requests and motor torque, tables become the road.

A phase holds a speed on the motors, coasts, or brakes by deceleration demand or pedal. It ends after its time
or when the speed passes `until_speed`. Demand and pedal move at a finite rate between phases too.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import BRAKE, CRUISE, GRAVITY
from brakelab.plant.road import LEVEL, Road, at_place

PEDAL_RATE: Final = 150.0 / 90.0 * 100.0  # %/s: 150 mm/s (section 4.5) over 90 mm of travel (assumption)
SPEED_GAIN: Final = 1.0  # 1/s, of the driver who holds a speed. Assumption
STANDSTILL: Final = 0.05  # m/s


class Script(NamedTuple):
    """A scenario in arrays: what driver and road do."""

    phases: NDArray[Any]
    """PHASE records."""
    road_friction: NDArray[np.float64]
    """Rows of time [s] and friction, shape (n, 2)."""
    grade: NDArray[np.float64]
    """Rows of time [s] and grade [rad], shape (n, 2)."""
    ambient_temperature: float
    blending: bool
    """In braking the motors do what the ECU asks; otherwise they rest."""
    road: Road = LEVEL
    """What is described by place goes before what is described by time."""


@kernel
def at_time(table: NDArray[np.float64], t: float) -> float:
    """Return the table's value at `t` [s]: linear between its rows, constant outside."""
    value: float = table[0, 1]
    for row in range(1, len(table)):
        part = (t - table[row - 1, 0]) / (table[row, 0] - table[row - 1, 0])
        value += min(max(part, 0.0), 1.0) * (table[row, 1] - table[row - 1, 1])
    return value


@kernel
def grade_now(script: Script, state: Record) -> float:
    """Return the road's grade [rad] under the car."""
    if len(script.road.grade) > 0:
        return at_place(script.road.grade, state.distance, 1)
    return at_time(script.grade, state.t)


@kernel
def friction_now(script: Script, state: Record) -> float:
    """Return the road's friction under the car, the mean of its sides."""
    friction = script.road.friction
    if len(friction) > 0:
        return 0.5 * (at_place(friction, state.distance, 1) + at_place(friction, state.distance, 2))
    return at_time(script.road_friction, state.t)


@kernel
def _towards(value: float, target: float, step: float) -> float:
    return value + min(max(target - value, -step), step)


@kernel
def _hold_speed(params: Record, state: Record, driver: Record, phase: Record, grade: float) -> None:
    accel = min(max(SPEED_GAIN * (phase.speed - state.speed_x), -phase.accel), phase.accel)
    weight = params.mass * GRAVITY
    resistance = params.drag_factor * state.speed_x * abs(state.speed_x) + weight * math.sin(grade)
    if phase.speed > 0.0:
        resistance += params.rolling_resistance * weight
    torque = (params.mass * accel + resistance) * state.rolling_radius[0]
    for wheel in range(4):
        driver.motor_demand[wheel] = -torque * params.motor_share[wheel]
    driver.accelerator_position = min(max(100.0 * accel / phase.accel, 0.0), 100.0)


@kernel
def drive(script: Script, params: Record, state: Record, driver: Record, dt: float) -> bool:
    """Let the driver act for the coming `dt` [s]; return whether the script is still running.

    In a braking phase the driver leaves the motors alone.
    """
    phases = script.phases
    if driver.phase < len(phases) and driver.started:
        phase = phases[driver.phase]
        threshold = max(phase.until_speed, STANDSTILL)
        passed = state.speed_x <= threshold if driver.above else state.speed_x >= threshold
        timed_out = driver.elapsed >= phase.seconds - 0.5 * dt
        if (passed and not math.isnan(phase.until_speed)) or timed_out:
            driver.phase += 1
            driver.started = 0
    if driver.phase >= len(phases):
        return False
    phase = phases[driver.phase]
    if not driver.started:
        driver.started = 1
        driver.elapsed = 0.0
        driver.above = state.speed_x > phase.until_speed - STANDSTILL
    driver.elapsed += dt

    by_demand = phase.kind == BRAKE and not math.isnan(phase.decel)
    decel = phase.decel if by_demand else 0.0
    pedal = phase.pedal if phase.kind == BRAKE and not by_demand else 0.0
    driver.decel_demand = _towards(driver.decel_demand, decel, phase.ramp * dt)
    driver.decel_demand_valid = 1.0 if driver.decel_demand > 0.0 else 0.0
    driver.pedal_position = _towards(driver.pedal_position, pedal, PEDAL_RATE * dt)
    driver.accelerator_position = 0.0
    if phase.kind == CRUISE:
        _hold_speed(params, state, driver, phase, grade_now(script, state))
    else:
        driver.motor_demand[:] = 0.0
    return True
