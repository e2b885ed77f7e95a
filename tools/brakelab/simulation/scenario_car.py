"""Car of a scenario: its file, its payload, its engine, and the width of its draw."""

from typing import get_args

from pydantic import BaseModel

from brakelab.plant.description import Plant, PlantFileError, load_plant
from brakelab.plant.draw import Widths, load_widths
from brakelab.simulation.scenario import Scenario
from ecu.errors import UserError
from ecu.settings.resources import named, resource


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
        changed["body"] = scenario.payload.body(plant.vehicle.body)
    if scenario.engine is not None:
        changed["engine"] = scenario.engine
    return plant.model_copy(update={"vehicle": plant.vehicle.model_copy(update=changed)})


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
