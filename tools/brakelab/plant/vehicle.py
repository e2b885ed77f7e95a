"""Whole simulated car: one call advances it by one step.

Fourteen degrees of freedom with a suspension (car: x, y, yaw, heave, pitch, roll; four unsprung masses; four
spins), seven without, plus the lags of tyres, hydraulics and motors, and the slow states of the brakes. The
step is 1 ms; everything is stable from standstill to top speed.
"""

import numpy as np

from brakelab.plant.body import advance_attitude, advance_planar, hub_velocity, set_wheel_loads
from brakelab.plant.chassis import advance_chassis, settle
from brakelab.plant.emission import advance_emission
from brakelab.plant.engine import advance_engine
from brakelab.plant.friction.law import START
from brakelab.plant.hydraulics import advance_pressure
from brakelab.plant.jit import Record, kernel
from brakelab.plant.lining import advance_disc_temperature, advance_lining
from brakelab.plant.motor import advance_motors
from brakelab.plant.records import HISTORY, STATE, RecordArray, new_record
from brakelab.plant.tyre import rolling_radius
from brakelab.plant.wear import advance_wear
from brakelab.plant.wheel import advance_wheel

STEP = 1e-3  # s


@kernel
def advance(params: Record, state: Record, commands: Record, dt: float) -> None:
    """Advance the car by `dt` [s] (designed for 1 ms, 0.5 to 2 ms) with `commands` held."""
    state.place = (state.place + 1) % HISTORY
    for wheel in range(4):
        state.demand_history[state.place, wheel] = commands.pressure_demand[wheel]
        state.motor_history[state.place, wheel] = commands.motor_demand[wheel]
    advance_pressure(params, state, dt)
    advance_motors(params, state, dt)
    advance_engine(params, state, dt)
    advance_lining(params, state, dt)
    if params.suspended:
        advance_chassis(params, state, commands, dt)
    else:
        set_wheel_loads(params, state, commands.grade, commands.bank)
    for wheel in range(4):
        along, across = hub_velocity(params, state, wheel, commands.steering_angle)
        advance_wheel(params, state, wheel, along, across, commands.road_friction[wheel], dt)
    advance_planar(params, state, commands.steering_angle, commands.grade, commands.bank, dt)
    if not params.suspended:
        advance_attitude(params, state, dt)
    advance_wear(params, state, dt)
    advance_emission(params, state, dt)
    advance_disc_temperature(params, state, commands.ambient_temperature, commands.wetness, dt)
    state.t += dt


def new_state(params: RecordArray, speed: float, disc_temperature: tuple[float, float]) -> RecordArray:
    """Return the state of a car that rolls freely at `speed` [m/s], shape (1,).

    `disc_temperature` [degC]: front and rear.
    """
    record = new_record(STATE)
    state, car = record[0], params[0]
    if car["suspended"]:
        settle(car, state)
    else:
        set_wheel_loads(car, state, 0.0, 0.0)
    state["speed_x"] = speed
    state["lining_memory"] = car["friction_row"][:, START]
    state["peak_reserve"] = car["motor_peak_time"]
    state["disc_temperature"] = np.repeat(disc_temperature, 2)
    for wheel in range(4):
        radius = rolling_radius(
            car["free_radius"][wheel], car["vertical_stiffness"][wheel], state["wheel_load"][wheel]
        )
        state["rolling_radius"][wheel] = radius
        state["wheel_speed"][wheel] = speed / radius
    advance_lining(car, state, 0.0)
    return record
