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
generate = "real-driving"        # or that of brakelab.simulation.trip.generate, with its grade
seed = 1
generate = "wltp-brake"          # or that of brakelab.simulation.trip.wltp_brake, on a level road
trip = 3                         # one of its ten; all of them without
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

[car]                            # what of the drawn car is set
cog_height = 0.75                # m
friction_scale_front = "80 %"    # of the drawn one

[payload]                        # what the car carries
mass = 495.0                     # kg
behind = 0.65                    # m, of the empty car's centre of gravity
height = 0.80                    # m

[engine]                         # combustion, in overrun, see `brakelab.plant.engine`
drag_torque = 25.0               # N m
lowest_speed = 126.0             # rad/s: there the gearbox shifts down
ratios = [14.8, 6.60, 3.15]      # crankshaft over wheels
share_front = 1.0

[steering]
angle = [[0.0, 0.0], [2.0, 0.03]]          # s, rad at the road wheel, left positive
path = [[0.0, 0.0], [30.0, 3.5]]           # or m, m: path that the driver follows
```
`[[fault]]` tables are faults of the bus, a sensor or an actuator; `[[expect]]` tables say what the run has to
show: by them `rig` and `simulate` pass or fail it. docs/rig.md has the keys of both.
```
[[fault]]
kind = "lost"
message = ["Imu"]
t = 4.0                          # s
duration = 1.0

[[expect]]
what = "bit"
bit = "IMU lost"
within = 0.1                     # s of the fault
```
"""

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, Field, ValidationError, model_validator

from brakelab.plant.cycle import CYCLE
from brakelab.plant.description import Engine
from brakelab.plant.driver import PEDAL_TRAVEL, Script
from brakelab.plant.records import BRAKE, COAST, CRUISE, FOLLOW, PHASE
from brakelab.plant.sensor_errors import Sensors
from brakelab.plant.steering import Steering
from brakelab.simulation.car_parameters import CarParameters
from brakelab.simulation.expectations import Expectation
from brakelab.simulation.faults import Fault
from brakelab.simulation.scenario_tables import (
    BRAKE_BY,
    REAL_DRIVING,
    NotNegative,
    Payload,
    Phase,
    RoadByPlace,
    Row,
    ScenarioTable,
    SteeringFile,
    Trace,
    TyreFault,
    as_rows,
)
from brakelab.simulation.speed_trace import SpeedTrace
from ecu.errors import Mistakes
from ecu.settings.toml_file import Unit, findings, read_toml

__all__ = [
    "LONGEST_DRIVE",
    "Payload",
    "Phase",
    "RoadByPlace",
    "Scenario",
    "SteeringFile",
    "Trace",
    "load_scenario",
]

Share = Annotated[float, Field(ge=0.0, le=1.0)]
ByTime = Annotated[
    list[Row], BeforeValidator(lambda given: given if isinstance(given, list) else [(0.0, given)])
]
"""Rows of time [s] and value; a number alone holds all the time."""
KINDS = {"cruise": CRUISE, "coast": COAST, "brake": BRAKE, "follow": FOLLOW}
LONGEST_DRIVE = 21_600.0
"""s, a scenario that did not end by itself ends here."""


class Scenario(BaseModel):
    """A scenario file."""

    model_config = ScenarioTable.model_config

    plant: str
    """Car: a file beside the scenario, or a name of config/plant."""
    draw: Literal["wide", "nominal"] = "wide"
    """How far the car of a seed is from its file; see `brakelab.plant.draw`."""
    car: CarParameters = {}
    """Parameters of the drawn car that are set, in their units or in per cent of it; docs/rig.md has them."""
    payload: Payload | None = None
    """What the car carries beside the driver."""
    engine: Engine | None = None
    """Combustion engine of the car instead of that of its file; in overrun it drags."""
    initial_speed: Annotated[NotNegative, Unit("m/s")]
    """At t = 0."""
    initial_disc_temperature: Annotated[tuple[float, float], Unit("degC")] = (100.0, 100.0)
    """Front and rear; 100 as where the friction's nominal value is defined."""
    ambient_temperature: Annotated[float, Unit("degC")] = 20.0
    """Of the air."""
    road_friction: Annotated[ByTime, Unit("s, -")] = [(0.0, 1.2)]
    """Of road and tyre: a number, or rows of time and number."""
    grade: Annotated[ByTime, Unit("s, rad")] = [(0.0, 0.0)]
    """Of the road, positive uphill: a number, or rows of time and number."""
    road: RoadByPlace = RoadByPlace()
    """Quantities in it must not be described by time as well."""
    steering: SteeringFile | None = None
    """Without it the car is steered straight on."""
    wetness: Annotated[Share, Unit("-")] = 0.0
    """Of the discs, 0 dry to 1 rain; above 0 the bus says that it rains."""
    tyre_fault: TyreFault | None = None
    """Tyres that change during the drive."""
    vehicle_speed: Literal["ideal", "optical", "gnss", "none"] = "ideal"
    """Source of the speed on the bus; see `brakelab.plant.sensor_errors.SPEED_SOURCES`."""
    wheel_transducers: bool = False
    """The bus carries wheel forces and torques."""
    sensor: Sensors = {}
    """Errors of its sensors beside those that the car's file gives, by name of the input."""
    blending: bool = False
    """While brakes are asked for the motors do what the ECU asks; otherwise they rest."""
    charge_limit: Annotated[ByTime, Unit("s, W")] = []
    """Charging limit of the battery instead of that of the car's file; at 0 its motors cannot brake."""
    motor_share: Annotated[Share, Unit("-")] = 0.0
    """Of each deceleration asked for, what the motors take; the brakes are asked for the rest (5.2)."""
    trace: Trace | None = None
    """What a follow phase follows."""
    repeat: Annotated[int, Field(ge=1), Unit("-")] = 1
    """How often the phases are driven."""
    fault: list[Fault] = []
    """Faults during the drive."""
    expect: list[Expectation] = []
    """What the run has to show."""
    phase: Annotated[list[Phase], Field(min_length=1)]
    """The driver's actions, one after the other."""

    @model_validator(mode="after")
    def _consistent(self) -> "Scenario":
        for name in ("road_friction", "grade", "charge_limit"):
            table = as_rows(getattr(self, name))
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
            and self.trace.generate == REAL_DRIVING
            and (self.road.grade or "grade" in self.model_fields_set)
        ):
            raise ValueError("grade: a generated trace has its own; remove this key")
        if self.motor_share > 0.0 and self.blending:
            raise ValueError("give either blending (by the ECU) or motor_share (without it)")
        missing = max((one.fault for one in self.expect if one.after_fault), default=0)
        if missing > len(self.fault):
            raise ValueError(f"expect: there is no [[fault]] number {missing}; add it, or give t")
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
            as_rows(self.road_friction),
            as_rows(self.grade),
            self.ambient_temperature,
            self.blending,
            road,
            Steering(*(as_rows(getattr(self.steering, name, [])) for name in Steering._fields)),
            trace.speed,
            self.wetness,
            self.motor_share,
            -1 if fault is None else round(fault.time / CYCLE),
            1.0 if fault is None else fault.stiffness,
            as_rows(self.charge_limit),
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


def load_scenario(path: Path) -> Scenario:
    """Read and check a scenario file.

    Raises:
        UserError: the file cannot be read, or keys are missing, unknown or out of range: all of them.
    """
    content = read_toml(path)
    trace = content.get("trace")
    if isinstance(trace, dict) and isinstance(trace.get("file"), str):
        trace["file"] = str(path.parent / trace["file"])
    plant = content.get("plant")
    if isinstance(plant, str) and (path.parent / plant).is_file():
        content["plant"] = str(path.parent / plant)
    try:
        return Scenario.model_validate(content)
    except ValidationError as error:
        found = findings(error, lambda _: str(path), Scenario)
        raise Mistakes(str(path), [(one.place, one.remedy) for one in found]) from None
