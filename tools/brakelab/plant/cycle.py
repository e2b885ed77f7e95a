"""One 10 ms cycle of the simulated vehicle: actuator commands, then ten steps of the car.

Fallback: when the pressure demand is flagged invalid, or none was accepted for 30 ms, the hydraulics brake on
their own: equal pressure on all wheels in proportion to the driver's demand, with nominal friction.
"""

from typing import Final

from brakelab.plant.driver import Script
from brakelab.plant.jit import Record, kernel
from brakelab.plant.road import is_described, set_road, value_at
from brakelab.plant.vehicle import STEP, advance

CYCLE: Final = 0.010  # s
STEPS: Final = 10
DEMAND_TIMEOUT: Final = 0.030  # s
FULL_PEDAL_DECEL: Final = 10.0  # m/s^2 at 100 % in fallback. Assumption
BAR: Final = 1e5  # Pa


@kernel
def set_commands(
    script: Script, params: Record, state: Record, driver: Record, demand: Record, commands: Record
) -> None:
    """Set the actuators for the coming cycle, and the road as far as it is described by time."""
    heard = demand.pressure_valid == 1 and demand.pressure_age < DEMAND_TIMEOUT
    decel = max(driver.decel_demand, 0.01 * driver.pedal_position * FULL_PEDAL_DECEL)
    asks = driver.braking == 1 or decel > 0.0
    blended = script.blending and asks and demand.motor_valid == 1
    blended = blended and demand.motor_age < DEMAND_TIMEOUT
    for wheel in range(4):
        fallback = params.fallback_gain * decel
        if fallback > 0.0:
            fallback += params.push_out_pressure[wheel]
        commands.pressure_demand[wheel] = BAR * demand.pressure[wheel] if heard else fallback
        commands.motor_demand[wheel] = demand.motor[wheel] if blended else driver.motor_demand[wheel]
    commands.steering_angle = driver.steering_angle
    commands.road_friction[:] = value_at(script.road_friction, state.t, 1)
    commands.grade = value_at(script.grade, state.t, 1)
    commands.ambient_temperature = script.ambient_temperature
    commands.wetness = script.wetness


@kernel
def move(
    script: Script, params: Record, state: Record, driver: Record, demand: Record, commands: Record
) -> None:
    """Advance the car by one cycle, after `drive` has moved the driver.

    `demand` holds the ECU's demands decoded so far; its ages grow by a cycle.
    """
    set_commands(script, params, state, driver, demand, commands)
    if round(state.t / CYCLE) == script.fault_cycle:
        for wheel in range(4):
            params.slip_stiffness[wheel] *= script.fault_stiffness
    if len(script.charge_limit) > 0:
        params.charge_limit = value_at(script.charge_limit, state.t, 1)
    road, by_place = script.road, is_described(script.road)
    for _ in range(STEPS):
        if by_place:
            set_road(road, params, state, commands)
        advance(params, state, commands, STEP)
    demand.pressure_age += CYCLE
    demand.motor_age += CYCLE
