"""Balances and gauges of a simulated laboratory and workshop, with errors of their own.

Each has noise, a zero that moves each time that it is set up, and a gain. Assumption: all numbers, in the
range of data sheets; what identifies a law assumes others.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.random import Generator

from brakelab.arrays import Array

BALANCE_NOISE: Final = 0.02  # g
MOISTURE: Final = 0.03  # g, of two pads, from weighing to weighing
BALANCE_GAIN: Final = 1e-4  # share
POINT_NOISE: Final = 0.009  # mm
POINT_ZERO: Final = 0.004  # mm, of all points of one day
POINT_GAIN: Final = 0.004  # share
WORKSHOP_NOISE: Final = 0.07  # mm, one reading through the wheel
WORKSHOP_ZERO: Final = 0.06  # mm, of one gauge and one person: a car's
WORKSHOP_GAIN: Final = 0.01  # share


def weigh(masses: Array, random: Generator) -> Array:
    """Return masses [g] as one balance shows them, one after the other; shape as given."""
    moist = np.hypot(BALANCE_NOISE, MOISTURE) * random.normal(size=masses.shape)
    return masses * (1.0 + BALANCE_GAIN * random.normal()) + moist


def measure_points(thickness: Array, random: Generator) -> Array:
    """Return thicknesses [mm] as one gauge shows them; shape (days, points)."""
    zero = POINT_ZERO * random.normal(size=(len(thickness), 1))
    noise = POINT_NOISE * random.normal(size=thickness.shape)
    return thickness * (1.0 + POINT_GAIN * random.normal()) + zero + noise


def workshop_gauge(random: Generator) -> Callable[[Array], Array]:
    """Return what turns wear [mm] into what one workshop's gauge finds of it."""
    zero, gain = WORKSHOP_ZERO * random.normal(), 1.0 + WORKSHOP_GAIN * random.normal()
    return lambda wear: gain * wear + zero + WORKSHOP_NOISE * random.normal(size=wear.shape)
