"""The car of a result, beside the rows in the metadata: `car`, JSON."""

import json
import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.brake import brake_gain_per_bar
from ecu.algorithm.control.distribution import front_share
from ecu.contract.params import BAR, GRAVITY
from ecu.settings.annex5 import Load
from ecu.settings.config import Config, new_params

KEY: Final = "car"
RATES: Final[NDArray[np.float64]] = np.round(np.arange(0.0, 1.001, 0.05), 2)
"""Braking rates of `Car.share`."""
_PAIRS: Final = ("radius", "gain", "pad_area", "push_out")


class Car(NamedTuple):
    """Geometry of a car and its brakes; of pairs the first is of the front axle."""

    mass: float
    """kg"""
    wheelbase: float
    """m"""
    rear_axle: float
    """Centre of gravity to rear axle, m."""
    cog_height: float
    """m"""
    loads: tuple[Load, ...]
    """States of load that the distribution is checked in."""
    share: tuple[float, ...]
    """Front share of the brake force at `RATES`, as control has it."""
    radius: tuple[float, float]
    """Of rolling, m."""
    gain: tuple[float, float]
    """Brake torque of one wheel per friction and pressure, N m/bar."""
    pad_area: tuple[float, float]
    """Of both pads of a brake, mm^2; NaN: CONFIG names no lining."""
    push_out: tuple[float, float] = (0.0, 0.0)
    """Push-out pressure, bar; results of earlier versions do not state it."""


def car_of(config: Config) -> dict[str, Any]:
    """Return the car of a configuration as JSON takes it; unknown values are null."""
    params = new_params(config)[0]
    return {
        **{name: float(params[name]) for name in ("mass", "wheelbase", "rear_axle", "cog_height")},
        "loads": [list(load) for load in config.vehicle.loads()],
        "share": [round(float(front_share(params, z * GRAVITY)), 4) for z in RATES],
        "radius": [float(params["wheel_radius"][i]) for i in (0, 2)],
        "gain": [float(brake_gain_per_bar(params, i)) for i in (0, 2)],
        "push_out": [float(params["push_out_pressure"][i] / BAR) for i in (0, 2)],
        "pad_area": [
            2e6 * axle.pad.area if "pad" in axle.model_fields_set else None
            for axle in (config.front, config.rear)
        ],
    }


def unpacked(text: str) -> Car | None:
    """Return the car of the JSON text, None of an empty one.

    Raises:
        ValueError: it is no JSON, or of another shape.
        TypeError: a field is of another kind, missing, or one too many.
    """
    if not text:
        return None
    found = json.loads(text)
    if not isinstance(found, dict):
        raise TypeError("no object")
    pairs: dict[str, Any] = {name: _pair(found.pop(name)) for name in _PAIRS if name in found}
    loads = tuple(Load(*load) for load in found.pop("loads", []))
    share = tuple(float(value) for value in found.pop("share", []))
    if len(share) != len(RATES):
        raise ValueError(f"{len(share)} front shares, not {len(RATES)}")
    rest: dict[str, Any] = {name: float(value) for name, value in found.items()}
    return Car(**rest, **pairs, loads=loads, share=share)


def _pair(values: list[float | None]) -> tuple[float, float]:
    front, rear = (math.nan if value is None else float(value) for value in values)
    return front, rear
