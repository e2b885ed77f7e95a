"""A line through one quantity over another, on a common grid and with the delay between them."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector

RATE: Final = 50.0  # Hz, of the common grid
SMOOTH_S: Final = 0.4
LAGS: Final = range(-10, 11)  # grid steps
MOVING: Final = 3.0  # m/s, from which a car drives
BRAKING: Final = 0.7  # m/s^2, from which it is its brakes that slow it


class Fit(NamedTuple):
    """A line through a signal over a reference."""

    correlation: float
    slope: float
    """Signal per reference."""
    intercept: float


def smooth(values: Vector) -> Vector:
    """Return the moving mean over `SMOOTH_S` of values on the grid."""
    width = max(int(SMOOTH_S * RATE), 1)
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def fit(signal: Vector, reference: Vector, rows: NDArray[np.bool_]) -> Fit:
    """Return the line of the best of a few lags between a signal and its expected value."""
    best = Fit(0.0, 0.0, 0.0)
    for lag in LAGS:
        shifted = np.roll(signal, lag)
        s, r = shifted[rows], reference[rows]
        if len(s) < 2 * RATE or s.std() == 0.0 or r.std() == 0.0:
            continue
        correlation = float(np.corrcoef(s, r)[0, 1])
        if abs(correlation) > abs(best.correlation):
            slope = float(np.cov(s, r)[0, 1] / r.var(ddof=1))
            best = Fit(correlation, slope, float(s.mean() - slope * r.mean()))
    return best
