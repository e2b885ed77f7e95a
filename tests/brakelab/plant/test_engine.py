"""An engine in overrun against its gear, its power and the work it takes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brakelab.plant.energy import energy
from brakelab.plant.engine import overrun_torque

Maker = Callable[[str, float], Any]
RATIOS = (12.0, 6.0, 3.0)


@pytest.fixture
def car(shipped: Maker) -> Callable[[float], Any]:
    """Return a maker of cars whose front axle has an engine: 30 N m + 0.05 N m s n, down to 1200 rpm."""

    def make(speed: float) -> Any:
        one = shipped("suv", speed)
        one.params["engine_drag_torque"], one.params["engine_drag_growth"] = 30.0, 0.05
        one.params["engine_lowest_speed"] = 1200 * 2 * np.pi / 60
        one.params["engine_ratio"][0, :3] = RATIOS
        one.params["engine_share"] = 0.5, 0.5, 0.0, 0.0
        return one

    return make


@pytest.mark.parametrize(
    ("rpm_of_the_wheels", "gear", "clutch"),
    [(1000, 3, 1.0), (401, 3, 1.0), (399, 2, 1.0), (201, 2, 1.0), (199, 1, 1.0), (50, 1, 0.5), (0, 1, 0.0)],
)
def test_it_turns_in_the_highest_gear_that_keeps_its_speed(
    car: Any, rpm_of_the_wheels: float, gear: int, clutch: float
) -> None:
    wheel_speed = rpm_of_the_wheels * 2 * np.pi / 60
    ratio = RATIOS[gear - 1]
    expected = ratio * clutch * (30.0 + 0.05 * ratio * wheel_speed)
    assert overrun_torque(car(20.0).params[0], wheel_speed) == pytest.approx(expected)


def test_its_power_is_that_of_the_crankshaft(car: Any) -> None:
    """25 m/s in top gear; what the wheels lose, the crankshaft's friction takes: T n."""
    one = car(25.0)
    one.run(2.0)
    seen = one.states(0.5)
    wheel_speed = seen["wheel_speed"][:, :2].mean(axis=1)
    crankshaft = 3.0 * wheel_speed
    power = (30.0 + 0.05 * crankshaft) * crankshaft
    assert seen["engine_loss"][-1] - seen["engine_loss"][0] == pytest.approx(
        np.trapezoid(power, dx=1e-3), rel=1e-3
    )
    assert np.all(seen["engine_torque"][:, 2:] == 0.0)


def test_the_car_is_slower_by_it_and_its_energy_is_accounted_for(car: Any, shipped: Maker) -> None:
    braked, free = car(25.0), shipped("suv", 25.0)
    before = braked.state.copy()
    for one in (braked, free):
        one.run(5.0)
    found, without = (energy(one.params, before, one.state) for one in (braked, free))
    assert abs(found.missing) < 1e-8
    mass = braked.params["mass"][0] + 4 * 1.6 / 0.37**2
    slower = 0.5 * mass * (free.now["speed_x"] ** 2 - braked.now["speed_x"] ** 2)
    saved = sum(without[4:]) - sum(found[4:]) + found.engine  # less drag and rolling at the lower speed
    assert slower + saved == pytest.approx(found.engine, rel=3e-3)
    assert found.engine > 30e3


def test_an_engine_that_pulls_does_not_drag(car: Any) -> None:
    one = car(25.0)
    for torque, drags in ((0.0, True), (-200.0, False), (0.0, True)):
        one.commands["motor_demand"] = torque
        one.run(2.0)
        assert (one.now["engine_torque"][0] > 20.0) == drags
    one.now["speed_x"], one.now["wheel_speed"] = 0.0, 0.0
    one.run(3.0)
    assert one.now["engine_torque"] == pytest.approx(0.0, abs=0.1)
    assert one.now["speed_x"] == pytest.approx(0.0, abs=1e-6)
