"""Sensor errors between a quantity and its signal, from their description to the kernel that applies them.

x(t) true   x_d = x(t - delay)                          linear between the cycles before and after
            b' = -b / tau + q w                         Gauss-Markov drift, tau = inf: random walk, var q^2 t
            y = s x_d + bias + b + noise N(0, 1)        held from `stuck_from` on
            y = max(resolution * round(y / resolution), floor)

A sample has no value (NaN) before its `period` is over, in a burst of dropout, and from `lost_from` on.
Bursts begin with probability `dropout` after a present sample and last `dropout_length` on average
(Gilbert's channel), so the share p L / (1 + p L) of all samples is missing.

Draws are made in the order of the signals and only where a sensor needs them, so the noise of a car without
other errors depends on the seed alone.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from brakelab.plant.friction.law import Bounds, NotNegative, Positive, Section, as_bounds, in_order
from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import LOOK_BACK, SENSING, SENSOR, RecordArray

CORNERS: Final = ("fl", "fr", "rl", "rr")
WHEEL_STEMS: Final = ("wheel_speed", "calliper_pressure", "wheel_force_x", "wheel_torque_y")
SIGNALS: Final = (
    *("accel_x", "accel_y", "yaw_rate", "vehicle_speed"),
    *(f"{stem}_{corner}" for corner in CORNERS for stem in WHEEL_STEMS),
    *(f"motor_torque_{corner}" for corner in CORNERS),
    "steering_angle",
)
"""Every sensor by the name and in the unit of its signal on the bus, in the order of the noise's draws."""
CYCLE: Final = 0.010  # s between samples
SLACK: Final = 1e-4  # s by which the sum of all steps may fall short of a cycle's time
LONGEST_DELAY: Final = 0.6  # s, less than LOOK_BACK cycles


Delay = Annotated[float, Field(ge=0.0, le=LONGEST_DELAY)]


class SensorErrors(Section):
    """Sensor errors as a file describes them, in the unit of the signal.

    Between two bounds a value is drawn uniformly per car and corner; one number is used as it is.
    """

    model_config = ConfigDict(allow_inf_nan=False, use_attribute_docstrings=True)

    noise: NotNegative = 0.0
    """Standard deviation, white."""
    resolution: NotNegative = 0.0
    """Step between two readings."""
    delay: Annotated[tuple[Delay, Delay], BeforeValidator(as_bounds), AfterValidator(in_order)] = (0.0, 0.0)
    """Of the reading behind the quantity, s."""
    scale: Positive = 1.0
    """Reading over quantity."""
    bias: Annotated[Bounds, BeforeValidator(as_bounds), AfterValidator(in_order)] = (0.0, 0.0)
    """Zero error."""
    drift: NotNegative = 0.0
    """q, random walk of the zero, unit per root second."""
    drift_time: Positive = math.inf
    """tau, after which a drift is forgotten, s."""
    dropout: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    """Probability that samples fail after one that came."""
    dropout_length: Annotated[float, Field(ge=1.0)] = 1.0
    """Mean length of such a failure, samples."""
    floor: float = -math.inf
    """No reading is less: many cars cannot report a pressure below zero."""
    period: NotNegative = 0.0
    """Between samples, s; 0: a sample in every cycle."""
    stuck_from: NotNegative = math.inf
    """From then on the reading stays, s."""
    lost_from: NotNegative = math.inf
    """From then on there is no reading, s."""


def _known(given: dict[str, SensorErrors]) -> dict[str, SensorErrors]:
    stems = [name for name in SIGNALS if name[-3:] not in {f"_{corner}" for corner in CORNERS}]
    stems += [*WHEEL_STEMS, "motor_torque"]
    for name in given:
        if name not in SIGNALS and name not in stems:
            raise ValueError(f"{name!r} is no sensor; name one of {', '.join(stems)}, or a corner's: _fl ...")
    return given


Sensors = Annotated[dict[str, SensorErrors], AfterValidator(_known)]
"""By name of the signal; a name without a corner means all four."""


class SensorFile(Section):
    """`[sensor]` of a car: the accelerometer's place [m], and tables of `Sensors`."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, SensorErrors] = Field(init=False)

    position: tuple[float, float, float]

    @property
    def errors(self) -> Mapping[str, SensorErrors]:
        return self.__pydantic_extra__

    @model_validator(mode="after")
    def _names_known(self) -> "SensorFile":
        _known(self.__pydantic_extra__)
        return self


STANDARD: Final[Mapping[str, SensorErrors]] = {
    "accel_x": SensorErrors(noise=0.01),  # m/s^2 (Table 4.1)
    "accel_y": SensorErrors(noise=0.01),
    "yaw_rate": SensorErrors(noise=0.002),  # rad/s. Assumption
    "wheel_speed": SensorErrors(noise=0.1),  # rad/s (Table 4.1)
    "calliper_pressure": SensorErrors(noise=1.8),  # bar (Table 4.1)
    "wheel_force_x": SensorErrors(noise=10.0),  # N (Table 4.1)
    "wheel_torque_y": SensorErrors(noise=3.5),  # N m. Assumption: the force's at the lever of the radius
}
"""Sensors of a car whose file says nothing else."""

ABSENT: Final = SensorErrors(lost_from=0.0)

SPEED_SOURCES: Final[Mapping[str, SensorErrors]] = {
    # Table 4.1: a GPS without delay that has a new speed in every cycle
    "ideal": SensorErrors(noise=0.027),
    # Non-contact sensor as in chapter 6 and D.1. Noise and averaging: assumptions
    "optical": SensorErrors(noise=0.01, delay=(0.008, 0.008)),
    # Receiver of a production car. Noise: Table 4.1; rate and age: assumptions
    "gnss": SensorErrors(noise=0.027, period=0.1, delay=(0.1, 0.2)),
    "none": SensorErrors(noise=0.027, lost_from=0.0),
}
"""Sources of the car's speed over ground."""


def new_sensors(layers: Iterable[Mapping[str, SensorErrors]], seed: int) -> RecordArray:
    """Return SENSOR of one car's sensors in the order of SIGNALS, shape (len(SIGNALS),).

    For each key a later layer overrides an earlier one, and a corner's name that of all four.
    """
    random = np.random.default_rng([seed, 3])
    rows = np.zeros(len(SIGNALS), SENSOR)
    layers = tuple(layers)
    for row, name in zip(rows, SIGNALS, strict=True):
        errors = SensorErrors()
        for layer in layers:
            for key in (name[:-3], name):
                said = layer.get(key)
                if said is not None:
                    errors = errors.model_copy(update=said.model_dump(exclude_unset=True))
        for field in ("noise", "resolution", "scale", "floor", "period", "stuck_from", "lost_from"):
            row[field] = getattr(errors, field)
        row["delay"] = random.uniform(*errors.delay) / CYCLE
        row["bias"] = random.uniform(*errors.bias)
        decay = math.exp(-CYCLE / errors.drift_time)
        row["drift_decay"] = decay
        passed = CYCLE if decay == 1.0 else 0.5 * errors.drift_time * (1.0 - decay**2)
        row["drift_step"] = errors.drift * math.sqrt(passed)
        row["dropout_begin"], row["dropout_end"] = errors.dropout, 1.0 / errors.dropout_length
    return rows


def new_sensing() -> RecordArray:
    """Return SENSING of sensors that have not measured yet, shape (len(SIGNALS),)."""
    rows = np.zeros(len(SIGNALS), SENSING)
    rows["cycle"] = -LOOK_BACK
    rows["sample"] = -1
    rows["held"] = np.nan
    return rows


@kernel
def _pass_time(sensor: Record, sensing: Record, true: float, cycle: int, noise: Generator) -> None:
    """Propagate through the cycles since the last call, in which the true value is taken as constant."""
    for k in range(min(sensing.cycle + 1, cycle), cycle + 1):
        sensing.history[k % LOOK_BACK] = true
    sensing.cycle = cycle
    if sensor.drift_step > 0.0:
        sensing.drift = sensor.drift_decay * sensing.drift + sensor.drift_step * noise.standard_normal()


@kernel
def _delayed(sensor: Record, sensing: Record) -> float:
    whole = int(sensor.delay)
    part = sensor.delay - whole
    newer: float = sensing.history[(sensing.cycle - whole) % LOOK_BACK]
    older: float = sensing.history[(sensing.cycle - whole - 1) % LOOK_BACK]
    return newer if part == 0.0 else (1.0 - part) * newer + part * older


@kernel
def _is_there(sensor: Record, sensing: Record, t: float, noise: Generator) -> bool:
    """Return whether a sample is due at `t` and not lost."""
    if sensor.period > 0.0:
        sample = math.floor(t / sensor.period)
        if sample == sensing.sample:
            return False
        sensing.sample = sample
    if sensor.dropout_begin > 0.0:
        drawn = noise.random()
        sensing.dropped = drawn >= sensor.dropout_end if sensing.dropped else drawn < sensor.dropout_begin
    return not sensing.dropped and t < sensor.lost_from


@kernel
def disturb(
    sensors: RecordArray, sensing: RecordArray, t: float, noise: Generator, values: NDArray[np.float64]
) -> None:
    """Replace true `values` at `t` [s], shape (len(SIGNALS),), by sensor readings; NaN: no new sample.

    To be called once per 10 ms cycle; a missed call leaves delays unchanged.
    """
    t += SLACK
    cycle = int(t / CYCLE)
    for i in range(len(sensors)):
        sensor, memory = sensors[i], sensing[i]
        _pass_time(sensor, memory, values[i], cycle, noise)
        value = sensor.scale * _delayed(sensor, memory) + (sensor.bias + memory.drift)
        if sensor.noise > 0.0:
            value += sensor.noise * noise.standard_normal()
        if sensor.resolution > 0.0:
            value = sensor.resolution * math.floor(value / sensor.resolution + 0.5)
        value = max(value, sensor.floor)
        if t >= sensor.stuck_from and not math.isnan(memory.held):
            value = memory.held
        there = _is_there(sensor, memory, t, noise)
        if there:
            memory.held = value
        values[i] = value if there else math.nan
