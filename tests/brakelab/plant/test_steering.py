"""Steering: signs, the one-track model's yaw rate, a path that is driven, hands of finite speed."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brakelab.plant.steering import LARGEST_RATE, Steering, steer, understeer_gradient
from brakelab.plant.vehicle import STEP, advance

NONE = np.empty((0, 2))
CYCLE = 0.01


def drive_along(car: Any, steering: Steering, seconds: float) -> np.ndarray[Any, Any]:
    """Return rows of angle [rad], x, y [m] and heading [rad], one a cycle; the car rolls."""
    rows = []
    angle = 0.0
    for _ in range(round(seconds / CYCLE)):
        angle = steer(steering, car.params[0], car.state[0], angle, CYCLE)
        car.commands["steering_angle"] = angle
        for _ in range(10):
            advance(car.params[0], car.state[0], car.commands[0], STEP)
        rows.append([angle, *(float(car.now[name]) for name in ("position_x", "position_y", "heading"))])
    return np.array(rows)


@pytest.mark.parametrize(("t", "angle"), [(0.0, 0.0), (0.25, 0.01), (0.5, 0.02), (9.0, 0.02)])
def test_an_angle_by_time_is_linear_between_its_rows(
    car_at: Callable[[float], Any], t: float, angle: float
) -> None:
    car = car_at(10.0)
    car.state["t"] = t
    steering = Steering(np.array([[0.0, 0.0], [0.5, 0.02]]), NONE)
    assert steer(steering, car.params[0], car.state[0], 0.3, CYCLE) == pytest.approx(angle)


@pytest.mark.parametrize("name", ["suv", "suv14"])
@pytest.mark.parametrize("angle", [0.004, -0.004])
def test_yaw_rate_is_that_of_the_one_track_model(
    shipped: Callable[[str, float], Any], name: str, angle: float
) -> None:
    """psi' = v delta / (L + EG v^2), EG = (1 / c_f - 1 / c_r) / g with 15 and 18 per N of load."""
    car = shipped(name, 20.0)
    drive_along(car, Steering(np.array([[0.0, angle]]), NONE), 4.0)
    speed = float(car.now["speed_x"])
    expected = speed * angle / (2.665 + (1 / 15 - 1 / 18) / 9.81 * speed**2)
    assert car.now["yaw_rate"] == pytest.approx(expected, rel=0.02)
    assert understeer_gradient(car.params[0]) == pytest.approx(0.001133, rel=1e-3)


def test_a_circle_closes(car_at: Callable[[float], Any]) -> None:
    """Left is positive, the radius v / psi'; after a full turn the car is where it was."""
    car = car_at(5.0)
    car.params["drag_factor"] = car.params["rolling_resistance"] = 0.0
    rows = drive_along(car, Steering(np.array([[0.0, 0.1]]), NONE), 50.0)
    start = 300  # settled
    end = start + int(np.argmin(np.abs(rows[start:, 3] - rows[start, 3] - 2.0 * np.pi)))
    y = rows[start:end, 2]
    radius = float(np.hypot(car.now["speed_x"], car.now["speed_y"]) / car.now["yaw_rate"])
    assert rows[end, 1:3] == pytest.approx(rows[start, 1:3], abs=0.5)
    assert y.max() - y.min() == pytest.approx(2.0 * radius, rel=0.02)
    assert np.all(np.diff(rows[start:, 3]) > 0.0)
    direction = np.unwrap(np.arctan2(np.diff(rows[start:, 2]), np.diff(rows[start:, 1])))
    drift = direction - 0.5 * (rows[start + 1 :, 3] + rows[start:-1, 3])
    towards = np.arctan2(car.now["speed_y"], car.now["speed_x"])
    assert np.allclose(np.angle(np.exp(1j * (drift - towards))), 0.0, atol=1e-3)


@pytest.mark.parametrize("speed", [8.0, 15.0, 25.0])
@pytest.mark.parametrize("offset", [3.0, -3.0])
def test_a_path_is_found_and_kept(car_at: Callable[[float], Any], speed: float, offset: float) -> None:
    car = car_at(speed)
    path = np.array([[0.0, 0.0], [2.0 * speed, 0.0], [5.0 * speed, offset], [6.0 * speed, offset]])
    rows = drive_along(car, Steering(NONE, path), 9.0)
    assert rows[-1, 2:] == pytest.approx([offset, 0.0], abs=0.05)
    assert np.max(np.sign(offset) * rows[:, 2]) < 1.1 * abs(offset)
    assert np.max(np.abs(np.diff(rows[:, 0]))) <= LARGEST_RATE * CYCLE * 1.001


def test_without_rows_the_car_goes_straight_on(car_at: Callable[[float], Any]) -> None:
    rows = drive_along(car_at(20.0), Steering(NONE, NONE), 1.0)
    assert np.all(rows[:, [0, 2, 3]] == 0.0)
