"""The step: half of it changes a stop or a step-steer by less than a thousandth."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.plant.cycle import CYCLE, set_commands
from brakelab.plant.driver import drive
from brakelab.plant.records import DEMAND, DRIVER, new_record
from brakelab.plant.vehicle import STEP
from brakelab.simulation.scenario import load_scenario

SCENARIOS = Path(__file__).parents[3] / "config" / "scenarios"

Maker = Callable[[str, float], Any]


def stop(car: Any, name: str, dt: float) -> tuple[float, float]:
    """Drive a stop of Table 4.2 on the hydraulics' fallback; return distance [m] and mean friction by it."""
    script = load_scenario(SCENARIOS / f"{name}.toml").script()
    driver, demand = new_record(DRIVER), new_record(DEMAND)
    demand["pressure_age"] = demand["motor_age"] = math.inf
    distance, friction = [], []
    while drive(script, car.params[0], car.now, driver[0], CYCLE):
        set_commands(script, car.params[0], car.now, driver[0], demand[0], car.commands[0])
        car.run(CYCLE, dt)
        if driver["decel_demand"][0] > 0.0:
            distance.append(float(car.now["distance"]))
            friction.append(float(car.now["mu_b"].mean()))
    assert abs(float(car.now["speed_x"])) < 0.01
    return distance[-1] - distance[0], float(np.average(friction[1:], weights=np.diff(distance)))


@pytest.mark.parametrize("name", ["stop-1", "stop-2", "stop-3", "stop-4"])
@pytest.mark.parametrize("car", ["suv", "suv14"])
def test_half_a_step_changes_distance_and_friction_of_a_stop_by_less_than_a_thousandth(
    shipped: Maker, car: str, name: str
) -> None:
    whole, half = (stop(shipped(car, 33.333), name, dt) for dt in (STEP, 0.5 * STEP))
    assert whole == pytest.approx(half, rel=1e-3)
    assert 80.0 < whole[0] < 180.0


@pytest.mark.parametrize("car", ["suv", "suv14"])
def test_half_a_step_changes_a_step_steer_by_less_than_a_thousandth(shipped: Maker, car: str) -> None:
    found = []
    for dt in (STEP, 0.5 * STEP):
        steered = shipped(car, 25.0)
        steered.commands["steering_angle"] = 0.03
        steered.run(1.5, dt)
        found.append([float(steered.now[name]) for name in ("yaw_rate", "roll", "accel_y", "speed_x")])
    assert found[0] == pytest.approx(found[1], rel=1e-3)
