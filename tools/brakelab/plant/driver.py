"""Driver model: a script of phases becomes pedals, requests, motor torque and steering.

A phase holds a speed on the motors, coasts, follows a speed trace, or brakes: by deceleration demand, by a
fixed pedal, or by the pedal that keeps a deceleration, like the expert driver of section 6.2.2, who watches
the measured one. It ends after its time or when the speed passes `until_speed`. Demand and pedal move at a
finite rate between phases too. The driver knows mass and resistance of the car and roughly its deceleration
by pedal position; the error is learned.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import BRAKE, CRUISE, FOLLOW, GRAVITY
from brakelab.plant.road import LEVEL, Road, value_at
from brakelab.plant.steering import HANDS_OFF, Steering, steer

PEDAL_TRAVEL: Final = 90.0  # mm. Assumption
SPEED_GAIN: Final = 1.0  # 1/s, of the driver who holds a speed or follows a trace. Assumption
SPEED_PATIENCE: Final = 0.3  # 1/s^2, how fast a lasting error of speed is corrected. Assumption
DECEL_PATIENCE: Final = 1.5  # 1/s, the same for an error of deceleration. Assumption
LARGEST_CORRECTION: Final = 4.0  # m/s^2. Assumption
LOOK_AHEAD: Final = 0.3  # s; covers the brakes' dead time and build-up. Assumption
GLANCE: Final = 1.0  # s over which the trace's acceleration is seen. Assumption
LIFT_OFF_DECEL: Final = 0.4  # m/s^2 that the motors give with both pedals free. Assumption
RELEASE_DECEL: Final = 0.1  # m/s^2, below which the brake pedal is released. Assumption
HOLDING_PEDAL: Final = 30.0  # %, at rest. Assumption
STANDSTILL: Final = 0.05  # m/s
AT_REST: Final = 0.3  # m/s, below which a trace demands standstill. Assumption


class Script(NamedTuple):
    """A scenario in arrays: actions of the driver, and the road."""

    phases: NDArray[Any]
    """PHASE records."""
    road_friction: NDArray[np.float64]
    """Rows of time [s] and friction, shape (n, 2)."""
    grade: NDArray[np.float64]
    """Rows of time [s] and grade [rad], shape (n, 2)."""
    ambient_temperature: float
    blending: bool
    """While brakes are asked for the motors do what the ECU asks; otherwise they rest in braking phases, but
    for `motor_share`."""
    road: Road = LEVEL
    """A description by place goes before one by time."""
    steering: Steering = HANDS_OFF
    trace: NDArray[np.float64] = np.zeros((1, 2))
    """Rows of time [s] in a FOLLOW phase and speed [m/s], shape (n, 2)."""
    wetness: float = 0.0
    """0 dry to 1 rain."""
    motor_share: float = 0.0
    """Of the deceleration asked for in braking, what the motors take as long as they can."""
    fault_cycle: int = -1
    """From this cycle on the tyres' slip stiffness is `fault_stiffness` of what it was."""
    fault_stiffness: float = 1.0
    charge_limit: NDArray[np.float64] = np.empty((0, 2))
    """Rows of time [s] and what the battery takes [W], shape (n, 2); empty: what the car's file says."""


@kernel
def grade_now(script: Script, state: Record) -> float:
    """Return the road's grade [rad] under the car."""
    if len(script.road.grade) > 0:
        return value_at(script.road.grade, state.distance, 1)
    return value_at(script.grade, state.t, 1)


@kernel
def friction_now(script: Script, state: Record) -> float:
    """Return the road's friction under the car, the mean of its sides."""
    friction = script.road.friction
    if len(friction) > 0:
        return 0.5 * (value_at(friction, state.distance, 1) + value_at(friction, state.distance, 2))
    return value_at(script.road_friction, state.t, 1)


@kernel
def pedal_for(decel: float) -> float:
    """Return the pedal position [%] from which a driver expects `decel` [m/s^2].

    60 % gives about 4 m/s^2 (section 5.5). Assumption: progressive, 100 % gives 9.4.
    """
    return min(60.0 * (max(decel, 0.0) / 4.0) ** 0.6, 100.0)


@kernel
def _towards(value: float, target: float, step: float) -> float:
    return value + min(max(target - value, -step), step)


@kernel
def _learn(driver: Record, more: float) -> None:
    """Correct the driver's expectation by `more` [m/s^2]."""
    driver.correction = min(max(driver.correction + more, -LARGEST_CORRECTION), LARGEST_CORRECTION)


@kernel
def _resistance(params: Record, state: Record, grade: float, rolling: bool) -> float:
    """Return drag, grade and, where the car is `rolling`, rolling resistance [N]."""
    weight = params.mass * GRAVITY
    resistance: float = params.drag_factor * state.speed_x * abs(state.speed_x) + weight * math.sin(grade)
    if rolling:
        resistance += params.rolling_resistance * weight
    return resistance


@kernel
def _drive_on(params: Record, state: Record, driver: Record, accel: float, force: float, full: float) -> None:
    """Drive the motors with `force` [N], the accelerator at `accel` of `full` [m/s^2]."""
    for wheel in range(4):
        driver.motor_demand[wheel] = -force * state.rolling_radius[0] * params.motor_share[wheel]
    driver.accelerator_position = min(max(100.0 * accel / full, 0.0), 100.0)


@kernel
def _hold_speed(params: Record, state: Record, driver: Record, phase: Record, grade: float) -> None:
    accel = min(max(SPEED_GAIN * (phase.speed - state.speed_x), -phase.accel), phase.accel)
    force = params.mass * accel + _resistance(params, state, grade, phase.speed > 0.0)
    _drive_on(params, state, driver, accel, force, phase.accel)


@kernel
def _follow(script: Script, params: Record, state: Record, driver: Record, phase: Record, dt: float) -> float:
    """Drive or coast on the motors after the trace; return the pedal [%] for the remainder."""
    trace = script.trace
    soon = driver.elapsed + LOOK_AHEAD
    asked = value_at(trace, driver.elapsed, 1)
    sooner, later = value_at(trace, soon - 0.5 * GLANCE, 1), value_at(trace, soon + 0.5 * GLANCE, 1)
    if max(asked, later, state.speed_x) < AT_REST:
        driver.correction = 0.0
        driver.braking = 1
        return HOLDING_PEDAL
    error = asked - state.speed_x
    accel = (later - sooner) / GLANCE + SPEED_GAIN * error + driver.correction
    force = params.mass * accel + _resistance(params, state, grade_now(script, state), True)
    decel = -force / params.mass
    braking = decel > (RELEASE_DECEL if driver.braking else LIFT_OFF_DECEL)
    if braking != driver.braking:
        driver.braking = braking
        driver.correction = 0.0
    _learn(driver, SPEED_PATIENCE * dt * error)
    if braking:
        return pedal_for(decel)
    _drive_on(params, state, driver, accel, force, phase.accel)
    return 0.0


@kernel
def _keep_decel(state: Record, driver: Record, wanted: float, dt: float) -> float:
    """Return the pedal [%] that brings the measured deceleration to `wanted` [m/s^2]."""
    pedal = pedal_for(wanted + driver.correction)
    if abs(pedal - driver.pedal_position) < 1.0:
        # Only once the pedal is where it was meant to be.
        _learn(driver, DECEL_PATIENCE * dt * (wanted + state.accel_x))
    return pedal


@kernel
def _share(script: Script, params: Record, state: Record, driver: Record) -> None:
    """Split the demanded deceleration between the motors, up to their limits, and the brakes."""
    covered = 0.0
    radius = state.rolling_radius[0]
    torque = script.motor_share * params.mass * driver.asked_decel * radius
    for wheel in range(4):
        taken = min(torque * params.motor_share[wheel], state.motor_limit[wheel])
        driver.motor_demand[wheel] = taken
        covered += taken / (params.mass * radius)
    driver.decel_demand = driver.asked_decel - covered


@kernel
def _next_phase(script: Script, state: Record, driver: Record, dt: float) -> bool:
    """Go to the next phase of the script where one has ended; return whether there is one."""
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
    if not driver.started:
        phase = phases[driver.phase]
        driver.started = 1
        driver.elapsed = 0.0
        driver.correction = 0.0
        driver.braking = phase.kind == BRAKE
        if phase.kind == CRUISE:
            driver.above = phase.speed < phase.until_speed
        else:
            driver.above = state.speed_x > phase.until_speed - STANDSTILL
    driver.elapsed += dt
    return True


@kernel
def drive(script: Script, params: Record, state: Record, driver: Record, dt: float) -> bool:
    """Advance the driver by the coming `dt` [s]; return whether the script is still running.

    In a braking phase the driver does not use the motors, except for the script's `motor_share`.
    """
    if not _next_phase(script, state, driver, dt):
        return False
    phase = script.phases[driver.phase]
    decel = 0.0
    pedal = 0.0
    driver.motor_demand[:] = 0.0
    driver.accelerator_position = 0.0
    if phase.kind == CRUISE:
        _hold_speed(params, state, driver, phase, grade_now(script, state))
    elif phase.kind == FOLLOW:
        pedal = _follow(script, params, state, driver, phase, dt)
    elif phase.kind == BRAKE and not math.isnan(phase.decel):
        decel = phase.decel
    elif phase.kind == BRAKE and not math.isnan(phase.pedal):
        pedal = phase.pedal
    elif phase.kind == BRAKE:
        pedal = _keep_decel(state, driver, phase.kept_decel, dt)
    driver.asked_decel = _towards(driver.asked_decel, decel, phase.ramp * dt)
    driver.decel_demand = driver.asked_decel
    if phase.kind == BRAKE and script.motor_share > 0.0:
        _share(script, params, state, driver)
    driver.decel_demand_valid = 1.0 if driver.asked_decel > 0.0 else 0.0
    driver.pedal_position = _towards(driver.pedal_position, pedal, phase.pedal_rate * dt)
    driver.steering_angle = steer(script.steering, params, state, driver.steering_angle, dt)
    return True
