"""CONFIG files: one vehicle, its brakes, sensors and tuning, in TOML; checked here, turned into `PARAMS`.

Pressures stand in bar, everything else in SI units. `include = "tuned.toml"` takes from another file, named
relative to this one, the keys that this one does not give itself. A key that is missing, unknown or out of
range is one line: the file, the key and what would be right.
"""

import hashlib
import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator

from ecu.algorithm.vehicle import rolling_radius
from ecu.contract.params import BAR, COMPENSATIONS, DISTRIBUTIONS, GRAVITY, OBSERVERS, PARAMS, PEDAL_POINTS
from ecu.contract.records import RecordArray
from ecu.errors import UserError
from ecu.settings.annex5 import Load, annex_5_violation
from ecu.settings.dust import Dust, set_dust, set_dust_version
from ecu.settings.pad import Pad, set_pad
from ecu.settings.toml_file import Section, describe, read_toml

AIR_DENSITY = 1.2  # kg/m^3, 20 degC at sea level

Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(gt=0, lt=1)]


class Vehicle(Section):
    """Masses and lengths of the car as driven."""

    mass: Annotated[float, Field(gt=200, lt=10000)]
    wheelbase: Annotated[float, Field(gt=1, lt=8)]
    front_axle: Positive
    """Centre of gravity to front axle, m."""
    cog_height: Annotated[float, Field(gt=0.1, lt=3)]
    track: Annotated[float, Field(gt=0.8, lt=3)]
    drag_coefficient: Positive
    frontal_area: Positive
    rolling_resistance: Annotated[float, Field(ge=0, lt=0.1)]
    pitch_gradient: Annotated[float, Field(ge=0, lt=0.02)]
    """Nose-down pitch per deceleration, rad per m/s^2."""
    imu_x: float
    """Acceleration sensor ahead of the centre of gravity, m."""
    load_transfer_lag: Annotated[float, Field(ge=0, lt=1)]
    ambient_temperature: Annotated[float, Field(gt=-50, lt=60)] = 15.0
    """Where no sensor reports it, degC."""
    laden_mass: Annotated[float, Field(gt=200, lt=10000)] | None = None
    """Greatest mass allowed, kg. Without the three of `laden_` the car counts as driven at `mass` alone."""
    laden_front_axle: Positive | None = None
    """Centre of gravity to front axle when laden, m."""
    laden_cog_height: Annotated[float, Field(gt=0.1, lt=3)] | None = None

    def loads(self) -> tuple[Load, ...]:
        """Return the states of load that the car is driven in: as configured, and laden if that is given."""
        unladen = Load("unladen", self.mass, self.front_axle, self.cog_height)
        if self.laden_mass is None or self.laden_front_axle is None or self.laden_cog_height is None:
            return (unladen,)
        return unladen, Load("laden", self.laden_mass, self.laden_front_axle, self.laden_cog_height)

    @model_validator(mode="after")
    def _laden(self) -> "Vehicle":
        given = [self.laden_mass, self.laden_front_axle, self.laden_cog_height]
        if given != [None] * 3 and None in given:
            raise ValueError("give all of laden_mass, laden_front_axle and laden_cog_height, or none")
        if self.laden_mass is not None and self.laden_mass < self.mass:
            raise ValueError("laden_mass must not be smaller than mass")
        return self


class Axle(Section):
    """One axle: tyre and brake of each of its two corners."""

    unloaded_radius: Annotated[float, Field(gt=0.15, lt=0.8)]
    vertical_stiffness: Annotated[float, Field(gt=5e4, lt=2e6)]
    wheel_inertia: Positive
    slip_stiffness: Annotated[float, Field(gt=3, lt=100)]
    """Longitudinal slip stiffness per wheel load at static load, -."""
    stiffness_degression: Annotated[float, Field(ge=0, lt=0.5)]
    """e in C_L ~ F_Z^(1-e); 0: stiffness proportional to load."""
    pistons: Annotated[int, Field(ge=1, le=12)]
    """Pistons on one side of the disc."""
    piston_diameter: Annotated[float, Field(gt=0.01, lt=0.15)]
    effective_radius: Annotated[float, Field(gt=0.03, lt=0.4)]
    mu_nominal: Annotated[float, Field(gt=0.1, lt=1)]
    push_out_pressure: Annotated[float, Field(ge=0, lt=10)]
    activation_decel: Annotated[float, Field(ge=0)]
    """The observer of this axle works above this deceleration, m/s^2."""
    disc_heating: Annotated[float, Field(gt=2e-5, lt=2e-3)] = 2.111e-4
    """Rise of the disc's temperature per brake work, xi of (3.7), K/J: share of the heat / (mass c_p)."""
    disc_cooling: Annotated[float, Field(gt=0, lt=0.1)] = 1.792e-3
    """At standstill, delta_0 of (3.7), 1/s."""
    disc_cooling_by_speed: Annotated[float, Field(ge=0, lt=0.01)] = 9.108e-5
    """delta_1 of (3.7), 1/m. Table C.1 prints ten times as much: 400 to 100 degC in a minute at 100 km/h."""
    pad: Pad = Pad()
    dust: Dust | None = None
    """Particle emission of its brakes; without it the outputs are not available."""


class Sensors(Section):
    """Standard deviations of the sensors (Table 4.1), the accelerometer's range, the reference's delay."""

    wheel_speed: Positive = 0.1
    accel: Positive = 0.01
    accel_range: Annotated[float, Field(ge=5.0, le=40.0)] = 20.0
    """A reading beyond it is none, m/s^2: more than car and tyres can do."""
    pressure: Positive = 1.8
    vehicle_speed: Positive = 0.027
    vehicle_speed_delay: Annotated[float, Field(ge=0, lt=1)] = 0.0
    motor_torque: Annotated[float, Field(ge=0, le=1)] = 0.03


class Observer(Section):
    """The friction observer and its tuning."""

    kind: Literal["joint", "observer1", "observer2"] = "joint"
    """One filter for the whole car, or the thesis's observers with measured or with virtual wheel forces."""

    relaxation_length: Positive = 0.25
    cornering_stiffness: Positive = 15.0
    min_speed: Positive = 15 / 3.6
    rls_forgetting: Share = 0.7
    """Of K_f, per 10 ms: tyre and road may change within 100 ms (section 4.6)."""
    mu_drift: Positive = 0.02
    """Random walk of friction, 1/sqrt(s)."""
    omega_walk: Positive = 2.0
    """Random walk of wheel speed by torques that are not modelled (road), rad/s/sqrt(s)."""
    force_walk: Positive = 0.10
    """Model error of the tyre force relative to the wheel load, 1/sqrt(s)."""
    time_correlation: Positive = 3.0
    """Low-passed slip samples are correlated: the virtual force's variance counts this often."""
    sigma_mu_initial: Annotated[float, Field(gt=0, lt=0.4)] = 0.15
    sigma_mass: Share = 0.02
    sigma_slip_stiffness_ratio: Share = 0.04


class Control(Section):
    """Pedal map, holding at rest, distribution, limits of the pressure demand."""

    pedal_position: list[float] = Field(min_length=2, max_length=PEDAL_POINTS)
    pedal_decel: list[float] = Field(min_length=2, max_length=PEDAL_POINTS)
    hold_grade: Annotated[float, Field(ge=0, le=0.5)] = 0.2
    """Steepest grade (tangent) on which the standing car is held, laden and with the linings at - 2 sigma."""
    distribution: Literal["ideal", "fixed", "electronic"] = "ideal"
    """Equal adhesion at both axles, a constant share, or a constant share until the ideal one passes it."""
    front_share: Share | None = None
    """Of the brake force, for the distributions "fixed" and "electronic"."""
    rear_slip_margin: Annotated[float, Field(ge=0.002, le=0.05)] = 0.01
    """Slip of a rear wheel beyond the front one of its side that takes back the torque of the rear."""
    max_pressure: Annotated[float, Field(gt=20, le=180)] = 180.0
    max_pressure_rate: Annotated[float, Field(ge=1500)] = 3000.0
    compensation: Literal["second-order", "inverse", "off"] = "inverse"
    """How pressure follows friction in a braking: by (5.8) corrected, by what it approximates, or not."""
    slip_guard: bool = True
    """Hold the pressure back at a wheel that slips beyond its tyre's range."""

    @field_validator("pedal_position", "pedal_decel")
    @classmethod
    def _rising(cls, points: list[float]) -> list[float]:
        if any(b < a for a, b in pairwise(points)) or points[0] < 0:
            raise ValueError("must rise from zero or more")
        return points

    @field_validator("pedal_decel")
    @classmethod
    def _free_at_rest(cls, points: list[float]) -> list[float]:
        if points[0] != 0.0:
            raise ValueError("must start at 0: a pedal at rest brakes nothing")
        return points

    @field_validator("pedal_position")
    @classmethod
    def _distinct(cls, points: list[float]) -> list[float]:
        if len(set(points)) < len(points):
            raise ValueError("names the same position twice")
        return points

    @model_validator(mode="after")
    def _paired(self) -> "Control":
        if len(self.pedal_position) != len(self.pedal_decel):
            raise ValueError("pedal_position and pedal_decel need the same number of points")
        if (self.front_share is None) != (self.distribution == "ideal"):
            raise ValueError('distributions "fixed" and "electronic" need a front_share, "ideal" has its own')
        return self


class Blending(Section):
    """Share f of the brake torque for the motors (5.2): 0 off, 1 series phasing, parallel in between."""

    front: Annotated[float, Field(ge=0, le=1)] = 0.0
    rear: Annotated[float, Field(ge=0, le=1)] = 0.0
    fade_speed: Annotated[float, Field(ge=0, lt=20)] = 3.0
    """Below it the motors' limit falls with the speed, m/s (Figure A.7); a motor's own map knows better."""


class Config(Section):
    """One vehicle's configuration."""

    name: Annotated[str, Field(min_length=1)]
    transmit: bool = False
    """Armed: pressure demands are flagged valid. Otherwise a shadow that only listens and publishes."""
    can_fd: bool = False
    vehicle: Vehicle
    front: Axle
    rear: Axle
    sensors: Sensors = Sensors()
    observer: Observer = Observer()
    control: Control
    blending: Blending = Blending()

    @model_validator(mode="after")
    def _axles(self) -> "Config":
        if self.vehicle.front_axle >= self.vehicle.wheelbase:
            raise ValueError("vehicle.front_axle must be smaller than vehicle.wheelbase")
        return self


def load_config(path: Path) -> Config:
    """Read and check a CONFIG file.

    Raises:
        UserError: a file cannot be read, a key is missing, unknown or out of range, or the distribution of
            the brake force violates Annex 5 of ECE R13-H.
    """
    own = read_toml(path)
    source, included = _included(path, own.pop("include")) if "include" in own else (path, {})
    try:
        config = Config.model_validate(_merged(own, included))
    except ValidationError as error:
        keys = error.errors()[0]["loc"]
        elsewhere = _holds(included, keys) and not _holds(own, keys)
        raise describe(error, str(source if elsewhere else path)) from None
    finding = annex_5_violation(new_params(config)[0], config.vehicle.loads())
    if finding:
        raise UserError(str(path), "control.distribution", finding)
    return config


def _included(path: Path, name: object) -> tuple[Path, dict[str, Any]]:
    if not isinstance(name, str) or not name:
        raise UserError(str(path), "include", 'give the name of a TOML file in "quotes"')
    source = path.parent / name
    included = read_toml(source)
    if "include" in included:
        raise UserError(str(source), "include", f"an included file includes no other; name it in {path}")
    return source, included


def _merged(own: dict[str, Any], included: dict[str, Any]) -> dict[str, Any]:
    both = {
        key: _merged(own[key], value)
        for key, value in included.items()
        if isinstance(value, dict) and isinstance(own.get(key), dict)
    }
    return included | own | both


def _holds(content: Any, keys: tuple[int | str, ...]) -> bool:
    """Return whether the key is there; places within a list count as its key."""
    if not keys or not isinstance(content, dict):
        return True
    return keys[0] in content and _holds(content[keys[0]], keys[1:])


def config_hash(config: Config) -> str:
    """Return a hash of everything that changes results, so two runs can be told apart."""
    text = json.dumps(config.model_dump(exclude={"transmit"}), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def store_key(config: Config) -> str:
    """Return what learned values belong to: vehicle, brakes and the version of the algorithm.

    Not the linings' wear law: wear is kept in a form that any law can be applied to later. Not their dust:
    its totals carry the version of their model.
    """
    axles = [axle.model_dump(exclude={"pad", "dust"}) for axle in (config.front, config.rear)]
    brakes = json.dumps(axles, sort_keys=True)
    return f"{config.name}/{hashlib.sha256(brakes.encode()).hexdigest()[:8]}/5"


def new_params(config: Config) -> RecordArray:
    """Return `PARAMS` of length 1 in SI units; every input counts as mapped until told otherwise."""
    params = np.zeros(1, PARAMS)
    row = params[0]
    vehicle, sensors, observer, control = config.vehicle, config.sensors, config.observer, config.control
    row["transmit"], row["slip_guard"] = config.transmit, control.slip_guard
    row["compensation"] = COMPENSATIONS.index(control.compensation)
    row["mapped"] = 1
    rear_axle = vehicle.wheelbase - vehicle.front_axle
    for name in ("mass", "wheelbase", "front_axle", "cog_height", "track", "rolling_resistance"):
        row[name] = getattr(vehicle, name)
    for name in ("pitch_gradient", "imu_x", "load_transfer_lag", "ambient_temperature"):
        row[name] = getattr(vehicle, name)
    row["rear_axle"] = rear_axle
    row["drag_area"] = 0.5 * AIR_DENSITY * vehicle.drag_coefficient * vehicle.frontal_area
    axle_load = vehicle.mass * GRAVITY / vehicle.wheelbase
    for corner, axle in enumerate((config.front, config.front, config.rear, config.rear)):
        static_load = axle_load * (rear_axle if corner < 2 else vehicle.front_axle) / 2
        row["wheel_radius"][corner] = rolling_radius(
            static_load, axle.unloaded_radius, axle.vertical_stiffness
        )
        row["piston_area"][corner] = axle.pistons * math.pi / 4 * axle.piston_diameter**2
        row["push_out_pressure"][corner] = axle.push_out_pressure * BAR
        row["static_load"][corner] = static_load
        for name in ("unloaded_radius", "vertical_stiffness", "wheel_inertia", "slip_stiffness"):
            row[name][corner] = getattr(axle, name)
        for name in ("stiffness_degression", "effective_radius", "mu_nominal", "activation_decel"):
            row[name][corner] = getattr(axle, name)
        for name in ("disc_heating", "disc_cooling", "disc_cooling_by_speed"):
            row[name][corner] = getattr(axle, name)
        set_pad(row, corner, axle.pad)
        set_dust(row, corner, axle.dust)
    set_dust_version(row)
    row["sigma_wheel_speed"], row["sigma_accel"] = sensors.wheel_speed, sensors.accel
    row["accel_range"] = sensors.accel_range
    row["sigma_pressure"] = sensors.pressure * BAR
    row["sigma_vehicle_speed"] = sensors.vehicle_speed
    row["sigma_motor_torque"] = sensors.motor_torque
    row["vehicle_speed_delay"] = sensors.vehicle_speed_delay
    row["observer"] = OBSERVERS.index(observer.kind)
    for name in set(Observer.model_fields) - {"kind"}:
        row[name] = getattr(observer, name)
    for name in ("pedal_position", "pedal_decel"):
        points = getattr(control, name)
        row[name] = points + points[-1:] * (PEDAL_POINTS - len(points))
    row["fade_speed"] = config.blending.fade_speed
    row["blending"] = np.repeat((config.blending.front, config.blending.rear), 2)
    heaviest = max(load.mass for load in vehicle.loads())
    down_grade = GRAVITY * math.sin(math.atan(control.hold_grade)) * heaviest / vehicle.mass
    row["hold_decel"] = down_grade / (1.0 - 2.0 * observer.sigma_mu_initial)
    row["distribution"] = DISTRIBUTIONS.index(control.distribution)
    row["front_share"], row["rear_slip_margin"] = control.front_share or 0.0, control.rear_slip_margin
    row["max_pressure"] = control.max_pressure * BAR
    row["max_pressure_rate"] = control.max_pressure_rate * BAR
    return params
