"""Synchronisation of signals of any rate: all are taken at the latest common sample time.

A balance of signals measured at different times is wrong during any change, and a held signal lags by half
its period on average. Samples of a window count as one, at their mean time; every signal is interpolated
between its last two such means at the oldest of the last times, never extrapolated. Where all signals arrive
in every cycle, that is the middle of the window, without interpolation.

Where no accelerometer is mapped, the change of speed from window to window stands for it, halfway between
their times: over a brake application its mean is exact, but for a slope.
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
        ("speeds", "i8"),  # samples of the speed in this window
        ("speed_sum", "f8"),  # of them [m/s]
        ("speed_sum_at", "f8"),  # s
        ("last_speed", "f8"),  # mean of the last window that had samples [m/s]
        ("last_speed_at", "f8"),  # its time [s]
    ],
    align=True,
)

LEAST_STEP_S, OLDEST_S = 0.001, 0.5  # between samples that are compared
LEAST_ADVANCE_S = 0.02  # advance of the common time that allows another balance


@kernel
def open_sampling(state: Record) -> None:
    """Begin a window."""
    for i in range(CHANNELS):
        state.sum[i], state.sum_at[i], state.count[i] = 0.0, 0.0, 0
    state.speed_sum, state.speed_sum_at, state.speeds = 0.0, 0.0, 0


@kernel
def add_sample(state: Record, i: int, value: float, age: float) -> None:
    """Add a sample of channel `i` that is `age` [s] old."""
    state.sum[i] += value
    state.sum_at[i] += state.now - age
    state.count[i] += 1


@kernel
def add_speed(state: Record, speed: float, age: float) -> None:
    """Add a speed of the car [m/s] that is `age` [s] old."""
    state.speed_sum += speed
    state.speed_sum_at += state.now - age
    state.speeds += 1


@kernel
def accelerate_by_speed(state: Record) -> None:
    """Add the change of the speed since the last window that had one as a sample of the acceleration."""
    if state.speeds == 0:
        return
    speed, at = state.speed_sum / state.speeds, state.speed_sum_at / state.speeds
    time = at - state.last_speed_at
    if LEAST_STEP_S < time < OLDEST_S:
        add_sample(state, ACCEL, (speed - state.last_speed) / time, state.now - at + 0.5 * time)
    state.last_speed, state.last_speed_at = speed, at


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
    return (state.value[i] - state.before[i]) / time if LEAST_STEP_S < time < OLDEST_S else 0.0


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
