"""Lags of a drive's speeds and of its accelerometer, by the correlation of their accelerations.

    a(t)  ~  dv/dt(t + lag)        both smoothed alike; the peak between two steps by a parabola

Slip makes the speed of a wheel lead by up to a quarter of a second, so that wheels are compared by the axle
that is not driven, while the car does not brake: by the later one, if they differ. A sensor comes late, not
early, so the earliest input is right, unless it precedes the pressures. Without an accelerometer pressures
stand for it, which the car's deceleration follows `ANSWERS` later. The standard deviation is that of the
mean over parts of the drive.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.logs.physics.line import BRAKING, MOVING, RATE
from brakelab.logs.physics.samples import InputSeries, Rows
from ecu.contract.signals import CORNERS

STEPS: Final = range(-35, 36)  # of the grid, beyond what a map takes: a peak at the end is none
PARTS: Final = 8
FEWEST_PARTS: Final = 3
LEAST_ROWS: Final = int(6 * RATE)  # of a part
FOLLOWS: Final = 0.7  # correlation from which a peak is one
CERTAIN: Final = 0.012  # s, greatest standard deviation of a lag that is reported
FLOOR: Final = 0.005  # s, half a cycle
LEAST_LAG: Final = 0.03  # s, that matters
UNDRIVEN: Final = 0.05  # s, by which the axle that is not driven comes later than the other
BESIDE: Final = int(0.4 * RATE)  # rows beside a braking
ANSWERS: Final = 0.08  # s, from the pressure to the deceleration
ANSWERS_SIGMA: Final = 0.03  # s, of that, from car to car
PRECEDES: Final = -0.08  # s, likewise, that no car's deceleration does
SLIPS: Final = 0.05  # s, by which a speed that is counted at wheels comes earlier while they slip
RADIUS: Final = 0.3  # m, about
COPIES: Final = 1e-3  # relative, within which one speed stands for all wheels


class Lag(NamedTuple):
    """By how much an input comes late."""

    name: str
    """Of the input; `wheel_speed` of all four."""
    seconds: float
    sigma: float

    @property
    def line(self) -> str:
        """What it is."""
        name = f"{self.name}_*" if self.name == "wheel_speed" else self.name
        late = "late" if self.seconds > 0.0 else "early"
        return f"{name}: {abs(self.seconds):.2f} ± {self.sigma:.2f} s {late}"


def lags(series: InputSeries) -> list[Lag]:
    """Return the inputs that come late or early by more than their uncertainty, where the drive shows it."""
    if "accel_x" not in series:
        behind = (_behind_pressures(series, name) for name in ("wheel_speed", "vehicle_speed"))
        return [lag for lag in behind if lag and lag.seconds > max(LEAST_LAG, 3.0 * lag.sigma)]
    accel = series["accel_x"]
    found = {
        name: lag for name in ("wheel_speed", "vehicle_speed") if (lag := _speed_lag(series, accel, name))
    }
    if not found:
        return []
    found["accel_x"] = Lag("accel_x", 0.0, max(lag.sigma for lag in found.values()))
    earliest = min(lag.seconds for lag in found.values())
    pressures = series.corners("calliper_pressure")
    if pressures is not None:
        answer = _lag("accel_x", accel, -pressures.sum(axis=1), series.known)
        if answer and answer.seconds + earliest < PRECEDES:
            earliest = ANSWERS - answer.seconds
    late = [lag._replace(seconds=lag.seconds - earliest) for lag in found.values()]
    return [lag for lag in late if abs(lag.seconds) > max(LEAST_LAG, 3.0 * lag.sigma)]


def _behind_pressures(series: InputSeries, name: str) -> Lag | None:
    """Return by how much a speed comes later than pressures let expect; None: not shown."""
    pressures, speed = series.corners("calliper_pressure"), _speed(series, name)
    if pressures is None or speed is None:
        return None
    moving = series.known & (speed > MOVING)
    lag = _lag(name, np.gradient(speed, 1.0 / RATE), -pressures.sum(axis=1), moving)
    return lag and Lag(name, lag.seconds - ANSWERS, float(np.hypot(lag.sigma, ANSWERS_SIGMA)))


def _speed(series: InputSeries, name: str) -> Vector | None:
    """Return the car's speed by an input [m/s], wheels of about `RADIUS`; None: it is not there."""
    wheels = series.corners(name)
    if wheels is not None:
        return np.asarray(np.median(wheels, axis=1) * RADIUS)
    there = name in series
    return series[name] if there else None


def _speed_lag(series: InputSeries, accel: Vector, name: str) -> Lag | None:
    """Return by how much a speed comes later than the accelerometer; None: the drive does not show it."""
    wheels, speed = series.corners(name), _speed(series, name)
    if speed is None:
        return None
    moving = series.known & (speed > MOVING)
    brakes = np.convolve(accel < -BRAKING, np.ones(2 * BESIDE + 1), mode="same") > 0.5
    if wheels is None or _is_copied(series, moving):
        change = np.gradient(speed, 1.0 / RATE)
        both = [_peak(change, accel, _inner(moving & rows)) for rows in (brakes, ~brakes)]
        if both[0] is None or both[1] is None or abs(both[0] - both[1]) > SLIPS:
            return None
        return _lag(name, change, accel, moving)
    changes = (np.gradient(wheels[:, axle].mean(axis=1), 1.0 / RATE) for axle in (slice(2), slice(2, 4)))
    front, rear = (_lag(name, change, accel, moving & ~brakes) for change in changes)
    if front is None or rear is None or abs(front.seconds - rear.seconds) < UNDRIVEN:
        return None
    return max(front, rear, key=lambda lag: lag.seconds)


def _is_copied(series: InputSeries, moving: Rows) -> bool:
    """Return whether one speed stands for all four wheels."""
    raw = np.stack([series.raw(f"wheel_speed_{corner}") for corner in CORNERS], axis=1)[moving]
    return len(raw) > 0 and bool((raw / np.maximum(raw[:, :1], 1.0)).std(axis=0).max() < COPIES)


def _inner(rows: Rows) -> NDArray[np.int64]:
    """Return the places of rows that have all `STEPS` beside them."""
    places = np.flatnonzero(rows)
    return places[(places >= -STEPS[0]) & (places < len(rows) - STEPS[-1])]


def _lag(name: str, signal: Vector, reference: Vector, rows: Rows) -> Lag | None:
    """Return by how much `signal` comes later than `reference` in the `rows`, all of shape (n,)."""
    places = _inner(rows)
    count = min(len(places) // LEAST_ROWS, PARTS)
    parts = np.array_split(places, count) if count >= FEWEST_PARTS else []
    peaks = [peak for part in parts if (peak := _peak(signal, reference, part)) is not None]
    if len(peaks) < FEWEST_PARTS:
        return None
    sigma = float(np.hypot(np.std(peaks, ddof=1) / np.sqrt(len(peaks)), FLOOR))
    return Lag(name, float(np.median(peaks)), sigma) if sigma < CERTAIN else None


def _peak(signal: Vector, reference: Vector, part: NDArray[np.int64]) -> float | None:
    """Return the lag [s] at the best correlation in a part, None: it has none."""
    if len(part) < LEAST_ROWS:
        return None
    fixed = reference[part] - reference[part].mean()
    correlations = np.empty(len(STEPS))
    for i, step in enumerate(STEPS):
        moved = signal[part + step] - signal[part + step].mean()
        correlations[i] = (moved @ fixed) / max(np.sqrt((moved @ moved) * (fixed @ fixed)), 1e-9)
    best = int(np.argmax(correlations))
    if best in (0, len(STEPS) - 1) or correlations[best] < FOLLOWS:
        return None
    before, at, after = correlations[best - 1 : best + 2]
    return float((STEPS[best] + 0.5 * (before - after) / (before - 2.0 * at + after)) / RATE)
