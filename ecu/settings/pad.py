"""The linings of an axle as CONFIG has them: `[front.pad]`, `[rear.pad]`."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from ecu.settings.toml_file import Section, Unit


class Pad(Section):
    """The linings of an axle and what they wear by. Thickness in mm, without the backplate."""

    area: Annotated[float, Field(gt=5e-4, lt=0.05), Unit("m^2")] = 7.125e-3
    """Of one pad, m^2: Table 3.1, brake A."""
    density: Annotated[float, Field(gt=500, lt=8000), Unit("kg/m^3")] = 2500.0
    """Of the lining."""
    thickness_new: Annotated[float, Field(gt=2, lt=40), Unit("mm")] = 12.0
    """New lining, section 7.6.2."""
    thickness_worn: Annotated[float, Field(ge=0, lt=20), Unit("mm")] = 3.0
    """At which pads are replaced."""
    chamfer_depth: Annotated[float, Field(ge=0, lt=20), Unit("mm")] = 0.0
    """From the new surface to where the chamfers end."""
    chamfer_share: Annotated[float, Field(ge=0, lt=0.9), Unit("-")] = 0.0
    """Of the area, missing at the new surface; falls linearly to nothing at the depth."""
    law: Literal["extended", "quasi-static"] = "extended"
    """(7.13), or (7.14): its first three coefficients alone."""
    coefficients: list[Annotated[float, Field(ge=0, le=100)]] = Field(
        default=[0.1016, 0.0, 0.3984e-6, 0.4887, 0.0, 0.0, 0.66e-2], min_length=7, max_length=7
    )
    """gamma_10 to gamma_31 of Table 7.1, of both pads of a calliper; the disc's temperature in degC."""
    road_scale: Annotated[float, Field(gt=0.1, lt=10), Unit("-")] = 1.0
    """Wear on the road over that on the dynamometer (section 7.6)."""
    sigma: Annotated[float, Field(gt=1e-3, lt=1), Unit("-")] = 0.15
    """Of the law, relative, for linings that were never measured."""
    walk: Annotated[float, Field(ge=0, lt=0.2), Unit("1/sqrt(g)")] = 0.01
    """Random walk of the law's scale as the lining wears, per square root of a gram."""
    scatter: Annotated[float, Field(ge=0, lt=5), Unit("sqrt(g)")] = 0.35
    """Standard deviation of the mass over the square root of the mass, sqrt(g): weather and roads, some 10 %
    that stay the same over some 6 g."""

    airborne_share: Annotated[float, Field(ge=0, le=1), Unit("-")] = 0.5
    """Of the mass worn off, what stays in the air: about half (Grigoratos and Martini 2015). The disc's own
    is not in it."""
    airborne_low: Annotated[float, Field(ge=0, le=1), Unit("-")] = 0.02
    """The least that it may be: 0.02 to 0.21 for non-asbestos organic linings (Hagino et al. 2016)."""
    airborne_high: Annotated[float, Field(ge=0, le=1), Unit("-")] = 0.70
    """The most: 0.5 to 0.7 of the collected debris of three kinds of linings (Sanders et al. 2002)."""

    @model_validator(mode="after")
    def _something_to_wear(self) -> "Pad":
        if self.thickness_worn >= self.thickness_new:
            raise ValueError("thickness_worn must be smaller than thickness_new")
        if not self.airborne_low <= self.airborne_share <= self.airborne_high:
            raise ValueError("airborne_share must lie between airborne_low and airborne_high")
        return self


def set_pad(row: Any, corner: int, pad: Pad) -> None:
    """Write the linings of a corner into `row`, one `PARAMS`."""
    used = [1.0] * 7 if pad.law == "extended" else [1.0] * 3 + [0.0] * 4
    row["wear_law"][:, corner] = pad.road_scale * np.multiply(pad.coefficients, used)
    row["wear_sigma"][corner], row["wear_walk"][corner] = pad.sigma, pad.walk
    row["wear_scatter"][corner] = pad.scatter
    row["airborne_share"][corner] = pad.airborne_share
    row["airborne_low"][corner], row["airborne_high"][corner] = pad.airborne_low, pad.airborne_high
    row["pad_mass"][corner] = 2.0 * pad.density * pad.area  # kg/m is g/mm
    row["pad_life"][corner] = pad.thickness_new - pad.thickness_worn
    row["chamfer_depth"][corner], row["chamfer_share"][corner] = pad.chamfer_depth, pad.chamfer_share
