"""Scenario files: which car, on which road, what its driver does, in TOML.

```
plant = "suv"                    # of config/plant
initial_speed = 33.33            # m/s
road_friction = [[0.0, 1.2], [9.0, 1.2], [9.01, 0.7]]      # or one number

[[phase]]
kind = "cruise"                  # hold `speed` on the motors
speed = 33.33
seconds = 6.0

[[phase]]
kind = "brake"                   # by `decel` [m/s^2] or `pedal` [%]
decel = 4.0
until_speed = 0.0
```
The road can be described by place instead of time, with friction and height of each side:
```
[road]
friction = [[0.0, 1.2, 1.2], [150.0, 1.2, 1.2], [150.1, 0.2, 1.2]]    # m, left, right
grade = [[0.0, 0.0], [300.0, -0.06]]                                    # m, rad
```
A phase ends after `seconds` or when the speed passes `until_speed`, whichever comes first.
"""

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from brakelab.plant.description import Plant, PlantFileError, load_plant
from brakelab.plant.driver import Script
from brakelab.plant.records import BRAKE, COAST, CRUISE, PHASE
from brakelab.plant.road import Road
from ecu.config import describe, read_toml
from ecu.errors import UserError
from ecu.resources import named

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Row = tuple[float, float]
Sides = tuple[float, float, float]
KINDS = {"cruise": CRUISE, "coast": COAST, "brake": BRAKE}
LONGEST = 3600.0
"""s, a scenario that did not end by itself ends here."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Phase(_Section):
    """What the driver does for a while."""

    kind: Literal["cruise", "coast", "brake"]
    speed: NotNegative | None = None
    accel: Positive = 2.0
    decel: NotNegative | None = None
    pedal: Annotated[float, Field(ge=0.0, le=100.0)] | None = None
    ramp: Positive = 13.3
    """m/s^3; 4 m/s^2 within 0.3 s, as a pedal at 150 mm/s over some 90 mm would ask for it."""
    until_speed: NotNegative | None = None
    seconds: Positive | None = None

    @model_validator(mode="after")
    def _complete(self) -> "Phase":
        if self.until_speed is None and self.seconds is None:
            raise ValueError("never ends; give until_speed or seconds")
        if (self.speed is None) == (self.kind == "cruise"):
            raise ValueError("speed belongs to a cruise phase, and only there")
        if self.kind == "brake" and (self.decel is None) == (self.pedal is None):
            raise ValueError("a brake phase needs either decel or pedal")
        if self.kind != "brake" and (self.decel is not None or self.pedal is not None):
            raise ValueError("decel and pedal belong to a brake phase")
        return self


class RoadByPlace(_Section):
    """The road over the distance driven; see `brakelab.plant.road`."""

    friction: list[Sides] = []
    height: list[Sides] = []
    grade: list[Row] = []
    bank: list[Row] = []

    @model_validator(mode="after")
    def _tables_rise(self) -> "RoadByPlace":
        for name, rows in self:
            if np.any(np.diff([row[0] for row in rows]) <= 0.0):
                raise ValueError(f"{name}: give rows of rising distance")
        if any(min(left, right) <= 0.0 for _, left, right in self.friction):
            raise ValueError("friction: give values above 0")
        return self

    def road(self) -> Road:
        """Return the tables as arrays for the kernels."""

        def array(rows: list[Row] | list[Sides], columns: int) -> NDArray[np.float64]:
            return np.array(rows, dtype=np.float64).reshape(-1, columns)

        return Road(array(self.friction, 3), array(self.height, 3), array(self.grade, 2), array(self.bank, 2))


class Scenario(_Section):
    """A scenario file."""

    plant: str
    initial_speed: NotNegative
    initial_disc_temperature: tuple[float, float] = (100.0, 100.0)
    """Front and rear, degC; 100 as where the friction's nominal value is defined."""
    ambient_temperature: float = 20.0
    road_friction: Positive | list[Row] = 1.2
    grade: float | list[Row] = 0.0
    road: RoadByPlace = RoadByPlace()
    """What it describes must not be described by time as well."""
    vehicle_speed: bool = True
    """The bus carries a vehicle speed."""
    wheel_transducers: bool = False
    """The bus carries wheel forces and torques."""
    blending: bool = False
    """While braking the motors do what the ECU asks; otherwise they rest."""
    phase: Annotated[list[Phase], Field(min_length=1)]

    @model_validator(mode="after")
    def _tables_rise(self) -> "Scenario":
        for name in ("road_friction", "grade"):
            table = _table(getattr(self, name))
            if len(table) == 0 or np.any(np.diff(table[:, 0]) <= 0.0):
                raise ValueError(f"{name}: give rows of rising time [[t, value], ...]")
        for name, by_time in (("friction", "road_friction"), ("grade", "grade")):
            if getattr(self.road, name) and by_time in self.model_fields_set:
                raise ValueError(f"give either {by_time} (by time) or road.{name} (by place)")
        return self

    def script(self) -> Script:
        """Return what driver and road do as arrays for the kernels."""
        phases = np.zeros(len(self.phase), PHASE)
        for row, phase in zip(phases, self.phase, strict=True):
            row["kind"] = KINDS[phase.kind]
            row["accel"], row["ramp"] = phase.accel, phase.ramp
            for name in ("speed", "decel", "pedal", "until_speed"):
                value = getattr(phase, name)
                row[name] = math.nan if value is None else value
            row["seconds"] = math.inf if phase.seconds is None else phase.seconds
        return Script(
            phases,
            _table(self.road_friction),
            _table(self.grade),
            self.ambient_temperature,
            self.blending,
            self.road.road(),
        )


def _table(value: float | list[Row]) -> NDArray[np.float64]:
    rows = value if isinstance(value, list) else [(0.0, value)]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def load_scenario(path: Path) -> Scenario:
    """Read and check a scenario file.

    Raises:
        UserError: the file cannot be read, or a key is missing, unknown or out of range.
    """
    try:
        return Scenario.model_validate(read_toml(path))
    except ValidationError as error:
        raise describe(error, str(path)) from None


def scenario_plant(scenario: Scenario) -> Plant:
    """Return the car of a scenario.

    Raises:
        UserError: the plant's file cannot be read or is wrong.
    """
    try:
        return load_plant(named(scenario.plant, "config/plant"))
    except PlantFileError as error:
        raise UserError(error.where, error.place, error.remedy) from None
