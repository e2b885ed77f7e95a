"""Tables of a scenario file: phases, speed trace, steering, payload, the road by place."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from brakelab.plant.description import Body
from brakelab.plant.road import Road
from brakelab.simulation.speed_trace import (
    N_TRIPS,
    SpeedTrace,
    generated_trace,
    read_trace,
    trace_of,
    wltp_brake_trace,
)
from ecu.settings.described import describe_keys
from ecu.settings.toml_file import Unit

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Row = tuple[float, float]
Sides = tuple[float, float, float]
BRAKE_BY = ("decel", "pedal", "kept_decel")
REAL_DRIVING, WLTP_BRAKE = "real-driving", "wltp-brake"


def as_rows(rows: list[Row] | list[Sides], columns: int = 2) -> NDArray[np.float64]:
    """Return a table as an array of shape (rows, columns), also without a row."""
    return np.array(rows, dtype=np.float64).reshape(-1, columns)


class ScenarioTable(BaseModel):
    """A table of a scenario: no key but those it knows."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, json_schema_extra=describe_keys
    )


class Phase(ScenarioTable):
    """One phase of the driver's actions."""

    kind: Literal["cruise", "coast", "brake", "follow"]
    """Hold a speed on the motors, roll, brake, or follow a speed trace to its end."""
    speed: Annotated[NotNegative, Unit("m/s")] | None = None
    """Held by a cruise phase."""
    accel: Annotated[Positive, Unit("m/s^2")] = 2.0
    """Greatest by the motors."""
    decel: Annotated[NotNegative, Unit("m/s^2")] | None = None
    """Demanded by a brake phase."""
    pedal: Annotated[float, Field(ge=0.0, le=100.0), Unit("%")] | None = None
    """Position that a brake phase keeps."""
    kept_decel: Annotated[Positive, Unit("m/s^2")] | None = None
    """Deceleration that the driver of a brake phase keeps by the pedal."""
    ramp: Annotated[Positive, Unit("m/s^3")] = 13.3
    """Of `decel`: 4 m/s^2 within 0.3 s, as a pedal at 150 mm/s over some 90 mm would ask for it."""
    pedal_speed: Annotated[Positive, Unit("mm/s")] = 150.0
    """Of the foot; sections 5.7 and 5.7.2 have 150 and 50."""
    until_speed: Annotated[NotNegative, Unit("m/s")] | None = None
    """The phase ends when the speed passes it."""
    seconds: Annotated[Positive, Unit("s")] | None = None
    """The phase ends after it at the latest."""

    @model_validator(mode="after")
    def _complete(self) -> "Phase":
        if self.until_speed is None and self.seconds is None and self.kind != "follow":
            raise ValueError("never ends; give until_speed or seconds")
        if (self.speed is None) == (self.kind == "cruise"):
            raise ValueError("speed belongs to a cruise phase, and only there")
        if self.kind == "cruise" and self.speed == self.until_speed:
            raise ValueError("until_speed is never passed; give a speed beyond it")
        given = sum(getattr(self, name) is not None for name in BRAKE_BY)
        if given != (self.kind == "brake"):
            raise ValueError("a brake phase needs one of decel, pedal and kept_decel, no other phase has any")
        return self


class Trace(ScenarioTable):
    """Speed trace of a `follow` phase, from one of three sources."""

    speed: Annotated[list[Row], Unit("s, m/s")] | None = None
    """Rows of time and speed."""
    file: str | None = None
    """CSV file of time and speed, beside the scenario."""
    generate: Literal["real-driving", "wltp-brake"] | None = None
    """A trip of `simulation/trip/generate.py`, with its grade, or the cycle of `wltp_brake.py` there."""
    seed: Annotated[int, Field(ge=0), Unit("-")] = 0
    """Of the trip of real driving."""
    trip: Annotated[int, Field(ge=1, le=N_TRIPS), Unit("-")] | None = None
    """Of the WLTP-Brake cycle; without it all trips in a row."""

    @model_validator(mode="after")
    def _one_source(self) -> "Trace":
        if sum(given is not None for given in (self.speed, self.file, self.generate)) != 1:
            raise ValueError("give one of speed, file and generate")
        if "seed" in self.model_fields_set and self.generate != REAL_DRIVING:
            raise ValueError(f'seed belongs to generate = "{REAL_DRIVING}"')
        if self.trip is not None and self.generate != WLTP_BRAKE:
            raise ValueError(f'trip belongs to generate = "{WLTP_BRAKE}"')
        if self.speed is not None:
            trace_of(self.speed)
        return self

    def trace(self) -> SpeedTrace:
        """Return the trace. Raises `UserError`: the file is wrong or cannot be read."""
        if self.speed is not None:
            return trace_of(self.speed)
        if self.file is not None:
            return read_trace(Path(self.file))
        return wltp_brake_trace(self.trip) if self.generate == WLTP_BRAKE else generated_trace(self.seed)


class SteeringFile(ScenarioTable):
    """Steering by file: see `brakelab.plant.steering`."""

    angle: Annotated[list[Row], Unit("s, rad")] = []
    """Of the road wheels by time, positive to the left."""
    path: Annotated[list[Row], Unit("m, m")] = []
    """Place to the left by the distance driven; a driver follows it."""

    @model_validator(mode="after")
    def _one_that_rises(self) -> "SteeringFile":
        if bool(self.angle) == bool(self.path):
            raise ValueError("give either angle (by time) or path")
        for name, rows in self:
            if np.any(np.diff([row[0] for row in rows]) <= 0.0):
                raise ValueError(f"{name}: give rows of rising {'time' if name == 'angle' else 'distance'}")
        return self


class TyreFault(ScenarioTable):
    """Change of the tyres' slip stiffness by the factor `stiffness` from `time` [s] on (section 4.6)."""

    time: Annotated[NotNegative, Unit("s")]
    """When the tyres change."""
    stiffness: Annotated[Positive, Unit("-")]
    """Factor of the slip stiffness from then on."""


class Payload(ScenarioTable):
    """Payload beside the driver, a point mass of `mass` [kg]."""

    mass: Annotated[Positive, Unit("kg")]
    """Of what the car carries."""
    behind: Annotated[float, Unit("m")]
    """Behind the empty car's centre of gravity."""
    height: Annotated[Positive, Unit("m")]
    """Over the road."""

    def body(self, empty: Body) -> Body:
        """Return the laden car's body: its mass, centre of gravity and yaw inertia."""
        mass = empty.mass + self.mass
        back = self.mass * self.behind / mass
        update = {
            "mass": mass,
            "front_length": empty.front_length + back,
            "rear_length": empty.rear_length - back,
            "cog_height": (empty.mass * empty.cog_height + self.mass * self.height) / mass,
            "yaw_inertia": empty.yaw_inertia + empty.mass * back * self.behind,
        }
        return empty.model_copy(update=update)


class RoadByPlace(ScenarioTable):
    """The road over the distance driven; see `brakelab.plant.road`."""

    friction: Annotated[list[Sides], Unit("m, -, -")] = []
    """Rows of distance, friction on the left, friction on the right."""
    height: Annotated[list[Sides], Unit("m, m, m")] = []
    """Rows of distance, height of the left side, of the right side."""
    grade: Annotated[list[Row], Unit("m, rad")] = []
    """Rows of distance and grade, positive uphill."""
    bank: Annotated[list[Row], Unit("m, rad")] = []
    """Rows of distance and bank of the road."""

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
        return Road(
            as_rows(self.friction, 3), as_rows(self.height, 3), as_rows(self.grade), as_rows(self.bank)
        )
