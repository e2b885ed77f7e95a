"""Whether the simulated car is the configured one: to 10 % in mass, wheels and brakes."""

import pytest

from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.scenario_car import other_car, with_plant
from ecu.settings.config import Config, load_config
from ecu.settings.resources import resource

SUV = resource("config/suv.toml")


def changed(table: str, **values: float) -> Config:
    config = load_config(SUV)
    return config.model_copy(update={table: getattr(config, table).model_copy(update=values)})


@pytest.mark.parametrize(
    ("config", "plant", "message"),
    [
        (load_config(SUV), None, ""),
        (load_config(SUV), "suv14", ""),
        (load_config(resource("config/lcv.toml")), "lcv", ""),
        (load_config(resource("config/sedan.toml")), "sedan", ""),
        (changed("vehicle", mass=1950.0), None, ""),
        (changed("vehicle", mass=1180.0), None, "mass +78 %"),
        (changed("front", unloaded_radius=0.29), None, "front wheels +28 %"),
        (changed("rear", effective_radius=0.17), None, "rear brakes -24 %"),
        (changed("front", pistons=2, piston_diameter=0.0425), None, ""),  # as much as one of 60 mm
        (load_config(resource("config/lcv.toml")), None, "mass +11 %"),
    ],
)
def test_another_car_than_the_configured_one_is_named(
    config: Config, plant: str | None, message: str
) -> None:
    scenario = load_scenario(resource("config/scenarios/single.toml"))
    line = other_car(with_plant(scenario, plant), config)
    assert message in line
    assert bool(line) == bool(message)


def test_a_payload_is_not_another_car() -> None:
    laden = load_scenario(resource("config/scenarios/type-0-laden.toml"))
    assert laden.payload is not None
    assert other_car(laden, load_config(SUV)) == ""
