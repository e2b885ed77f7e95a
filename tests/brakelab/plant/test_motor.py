"""Motors: map, peak for half a minute, what the battery takes and gives."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brakelab.plant.motor import advance_motors, motor_loss
from brakelab.plant.records import HISTORY

NOMINAL, PEAK, NOMINAL_POWER, PEAK_POWER = 1350.0, 2000.0, 42e3, 100e3
Maker = Callable[[str, float], Any]


def ask(car: Any, torque: float, seconds: float, dt: float = 1e-3) -> list[float]:
    """Hold a demand at constant speed; return the torque of the front left motor after each step."""
    car.state["motor_history"] = np.full((HISTORY, 4), torque)
    torques = []
    for _ in range(round(seconds / dt)):
        advance_motors(car.params[0], car.now, dt)
        torques.append(float(car.now["motor_torque"][0]))
    return torques


@pytest.mark.parametrize("speed", [5.0, 15.0, 21.0, 40.0, 60.0, 100.0])
def test_peak_and_nominal_limits_have_the_shape_of_the_map(shipped: Maker, speed: float) -> None:
    car = shipped("suv14", 10.0)
    car.state["wheel_speed"] = speed
    fade = min(speed / 8.0, 1.0)
    peak, nominal = min(PEAK, PEAK_POWER / speed), min(NOMINAL, NOMINAL_POWER / speed)
    discharge, charge = 300e3 / 4 / speed, 160e3 / 4 / speed
    assert ask(car, -9000.0, 0.05)[-1] == pytest.approx(-min(peak, discharge), rel=1e-3)
    assert ask(car, 9000.0, 0.05)[-1] == pytest.approx(min(peak, charge) * fade, rel=1e-3)
    car.state["peak_reserve"] = 0.0
    car.params["motor_peak_time"] = 0.0
    assert ask(car, -9000.0, 0.05)[-1] == pytest.approx(-min(nominal, discharge), rel=1e-3)


def test_the_peak_lasts_half_a_minute_and_comes_back_after_a_rest(shipped: Maker) -> None:
    car = shipped("suv14", 10.0)
    car.state["wheel_speed"] = 20.0
    torque = np.abs(ask(car, -9000.0, 45.0))
    assert np.all(torque[100:28_900] == pytest.approx(PEAK, rel=1e-6))
    assert torque[-1] == pytest.approx(NOMINAL, rel=0.03)
    excess = float(np.sum(torque - NOMINAL)) * 1e-3 / (PEAK - NOMINAL)
    assert excess == pytest.approx(30.0, rel=0.1)
    ask(car, -NOMINAL * 0.9, 91.0)
    assert car.now["peak_reserve"][0] == pytest.approx(30.0)


def test_the_battery_is_shared_by_the_motors(shipped: Maker) -> None:
    car = shipped("suv14", 10.0)
    car.state["wheel_speed"] = 60.0
    ask(car, 9000.0, 0.1)
    assert float(np.sum(car.now["motor_torque"]) * 60.0) == pytest.approx(160e3, rel=1e-3)
    assert car.now["motor_limit"] * 60.0 == pytest.approx(40e3)
    car.params["motor_share"] = (0.0, 0.0, 0.5, 0.5)
    ask(car, -9000.0, 0.1)
    assert car.now["motor_torque"][:2] == pytest.approx(0.0, abs=1e-9)
    assert float(-np.sum(car.now["motor_torque"]) * 60.0) == pytest.approx(200e3, rel=1e-3)


def test_without_a_peak_the_nominal_limits_hold_from_the_start(shipped: Maker) -> None:
    car = shipped("suv", 10.0)
    car.state["wheel_speed"] = 20.0
    assert ask(car, -9000.0, 0.1)[-1] == pytest.approx(-NOMINAL)


@pytest.mark.parametrize(
    ("torque", "speed", "efficiency"),
    [
        pytest.param(1350.0, 31.1, 0.94, id="nominal"),
        pytest.param(-1350.0, 31.1, 0.94, id="driving"),
        pytest.param(1350.0, 5.0, 0.67, id="slow, hard: copper"),
        pytest.param(30.0, 100.0, 0.66, id="fast, light: iron and gear"),
        pytest.param(300.0, 60.0, 0.96, id="between"),
    ],
)
def test_a_motor_loses_most_at_the_ends_of_its_map(
    shipped: Maker, torque: float, speed: float, efficiency: float
) -> None:
    car = shipped("suv14", 10.0)
    power = abs(torque * speed)
    assert 1.0 - motor_loss(car.params[0], torque, speed) / power == pytest.approx(efficiency, abs=0.01)


def test_without_current_nothing_is_lost(shipped: Maker) -> None:
    assert motor_loss(shipped("suv14", 10.0).params[0], 0.5, 100.0) == 0.0


def test_a_torque_that_decays_ends_at_zero(shipped: Maker) -> None:
    car = shipped("suv14", 10.0)
    car.state["wheel_speed"] = 20.0
    ask(car, 1000.0, 0.1)
    assert 0.0 < ask(car, 0.0, 0.1)[-1] < 1e-12
    assert ask(car, 0.0, 2.0)[-1] == 0.0
