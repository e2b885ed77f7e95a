"""The plant file of a configured car: it is that car, and it brakes."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.plant.description import load_plant, nominal
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.plant_of_config import AS_CONFIG
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.scenario_car import other_car, with_draw, with_plant, with_plant_for
from ecu import cli
from ecu.settings.config import Config, load_config
from ecu.settings.hydraulics import Hydraulics
from ecu.settings.resources import resource

STOP = load_scenario(resource("config/scenarios/stop-1.toml"))


def hatchback() -> Config:
    """1180 kg on 16-inch wheels; two pistons in front."""
    suv = load_config(resource("config/suv.toml"))
    front = {"unloaded_radius": 0.307, "pistons": 2, "piston_diameter": 0.036, "effective_radius": 0.104}
    return suv.model_copy(
        update={
            "name": "hatch",
            "vehicle": suv.vehicle.model_copy(update={"mass": 1180.0, "wheelbase": 2.49, "front_axle": 0.96}),
            "front": suv.front.model_copy(update=front),
            "rear": suv.rear.model_copy(update={"unloaded_radius": 0.307, "effective_radius": 0.1}),
        }
    )


@pytest.mark.parametrize("base", ["suv", "suv14", "sedan"])
def test_the_car_of_the_file_is_the_configured_one(base: str, tmp_path: Path) -> None:
    config = hatchback()
    driven = with_plant_for(STOP.model_copy(update={"plant": base}), AS_CONFIG, config, tmp_path)
    assert other_car(driven, config) == ""
    car = nominal(load_plant(Path(driven.plant)))[0]
    assert car["mass"] == 1180.0
    assert car["piston_area"][0] == pytest.approx(2 * np.pi / 4 * 0.036**2, rel=1e-4)
    assert "mass = 1180.0 # of hatch" in Path(driven.plant).read_text("utf-8")


@pytest.mark.parametrize("base", ["suv", "suv14"])
def test_it_stops_as_asked(base: str, tmp_path: Path) -> None:
    config = hatchback()
    driven = with_plant_for(STOP.model_copy(update={"plant": base}), AS_CONFIG, config, tmp_path)
    drive = run(new_loop(with_draw(driven, "nominal"), config, 1))
    speed = drive.truth["vehicle_speed"]
    braking = (drive.truth["decel_demand"] > 3.9) & (speed > 8.0) & (speed < 25.0)
    achieved = -float(np.mean(np.gradient(speed, 0.01)[braking]))
    print(f"{achieved:.2f} m/s^2 of 4")
    assert achieved == pytest.approx(4.0, abs=0.4)


def test_its_hydraulic_unit_is_the_configured_one(tmp_path: Path) -> None:
    unit = Hydraulics(dead_time_rise=0.15, lag_fall=0.09, rise_limit=80.0)
    config = hatchback().model_copy(update={"hydraulics": unit})
    driven = with_plant_for(STOP, AS_CONFIG, config, tmp_path)
    car = nominal(load_plant(Path(driven.plant)))[0]
    assert car["build_up"] == pytest.approx([0.00075, 0.037, 0.15])
    assert car["release"] == pytest.approx([4 * 0.00021, 0.09, 0.015])
    assert (car["rise_limit"], car["fall_limit"]) == (80e5, 18000e5)


def test_config_plant_writes_the_car_for_other_commands(tmp_path: Path) -> None:
    car, out = tmp_path / "car.toml", tmp_path / "made" / "plant.toml"
    car.write_text('include = "suv"\n[vehicle]\nmass = 1750.0\n')
    words = ["config", "plant", str(car), "--out", str(out)]
    for _ in range(2):  # it may renew what it wrote
        assert cli.main(words) == 0
    assert nominal(load_plant(out))[0]["mass"] == 1750.0
    driven = with_plant(STOP, str(out))
    assert other_car(driven, load_config(car)) == ""
    assert cli.main(["config", "plant", str(car), "--out", str(car)]) == 2  # it reads this one
    assert "1750" in car.read_text()
