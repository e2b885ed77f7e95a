"""Scenario files in TOML: the car, the road and the driver's actions.

```
plant = "suv"                    # of config/plant
draw = "wide"                    # or "nominal": less scatter between cars of the series
initial_speed = 33.33            # m/s
road_friction = [[0.0, 1.2], [9.0, 1.2], [9.01, 0.7]]      # or one number

[[phase]]
kind = "cruise"                  # hold `speed` on the motors
speed = 33.33
seconds = 6.0

[[phase]]
kind = "brake"                   # by a demanded `decel` [m/s^2], by `pedal` [%], or by
decel = 4.0                      # the pedal that it takes for `kept_decel` [m/s^2]
until_speed = 0.0
```
A phase ends after `seconds` or when the speed passes `until_speed`, whichever comes first; the list is driven
`repeat` times. A phase of the kind "follow" follows a speed trace to its end:
```
[trace]
file = "town.csv"                # beside the scenario; or `speed = [[0.0, 0.0], [9.0, 14.0]]`
generate = "real-driving"        # or that of brakelab.trip.generate, with its grade
seed = 1
```
The road can be described by place instead of time, with friction and height of each side, and the steering:
```
[road]
friction = [[0.0, 1.2, 1.2], [150.0, 1.2, 1.2], [150.1, 0.2, 1.2]]    # m, left, right
grade = [[0.0, 0.0], [300.0, -0.06]]                                    # m, rad

[sensor.accel_x]                 # errors of a sensor, see `brakelab.plant.sensor_errors`
bias = [-0.1, 0.1]               # drawn per car; or one number

[sensor.wheel_speed_fl]          # `wheel_speed` would be all four
lost_from = 3.0                  # s

[payload]                        # what the car carries
mass = 495.0                     # kg
behind = 0.65                    # m, of the empty car's centre of gravity
height = 0.80                    # m

[steering]
angle = [[0.0, 0.0], [2.0, 0.03]]          # s, rad at the road wheel, left positive
path = [[0.0, 0.0], [30.0, 3.5]]           # or m, m: path that the driver follows
```
Faults of the bus, a sensor or an actuator are described by `[[fault]]` tables: `faults.py`.
"""

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from brakelab.plant.cycle import CYCLE
from brakelab.plant.description import Body
from brakelab.plant.driver import PEDAL_TRAVEL, Script
from brakelab.plant.records import BRAKE, COAST, CRUISE, FOLLOW, PHASE
from brakelab.plant.road import Road
from brakelab.plant.sensor_errors import Sensors
from brakelab.plant.steering import Steering
from brakelab.simulation.faults import Fault
from brakelab.simulation.speed_trace import SpeedTrace, generated_trace, read_trace, trace_of
from ecu.settings.toml_file import describe, read_toml

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Row = tuple[float, float]
Sides = tuple[float, float, float]
ByTime = Annotated[
    list[Row], BeforeValidator(lambda given: given if isinstance(given, list) else [(0.0, given)])
]
"""Rows of time [s] and value; a number alone holds all the time."""
KINDS = {"cruise": CRUISE, "coast": COAST, "brake": BRAKE, "follow": FOLLOW}
BRAKE_BY = ("decel", "pedal", "kept_decel")
LONGEST = 10_800.0
"""s, a scenario that did not end by itself ends here."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Phase(_Section):
    """One phase of the driver's actions."""

    kind: Literal["cruise", "coast", "brake", "follow"]
    speed: NotNegative | None = None
    accel: Positive = 2.0
    decel: NotNegative | None = None
    pedal: Annotated[float, Field(ge=0.0, le=100.0)] | None = None
    kept_decel: Positive | None = None
    ramp: Positive = 13.3
    """m/s^3; 4 m/s^2 within 0.3 s, as a pedal at 150 mm/s over some 90 mm would ask for it."""
    pedal_speed: Positive = 150.0
    """mm/s; sections 5.7 and 5.7.2 have 150 and 50."""
    until_speed: NotNegative | None = None
    seconds: Positive | None = None

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


class Trace(_Section):
    """Speed trace of a `follow` phase, from one of three sources."""

    speed: list[Row] | None = None
    file: str | None = None
    generate: Literal["real-driving"] | None = None
    seed: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _one_source(self) -> "Trace":
        if sum(given is not None for given in (self.speed, self.file, self.generate)) != 1:
            raise ValueError("give one of speed, file and generate")
        if "seed" in self.model_fields_set and self.generate is None:
            raise ValueError("seed belongs to generate")
        if self.speed is not None:
            trace_of(self.speed)
        return self

    def trace(self) -> SpeedTrace:
        """Return the trace. Raises `UserError`: the file is wrong or cannot be read."""
        if self.speed is not None:
            return trace_of(self.speed)
        return generated_trace(self.seed) if self.file is None else read_trace(Path(self.file))


class SteeringFile(_Section):
    """Steering by file: see `brakelab.plant.steering`."""

    angle: list[Row] = []
    path: list[Row] = []

    @model_validator(mode="after")
    def _one_that_rises(self) -> "SteeringFile":
        if bool(self.angle) == bool(self.path):
            raise ValueError("give either angle (by time) or path")
        for name, rows in self:
            if np.any(np.diff([row[0] for row in rows]) <= 0.0):
                raise ValueError(f"{name}: give rows of rising {'time' if name == 'angle' else 'distance'}")
        return self


class TyreFault(_Section):
    """Change of the tyres' slip stiffness by the factor `stiffness` from `time` [s] on (section 4.6)."""

    time: NotNegative
    stiffness: Positive


class Payload(_Section):
    """Payload beside the driver, a point mass of `mass` [kg]."""

    mass: Positive
    behind: float
    """Behind the empty car's centre of gravity, m."""
    height: Positive
    """Over the road, m."""

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
        return Road(_rows(self.friction, 3), _rows(self.height, 3), _rows(self.grade), _rows(self.bank))


class Scenario(_Section):
    """A scenario file."""

    plant: str
    draw: Literal["wide", "nominal"] = "wide"
    """How far the car of a seed is from its file; see `brakelab.plant.draw`."""
    payload: Payload | None = None
    initial_speed: NotNegative
    initial_disc_temperature: tuple[float, float] = (100.0, 100.0)
    """Front and rear, degC; 100 as where the friction's nominal value is defined."""
    ambient_temperature: float = 20.0
    road_friction: ByTime = [(0.0, 1.2)]
    grade: ByTime = [(0.0, 0.0)]
    road: RoadByPlace = RoadByPlace()
    """Quantities in it must not be described by time as well."""
    steering: SteeringFile | None = None
    """Without it the car is steered straight on."""
    wetness: Share = 0.0
    """Of the discs, 0 dry to 1 rain; above 0 the bus says that it rains."""
    tyre_fault: TyreFault | None = None
    vehicle_speed: Literal["ideal", "optical", "gnss", "none"] = "ideal"
    """Source of the speed on the bus; see `brakelab.plant.sensor_errors.SPEED_SOURCES`."""
    wheel_transducers: bool = False
    """The bus carries wheel forces and torques."""
    sensor: Sensors = {}
    """Errors of its sensors beside those that the car's file gives."""
    blending: bool = False
    """While brakes are asked for the motors do what the ECU asks; otherwise they rest."""
    charge_limit: ByTime = []
    """Charging limit of the battery [W], instead of that of the car's file; at 0 its motors cannot brake."""
    motor_share: Share = 0.0
    """Of each deceleration asked for, what the motors take; the brakes are asked for the rest (5.2)."""
    trace: Trace | None = None
    repeat: Annotated[int, Field(ge=1)] = 1
    """How often the phases are driven."""
    fault: list[Fault] = []
    """Faults on the way; see `brakelab.simulation.faults`."""
    phase: Annotated[list[Phase], Field(min_length=1)]

    @model_validator(mode="after")
    def _consistent(self) -> "Scenario":
        for name in ("road_friction", "grade", "charge_limit"):
            table = _rows(getattr(self, name))
            if (len(table) == 0 and name != "charge_limit") or np.any(np.diff(table[:, 0]) <= 0.0):
                raise ValueError(f"{name}: give rows of rising time [[t, value], ...]")
        if any(value <= 0.0 for _, value in self.road_friction):
            raise ValueError("road_friction: give values above 0")
        if any(value < 0.0 for _, value in self.charge_limit):
            raise ValueError("charge_limit: give values of at least 0")
        for name, by_time in (("friction", "road_friction"), ("grade", "grade")):
            if getattr(self.road, name) and by_time in self.model_fields_set:
                raise ValueError(f"give either {by_time} (by time) or road.{name} (by place)")
        if (self.trace is None) == any(phase.kind == "follow" for phase in self.phase):
            raise ValueError("a follow phase needs [trace], and [trace] a follow phase")
        if (
            self.trace is not None
            and self.trace.generate
            and (self.road.grade or "grade" in self.model_fields_set)
        ):
            raise ValueError("grade: a generated trace has its own; remove this key")
        if self.motor_share > 0.0 and self.blending:
            raise ValueError("give either blending (by the ECU) or motor_share (without it)")
        return self

    def script(self) -> Script:
        """Return the actions of driver and road as arrays for the kernels.

        Raises:
            UserError: the trace's file cannot be read or is wrong.
        """
        trace = SpeedTrace(np.zeros((1, 2)), np.empty((0, 2))) if self.trace is None else self.trace.trace()
        road = self.road.road()
        if len(trace.grade) > 0:
            road = road._replace(grade=trace.grade)
        fault = self.tyre_fault
        return Script(
            self._phases(float(trace.speed[-1, 0])),
            _rows(self.road_friction),
            _rows(self.grade),
            self.ambient_temperature,
            self.blending,
            road,
            Steering(*(_rows(getattr(self.steering, name, [])) for name in Steering._fields)),
            trace.speed,
            self.wetness,
            self.motor_share,
            -1 if fault is None else round(fault.time / CYCLE),
            1.0 if fault is None else fault.stiffness,
            _rows(self.charge_limit),
        )

    def _phases(self, trace_end: float) -> NDArray[np.void]:
        phases = np.zeros(len(self.phase), PHASE)
        for row, phase in zip(phases, self.phase, strict=True):
            row["kind"] = KINDS[phase.kind]
            row["accel"], row["ramp"] = phase.accel, phase.ramp
            row["pedal_rate"] = phase.pedal_speed / PEDAL_TRAVEL * 100.0
            for name in ("speed", "until_speed", *BRAKE_BY):
                value = getattr(phase, name)
                row[name] = math.nan if value is None else value
            ends = trace_end if phase.kind == "follow" else math.inf
            row["seconds"] = ends if phase.seconds is None else min(phase.seconds, ends)
        return np.tile(phases, self.repeat)


def _rows(rows: list[Row] | list[Sides], columns: int = 2) -> NDArray[np.float64]:
    return np.array(rows, dtype=np.float64).reshape(-1, columns)


def load_scenario(path: Path) -> Scenario:
    """Read and check a scenario file.

    Raises:
        UserError: the file cannot be read, or a key is missing, unknown or out of range.
    """
    content = read_toml(path)
    trace = content.get("trace")
    if isinstance(trace, dict) and isinstance(trace.get("file"), str):
        trace["file"] = str(path.parent / trace["file"])
    try:
        return Scenario.model_validate(content)
    except ValidationError as error:
        raise describe(error, str(path), Scenario) from None
