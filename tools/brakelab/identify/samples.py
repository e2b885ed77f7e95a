"""Samples of a measurement one by one: those that stand alone, gaps between two, a time that begins anew."""

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from brakelab.arrays import Array

ANEW: Final = 1.0  # of a file's time, by which a stop may begin later than the first
APART: Final = 100.0  # likewise, between stops whose time begins anew
NEAR: Final = 5  # samples, of which the median shows what is usual: two may be mistyped
FEWEST_SAMPLES: Final = 50  # samples that show a range
BEYOND: Final = 3.0  # times the range of what is usual: noise alone stays within
LONGEST_GAP: Final = 0.5  # s between two samples of a rig's column
PEAKS: Final = 100.0  # likewise, of a particle counter


def alone(values: Array, beyond: float = BEYOND) -> NDArray[np.bool_]:
    """Return which samples, shape (n,), are far from those around, beyond all that the others do."""
    found = np.zeros(len(values), np.bool_)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) >= FEWEST_SAMPLES:
        sound = values[known]
        around = np.median(sliding_window_view(np.pad(sound, NEAR // 2, "edge"), NEAR), axis=1)
        found[known] = np.abs(sound - around) > beyond * np.ptp(around)
    return found


def bridged(t: Array, values: Array, longest: float) -> Array:
    """Return samples, shape (n,), those that are NaN interpolated between two at most `longest` [s] apart.

    Where rows themselves are farther apart, as between two stops, the stop's nearest sample is held.
    """
    known = np.flatnonzero(np.isfinite(values))
    if len(known) in (0, len(values)):
        return values
    stop = np.cumsum(np.diff(t, prepend=t[0]) > longest)
    place = np.searchsorted(known, np.arange(len(t)))
    after, before = known[np.minimum(place, len(known) - 1)], known[np.maximum(place - 1, 0)]
    ahead = np.where((stop[after] == stop) & (t[after] >= t), t[after], np.inf)
    behind = np.where((stop[before] == stop) & (t[before] <= t), t[before], -np.inf)
    between = np.interp(t, t[known], values[known])
    held = np.where(np.isfinite(ahead), values[after], values[before])
    one_sided = np.isfinite(ahead) != np.isfinite(behind)
    gap = np.where(one_sided, np.minimum(ahead - t, t - behind), ahead - behind)
    filled = np.where(gap <= longest, np.where(one_sided, held, between), np.nan)
    return np.where(np.isfinite(values), values, filled)


def continued(time: Array) -> Array:
    """Return a time that begins anew with every stop as one that goes on, stops `APART` apart."""
    if len(time) < 3:
        return time
    before, here, after = time[:-2], time[1:-1], time[2:]
    anew = 1 + np.flatnonzero((here < before) & (after > here) & (after < before) & (here - time[0] < ANEW))
    steps = np.zeros(len(time))
    steps[anew] = time[anew - 1] - time[anew] + APART
    return np.asarray(time + np.cumsum(steps))
