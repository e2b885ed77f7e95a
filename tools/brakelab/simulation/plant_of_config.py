"""A plant file of the car that CONFIG describes (`config plant`, `--plant as-config`).

Masses, lengths, wheels and brakes are CONFIG's; what it does not know (tyre curves, linings, discs, sensors)
stays that of another car's file. Inertia goes with mass times wheelbase squared; motors, springs and dampers
go with the mass. Of both axles' wheels the plant has the mean.
"""

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomlkit

from brakelab.results.outputs import check_outputs
from ecu.errors import UserError
from ecu.output import argument, wrote
from ecu.settings.config import Config, config_files, load_config, new_params
from ecu.settings.hydraulics import Hydraulics
from ecu.settings.resources import command_name, named

AS_CONFIG: Final = "as-config"
_BY_MASS: Final = {
    "motor": ("torque_limit", "power_limit", "peak_torque", "peak_power", "charge_limit", "discharge_limit"),
    "suspension": (
        *("unsprung_mass_front", "unsprung_mass_rear", "pitch_inertia", "roll_inertia", "stop_stiffness"),
        *("spring_stiffness_front", "spring_stiffness_rear", "damper_force_front", "damper_force_rear"),
        *("anti_roll_stiffness_front", "anti_roll_stiffness_rear"),
    ),
}


def plant_command(config: Path, like: str, out: Path) -> None:
    """Write the car of the file `config` as a plant, made from the car `like`, a file or a shipped name.

    Raises:
        UserError: a file cannot be read, or `out` or its linings not be written.
    """
    base, files = named(like, "config/plant"), (out, out.with_name("linings.toml"))
    check_outputs(out, files, [base, *config_files(config)], toml=True)
    write_plant(load_config(config), base, out)
    car, made = argument(command_name(config)), argument(out)
    wrote(*files, next=f"brake-ecu rig single --config {car} --plant {made} --lock-step")


def write_plant(config: Config, base: Path, out: Path) -> Path:
    """Write CONFIG's car, made from the car `base`, as `out` with its linings beside it; return `out`.

    Raises:
        UserError: `base` cannot be read, or `out` not be written.
    """
    try:
        document = tomlkit.parse(base.read_text("utf-8-sig"))
        for table, values in _values(config, document).items():
            for key, value in values.items():
                document[table][key] = tomlkit.item(value).comment(f"of {config.name}")
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(document.as_string(), "utf-8")
        out.with_name("linings.toml").write_bytes(base.with_name("linings.toml").read_bytes())
    except OSError as error:
        raise UserError(str(error.filename), "", f"{error.strerror}; see --plant and --out") from None
    return out


def _values(config: Config, base: Any) -> dict[str, dict[str, Any]]:
    """Return what of the file `base` CONFIG says, by table and key."""
    car, axles, body = config.vehicle, (config.front, config.rear), base["body"]
    heavier = car.mass / body["mass"]
    longer = car.wheelbase / (body["front_length"] + body["rear_length"])

    def mean(name: str) -> float:
        return _round(0.5 * sum(float(getattr(axle, name)) for axle in axles))

    values: dict[str, dict[str, Any]] = {
        "body": {
            "mass": car.mass,
            "yaw_inertia": _round(body["yaw_inertia"] * heavier * longer**2),
            "cog_height": car.cog_height,
            "front_length": car.front_axle,
            "rear_length": _round(car.wheelbase - car.front_axle),
            "track": car.track,
            "drag_coefficient": car.drag_coefficient,
            "frontal_area": car.frontal_area,
        },
        "tyre": {
            "free_radius": mean("unloaded_radius"),
            "rolling_resistance": car.rolling_resistance,
            **{name: mean(name) for name in ("vertical_stiffness", "wheel_inertia", "slip_stiffness")},
        },
        "hydraulics": {"fallback_friction": mean("mu_nominal"), **_unit(config)},
    }
    for name, axle in zip(("brake_front", "brake_rear"), axles, strict=True):
        values[name] = {
            "friction_nominal": axle.mu_nominal,
            "piston_diameter": _round(axle.piston_diameter * math.sqrt(axle.pistons)),
            "effective_radius": axle.effective_radius,
            "push_out_pressure": axle.push_out_pressure,
        }
    if "attitude" in base:
        values["attitude"] = {"pitch_gradient": car.pitch_gradient}
    for table, keys in _BY_MASS.items():
        given = {key: base[table][key] for key in keys if key in base.get(table, {})}
        values[table] = {key: _scaled(value, heavier) for key, value in given.items()}
    return {table: of_table for table, of_table in values.items() if of_table}


def _unit(config: Config) -> dict[str, Any]:
    """Return the hydraulic unit where CONFIG has one."""
    unit, params = config.hydraulics, new_params(config)[0]
    if unit == Hydraulics():
        return {}
    answers = np.stack([params["pressure_inertia"], params["pressure_lag"], params["dead_time"]])
    build_up, release = answers.T.tolist()
    limits = {"rise_limit": unit.rise_limit, "fall_limit": unit.fall_limit}
    return {"build_up": build_up, "release": release, **limits}


def _scaled(value: Any, factor: float) -> Any:
    return [_scaled(one, factor) for one in value] if isinstance(value, list) else _round(value * factor)


def _round(value: float) -> float:
    return float(f"{value:.6g}")
