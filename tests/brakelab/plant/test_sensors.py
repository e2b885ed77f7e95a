"""Sensors: noise of Table 4.1, what a body-fixed accelerometer reads, same seed same bits."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brakelab.plant.description import Plant, nominal
from brakelab.plant.records import MEASURED, RecordArray, new_record
from brakelab.plant.sensors import body_accelerations, measure
from brakelab.plant.vehicle import new_state

SAMPLES = 20_000
NOISE = {
    "vehicle_speed": 0.027,
    "wheel_speed": 0.1,
    "accel_x": 0.01,
    "accel_y": 0.01,
    "calliper_pressure": 1.8,
    "wheel_force_x": 10.0,
    "yaw_rate": 0.002,
}


def readings(params: RecordArray, state: RecordArray, seed: int, count: int) -> RecordArray:
    rows = np.zeros(count, MEASURED)
    noise = np.random.default_rng(seed)
    one = new_record(MEASURED)
    for row in range(count):
        measure(params[0], state[0], 0.0, noise, one[0])
        rows[row] = one[0]
    return rows


@pytest.fixture(scope="module")
def still(suv: Plant) -> RecordArray:
    params = nominal(suv)
    return readings(params, new_state(params, 0.0, (20.0, 20.0)), 7, SAMPLES)


@pytest.mark.parametrize(("name", "sigma"), NOISE.items())
def test_noise_is_that_of_table_4_1(still: RecordArray, name: str, sigma: float) -> None:
    values = still[name].reshape(SAMPLES, -1)
    assert values.std(axis=0) == pytest.approx(np.full(values.shape[1], sigma), rel=0.03)
    assert np.all(np.abs(values.mean(axis=0)) < 5 * sigma / math.sqrt(SAMPLES))
    assert abs(np.corrcoef(values[1:, 0], values[:-1, 0])[0, 1]) < 0.03  # white


def test_pressure_noise_is_not_rectified_at_zero(still: RecordArray) -> None:
    assert still["calliper_pressure"].min() < -5.0


def test_same_seed_same_bits(car_at: Callable[[float], Any]) -> None:
    car = car_at(20.0)
    first, again, other = (readings(car.params, car.state, seed, 50).tobytes() for seed in (3, 3, 4))
    assert first == again
    assert first != other


@pytest.mark.parametrize("grade", [-0.08, 0.0, 0.08])
def test_a_parked_car_reads_the_grade(car_at: Callable[[float], Any], grade: float) -> None:
    car = car_at(0.0)
    car.commands["grade"] = grade
    car.press(60.0, 60.0)
    car.run(4.0)
    read, _ = body_accelerations(car.params[0], car.now, grade)
    pitched = -3.3e-3 * 9.81 * math.sin(grade)  # the body leans on its springs as under acceleration
    assert read == pytest.approx(9.81 * math.sin(grade - pitched), abs=0.03)


def test_dive_puts_gravity_into_the_reading(car_at: Callable[[float], Any]) -> None:
    car = car_at(30.0)
    car.freeze_friction()
    car.press(60.0, 70.0)
    car.run(1.5)
    read, _ = body_accelerations(car.params[0], car.now, 0.0)
    accel = float(car.now["accel_x"])
    assert accel < -5.0
    assert read - accel == pytest.approx(9.81 * 3.3e-3 * accel, rel=0.03)  # -0.16 m/s^2 at 5 m/s^2


def test_a_sensor_ahead_of_the_centre_feels_the_turn(car_at: Callable[[float], Any]) -> None:
    car = car_at(0.0)
    car.params["sensor_position"] = (1.2, 0.4, 0.0)
    car.state["yaw_rate"], car.state["yaw_accel"] = 0.5, 0.3
    read = body_accelerations(car.params[0], car.now, 0.0)
    assert read == pytest.approx((-0.25 * 1.2 - 0.3 * 0.4, -0.25 * 0.4 + 0.3 * 1.2))


def test_wheel_transducers_see_brake_and_motor_torque(car_at: Callable[[float], Any]) -> None:
    car = car_at(30.0)
    car.press(40.0, 40.0)
    car.commands["motor_demand"] = 200.0
    car.run(0.5)
    torque = readings(car.params, car.state, 1, 400)["wheel_torque_y"].mean(axis=0)
    assert torque == pytest.approx(-car.now["brake_torque"] - 200.0, abs=1.0)
    assert np.all(torque < 0.0)
