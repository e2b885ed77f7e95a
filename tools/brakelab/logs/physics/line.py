"""A line through one quantity over another, on a common grid and with the delay between them."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector

RATE: Final = 50.0  # Hz, of the common grid
SMOOTH_S: Final = 0.4
LAGS: Final = range(-10, 11)  # grid steps
STRIDE: Final = 5  # rows from one compared to the next: a quarter of `SMOOTH_S`, nothing is lost
MOVING: Final = 3.0  # m/s, from which a car drives
BRAKING: Final = 0.7  # m/s^2, from which it is its brakes that slow it


class Fit(NamedTuple):
    """A line through a signal over a reference."""

    correlation: float
    slope: float
    """Signal per reference."""
    intercept: float

    @property
    def span(self) -> tuple[float, float]:
        """Least and greatest size of the slope: all noise is the signal's, or all is the reference's."""
        return abs(self.slope), abs(self.slope) / max(self.correlation**2, 1e-9)

    def is_beyond(self, tolerated: float) -> bool:
        """Return whether the size of the slope is not 1 within a factor, whosever the noise is.

        As much again is left for a reference that is too large: wheels that lock, a coarse speed.
        """
        least, most = self.span
        slack = tolerated / max(self.correlation**2, 1e-9)
        return most < 1.0 / slack or least > slack


def smooth(values: Vector) -> Vector:
    """Return the moving mean over `SMOOTH_S` of values on the grid."""
    width = max(int(SMOOTH_S * RATE), 1)
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def _product(one: Vector, other: Vector) -> float:
    """Return the scalar product; BLAS would have threads wait for each, busily."""
    return float(np.einsum("i,i", one, other))


def fit(signal: Vector, reference: Vector, rows: NDArray[np.bool_]) -> Fit:
    """Return the line of the best of a few lags between a signal and its expected value."""
    best, places = Fit(0.0, 0.0, 0.0), np.flatnonzero(rows)
    if len(places) < 2 * RATE:
        return best
    places = places[::STRIDE]
    r = reference[places]
    mean = float(r.mean())
    r -= mean
    size = _product(r, r)
    padded = np.pad(signal, LAGS[-1], mode="wrap")
    for lag in LAGS:
        s = padded[places + (LAGS[-1] - lag)]
        level = float(s.mean())
        s -= level
        both, own = _product(s, r), _product(s, s)
        if own == 0.0 or size == 0.0:
            continue
        correlation = both / float(np.sqrt(own * size))
        if abs(correlation) > abs(best.correlation):
            slope = both / size
            best = Fit(correlation, slope, level - slope * mean)
    return best
