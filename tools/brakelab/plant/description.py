"""Description of a car, `config/plant/*.toml`: checked, and turned into parameters.

`config/plant/linings.toml`, beside every vehicle file, holds the linings that vehicles name.
"""

import tomllib
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from brakelab.plant.dynamometer import nominal_friction
from brakelab.plant.friction.law import NotNegative, Positive, Section
from brakelab.plant.friction.laws import law_row
from brakelab.plant.hydraulics import BUILD_UP, RELEASE
from brakelab.plant.linings import VEHICLE_LAW, Lining, Linings, rig_with
from brakelab.plant.records import DAMPER_KNOTS, GEARS, GRAVITY, PARAMS, RecordArray, new_record
from brakelab.plant.sensor_errors import SensorFile

Share = Annotated[float, Field(ge=0.0, le=1.0)]
AIR_DENSITY: Final = 1.2  # kg/m^3


class PlantFileError(ValueError):
    """A file of `config/plant` cannot be used. Example: `suv.toml: body.mass: Field required`."""

    def __init__(self, where: str, place: str, remedy: str) -> None:
        self.where, self.place, self.remedy = where, place, remedy
        super().__init__(f"{where}: {place}: {remedy}")


class Body(Section):
    mass: Positive
    yaw_inertia: Positive
    cog_height: Positive
    front_length: Positive
    rear_length: Positive
    track: Positive
    drag_coefficient: NotNegative
    frontal_area: Positive


class Attitude(Section):
    """Attitude of the body of a car without a suspension; see `body.py`."""

    frequency: Positive  # Hz
    damping: Positive
    pitch_gradient: NotNegative
    roll_gradient: NotNegative
    roll_share_front: Share


DamperForce = Annotated[tuple[float, ...], Field(min_length=DAMPER_KNOTS, max_length=DAMPER_KNOTS)]


class Suspension(Section):
    """Suspension of a car of fourteen degrees of freedom; see `chassis.py`. All at the wheel."""

    unsprung_mass_front: Positive
    unsprung_mass_rear: Positive
    pitch_inertia: Positive
    roll_inertia: Positive
    spring_stiffness_front: Positive
    spring_stiffness_rear: Positive
    stop_clearance: Positive
    stop_stiffness: NotNegative
    anti_roll_stiffness_front: NotNegative
    anti_roll_stiffness_rear: NotNegative
    damper_speed: DamperForce
    damper_force_front: DamperForce
    damper_force_rear: DamperForce

    @model_validator(mode="after")
    def _dampers_damp(self) -> "Suspension":
        if np.any(np.diff(self.damper_speed) <= 0.0):
            raise ValueError("damper_speed: give rising speeds")
        for force in (self.damper_force_front, self.damper_force_rear):
            if np.any(np.array(force) * np.array(self.damper_speed) < 0.0):
                raise ValueError("damper_force: give forces with the sign of their speeds")
        return self


class Tyre(Section):
    free_radius: Positive
    vertical_stiffness: Positive
    wheel_inertia: Positive
    rolling_resistance: NotNegative
    slip_stiffness: Positive
    cornering_stiffness_front: Positive
    cornering_stiffness_rear: Positive
    stiffness_degression: NotNegative
    friction_degression: NotNegative
    magic_c: Positive | None = None
    magic_e: float | None = None
    burckhardt_fall: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None
    longitudinal_stiffness: Positive
    lateral_stiffness: Positive

    @model_validator(mode="after")
    def _one_law(self) -> "Tyre":
        magic = (self.magic_c is not None, self.magic_e is not None)
        if magic != (self.burckhardt_fall is None,) * 2:
            raise ValueError("give either magic_c and magic_e or burckhardt_fall")
        return self


class Brake(Section):
    lining: str
    friction: str = VEHICLE_LAW  # name of the lining's friction law
    friction_nominal: Positive
    """As the data sheet has it."""
    friction_level: Positive = 1.0
    """Of this car's linings, over the nominal friction."""
    piston_diameter: Positive
    effective_radius: Positive
    push_out_pressure: NotNegative  # bar


LONGEST_DEAD_TIME: Final = 0.3  # s, that the history holds for every draw
Response = tuple[Positive, Positive, Annotated[float, Field(ge=0.0, le=LONGEST_DEAD_TIME)]]
"""Inertia [s^2], damping [s] and dead time [s], as (A.17)."""


class Hydraulics(Section):
    pressure_limit: Positive  # bar
    fallback_friction: Positive
    offset_start: NotNegative = 60.0  # bar. Assumption; see hydraulics.py
    offset_slope: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.04  # Assumption: 2.8 bar at 130 bar
    offset_known: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.04  # as the thesis's inverse map: all of it
    build_up: Response = BUILD_UP
    release: Response = RELEASE
    rise_limit: Positive = np.inf  # bar/s
    fall_limit: Positive = np.inf


class Motor(Section):
    torque_limit: NotNegative
    power_limit: NotNegative
    peak_torque: Positive | None = None
    peak_power: Positive | None = None
    peak_time: Positive = 30.0  # s, Table A.1
    charge_limit: NotNegative = np.inf  # W, of the battery
    discharge_limit: NotNegative = np.inf
    fade_speed: Positive
    copper_loss: NotNegative = 0.0  # W/(N m)^2
    turning_loss: NotNegative = 0.0  # W s/rad
    share_front: Share

    @model_validator(mode="after")
    def _peak_above(self) -> "Motor":
        if (self.peak_torque is None) != (self.peak_power is None):
            raise ValueError("give peak_torque and peak_power or neither")
        for peak, limit in ((self.peak_torque, self.torque_limit), (self.peak_power, self.power_limit)):
            if peak is not None and peak < limit:
                raise ValueError("give a peak that is not below its limit")
        return self


class Engine(Section):
    """Combustion engine with automatic gearbox, in overrun; see `brakelab.plant.engine`."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    drag_torque: NotNegative
    """N m, of the crankshaft at rest, throttle closed."""
    drag_growth: NotNegative = 0.0
    """N m per rad/s of the crankshaft."""
    lowest_speed: Positive
    """rad/s of the crankshaft: there the gearbox shifts down."""
    ratios: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=GEARS)]
    """Crankshaft over wheels, from first gear on."""
    share_front: Share
    """Of its torque, at the front wheels."""

    @model_validator(mode="after")
    def _falling(self) -> "Engine":
        if any(np.diff(self.ratios) >= 0.0):
            raise ValueError("ratios: give falling ones, first gear first")
        return self


class VehicleFile(Section):
    body: Body
    attitude: Attitude | None = None
    suspension: Suspension | None = None
    tyre: Tyre
    brake_front: Brake
    brake_rear: Brake
    hydraulics: Hydraulics
    motor: Motor
    engine: Engine | None = None
    sensor: SensorFile

    @model_validator(mode="after")
    def _one_chassis(self) -> "VehicleFile":
        if (self.attitude is None) == (self.suspension is None):
            raise ValueError("give either [suspension] (fourteen degrees of freedom) or [attitude] (seven)")
        return self


class Plant(Section):
    """A car and its linings as the files describe them."""

    name: str
    vehicle: VehicleFile
    linings: Linings

    def brake(self, wheel: int) -> Brake:
        """Return the brake of a corner."""
        return self.vehicle.brake_front if wheel < 2 else self.vehicle.brake_rear

    def lining(self, wheel: int) -> Lining:
        """Return the lining of a corner."""
        return self.linings.lining[self.brake(wheel).lining]


Model = TypeVar("Model", bound=BaseModel)


def read_file(path: Path, model: type[Model]) -> Model:
    """Return the TOML file `path` as a `model`. Raises `PlantFileError`, one line."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
        return model.model_validate(content, context={"folder": path.parent})
    except OSError as error:
        raise PlantFileError(str(path), "", error.strerror or "cannot be read") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise PlantFileError(str(path), "not valid TOML", str(error)) from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part + 1 if isinstance(part, int) else part) for part in first["loc"])
        raise PlantFileError(str(path), place, first["msg"]) from error


def load_plant(path: Path) -> Plant:
    """Return the car that `path` describes. Raises `PlantFileError`, one line."""
    vehicle = read_file(path, VehicleFile)
    linings = read_file(path.with_name("linings.toml"), Linings)
    for place in ("brake_front", "brake_rear"):
        brake: Brake = getattr(vehicle, place)
        name, law = brake.lining, brake.friction
        if name not in linings.lining:
            known = ", ".join(linings.lining)
            raise PlantFileError(str(path), f"{place}.lining", f"{name!r} unknown; linings.toml has {known}")
        if law not in linings.lining[name].friction:
            known = ", ".join(linings.lining[name].friction)
            remedy = f"{law!r} unknown; lining {name} has {known}"
            raise PlantFileError(str(path), f"{place}.friction", remedy)
    return Plant(name=path.stem, vehicle=vehicle, linings=linings)


def set_lining(car: Any, wheel: int, lining: Lining, law: str, mu_nominal: float) -> None:
    """Fit a wheel of `car`, one `PARAMS`, with a lining under one of its laws, of that nominal friction."""
    entry = lining.friction[law]
    car["friction_law"][wheel], car["friction_row"][wheel] = law_row(entry, lining.brake)
    car["friction_scale"][wheel] = mu_nominal / nominal_friction(rig_with(lining, law))
    car["rig_gain"][wheel] = lining.brake.gain(entry.rig_mass)
    for name in ("heating", "cooling", "cooling_by_speed"):
        car[name][wheel] = getattr(lining.disc, name)


def _set_suspension(car: Any, suspension: Suspension) -> None:
    car["suspended"] = 1
    for name in ("unsprung_mass", "spring_stiffness", "damper_force"):
        front, rear = getattr(suspension, f"{name}_front"), getattr(suspension, f"{name}_rear")
        car[name] = (front, front, rear, rear)
    car["anti_roll_stiffness"] = suspension.anti_roll_stiffness_front, suspension.anti_roll_stiffness_rear
    car["spring_preload"] = car["nominal_load"] - GRAVITY * car["unsprung_mass"]


def _set_engine(car: Any, engine: Engine) -> None:
    for name in ("drag_torque", "drag_growth", "lowest_speed"):
        car[f"engine_{name}"] = getattr(engine, name)
    car["engine_ratio"][: len(engine.ratios)] = engine.ratios
    car["engine_share"] = 0.5 * np.repeat((engine.share_front, 1.0 - engine.share_front), 2)


def nominal(plant: Plant) -> RecordArray:
    """Return the parameters of the car exactly as described, shape (1,)."""
    params = new_record(PARAMS)
    car = params[0]
    body, tyre, motor = plant.vehicle.body, plant.vehicle.tyre, plant.vehicle.motor
    attitude, suspension = plant.vehicle.attitude, plant.vehicle.suspension
    for section in (body, attitude, suspension, tyre):
        for name, value in dict(section or {}).items():
            if name in (PARAMS.names or ()) and value is not None:
                car[name] = value
    car["drag_factor"] = 0.5 * AIR_DENSITY * body.drag_coefficient * body.frontal_area
    if attitude is not None:
        car["body_frequency"] = 2.0 * np.pi * attitude.frequency
        car["body_damping"] = attitude.damping
    car["cornering_stiffness"] = np.repeat((tyre.cornering_stiffness_front, tyre.cornering_stiffness_rear), 2)
    base = body.front_length + body.rear_length
    car["nominal_load"] = (
        0.5 * body.mass * GRAVITY * np.repeat((body.rear_length, body.front_length), 2) / base
    )
    if suspension is not None:
        _set_suspension(car, suspension)
    hydraulics = plant.vehicle.hydraulics
    car["build_up"], car["release"] = hydraulics.build_up, hydraulics.release
    car["rise_limit"], car["fall_limit"] = 1e5 * hydraulics.rise_limit, 1e5 * hydraulics.fall_limit
    car["pressure_limit"] = 1e5 * hydraulics.pressure_limit
    car["offset_start"] = 1e5 * hydraulics.offset_start
    car["offset_slope"], car["offset_known"] = hydraulics.offset_slope, hydraulics.offset_known
    for wheel in range(4):
        brake = plant.brake(wheel)
        car["piston_area"][wheel] = 0.25 * np.pi * brake.piston_diameter**2
        car["effective_radius"][wheel] = brake.effective_radius
        car["push_out_pressure"][wheel] = 1e5 * brake.push_out_pressure
        lining = plant.lining(wheel)
        level = brake.friction_level * brake.friction_nominal
        set_lining(car, wheel, lining, brake.friction, level)
        car["wear_row"][wheel] = lining.wear.row(lining.brake.pad_area)
        car["wear_scale"][wheel] = 1.0
        car["emission_row"][wheel] = lining.emission.row()
        car["emission_scale"][wheel] = 1.0
    leverage = 4.0 * hydraulics.fallback_friction
    leverage *= sum(car["piston_area"][wheel] * car["effective_radius"][wheel] for wheel in (0, 2))
    car["fallback_gain"] = body.mass * tyre.free_radius / leverage
    car["motor_share"] = 0.5 * np.repeat((motor.share_front, 1.0 - motor.share_front), 2)
    car["motor_torque_limit"] = motor.torque_limit
    car["motor_power_limit"] = motor.power_limit
    car["motor_peak_torque"] = motor.peak_torque or motor.torque_limit
    car["motor_peak_power"] = motor.peak_power or motor.power_limit
    car["motor_peak_time"] = motor.peak_time
    car["charge_limit"], car["discharge_limit"] = motor.charge_limit, motor.discharge_limit
    car["motor_fade_speed"] = motor.fade_speed
    car["motor_copper_loss"], car["motor_turning_loss"] = motor.copper_loss, motor.turning_loss
    if plant.vehicle.engine is not None:
        _set_engine(car, plant.vehicle.engine)
    car["sensor_position"] = plant.vehicle.sensor.position
    return params
