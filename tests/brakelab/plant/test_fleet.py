"""Many cars at once: the bits of each are those it has alone."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.plant.description import load_plant
from brakelab.plant.draw import draw, load_widths
from brakelab.plant.fleet import advance_fleet
from brakelab.plant.records import COMMANDS, STATE, RecordArray
from brakelab.plant.vehicle import STEP, advance, new_state

pytestmark = pytest.mark.study

CONFIG = Path(__file__).parents[3] / "config" / "plant"
CARS = 5


@pytest.mark.parametrize("name", ["suv", "suv14"])
def test_a_fleet_is_the_cars_one_by_one(name: str) -> None:
    plant = load_plant(CONFIG / f"{name}.toml")
    width = load_widths(CONFIG / "draw.toml", "wide")
    params: RecordArray = np.concatenate([draw(plant, seed, width) for seed in range(CARS)])
    states: RecordArray = np.concatenate(
        [new_state(params[i : i + 1], 25.0, (80.0, 80.0)) for i in range(CARS)]
    )
    commands = np.zeros(CARS, COMMANDS)
    commands["road_friction"] = 1.2
    commands["steering_angle"] = 0.02
    commands["pressure_demand"] = 30e5
    alone = states.copy()
    advance_fleet(params, states, commands, 300, STEP)
    for car in range(CARS):
        for _ in range(300):
            advance(params[car], alone[car], commands[car], STEP)
    for name in STATE.names or ():
        assert states[name].tobytes() == alone[name].tobytes(), name
    assert len(set(states["speed_x"])) == CARS
