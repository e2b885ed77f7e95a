"""Bus interface of the simulated vehicle: sensors and driver as signals out, the ECU's demands in.

Shared by the closed loop in memory and by the vehicle in real time.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from brakelab.plant.cycle import DEMAND_TIMEOUT, move
from brakelab.plant.description import Plant, PlantFileError
from brakelab.plant.draw import Widths, draw, draw_sensors
from brakelab.plant.driver import Script, friction_now, grade_now
from brakelab.plant.records import COMMANDS, DEMAND, DRIVER, RecordArray, new_record
from brakelab.plant.sensor_errors import (
    ABSENT,
    SIGNALS,
    SPEED_SOURCES,
    STANDARD,
    disturb,
    new_sensing,
    new_sensors,
)
from brakelab.plant.sensors import body_accelerations, true_readings
from brakelab.plant.vehicle import new_state
from brakelab.plant.wear import pad_wear
from brakelab.simulation.car_parameters import set_parameters
from brakelab.simulation.fault_kernels import acting, spoil_car
from brakelab.simulation.faults import fault_records
from brakelab.simulation.scenario import Scenario
from brakelab.simulation.scenario_car import scenario_plant, scenario_widths
from ecu.contract import signals
from ecu.contract.signals import (
    CORNERS,
    INPUT,
    INPUT_SIGNALS,
    N_INPUTS,
    OUTPUT,
    OUTPUT_SIGNALS,
    without_corner,
)
from ecu.errors import UserError
from ecu.jit import Record, kernel

PRESSED_FROM: Final = 1.0  # % of pedal travel
SENSED: Final = np.array([INPUT[name] for name in SIGNALS])
RAIN: Final = INPUT["rain"]
PRESSURE_DEMAND: Final = OUTPUT["pressure_demand_fl"]
PRESSURE_DEMAND_VALID: Final = OUTPUT["pressure_demand_valid"]
MOTOR_DEMAND: Final = OUTPUT["motor_demand_fl"]
MOTOR_DEMAND_VALID: Final = OUTPUT["motor_demand_valid"]

_SCALAR_TRUTH: Final = (
    "vehicle_speed",
    "distance",
    "accel_x",  # reading of an ideal accelerometer
    "accel_x_road",  # specific force in road axes
    "accel_y",
    "yaw_rate",
    "pitch",
    "decel_demand",
    "pedal_position",
    "road_friction",
    "grade",
    "position_x",
    "position_y",
    "heading",
    "steering_angle",
    "fault_acting",  # mask: 1 for the scenario's first fault, 2 for the second
    "demand_heard",  # 1: the ECU's pressure demands are obeyed, 0: the hydraulics brake on their own
)
_CORNER_TRUTH: Final = (
    "mu_b",
    "wheel_force_x",
    "wheel_force_z",
    "slip",
    "brake_torque",
    "disc_temperature",
    "motor_torque",
    "calliper_pressure",
    "wheel_speed",
    "rolling_radius",
    "pad_wear",
    "pad_wear_mass",
    "particles",
)
TRUTH_COLUMNS: Final = _SCALAR_TRUTH + tuple(f"{name}_{c}" for name in _CORNER_TRUTH for c in CORNERS)
"""True values, those of the contract by its names; units: `truth_unit`."""
N_TRUTH: Final = len(TRUTH_COLUMNS)
_FIRST_CORNER: Final = len(_SCALAR_TRUTH)
_UNITS: Final = {
    **{signal.name: signal.unit for signal in INPUT_SIGNALS},
    **{signal.name: signal.unit for signal in OUTPUT_SIGNALS},
    **dict.fromkeys(("distance", "position_x", "position_y", "rolling_radius"), "m"),
    **dict.fromkeys(("pitch", "grade", "heading"), "rad"),
    **dict.fromkeys(("road_friction", "particles", "fault_acting"), "-"),
    "t": "s",
}


def truth_unit(name: str) -> str:
    """Return the unit of a true value, of `TRUTH_COLUMNS` or `t`; empty: none known."""
    return _UNITS.get(name, _UNITS.get(without_corner(name), ""))


class Vehicle(NamedTuple):
    """The simulated vehicle's records, each of shape (1,), and its script."""

    script: Script
    params: RecordArray
    state: RecordArray
    driver: RecordArray
    demand: RecordArray
    commands: RecordArray
    sensors: RecordArray
    sensing: RecordArray
    measured: NDArray[np.float64]
    speed_over_ground: bool
    faults: RecordArray
    """`brakelab.simulation.faults.FAULT`, shape (n,)."""
    sound: RecordArray
    """`params` without faults."""


def _sensors(scenario: Scenario, plant: Plant, width: Widths, seed: int) -> RecordArray:
    transducers = {} if scenario.wheel_transducers else {"wheel_force_x": ABSENT, "wheel_torque_y": ABSENT}
    known = {**STANDARD, "vehicle_speed": SPEED_SOURCES[scenario.vehicle_speed]}
    drawn = draw_sensors(known, seed, width)
    return new_sensors((known, drawn, plant.vehicle.sensor.errors, scenario.sensor, transducers), seed)


def new_vehicle(scenario: Scenario, seed: int) -> Vehicle:
    """Return the vehicle of a scenario before its first cycle, its car drawn from `seed`.

    Raises:
        UserError: the plant's or the trace's file cannot be read or is wrong.
    """
    script = scenario.script()
    plant, width = scenario_plant(scenario), scenario_widths(scenario)
    try:
        params = draw(plant, seed, width)
    except PlantFileError as error:
        raise UserError(error.where, error.place, error.remedy) from None
    set_parameters(params, scenario.car)
    commands = new_record(COMMANDS)
    commands["road_friction"] = script.road_friction[0, 1]
    demand = new_record(DEMAND)
    demand["pressure_age"] = demand["motor_age"] = math.inf
    return Vehicle(
        script,
        params,
        new_state(params, scenario.initial_speed, scenario.initial_disc_temperature),
        new_record(DRIVER),
        demand,
        commands,
        _sensors(scenario, plant, width, seed),
        new_sensing(),
        np.empty(len(SIGNALS)),
        scenario.vehicle_speed == "gnss",
        fault_records(scenario.fault),
        params.copy(),
    )


def new_noise(seed: int) -> Generator:
    """Return the source of the sensors' noise. Kernels take it beside the records: inside a tuple numba would
    need milliseconds per call to determine its type."""
    return np.random.default_rng([seed, 1])


@kernel
def sense(vehicle: Vehicle, noise: Generator, values: NDArray[np.float64]) -> None:
    """Write the values that the vehicle sends now into `values`, shape (N_INPUTS,); NaN: not available."""
    state, driver, measured = vehicle.state[0], vehicle.driver[0], vehicle.measured
    grade = grade_now(vehicle.script, state)
    steering = vehicle.commands[0].steering_angle
    true_readings(vehicle.params[0], state, grade, steering, vehicle.speed_over_ground, measured)
    disturb(vehicle.sensors, vehicle.sensing, state.t, noise, measured)
    values[:] = np.nan
    for i in range(len(measured)):
        values[SENSED[i]] = measured[i]
    values[signals.PEDAL_POSITION] = driver.pedal_position
    values[signals.PEDAL_PRESSED] = 1.0 if driver.pedal_position > PRESSED_FROM else 0.0
    values[signals.DECEL_DEMAND] = driver.decel_demand
    values[signals.DECEL_DEMAND_VALID] = driver.decel_demand_valid
    values[signals.ACCELERATOR_POSITION] = driver.accelerator_position
    values[signals.REVERSE] = values[signals.ABS_ACTIVE] = values[signals.ESP_ACTIVE] = 0.0
    values[signals.ACCUMULATOR_PRESSURE] = 1e-5 * vehicle.sound[0].pressure_limit[0]
    values[signals.HYDRAULIC_READY] = 1.0
    values[signals.AMBIENT_TEMPERATURE] = vehicle.script.ambient_temperature
    values[RAIN] = 1.0 if vehicle.script.wetness > 0.0 else 0.0
    if not np.isnan(values[signals.VEHICLE_SPEED]):
        values[signals.VEHICLE_SPEED_VALID] = 1.0
    for i in range(4):
        if not np.isnan(values[signals.MOTOR_TORQUE + i]):  # both are in one frame
            values[signals.MOTOR_LIMIT + i] = state.motor_limit[i]
    spoil_car(vehicle.faults, state.t, noise, vehicle.sound[0], vehicle.params[0], values)


@kernel
def decode_demands(heard: Record, demand: Record) -> None:
    """Decode the ECU's demands that arrived in this cycle; `heard` is a record of `OUTPUT_COLUMNS`."""
    if heard.new[PRESSURE_DEMAND] and heard.new[PRESSURE_DEMAND + 2]:
        demand.pressure_age = 0.0
        demand.pressure_valid = heard.value[PRESSURE_DEMAND_VALID] == 1.0
        for i in range(4):
            demand.pressure[i] = heard.value[PRESSURE_DEMAND + i]
    if heard.new[MOTOR_DEMAND] and heard.new[MOTOR_DEMAND + 2]:
        demand.motor_age = 0.0
        demand.motor_valid = heard.value[MOTOR_DEMAND_VALID] == 1.0
        for i in range(4):
            demand.motor[i] = heard.value[MOTOR_DEMAND + i]


@kernel
def advance(vehicle: Vehicle) -> None:
    """Advance the car by one cycle with the decoded demands."""
    move(
        vehicle.script,
        vehicle.params[0],
        vehicle.state[0],
        vehicle.driver[0],
        vehicle.demand[0],
        vehicle.commands[0],
    )


@kernel
def write_truth(vehicle: Vehicle, row: NDArray[np.float64]) -> None:
    """Write the present true values into `row`, shape (N_TRUTH,), in the order of `TRUTH_COLUMNS`."""
    state, driver = vehicle.state[0], vehicle.driver[0]
    grade = grade_now(vehicle.script, state)
    row[0] = state.speed_x
    row[1] = state.distance
    row[2] = body_accelerations(vehicle.params[0], state, grade)[0]
    row[3] = state.accel_x
    row[4] = body_accelerations(vehicle.params[0], state, grade)[1]
    row[5] = state.yaw_rate
    row[6] = state.pitch
    row[7] = driver.decel_demand
    row[8] = driver.pedal_position
    row[9] = friction_now(vehicle.script, state)
    row[10] = grade
    row[11] = state.position_x
    row[12] = state.position_y
    row[13] = state.heading
    row[14] = driver.steering_angle
    demand = vehicle.demand[0]
    row[15] = acting(vehicle.faults, state.t)
    row[16] = 1.0 if demand.pressure_valid == 1 and demand.pressure_age < DEMAND_TIMEOUT else 0.0
    for i in range(4):
        corner = _FIRST_CORNER + i
        row[corner] = state.mu_b[i]
        row[corner + 4] = state.force_x[i]
        row[corner + 8] = state.wheel_load[i]
        row[corner + 12] = state.slip[i]
        row[corner + 16] = state.brake_torque[i]
        row[corner + 20] = state.disc_temperature[i]
        row[corner + 24] = state.motor_torque[i]
        row[corner + 28] = 1e-5 * state.pressure[i]
        row[corner + 32] = state.wheel_speed[i]
        row[corner + 36] = state.rolling_radius[i]
        row[corner + 40] = pad_wear(vehicle.params[0].wear_row[i], state.pad_wear_mass[i])
        row[corner + 44] = state.pad_wear_mass[i]
        row[corner + 48] = state.particles[i]


def new_values() -> NDArray[Any]:
    """Return a buffer for the vehicle's values to send, shape (N_INPUTS,)."""
    return np.full(N_INPUTS, np.nan)
