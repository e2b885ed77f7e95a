"""The car on its suspension as a whole: straight stops, its reduced form, lift-off, what its sensor feels."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.plant.description import load_plant
from brakelab.plant.draw import draw, load_widths
from brakelab.plant.sensors import body_accelerations
from brakelab.plant.vehicle import new_state

CONFIG = Path(__file__).parents[3] / "config" / "plant"
G = 9.81

Maker = Callable[[str, float], Any]


def test_a_drawn_car_rolls_without_a_jolt(shipped: Maker) -> None:
    car = shipped("suv14", 20.0)
    car.params[:] = draw(load_plant(CONFIG / "suv14.toml"), 4, load_widths(CONFIG / "draw.toml", "wide"))
    car.state[:] = new_state(car.params, 20.0, (100.0, 100.0))
    before = float(car.now["heave"])
    accelerations: list[float] = []
    car.run(0.5, watch=lambda state: accelerations.append(float(state["heave_accel"])))
    assert before != 0.0
    assert max(map(abs, accelerations)) < 0.05


def test_a_wheel_leaves_the_road_and_the_car_lives(shipped: Maker) -> None:
    car = shipped("suv14", 15.0)
    car.commands["road_height"] = (-0.5, 0.0, 0.0, 0.0)
    car.run(0.05)
    assert car.now["wheel_load"][0] == 0.0
    assert car.now["force_x"][0] == pytest.approx(0.0, abs=5.0)
    assert all(np.all(np.isfinite(car.now[name])) for name in ("force_x", "force_y", "wheel_speed", "roll"))


def test_same_car_same_bits(shipped: Maker) -> None:
    states = []
    for _ in range(2):
        car = shipped("suv14", 25.0)
        car.commands["steering_angle"] = 0.02
        car.press(30.0, 30.0)
        car.run(0.5)
        states.append(car.state.tobytes())
    assert states[0] == states[1]


@pytest.mark.parametrize("steering", [0.0, 0.01])
def test_it_brakes_and_steers_as_its_reduced_form_does(shipped: Maker, steering: float) -> None:
    cars = shipped("suv14", 25.0), shipped("suv", 25.0)
    for car in cars:
        car.freeze_friction()
        car.commands["steering_angle"] = steering
        car.press(20.0, 20.0)
        car.run(2.0)
    full, reduced = (car.now for car in cars)
    assert full["speed_x"] == pytest.approx(reduced["speed_x"], rel=2e-3)
    assert full["wheel_load"] == pytest.approx(reduced["wheel_load"], rel=0.03)
    assert full["yaw_rate"] == pytest.approx(reduced["yaw_rate"], rel=0.02, abs=1e-9)


def test_straight_stops_stay_straight(shipped: Maker) -> None:
    car = shipped("suv14", 30.0)
    car.press(60.0, 60.0)
    car.run(7.5)
    for name in ("speed_y", "yaw_rate", "roll", "roll_rate"):
        assert car.now[name] == 0.0
    assert car.now["speed_x"] == pytest.approx(0.0, abs=1e-3)
    assert car.now["pitch"] == pytest.approx(0.0, abs=1e-4)  # it has rocked back and forth


def test_the_accelerometer_pitches_and_heaves_with_the_body(shipped: Maker) -> None:
    car = shipped("suv14", 30.0)
    car.freeze_friction()
    car.press(60.0, 70.0)
    car.run(1.6)
    read, _ = body_accelerations(car.params[0], car.now, 0.0)
    accel, pitch = float(car.now["accel_x"]), float(car.now["pitch"])
    assert read == pytest.approx(accel * math.cos(pitch) - G * math.sin(pitch), abs=0.02)
    car = shipped("suv14", 0.0)
    car.state["pitch"], car.state["heave"] = 0.02, 0.03
    car.run(0.002)
    car.state["pitch"] = 0.02
    up = float(car.now["vertical_accel"])
    assert abs(up) > 1.0
    read, _ = body_accelerations(car.params[0], car.now, 0.0)
    still = float(car.now["accel_x"]) * math.cos(0.02) + float(car.now["pitch_accel"]) * -0.10 * math.cos(
        0.02
    )
    assert read == pytest.approx(still - (G + up) * math.sin(0.02), abs=0.01)
