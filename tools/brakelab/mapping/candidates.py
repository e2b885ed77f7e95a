"""Choice of the signal of an input: the one that follows what the car did, or whose name speaks for it."""

import math
from collections.abc import Iterable
from typing import Final

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.physics.line import Fit, fit
from brakelab.logs.physics.samples import Rows
from brakelab.mapping.motion import Motion, contract_unit
from brakelab.mapping.names import converts, counts, names_itself, score, tells_direction, tells_pressure
from brakelab.mapping.series import Series, coarseness
from ecu.bus.units import spelled

LEAST_CORRELATION: Final = 0.5  # correlation that speaks for a signal
LEAST_ALONE: Final = 0.8  # for one whose unit or name says nothing
PER_WORD: Final = 0.1  # of correlation, that a word of the name is worth
NEAR: Final = 0.02  # of correlation, by which two signals follow equally well
STEPS: Final = 8  # fewer values are states, and nothing measured
BETTER: Final = 0.8  # of the coarseness, from which on the other of them is taken
IN_DEGREES: Final = 10.0  # slope against radians, of a signal without a unit, from which it must be degrees


def best_of(
    series: Iterable[Series],
    target: str,
    motion: Motion,
    reference: Vector,
    rows: Rows,
    fixed_sign: int = 0,
) -> tuple[Series, Fit] | None:
    """Return the signal that follows `reference` best among those whose unit or name fits the input.

    `fixed_sign`: of the slope, where a signal of the other sign is another quantity; 0: either.
    """
    unit = contract_unit(target)
    fitting: list[tuple[float, Series, Fit]] = []
    for one in series:
        points, pressure = score(one.signal, target), tells_pressure(one.message, one.signal)
        counting = counts(one.unit, unit) and (pressure or not one.unit.strip())
        if one.flag or points < 0 or not (converts(one.unit, unit) or (counting and points >= 1)):
            continue
        if (unit == "%" and points < 1) or len(np.unique(one.value)) <= STEPS:
            continue
        found = fit(motion.smoothed(one), reference, rows & motion.near(one))
        strength = found.correlation * fixed_sign if fixed_sign else abs(found.correlation)
        said = not counting or unit == "%" or (unit == "bar" and pressure)
        named = points > 0 and said
        least = LEAST_CORRELATION if named else LEAST_ALONE
        if not strength >= least:
            continue
        # Between signals that follow equally well the name decides, then steps and rate.
        fitting.append((strength + PER_WORD * points, one, found))
    if not fitting:
        return None
    best = max(fitting, key=lambda candidate: candidate[0])
    near = [candidate for candidate in fitting if candidate[0] > best[0] - NEAR]
    finest = min(near, key=lambda candidate: coarseness(candidate[1]))
    return (finest if coarseness(finest[1]) < BETTER * coarseness(best[1]) else best)[1:]


def by_name(series: Iterable[Series], target: str) -> Series | None:
    """Return the signal whose name speaks most for an input; a pressure only in a unit of pressure."""
    unit = contract_unit(target)

    def speaks(one: Series) -> bool:
        points = score(one.signal, target)
        if unit == "-":
            return one.flag and points >= 2 and names_itself(one.signal, target)
        fits = converts(one.unit, unit) and tells_direction(one.signal, target)
        return not one.flag and (points >= 1 if fits else points >= 2 and unit.startswith(("m/s", "rad")))

    fitting = [one for one in series if speaks(one)]
    return max(fitting, key=lambda one: score(one.signal, target), default=None)


def unit_of(target: str, one: Series, slope: float = math.inf) -> str:
    """Return the unit of a signal; of one without, what its size or custom says."""
    unit = contract_unit(target)
    if one.unit.strip() or not unit.startswith("rad"):
        return spelled(one.unit) if converts(one.unit, unit) else unit
    return unit.replace("rad", "deg") if abs(slope) > IN_DEGREES else unit
