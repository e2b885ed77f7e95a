"""Words for a line through an input: its sign, its scale, the unit that would explain it."""

from typing import Final, TypeGuard

from brakelab.logs.physics.line import Fit
from brakelab.logs.physics.samples import Car
from ecu.bus.units import CONVERSIONS

CLEAN: Final = 0.93  # correlation from which a slope is a scale
SIGNED: Final = 0.6  # from which it has a sign
SCALE: Final = {True: 0.15, False: 0.22}  # tolerated, of a car that is known, and of any
UNIT: Final = 1.45  # a factor within it of that of a unit is that unit
CHECK: Final = "check unit and factor"


def sign_and_scale(name: str, what: str, line: Fit, car: Car, remedy: str) -> list[str]:
    """Return the line of an input that is turned against `what` it follows, or of another scale, or none."""
    size, problems = abs(line.slope), []
    if line.correlation < -SIGNED:
        problems.append(f"turned against {what}; factor = -1")
    if abs(line.correlation) > SIGNED and line.is_beyond(1.0 + SCALE[car.known]):
        problems.append(f"reads {times(size)} {what}{unit_of('m/s^2', 1.0 / size, remedy)}")
    return [f"{name}: {'; '.join(problems)}"] if problems else []


def unit_of(target: str, wanted: float, otherwise: str) -> str:
    """Return the unit whose factor is about `wanted`, as a remedy; without one `otherwise`."""
    for unit, (scale, _) in CONVERSIONS[target].items():
        for factor, name in ((scale, unit), (1.0 / scale, target)):
            if scale != 1.0 and 1.0 / UNIT < wanted / factor < UNIT and is_apart(wanted, 1.8):
                return f'; unit = "{name}"'
    return f"; {otherwise}"


def is_clean(line: Fit | None) -> TypeGuard[Fit]:
    """Return whether a line is there whose slope is a scale."""
    return line is not None and abs(line.correlation) > CLEAN


def is_in_degrees(line: Fit | None) -> bool:
    """Return whether an angular rate is some 57 times what it should be."""
    return line is not None and abs(line.correlation) > SIGNED and abs(line.slope) > 57.3 * 0.3


def is_apart(ratio: float, tolerated: float) -> bool:
    """Return whether a ratio is not 1 within a factor."""
    return not 1.0 / tolerated <= ratio <= tolerated


def times(ratio: float) -> str:
    """Return a ratio in words."""
    return f"{ratio:.2f} times"
