"""Car of a scenario: its file, payload and engine, the width of its draw, and whether CONFIG means it."""

from pathlib import Path
from typing import Final, get_args

from pydantic import BaseModel

from brakelab.plant.description import Plant, PlantFileError, load_plant
from brakelab.plant.draw import Widths, load_widths
from brakelab.simulation.configured import with_keys
from brakelab.simulation.plant_of_config import AS_CONFIG, write_plant
from brakelab.simulation.scenario import Scenario
from ecu.errors import UserError
from ecu.settings.config import Config, load_config
from ecu.settings.resources import command_name, named, resource

ANOTHER: Final = 0.10
"""Relative difference from which on a car is not the configured one."""


def scenario_plant(scenario: Scenario) -> Plant:
    """Return the car of a scenario.

    Raises:
        UserError: the plant's file cannot be read or is wrong.
    """
    try:
        plant = load_plant(named(scenario.plant, "config/plant"))
    except PlantFileError as error:
        raise UserError(error.where, error.place, error.remedy) from None
    changed: dict[str, BaseModel] = {}
    if scenario.payload is not None:
        changed["vehicle.body"] = scenario.payload.body(plant.vehicle.body)
    if scenario.engine is not None:
        changed["vehicle.engine"] = scenario.engine
    return with_keys(plant, changed)


def with_plant(scenario: Scenario, plant: str | None) -> Scenario:
    """Return a scenario with the car `plant`, a file or a name of `config/plant`; None: its own."""
    return scenario if plant is None else scenario.model_copy(update={"plant": plant})


def with_plant_for(scenario: Scenario, plant: str | None, config: Config, folder: Path) -> Scenario:
    """Return a scenario as `with_plant` does; for "as-config" its car becomes that of `config`, in `folder`.

    Raises:
        UserError: the plant's file cannot be read, or `folder` not be written.
    """
    if plant == AS_CONFIG:
        base = named(scenario.plant, "config/plant")
        plant = str(write_plant(config, base, folder / base.stem / f"{AS_CONFIG}.toml"))
    return with_plant(scenario, plant)


def with_car(scenario: Scenario, plant: str | None, config: Path | None, folder: Path) -> Scenario:
    """Return a scenario as `with_plant_for` does; the file `config` is of "as-config" and of no other car.

    Raises:
        UserError: as there; "as-config" without `config`, or this without that.
    """
    if plant == AS_CONFIG and config is not None:
        return with_plant_for(scenario, plant, load_config(config), folder)
    if plant == AS_CONFIG:
        raise UserError("--plant", plant, "of which car? give --config")
    if config is not None:
        raise UserError(
            "--config", command_name(config), f"is the car of --plant {AS_CONFIG}; give that, too"
        )
    return with_plant(scenario, plant)


def other_car(scenario: Scenario, config: Config) -> str:
    """Return in what a scenario's empty car is not that of `config`, one line; "": in nothing.

    Compared are mass, radius of the wheels, and piston area times effective radius of the brakes.

    Raises:
        UserError: the plant's file cannot be read or is wrong.
    """
    vehicle = scenario_plant(scenario.model_copy(update={"payload": None})).vehicle
    ratios = {"mass": vehicle.body.mass / config.vehicle.mass}
    for axle in ("front", "rear"):
        configured, brake = getattr(config, axle), getattr(vehicle, f"brake_{axle}")
        area = (brake.piston_diameter / configured.piston_diameter) ** 2 / configured.pistons
        ratios[f"{axle} wheels"] = vehicle.tyre.free_radius / configured.unloaded_radius
        ratios[f"{axle} brakes"] = area * brake.effective_radius / configured.effective_radius
    more = {name: ratio - 1.0 for name, ratio in ratios.items() if abs(ratio - 1.0) > ANOTHER}
    found = ", ".join(f"{name} {100.0 * by:+.0f} %" for name, by in more.items())
    if not found:
        return ""
    name = Path(scenario.plant).stem
    return f"plant {name} is another car than {config.name} ({found}); give --plant as-config, or its file"


def with_draw(scenario: Scenario, draw: str) -> Scenario:
    """Return a scenario whose cars are drawn with that width, "wide" or "nominal".

    Raises:
        UserError: there is no such width.
    """
    known = get_args(Scenario.model_fields["draw"].annotation)
    if draw not in known:
        raise UserError("--draw", draw, f"no such draw of cars; choose {' or '.join(known)}")
    return scenario.model_copy(update={"draw": draw})


def scenario_widths(scenario: Scenario) -> Widths:
    """Return the draw widths of a scenario's cars: of the file beside the car's, or the shipped one.

    Raises:
        UserError: the file is wrong.
    """
    own = named(scenario.plant, "config/plant").with_name("draw.toml")
    try:
        return load_widths(own if own.is_file() else resource("config/plant/draw.toml"), scenario.draw)
    except PlantFileError as error:
        raise UserError(error.where, error.place, error.remedy) from None
