"""Synchronisation of signals of any rate: all are taken at the latest common sample time.

A balance of signals measured at different times is wrong during any change, and a held signal lags by half
its period on average. Samples of a window count as one, at their mean time; every signal is interpolated
between its last two such means at the oldest of the last times, never extrapolated. Where all signals arrive
in every cycle, that is the middle of the window, without interpolation.
"""

import numpy as np

from ecu.jit import Record, kernel

CHANNELS = 5  # four pressures, acceleration
ACCEL = 4

SAMPLING_STATE = np.dtype(
    [
        ("now", "f8"),  # s since the start
        ("sum", "f8", (CHANNELS,)),  # over this window
        ("sum_at", "f8", (CHANNELS,)),  # s
        ("count", "i8", (CHANNELS,)),
        ("value", "f8", (CHANNELS,)),  # mean of the last window that had samples
        ("at", "f8", (CHANNELS,)),  # its time [s]
        ("before", "f8", (CHANNELS,)),  # likewise, of the one before
        ("before_at", "f8", (CHANNELS,)),
        ("samples", "i8", (CHANNELS,)),  # number of samples in `value`
        ("common", "f8"),  # time of the last balance [s]
    ],
    align=True,
)

OLDEST_S = 0.5  # between samples that are compared
LEAST_ADVANCE_S = 0.02  # advance of the common time that allows another balance


@kernel
def open_sampling(state: Record) -> None:
    """Begin a window."""
    for i in range(CHANNELS):
        state.sum[i], state.sum_at[i], state.count[i] = 0.0, 0.0, 0


@kernel
def add_sample(state: Record, i: int, value: float, age: float) -> None:
    """Add a sample of channel `i` that is `age` [s] old."""
    state.sum[i] += value
    state.sum_at[i] += state.now - age
    state.count[i] += 1


@kernel
def close_sampling(state: Record) -> None:
    """Turn the sums of the channels that had samples into means."""
    for i in range(CHANNELS):
        n = state.count[i]
        if n > 0:
            state.before[i], state.before_at[i] = state.value[i], state.at[i]
            state.value[i], state.at[i], state.samples[i] = state.sum[i] / n, state.sum_at[i] / n, n


@kernel
def slope(state: Record, i: int) -> float:
    """Return the change of channel `i` per second between its last two means; 0 where they are far apart."""
    time = state.at[i] - state.before_at[i]
    return (state.value[i] - state.before[i]) / time if 0.001 < time < OLDEST_S else 0.0


@kernel
def at_common_time(state: Record, i: int) -> float:
    """Return channel `i` at the common time."""
    return state.value[i] - slope(state, i) * (state.at[i] - state.common)


@kernel
def advance_common_time(state: Record) -> bool:
    """Advance the common time; return whether a new comparison is possible."""
    oldest = state.at[0]
    for i in range(1, CHANNELS):
        oldest = min(oldest, state.at[i])
    if oldest < state.common + LEAST_ADVANCE_S or state.now - oldest > OLDEST_S:
        return False
    state.common = oldest
    return True
