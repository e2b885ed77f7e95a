"""Parameters of a drawn car that a scenario sets: its `[car]`, and `rig --vary`.

A name alone is of the car or of all four wheels; `_front`, `_rear`, `_fl` … are some of the wheels.
"""

import math
import re
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BeforeValidator

from brakelab.plant.records import PARAMS, RecordArray
from ecu.contract.signals import CORNERS
from ecu.errors import UserError, closest

PARAMETERS: Final = {
    "mass": ("kg", 1.0),
    "yaw_inertia": ("kg m²", 1.0),
    "cog_height": ("m", 1.0),
    "drag_factor": ("N s²/m²", 1.0),
    "rolling_resistance": ("-", 1.0),
    "pitch_gradient": ("rad s²/m", 1.0),
    "pressure_limit": ("bar", 1e5),
    "wheel_inertia": ("kg m²", 1.0),
    "free_radius": ("m", 1.0),
    "vertical_stiffness": ("N/m", 1.0),
    "slip_stiffness": ("-", 1.0),
    "cornering_stiffness": ("1/rad", 1.0),
    "effective_radius": ("m", 1.0),
    "piston_area": ("m²", 1.0),
    "push_out_pressure": ("bar", 1e5),
    "friction_scale": ("-", 1.0),
    "heating": ("K/J", 1.0),
    "cooling": ("1/s", 1.0),
}
"""Of `brakelab.plant.records.PARAMS`: unit here, and what turns it into the record's."""
FARTHEST_RATIO: Final = 30.0
"""A value farther from the drawn car's is one of another unit."""
_WHEELS: Final = {"_front": slice(0, 2), "_rear": slice(2, 4)} | {
    f"_{corner}": slice(place, place + 1) for place, corner in enumerate(CORNERS)
}
NUMBER: Final = r"\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_SHARE: Final = re.compile(rf"({NUMBER}) ?%")


def parameter(name: str) -> tuple[str, slice]:
    """Return the parameter and the wheels of a name. Raises ValueError for one that is none."""
    stem, wheels = name, slice(None)
    for ending, some in _WHEELS.items():
        if name.endswith(ending):
            stem, wheels = name.removesuffix(ending), some
    if stem not in PARAMETERS or (stem != name and PARAMS[stem].shape != (4,)):
        hint = closest(name, PARAMETERS) or f"; there are {', '.join(PARAMETERS)}"
        raise ValueError(f"{name}: no parameter of a car{hint}")
    return stem, wheels


def _checked(car: object) -> object:
    for name, value in car.items() if isinstance(car, dict) else ():
        parameter(name)
        share = _SHARE.fullmatch(value) if isinstance(value, str) else None
        number = float(share[1]) if share else value
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise ValueError(f'{name}: give a number, or a share of the drawn one, "80 %"')
        if not 0.0 < number < math.inf:
            raise ValueError(f"{name}: give a finite value above 0 (found {value})")
    return car


CarParameters = Annotated[dict[str, float | str], BeforeValidator(_checked)]
"""Values in the units of `PARAMETERS`, or as a share of the drawn car's, "80 %"."""


def set_parameters(params: RecordArray, car: CarParameters) -> None:
    """Set parameters of a drawn car, `PARAMS` of shape (1,); what names fewer wheels goes before.

    Raises:
        UserError: a value in a unit is `FARTHEST_RATIO` times the drawn one, or that part of it.
    """
    drawn = params.copy()
    for name in sorted(car, key=_wheels, reverse=True):
        stem, wheels = parameter(name)
        share = _SHARE.fullmatch(str(car[name]))
        rows: Any = ... if wheels == slice(None) else (slice(None), wheels)
        unit = PARAMETERS[stem][1]
        was = drawn[stem][rows]
        if share:
            params[stem][rows] = was * (0.01 * float(share[1]))
            continue
        params[stem][rows] = unit * float(car[name])
        ratio = params[stem][rows] / was
        if not ((ratio > 1.0 / FARTHEST_RATIO) & (ratio < FARTHEST_RATIO)).all():
            drawn_one = f"{np.mean(was) / unit:.4g} {PARAMETERS[stem][0]}"
            raise UserError("[car]", f"{name} = {car[name]}", f"the drawn car has {drawn_one}")


def _wheels(name: str) -> int:
    return len(range(4)[parameter(name)[1]])
