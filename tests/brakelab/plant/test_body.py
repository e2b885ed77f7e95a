"""The car's body: equilibrium of the loads, cornering against the bicycle model, axes and signs."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brakelab.plant.body import hub_velocity, set_wheel_loads

MASS, G, BASE, FRONT, REAR, TRACK, HEIGHT = 2105.0, 9.81, 2.665, 1.29, 1.375, 1.625, 0.66


def test_static_loads_balance_weight_and_moments(car_at: Callable[[float], Any]) -> None:
    load = car_at(0.0).now["wheel_load"]
    assert load.sum() == pytest.approx(MASS * G)
    assert load[:2].sum() * FRONT == pytest.approx(load[2:].sum() * REAR)
    assert load[0] == load[1]


@pytest.mark.parametrize(("accel_x", "accel_y"), [(-6.0, 0.0), (3.0, 0.0), (0.0, 4.0), (-4.0, -3.0)])
def test_transfer_balances_the_moment_of_inertia_forces(
    car_at: Callable[[float], Any], accel_x: float, accel_y: float
) -> None:
    car = car_at(0.0)
    car.state["felt_accel"] = (accel_x, accel_y)
    set_wheel_loads(car.params[0], car.now, 0.0, 0.0)
    load = car.now["wheel_load"]
    assert load.sum() == pytest.approx(MASS * G)
    assert load[:2].sum() * FRONT - load[2:].sum() * REAR == pytest.approx(-MASS * accel_x * HEIGHT)
    assert (load[1::2].sum() - load[::2].sum()) * TRACK / 2 == pytest.approx(MASS * accel_y * HEIGHT)


@pytest.mark.study
def test_loads_follow_the_braking_force_late_and_settle(car_at: Callable[[float], Any]) -> None:
    car = car_at(30.0)
    car.freeze_friction()
    car.press(40.0, 40.0)
    car.run(0.03)
    early = car.now["wheel_load"][0]
    car.run(1.0)
    settled = 0.5 * MASS * (G * REAR - car.now["accel_x"] * HEIGHT) / BASE
    static = 0.5 * MASS * G * REAR / BASE
    assert early - static < 0.2 * (settled - static)
    assert car.now["wheel_load"][0] == pytest.approx(settled, rel=2e-3)
    assert car.now["pitch"] == pytest.approx(-3.3e-3 * car.now["accel_x"], rel=1e-2)


@pytest.mark.parametrize("steering", [0.0, 0.1])
@pytest.mark.parametrize(("wheel", "x", "y"), [(0, FRONT, 1), (1, FRONT, -1), (2, -REAR, 1), (3, -REAR, -1)])
def test_hubs_move_with_the_rigid_body(
    car_at: Callable[[float], Any], wheel: int, x: float, y: float, steering: float
) -> None:
    car = car_at(20.0)
    car.state["yaw_rate"], car.state["speed_y"] = 0.8, -0.5
    car.state["pitch_rate"], car.state["roll_rate"] = 0.2, -0.3
    velocity = np.array([20.0, -0.5]) + 0.8 * np.array([-y * TRACK / 2, x])
    velocity += np.cross([-0.3, 0.2, 0.0], [0.0, 0.0, -HEIGHT])[:2]  # it swings with the body
    turned = steering if wheel < 2 else 0.0
    axes = np.array([[math.cos(turned), math.sin(turned)], [-math.sin(turned), math.cos(turned)]])
    assert hub_velocity(car.params[0], car.now, wheel, steering) == pytest.approx(axes @ velocity)


@pytest.mark.parametrize("speed", [6.0, 12.0, 20.0])
def test_steady_cornering_is_the_bicycle_model(car_at: Callable[[float], Any], speed: float) -> None:
    angle = 0.004
    car = car_at(speed)
    car.commands["steering_angle"] = angle
    car.params["drag_factor"] = car.params["rolling_resistance"] = 0.0
    car.run(4.0)
    front, rear = 2 * 15.0 * car.params["nominal_load"][0, 0], 2 * 18.0 * car.params["nominal_load"][0, 2]
    gradient = MASS * (rear * REAR - front * FRONT) / (front * rear * BASE)  # rad per m/s^2
    assert gradient > 0.0  # understeers
    v = float(car.now["speed_x"])
    expected = v * angle / (BASE + gradient * v * v)
    assert car.now["yaw_rate"] == pytest.approx(expected, rel=0.01)
    assert car.now["accel_y"] == pytest.approx(v * expected, rel=0.01)


def test_signs_are_iso_8855(car_at: Callable[[float], Any]) -> None:
    car = car_at(15.0)
    car.commands["steering_angle"] = 0.02
    car.press(20.0, 20.0)
    car.run(1.0)
    now = car.now
    assert now["accel_x"] < 0.0
    assert np.all(now["slip"] < 0.0)
    assert np.all(now["force_x"] < 0.0)
    assert now["pitch"] > 0.0  # nose down
    assert now["yaw_rate"] > 0.0  # to the left
    assert now["accel_y"] > 0.0
    assert now["roll"] > 0.0  # right side down
    assert np.all(now["wheel_load"][1::2] > now["wheel_load"][::2])
    assert np.all(now["brake_torque"] > 0.0)


def test_a_car_coasts_uphill_and_downhill_by_gravity(car_at: Callable[[float], Any]) -> None:
    for grade in (-0.05, 0.05):
        car = car_at(20.0)
        car.params["drag_factor"] = car.params["rolling_resistance"] = 0.0
        car.commands["grade"] = grade
        car.run(1.0)
        rotating = 4 * 1.6 / float(car.now["rolling_radius"][0]) ** 2
        gained = -G * math.sin(grade) * MASS / (MASS + rotating)
        assert float(car.now["speed_x"]) - 20.0 == pytest.approx(gained, rel=0.01)


def test_braking_the_left_wheels_alone_turns_the_car_to_the_left(car_at: Callable[[float], Any]) -> None:
    car = car_at(25.0)
    left = np.array([30e5, 0.0, 30e5, 0.0])
    car.commands["pressure_demand"] = car.state["pressure"] = car.state["turning_point"] = left
    car.state["demand_history"][0, :, :] = left
    car.run(0.15)
    force = car.now["force_x"]
    assert np.all(force[::2] < 20.0 * force[1::2])
    side = FRONT * car.now["force_y"][:2].sum() - REAR * car.now["force_y"][2:].sum()
    expected = (TRACK / 2 * (force[1::2].sum() - force[::2].sum()) + side) / 3350.0
    assert car.now["yaw_accel"] == pytest.approx(expected)
    assert car.now["yaw_rate"] > 0.0
