"""The whole car braking: closed forms, an independent integration, standstill, locked wheels, motors."""

import importlib
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from brakelab.plant.jit import kernel

MASS, G, BASE, FRONT, REAR, HEIGHT = 2105.0, 9.81, 2.665, 1.29, 1.375, 0.66
DRAG = 0.5 * 1.2 * 0.35 * 2.32


@pytest.mark.parametrize(("front_bar", "rear_bar"), [(15.0, 15.0), (35.0, 50.0), (60.0, 60.0)])
def test_constant_pressure_gives_the_closed_form_deceleration(
    car_at: Callable[[float], Any], front_bar: float, rear_bar: float
) -> None:
    car = car_at(30.0)
    car.freeze_friction()
    car.params["drag_factor"] = car.params["rolling_resistance"] = 0.0
    car.press(front_bar, rear_bar)
    car.run(1.5)
    radius, slip = car.now["rolling_radius"], car.now["slip"]
    braking = float(np.sum(car.now["brake_torque"] / radius))
    inert = MASS + float(np.sum(1.6 * (1.0 + slip) / radius**2))
    assert car.now["accel_x"] == pytest.approx(-braking / inert, rel=1e-3)


def reference_stop(torque: tuple[float, float], speed: float, seconds: float) -> Any:
    """Integrate a straight stop at constant brake torque: speed, two spins, two forces, felt acceleration.

    Written independently of the plant: one wheel an axle, Magic Formula for longitudinal slip alone.
    """

    def radius(load: float) -> float:
        angle = math.acos(1.0 - load / (0.3706 * 2.6e5))
        return 0.3706 * math.sin(angle) / angle

    static = np.array([REAR, FRONT]) * 0.5 * MASS * G / BASE

    def rates(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        v, spin, force, felt, felt_rate = x[0], x[1:3], x[3:5], x[5], x[6]
        transfer = 0.5 * MASS * felt * HEIGHT / BASE
        load = static + np.array([-transfer, transfer])
        dx = np.zeros(7)
        for i in range(2):
            r = radius(load[i])
            slip = (r * spin[i] - v) / max(r * spin[i], v)
            more = load[i] / static[i] - 1.0
            stiffness = 22.0 * load[i] * (1.0 - 0.10 * more)
            peak = 1.2 * load[i] * (1.0 - 0.08 * more)
            b_x = stiffness * slip / (1.6 * peak)
            steady = peak * math.sin(1.6 * math.atan(b_x - 0.2 * (b_x - math.atan(b_x))))
            dx[1 + i] = (-torque[i] - 0.010 * load[i] * r - r * force[i]) / 1.6
            dx[3 + i] = 4.0e5 * v / stiffness * (steady - force[i])
        accel = (2.0 * force.sum() - DRAG * v * v) / MASS
        frequency = 2 * math.pi * 1.9
        dx[0] = accel
        dx[5] = felt_rate
        dx[6] = frequency**2 * (accel - felt) - 2 * 0.5 * frequency * felt_rate
        return dx

    start = np.array([speed, speed / radius(static[0]), speed / radius(static[1]), 0, 0, 0, 0])
    found = solve_ivp(rates, (0, seconds), start, method="LSODA", rtol=1e-9, atol=1e-9, dense_output=True)
    return found.sol


@pytest.mark.parametrize(("front_bar", "rear_bar"), [(35.0, 50.0), (70.0, 60.0)])
def test_a_stop_agrees_with_an_independent_integration(
    car_at: Callable[[float], Any], front_bar: float, rear_bar: float
) -> None:
    car = car_at(33.0)
    car.freeze_friction()
    car.press(front_bar, rear_bar)
    rows: list[list[float]] = []

    def watch(state: Any) -> None:
        rows.append([state["speed_x"], *state["wheel_speed"][::2], *state["force_x"][::2]])

    car.run(0.001, watch=watch)
    torque = (float(car.now["brake_torque"][0]), float(car.now["brake_torque"][2]))
    car.run(3.3, watch=watch)
    found = np.array(rows)
    t = 1e-3 * np.arange(1, len(found) + 1)
    expected = reference_stop(torque, 33.0, 3.4)(t)[:5].T
    assert expected[-1, 0] > 2.5  # above the plant's transition speed
    assert np.max(np.abs(found[:, 0] - expected[:, 0])) < 0.005  # m/s
    assert np.max(np.abs(found[:, 1:3] - expected[:, 1:3])) < 0.2  # rad/s
    settled = t > 0.5
    assert np.max(np.abs(found[settled, 3:] / expected[settled, 3:] - 1.0)) < 1e-3


@pytest.mark.parametrize("grade", [-0.1, 0.0, 0.1])
def test_a_braked_car_comes_to_rest_and_stays(car_at: Callable[[float], Any], grade: float) -> None:
    car = car_at(5.0)
    car.commands["grade"] = grade
    car.press(60.0, 60.0)
    car.run(4.0)
    place = float(car.now["distance"])
    car.run(2.0)
    assert abs(float(car.now["speed_x"])) < 0.02  # the tyre creeps on a slope
    assert abs(float(car.now["distance"]) - place) < 0.04
    assert np.all(car.now["wheel_speed"] == 0.0)
    assert car.now["accel_x"] == pytest.approx(G * math.sin(grade), abs=0.05)


def test_wheels_lock_on_ice_and_never_turn_back(car_at: Callable[[float], Any]) -> None:
    car = car_at(20.0)
    car.commands["road_friction"] = 0.2
    car.press(150.0, 150.0)
    lowest: list[float] = []
    car.run(1.5, watch=lambda state: lowest.append(float(state["wheel_speed"].min())))
    assert min(lowest) == 0.0
    assert np.all(car.now["wheel_speed"] == 0.0)
    assert car.now["slip"] == pytest.approx(-np.ones(4))
    assert -0.2 * G * 1.1 < car.now["accel_x"] < -0.1 * G
    car.commands["pressure_demand"] = 0.0
    car.run(1.0)
    assert np.all(car.now["slip"] > -0.05)  # spun up again


def test_motors_brake_with_the_torque_that_is_asked_up_to_their_limits(
    car_at: Callable[[float], Any],
) -> None:
    car = car_at(10.0)
    car.params["drag_factor"] = car.params["rolling_resistance"] = 0.0
    car.commands["motor_demand"] = 300.0
    car.run(0.5)
    assert car.now["motor_torque"] == pytest.approx(300.0 * np.ones(4), rel=1e-3)
    assert car.now["accel_x"] == pytest.approx(-4 * 300.0 / 0.3637 / (MASS + 4 * 1.6 / 0.3637**2), rel=0.01)
    car.commands["motor_demand"] = 9000.0
    car.run(0.05)
    assert car.now["motor_torque"] == pytest.approx(1350.0 * np.ones(4), rel=1e-3)
    fast = car_at(50.0)
    fast.commands["motor_demand"] = -9000.0
    fast.run(0.05)
    power = -fast.now["motor_torque"] * fast.now["wheel_speed"]
    assert power == pytest.approx(42000.0 * np.ones(4), rel=0.01)


@pytest.mark.parametrize("name", ["suv", "suv14", "sedan", "lcv"])
def test_every_shipped_car_drives_and_stops(shipped: Callable[[str, float], Any], name: str) -> None:
    car = shipped(name, 15.0)
    car.commands["motor_demand"] = -300.0
    car.run(1.0)
    assert car.now["speed_x"] > 15.2
    car.commands["motor_demand"] = 0.0
    car.press(50.0, 50.0)
    car.run(5.0)
    assert abs(float(car.now["speed_x"])) < 0.1
    assert np.all(np.isfinite(car.now["force_x"]))


@kernel
def steps_that_allocate(count: int) -> float:
    total = 0.0
    for k in range(count):
        total += np.full(k + 1, 1.0).sum()
    return total


@pytest.mark.parametrize("name", ["suv", "suv14"])
def test_a_step_allocates_nothing(shipped: Callable[[str, float], Any], name: str) -> None:
    car = shipped(name, 20.0)
    car.press(30.0, 30.0)
    car.run(0.01)
    memsys = importlib.import_module("numba.core.runtime._nrt_python")
    memsys.memsys_enable_stats()
    try:
        before = memsys.memsys_get_stats_alloc()
        car.run(0.1, watch=lambda _: None)  # step by step: arrays handed to a kernel are counted, too
        assert memsys.memsys_get_stats_alloc() == before
        steps_that_allocate(5)
        assert memsys.memsys_get_stats_alloc() > before  # it would have been seen
    finally:
        memsys.memsys_disable_stats()
