"""Factor of a signal by its slope over what it should read: sign, and scale where no unit states it."""

import math
from typing import Final, NamedTuple

from brakelab.mapping.series import Series
from ecu.bus.units import CONVERSIONS

UNIT_SLOPE: Final = 1.25  # and its inverse: beyond, neither sign nor unit explains it
RADIUS: Final = "; or the wheels do not have the radius assumed"
LEAST_IN_CURVES: Final = (
    0.4  # of a slope over the wheels' yaw rate: the outer tyre, pressed flat, turns faster
)


class Scale(NamedTuple):
    """Factor of a signal in its unit, and what is to be looked into."""

    factor: float
    warning: str


def scale_of(one: Series, slope: float, correlation: float, in_curves: bool = False) -> Scale:
    """Return sign and scale of a signal that reads `slope` times what it should, in the unit it is taken for.

    Of a signal in a unit the sign alone is taken: a wrong scale is the database's or the wheels', a warning.
    One without a unit counts something: its scale is the drive's.

    `in_curves`: the reference is the wheels' yaw rate, which is too large at speed.
    """
    sign, size = math.copysign(1.0, slope), abs(slope)
    least = LEAST_IN_CURVES if in_curves else 1.0 / UNIT_SLOPE
    least *= correlation * correlation  # noise of the reference makes a slope no smaller
    if least <= size <= UNIT_SLOPE:
        return Scale(sign, "")
    looks = {
        unit: scale
        for units in (CONVERSIONS["rad/s"], CONVERSIONS["m/s^2"])
        for unit, (scale, _) in units.items()
        if scale != 1.0 and least < size * scale < UNIT_SLOPE
    }
    if not one.unit.strip():
        factor = next((sign * scale for scale in looks.values()), float(f"{1.0 / slope:.3g}"))
        why = f"the database states no unit; factor {factor:.3g} is by the motion of this drive"
        return Scale(factor, why)
    likely = next((f"; it would fit {unit}" for unit in looks), RADIUS)
    return Scale(sign, f"slope {slope:+.2f} instead of {sign:+.0f}: check unit and scale{likely}")
