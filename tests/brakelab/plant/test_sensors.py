"""Sensors: noise of Table 4.1, what a body-fixed accelerometer reads, same seed same bits."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.plant.description import Plant, nominal
from brakelab.plant.records import RecordArray
from brakelab.plant.sensor_errors import SIGNALS, SPEED_SOURCES, STANDARD, disturb, new_sensing, new_sensors
from brakelab.plant.sensors import body_accelerations, true_readings
from brakelab.plant.vehicle import new_state

SAMPLES = 20_000
NOISE = {
    "vehicle_speed": 0.027,
    "wheel_speed": 0.1,
    "accel_x": 0.01,
    "accel_y": 0.01,
    "calliper_pressure": 1.8,
    "wheel_force_x": 10.0,
    "wheel_torque_y": 3.5,
    "yaw_rate": 0.002,
    "motor_torque": 0.0,
    "steering_angle": 0.0,
}


def truth(params: RecordArray, state: RecordArray, over_ground: bool = False) -> NDArray[np.float64]:
    values = np.empty(len(SIGNALS))
    true_readings(params[0], state[0], 0.0, 0.02, over_ground, values)
    return values


def readings(params: RecordArray, state: RecordArray, seed: int, count: int) -> dict[str, Any]:
    """Return `count` samples of a standing state by signal, shape (count, 1 or 4)."""
    sensors = new_sensors((STANDARD, {"vehicle_speed": SPEED_SOURCES["ideal"]}), seed)
    sensing, noise = new_sensing(), np.random.default_rng(seed)
    rows = np.tile(truth(params, state), (count, 1))
    for k, row in enumerate(rows):
        disturb(sensors, sensing, 0.01 * k, noise, row)
    stems = {stem: [i for i, name in enumerate(SIGNALS) if name.startswith(stem)] for stem in NOISE}
    return {stem: rows[:, places] for stem, places in stems.items()}


@pytest.fixture(scope="module")
def still(suv: Plant) -> dict[str, Any]:
    params = nominal(suv)
    return readings(params, new_state(params, 0.0, (20.0, 20.0)), 7, SAMPLES)


@pytest.mark.parametrize(("name", "sigma"), NOISE.items())
def test_noise_is_that_of_table_4_1(still: dict[str, Any], name: str, sigma: float) -> None:
    values = still[name]
    assert values.std(axis=0) == pytest.approx(np.full(values.shape[1], sigma), rel=0.03, abs=1e-12)
    true = 0.02 if name == "steering_angle" else 0.0
    assert np.all(np.abs(values.mean(axis=0) - true) <= 5 * sigma / math.sqrt(SAMPLES) + 1e-12)
    if sigma > 0.0:
        assert abs(np.corrcoef(values[1:, 0], values[:-1, 0])[0, 1]) < 0.03  # white


def test_pressure_noise_is_not_rectified_at_zero(still: dict[str, Any]) -> None:
    assert still["calliper_pressure"].min() < -5.0


def test_draws_come_in_a_fixed_order(car_at: Callable[[float], Any]) -> None:
    """Body, then wheel by wheel: drives of earlier versions keep their noise."""
    car = car_at(20.0)
    wheel = ("wheel_speed", "calliper_pressure", "wheel_force_x", "wheel_torque_y")
    sigmas = [NOISE[name] for name in ("accel_x", "accel_y", "yaw_rate", "vehicle_speed", *wheel * 4)]
    found = readings(car.params, car.state, 3, 2)
    drawn = np.random.default_rng(3).standard_normal((2, len(sigmas))) * sigmas
    expected = truth(car.params, car.state)[: len(sigmas)] + drawn
    assert np.array_equal(found["accel_x"][:, 0], expected[:, 0])
    assert np.array_equal(found["vehicle_speed"][:, 0], expected[:, 3])
    assert np.array_equal(found["wheel_torque_y"], expected[:, 7::4])


def test_same_seed_same_bits(car_at: Callable[[float], Any]) -> None:
    car = car_at(20.0)
    first, again, other = (
        np.hstack(list(readings(car.params, car.state, seed, 50).values())).tobytes() for seed in (3, 3, 4)
    )
    assert first == again
    assert first != other


def test_only_a_satellite_receiver_sees_the_side_speed(car_at: Callable[[float], Any]) -> None:
    car = car_at(20.0)
    car.state["speed_y"] = -1.5
    along, over_ground = (truth(car.params, car.state, reference)[3] for reference in (False, True))
    assert along == 20.0
    assert over_ground == pytest.approx(math.sqrt(20.0**2 + 1.5**2), rel=1e-12)


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
