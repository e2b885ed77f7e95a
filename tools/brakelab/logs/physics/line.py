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


def ranked(values: Vector) -> list[Vector]:
    """Return the least of each row, the next, …, each of shape (n,), of `values` of shape (n, few).

    Columns are exchanged as wholes: numpy would sort row by row.
    """
    ranks = list(values.T)
    for end in range(len(ranks) - 1, 0, -1):
        for i in range(end):
            one, other = ranks[i], ranks[i + 1]
            ranks[i], ranks[i + 1] = np.minimum(one, other), np.maximum(one, other)
    return ranks


def smooth(values: Vector) -> Vector:
    """Return the moving mean over `SMOOTH_S` of values on the grid."""
    width = max(int(SMOOTH_S * RATE), 1)
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def fit(signal: Vector, reference: Vector, rows: NDArray[np.bool_]) -> Fit:
    """Return the line of the best of a few lags between a signal and its expected value."""
    places = np.flatnonzero(rows)
    if len(places) < 2 * RATE:
        return Fit(0.0, 0.0, 0.0)
    places = places[::STRIDE]
    r = reference[places]
    mean = r.mean()
    r -= mean
    padded = np.pad(signal, LAGS[-1], mode="wrap")
    s = padded[places + LAGS[-1] - np.array(LAGS)[:, np.newaxis]]
    levels = s.mean(axis=1)
    s -= levels[:, np.newaxis]
    # Not by BLAS, whose threads would wait for each other, busily.
    size, both, own = np.einsum("i,i", r, r), np.einsum("ki,i->k", s, r), np.einsum("ki,ki->k", s, s)
    spread = np.sqrt(own * size)
    correlations = np.divide(both, spread, out=np.zeros_like(both), where=spread > 0.0)
    best = int(np.argmax(np.abs(correlations)))
    if correlations[best] == 0.0:
        return Fit(0.0, 0.0, 0.0)
    slope = both[best] / size
    return Fit(float(correlations[best]), float(slope), float(levels[best] - slope * mean))
