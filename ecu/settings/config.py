"""CONFIG files: one vehicle, its brakes, sensors and tuning, in TOML; checked here, turned into `PARAMS`.

Pressures stand in bar, everything else in SI units. `include = "tuned.toml"` takes from another file, named
relative to this one, or from a shipped one ("suv") the keys that this one does not give itself. A key that is
missing, unknown or out of range is one line: the file, the key and what would be right.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from ecu.algorithm.vehicle import rolling_radius
from ecu.contract.params import (
    BAR,
    COMPENSATIONS,
    DISTRIBUTIONS,
    GRAVITY,
    MINIMISED,
    OBSERVERS,
    PARAMS,
    PEDAL_POINTS,
)
from ecu.contract.records import RecordArray
from ecu.errors import UserError
from ecu.settings.annex3 import annex_3_violation
from ecu.settings.annex5 import annex_5_violation
from ecu.settings.dust import set_dust, set_dust_version
from ecu.settings.hydraulics import set_hydraulics
from ecu.settings.lining_share import set_lining_share
from ecu.settings.pad import set_pad
from ecu.settings.resources import shipped_in
from ecu.settings.sections import Axle, Config, Observer
from ecu.settings.toml_file import describe, findings, read_toml, summarised

__all__ = [
    "Axle",
    "Config",
    "Observer",
    "config_files",
    "config_hash",
    "config_of",
    "included_file",
    "load_config",
    "new_params",
    "store_key",
    "torque_per_bar",
    "validate_config",
    "violations",
]

AIR_DENSITY = 1.2  # kg/m^3, 20 degC at sea level


def load_config(path: Path) -> Config:
    """Read and check a CONFIG file.

    Raises:
        UserError: a file cannot be read, a key is missing, unknown or out of range, or the car violates
            ECE R13-H, see `violations`.
    """
    config = validate_config(path)
    if not isinstance(config, Config):
        raise summarised(config)
    return _lawful(path, config)


def config_of(given: Mapping[str, Any], where: str) -> Config:
    """Return the configuration of tables as a CONFIG file has them, checked as one; errors name `where`.

    Raises:
        UserError: as `load_config`.
    """
    try:
        config = Config.model_validate(given)
    except ValidationError as error:
        raise describe(error, where, Config) from None
    return _lawful(Path(where), config)


def _lawful(path: Path, config: Config) -> Config:
    found = violations(path, config, new_params(config)[0])
    if found:
        raise summarised(found)
    return config


def violations(path: Path, config: Config, params: Any) -> list[UserError]:
    """Return what of the car in `path` violates Annexes 3 and 5 of ECE R13-H; `params` is its `PARAMS`."""
    loads = config.vehicle.loads()
    braking, distribution = annex_3_violation(params, loads), annex_5_violation(params, loads)
    return [
        *([UserError(str(path), *braking)] if braking else []),
        *([UserError(str(path), "control.distribution", distribution)] if distribution else []),
    ]


def validate_config(path: Path) -> Config | list[UserError]:
    """Return the configuration, or everything that is wrong with its keys. Raises UserError for no TOML."""
    own = read_toml(path)
    source, included = _included(path, own.pop("include")) if "include" in own else (path, {})
    try:
        return Config.model_validate(_merged(own, included))
    except ValidationError as error:

        def file_of(keys: tuple[int | str, ...]) -> str:
            return str(source if _holds(included, keys) and not _holds(own, keys) else path)

        return findings(error, file_of, Config)


def _included(path: Path, name: object) -> tuple[Path, dict[str, Any]]:
    if not isinstance(name, str) or not name:
        raise UserError(str(path), "include", 'give the name of a TOML file in "quotes"')
    source = included_file(path, name)
    included = read_toml(source)
    if "include" in included:
        raise UserError(str(source), "include", f"an included file includes no other; name it in {path}")
    return source, included


def config_files(config: Path) -> list[Path]:
    """Return `config` and the file that it includes, if any."""
    name = read_toml(config).get("include")
    return [config, included_file(config, str(name))] if name else [config]


def included_file(path: Path, name: str) -> Path:
    """Return the file that `path` includes as `name`: one relative to it, or a shipped configuration."""
    beside = path.parent / name
    return beside if beside.exists() else shipped_in("config").get(name, beside)


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
    """Return a hash of everything that changes results, by which two runs are distinguished."""
    text = json.dumps(config.model_dump(exclude={"transmit"}), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def store_key(config: Config) -> str:
    """Return what learned values belong to: vehicle, brakes and the version of the algorithm.

    Not the linings' wear law: wear is kept in a form that any law can be applied to later. Not their dust:
    its totals carry the version of their model. Not the discs' temperature model: friction is the lining's.
    """
    apart = {"pad", "dust", *(name for name in Axle.model_fields if "disc_" in name)}
    axles = [axle.model_dump(exclude=apart) for axle in (config.front, config.rear)]
    brakes = json.dumps(axles, sort_keys=True)
    return f"{config.name}/{hashlib.sha256(brakes.encode()).hexdigest()[:8]}/8"


def new_params(config: Config) -> RecordArray:
    """Return `PARAMS` of length 1 in SI units; every input counts as mapped until a map is read."""
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
        for name in ("sigma_disc_heating", "sigma_disc_cooling", "sigma_disc_cooling_wet"):
            row[name][corner] = getattr(axle, name)
        row["disc_cooling_wet"][corner], row["disc_cooling_by_speed_wet"][corner] = axle.wet_cooling()
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
    set_hydraulics(row, config.hydraulics)
    row["fade_speed"] = config.blending.fade_speed
    row["blending"] = np.repeat((config.blending.front, config.blending.rear), 2)
    heaviest = max(load.mass for load in vehicle.loads())
    down_grade = GRAVITY * math.sin(math.atan(control.hold_grade)) * heaviest / vehicle.mass
    row["hold_decel"] = down_grade / (1.0 - 2.0 * observer.sigma_mu_initial)
    row["distribution"] = DISTRIBUTIONS.index(control.distribution)
    row["front_share"], row["rear_slip_margin"] = control.front_share or 0.0, control.rear_slip_margin
    row["max_pressure"] = control.max_pressure * BAR
    row["max_pressure_rate"] = control.max_pressure_rate * BAR
    row["minimised"] = MINIMISED.index(control.minimise)
    if row["minimised"]:
        set_lining_share(row, vehicle.loads())
    return params


def torque_per_bar(params: Any) -> NDArray[np.float64]:
    """Return torques at nominal friction [N m/bar], 2 A_k r_eff mu, shape (4,), of one `PARAMS`."""
    return np.asarray(BAR * 2.0 * params["piston_area"] * params["effective_radius"] * params["mu_nominal"])
