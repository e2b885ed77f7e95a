"""Brakings of a logged drive, and what the configured car expects of their pressures.

    reading / (1 + g pitch_gradient) = -(lining + rest)
    lining = sum_i 2 A_i r_i mu_i (p_i - p_0) / R_i / m_e
    rest = (drag + rolling + sum_i T_motor / R_i) / m_e

What an engine reports as its torque is left out of what the configured car expects: its controller guesses
it.

A braking is the time from where the front pressures are 1 bar above their zero for 0.1 s to where they are
below for 0.1 s. The force balance can judge its rows above 5 m/s and below 0.4 g across, from 0.25 s after
its start: before, callipers and accelerometer lag behind the pressure, each by its own time, and where little
more than a second is straight that alone takes 4 to 8 % from the mean.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .config import Nominal
from .logger import CORNERS
from .route import G, Values

PERIOD = 0.01  # s, of a row
HELD = 0.7  # s over which samples are joined
FEWEST_ROWS = 30  # rows to judge
ONSET = 25  # rows in which force and reading follow the pressure


class Signals(NamedTuple):
    """Logged signals every 10 ms; NaN where the logger was silent."""

    t: Values
    speed: Values  # m/s
    decel: Values  # m/s^2 measured, pitch removed
    across: Values  # m/s^2
    pressure: Values  # bar above its zero, shape (rows, 4)
    zero: Values  # bar, shape (4,)
    motor: Values  # N m reported, shape (rows, 4)


class Braking(NamedTuple):
    """A brake application that can be judged."""

    start: int  # row
    end: int
    rows: NDArray[np.int64]  # of it, that a force balance can judge
    measured: float  # m/s^2, mean over them
    lining: Values  # m/s^2 expected of the configured linings, every row of them
    rest: float  # m/s^2 expected of drag, rolling and reported motors, mean


def _every_row(columns: dict[str, Values], name: str, t: Values) -> Values:
    if name not in columns:
        return np.full(len(t), np.nan)
    there = ~np.isnan(columns[name])
    stamps, values = columns["t"][there], columns[name][there]
    joined = np.interp(t, stamps, values)
    after = np.clip(np.searchsorted(stamps, t), 1, len(stamps) - 1)
    joined[stamps[after] - stamps[after - 1] > HELD] = np.nan
    return joined


def read(columns: dict[str, Values], nominal: Nominal) -> Signals:
    """Return the signals of `logger.record` on rows of 10 ms from the first stamp."""
    first, last = columns["t"][0], columns["t"][-1]
    t = first + PERIOD * np.arange(round((last - first) / PERIOD))
    wheels = (
        np.array([_every_row(columns, f"wheel_speed_{corner}", t) for corner in CORNERS]).T * nominal.radius
    )
    speed = _every_row(columns, "vehicle_speed", t)
    speed = np.sort(wheels, axis=1)[:, 2] if np.all(np.isnan(speed)) else speed  # two may slide, one jump
    pressure = np.array([_every_row(columns, f"calliper_pressure_{corner}", t) for corner in CORNERS]).T
    drives = _every_row(columns, "accelerator_position", t) > 20.0
    zero = np.nanmedian(pressure[drives], axis=0)
    motor = np.array([_every_row(columns, f"motor_torque_{corner}", t) for corner in CORNERS]).T
    decel = -_every_row(columns, "accel_x", t) / (1.0 + G * nominal.pitch_gradient)
    return Signals(
        t, speed, decel, _every_row(columns, "accel_y", t), pressure - zero, zero, np.nan_to_num(motor)
    )


def lining_decel(
    signals: Signals, rows: NDArray[np.int64], nominal: Nominal, mu: Values, mass: float
) -> Values:
    """Return the deceleration [m/s^2] by linings of friction mu, shape (4,), in a car of this mass [kg]."""
    pressure = np.maximum(signals.pressure[rows] - nominal.push_out_pressure, 0.0)
    return pressure @ (nominal.gain * mu / nominal.radius) / (mass + nominal.inertia)


def rest_decel(signals: Signals, rows: NDArray[np.int64], nominal: Nominal, mass: float) -> float:
    """Return the mean deceleration [m/s^2] by drag, rolling and reported motors."""
    force = nominal.resistance(signals.speed[rows], mass) + signals.motor[rows] @ (1.0 / nominal.radius)
    return float(np.mean(force)) / (mass + nominal.inertia)


def find(signals: Signals, nominal: Nominal) -> list[Braking]:
    """Return the brakings of which a force balance can judge at least 0.3 s."""
    pressed = signals.pressure[:, :2].mean(axis=1) > 1.0
    count = round(0.1 / PERIOD)
    window = np.convolve(pressed, np.ones(count), "full")[: len(pressed)]
    active, since = np.zeros(len(pressed), bool), False
    for row in range(len(pressed)):
        since = window[row] == count if not since else window[row] > 0
        active[row] = since
    edges = np.diff(active.astype(int), prepend=0, append=0)
    brakings = []
    for found, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        start = found - count + 1
        end -= count - 1
        rows = np.arange(start + ONSET, end)
        fit = (signals.speed[rows] > 5.0) & (np.abs(signals.across[rows]) < 0.4 * G)
        rows = rows[fit & ~np.isnan(signals.decel[rows]) & ~np.isnan(signals.pressure[rows]).any(axis=1)]
        if len(rows) < FEWEST_ROWS:
            continue
        lining = lining_decel(signals, rows, nominal, np.repeat(nominal.mu_nominal, 2), nominal.mass)
        known = signals if nominal.electric else signals._replace(motor=np.zeros_like(signals.motor))
        rest = rest_decel(known, rows, nominal, nominal.mass)
        brakings.append(Braking(start, end, rows, float(np.mean(signals.decel[rows])), lining, rest))
    return brakings
