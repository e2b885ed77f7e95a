"""One car of a series: all properties unknown to a configuration, drawn from a seed.

`config/plant/draw.toml` has the widths: "wide" is the scatter of cars and sensors that share one
configuration, "nominal" a smaller one that leaves brakes, hydraulics and sensors as described.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from numpy.random import Generator
from pydantic import AfterValidator, BeforeValidator

from brakelab.plant.description import Plant, PlantFileError, nominal, read_file, set_lining
from brakelab.plant.friction.law import Bounds, NotNegative, Section, as_bounds, in_order
from brakelab.plant.hydraulics import DAMPING, DEAD_TIME, INERTIA
from brakelab.plant.records import RecordArray
from brakelab.plant.sensor_errors import SensorErrors

Factors = Annotated[Bounds, BeforeValidator(as_bounds), AfterValidator(in_order)]
SAME: Final = (1.0, 1.0)


class Widths(Section):
    """Half-widths of uniform distributions, relative unless stated; factors have both of their bounds."""

    mass: NotNegative = 0.0
    cog_height: NotNegative = 0.0
    cog_place: NotNegative = 0.0
    """m, along the car."""
    drag: NotNegative = 0.0
    rolling_resistance: NotNegative = 0.0
    pitch_gradient: NotNegative = 0.0
    free_radius: NotNegative = 0.0
    """Of each wheel."""
    vertical_stiffness: NotNegative = 0.0
    wheel_inertia: NotNegative = 0.0
    slip_stiffness: NotNegative = 0.0
    slip_stiffness_axle: NotNegative = 0.0
    """Of each axle, beside what all wheels share."""
    stiffness_degression: Factors = SAME
    friction_axle: Factors | None = None
    """Of each axle's data sheet; None: the level that the car's file gives."""
    friction_wheel: NotNegative = 0.0
    friction_laws: tuple[str, ...] = ()
    """One of them rules both axles; none: those of the car's file."""
    effective_radius: NotNegative = 0.0
    """Of each axle."""
    piston_area: NotNegative = 0.0
    """Of each wheel."""
    push_out_pressure: NotNegative = 0.0
    """bar, of each axle."""
    disc_heating: NotNegative = 0.0
    """Of each axle."""
    disc_cooling: NotNegative = 0.0
    """Of each axle; both numbers."""
    wear_lot: Factors = SAME
    """Of each axle's linings."""
    wear_climate: NotNegative = 0.0
    """Standard deviation of its logarithm, of a day: air and dirt."""
    emission_lot: Factors = SAME
    """Of each axle's linings."""
    emission_day: NotNegative = 0.0
    """Standard deviation of its logarithm, of a day: air, dirt, humidity."""
    hydraulic_inertia: NotNegative = 0.0
    hydraulic_damping: NotNegative = 0.0
    hydraulic_dead_time: NotNegative = 0.0
    sensor_noise: Factors = SAME
    """Of each kind of sensor."""
    motor_torque_scale: NotNegative = 0.0
    motor_torque_noise: Factors = (0.0, 0.0)
    """N m, of each wheel."""
    engine_drag: NotNegative = 0.0
    """Of a combustion engine, both numbers: size, oil, auxiliaries."""
    accel_zero: NotNegative = 0.0
    """m/s^2, of each axis."""
    yaw_rate_zero: NotNegative = 0.0
    """rad/s"""
    steering_zero: NotNegative = 0.0
    """rad"""
    pressure_zero: NotNegative = 0.0
    """bar, of each wheel."""


class DrawFile(Section):
    nominal: Widths
    wide: Widths


def load_widths(path: Path, name: str) -> Widths:
    """Return the widths called "nominal" or "wide" in `path`. Raises `PlantFileError`, one line."""
    found: Widths = getattr(read_file(path, DrawFile), name)
    return found


def _around_one(random: Generator, width: float, size: int | None = None) -> Any:
    return 1.0 + random.uniform(-width, width, size)


def _per_axle(random: Generator, width: float) -> Any:
    return np.repeat(_around_one(random, width, 2), 2)


def draw(plant: Plant, seed: int, width: Widths) -> RecordArray:
    """Return the parameters of one car of the series, shape (1,); the same for the same `seed`.

    Raises:
        PlantFileError: a drawn friction law is not in the lining file.
    """
    body, rest = np.random.default_rng(seed), np.random.default_rng([seed, 5])
    params = nominal(plant)
    car = params[0]
    car["mass"] *= _around_one(body, width.mass)
    car["cog_height"] *= _around_one(body, width.cog_height)
    car["free_radius"] *= _around_one(body, width.free_radius, 4)
    stiffness = _around_one(body, width.slip_stiffness)
    car["slip_stiffness"] *= stiffness * _per_axle(body, width.slip_stiffness_axle)
    car["wheel_inertia"] *= _around_one(body, width.wheel_inertia)
    car["push_out_pressure"] += np.repeat(
        body.uniform(-1e5 * width.push_out_pressure, 1e5 * width.push_out_pressure, 2), 2
    )
    moved = rest.uniform(-width.cog_place, width.cog_place)
    car["front_length"] += moved
    car["rear_length"] -= moved
    for name, share in (
        ("drag_factor", width.drag),
        ("rolling_resistance", width.rolling_resistance),
        ("pitch_gradient", width.pitch_gradient),
        ("vertical_stiffness", width.vertical_stiffness),
    ):
        car[name] *= _around_one(rest, share)
    car["stiffness_degression"] *= rest.uniform(*width.stiffness_degression)
    _draw_brakes(plant, car, width, rest)
    _draw_hydraulics(car, width, rest)
    wear = np.random.default_rng([seed, 7])
    car["wear_scale"] *= np.repeat(wear.uniform(*width.wear_lot, 2), 2)
    car["wear_scale"] *= np.exp(width.wear_climate * wear.standard_normal())
    dust = np.random.default_rng([seed, 8])
    car["emission_scale"] *= np.repeat(dust.uniform(*width.emission_lot, 2), 2)
    car["emission_scale"] *= np.exp(width.emission_day * dust.standard_normal())
    engine = _around_one(np.random.default_rng([seed, 9]), width.engine_drag)
    car["engine_drag_torque"] *= engine
    car["engine_drag_growth"] *= engine
    return params


def _draw_brakes(plant: Plant, car: Any, width: Widths, random: Generator) -> None:
    level = random.uniform(*(width.friction_axle or SAME), 2)
    law = width.friction_laws[random.integers(len(width.friction_laws))] if width.friction_laws else None
    for axle, left in enumerate((0, 2)):
        brake, lining = plant.brake(left), plant.lining(left)
        share = brake.friction_level if width.friction_axle is None else level[axle]
        chosen = law or brake.friction
        if chosen not in lining.friction:
            raise PlantFileError(
                "draw.toml", "friction_laws", f"{chosen!r} is no law of lining {brake.lining}"
            )
        drawn = lining.friction | {chosen: lining.friction[chosen].drawn(random)}
        for wheel in (left, left + 1):
            own = lining.model_copy(update={"friction": drawn})
            set_lining(car, wheel, own, chosen, share * brake.friction_nominal)
    car["friction_scale"] *= _around_one(random, width.friction_wheel, 4)
    car["effective_radius"] *= _per_axle(random, width.effective_radius)
    car["piston_area"] *= _around_one(random, width.piston_area, 4)
    car["heating"] *= _per_axle(random, width.disc_heating)
    cooling = _per_axle(random, width.disc_cooling)
    car["cooling"] *= cooling
    car["cooling_by_speed"] *= cooling


def _draw_hydraulics(car: Any, width: Widths, random: Generator) -> None:
    for place, share in (
        (INERTIA, width.hydraulic_inertia),
        (DAMPING, width.hydraulic_damping),
        (DEAD_TIME, width.hydraulic_dead_time),
    ):
        factor = _around_one(random, share)
        car["build_up"][place] *= factor
        car["release"][place] *= factor


def draw_sensors(known: Mapping[str, SensorErrors], seed: int, width: Widths) -> dict[str, SensorErrors]:
    """Return the drawn properties of one car's sensors that deviate from those `known`, by signal name.

    A sensor without configured noise stays without, except for the motors' torque.
    """
    random = np.random.default_rng([seed, 6])
    low, high = np.log(width.sensor_noise)
    factor = {name: float(np.exp(random.uniform(low, high))) for name in sorted(known)}
    found: dict[str, dict[str, Any]] = {
        name: {"noise": factor[name] * errors.noise} for name, errors in known.items()
    }

    def add(name: str, **errors: Any) -> None:
        found.setdefault(name, {}).update(errors)

    add(
        "motor_torque",
        noise=random.uniform(*width.motor_torque_noise),
        scale=_around_one(random, width.motor_torque_scale),
    )
    for name, zero in (
        ("accel_x", width.accel_zero),
        ("accel_y", width.accel_zero),
        ("yaw_rate", width.yaw_rate_zero),
        ("steering_angle", width.steering_zero),
        ("calliper_pressure", width.pressure_zero),
    ):
        add(name, bias=(-zero, zero))
    return {name: SensorErrors(**errors) for name, errors in found.items()}
