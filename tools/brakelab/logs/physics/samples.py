"""Samples of a drive on a grid of their own, and the car that they are judged by.

Kept while a log is read: the mean of the valid samples of 20 ms, of the first hour.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.logs.physics.line import RATE, smooth
from ecu.contract.params import GRAVITY
from ecu.contract.signals import (
    ACCEL_X,
    ACCEL_Y,
    AMBIENT_TEMPERATURE,
    CALLIPER_PRESSURE,
    CORNERS,
    DISC_TEMPERATURE_MEASURED,
    INPUT_SIGNALS,
    MOTOR_TORQUE,
    RAIN,
    STEERING_ANGLE,
    VEHICLE_SPEED,
    WHEEL_SPEED,
    YAW_RATE,
)
from ecu.settings.config import torque_per_bar

SAMPLED: Final = (
    *range(WHEEL_SPEED, WHEEL_SPEED + 4),
    *(ACCEL_X, ACCEL_Y, YAW_RATE, STEERING_ANGLE, VEHICLE_SPEED),
    *range(CALLIPER_PRESSURE, CALLIPER_PRESSURE + 4),
    *range(MOTOR_TORQUE, MOTOR_TORQUE + 4),
)
"""Inputs whose samples are judged by the physics of the drive."""
KEPT: Final = (
    *SAMPLED,
    *(AMBIENT_TEMPERATURE, RAIN),
    *range(DISC_TEMPERATURE_MEASURED, DISC_TEMPERATURE_MEASURED + 4),
)
"""Inputs whose samples are kept beside the rows."""
CYCLES: Final = 2  # of 10 ms in a row of the grid
MOST_ROWS: Final = int(3600 * RATE)
BRIDGED: Final = int(0.5 * RATE)  # rows without a sample that a straight line may fill
FEWEST_SAMPLES: Final = 100

Rows = NDArray[np.bool_]


class Brakes(NamedTuple):
    """Brakes of a car that is known."""

    decel_per_bar: Vector
    """Of each calliper [m/s^2/bar], shape (4,)."""
    decel_per_torque: Vector
    """Of each wheel [m/s^2/(N m)], shape (4,)."""
    front_load: float
    """Share of the load that the front axle bears at rest."""
    transfer: float
    """Share that moves to it per deceleration [1/(m/s^2)]."""


class Car(NamedTuple):
    """Lengths of a car, and its brakes."""

    radius: Vector
    """m, shape (4,)."""
    track: float
    """m"""
    wheelbase: float
    """m"""
    brakes: Brakes | None
    """None: of any passenger car."""

    @property
    def known(self) -> bool:
        """Whether a configuration tells it."""
        return self.brakes is not None


ANY_CAR: Final = Car(np.full(4, 0.33), 1.55, 2.7, None)


def car_of(params: Any) -> Car:
    """Return the car of one `PARAMS`."""
    torque = torque_per_bar(params)
    radius = np.array(params["wheel_radius"])
    per_torque = 1.0 / radius / float(params["mass"])
    wheelbase = float(params["wheelbase"])
    front_load = float(params["rear_axle"]) / wheelbase
    transfer = float(params["cog_height"]) / wheelbase / GRAVITY
    brakes = Brakes(torque * per_torque, per_torque, front_load, transfer)
    return Car(radius, float(params["track"]), wheelbase, brakes)


class Collector:
    """Takes the samples of a log as they come."""

    def __init__(self) -> None:
        self._rows: list[NDArray[np.float32]] = []
        self._count = 0

    def add(self, samples: Vector) -> None:
        """Take samples of cycles, `SAMPLED` first, shape (n, …), NaN: none; an odd last one is left out."""
        if self._count >= MOST_ROWS:
            return
        judged = samples[: len(samples) // CYCLES * CYCLES, : len(SAMPLED)]
        pairs = judged.reshape(-1, CYCLES, len(SAMPLED))
        first, second = pairs[:, 0], pairs[:, 1]
        mean = 0.5 * (first + second)
        for alone, other in ((first, second), (second, first)):
            np.copyto(mean, alone, where=~np.isfinite(other))
        np.copyto(mean, np.nan, where=~np.isfinite(mean))
        self._rows.append(mean.astype(np.float32))
        self._count += len(mean)

    def series(self) -> "InputSeries":
        """Return the series of the collected samples."""
        rows = np.concatenate(self._rows) if self._rows else np.zeros((0, len(SAMPLED)), np.float32)
        return InputSeries(rows.astype(np.float64))


class InputSeries:
    """Series of a drive's inputs by name: smoothed on the grid, with the rows where they are known."""

    def __init__(self, samples: Vector) -> None:
        """Take rows of the grid, shape (n, len(SAMPLED))."""
        self._values: dict[str, Vector] = {}
        self._raw: dict[str, Vector] = {}
        self.known = np.ones(len(samples), np.bool_)
        """Rows where every input that there is has samples near, shape (n,)."""
        places = np.arange(len(samples))
        for column, place in enumerate(SAMPLED):
            there = np.flatnonzero(np.isfinite(samples[:, column]))
            if len(there) < FEWEST_SAMPLES:
                continue
            name = INPUT_SIGNALS[place].name
            if len(there) == len(samples):
                self._raw[name] = samples[:, column].copy()
                self._values[name] = smooth(self._raw[name])
                continue
            self._raw[name] = np.interp(places, there, samples[there, column])
            self._values[name] = smooth(self._raw[name])
            after = np.minimum(np.searchsorted(there, places), len(there) - 1)
            before = np.maximum(after - 1, 0)
            near = np.minimum(np.abs(there[after] - places), np.abs(places - there[before]))
            self.known &= near <= BRIDGED

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> Vector:
        return self._values[name]

    def raw(self, name: str) -> Vector:
        """Return an input on the grid as it came, not smoothed, shape (n,)."""
        return self._raw[name]

    def corners(self, stem: str) -> Vector | None:
        """Return the four of a wheel's quantity, shape (n, 4), column by column; None: not all are there."""
        names = [f"{stem}_{corner}" for corner in CORNERS]
        if not all(name in self for name in names):
            return None
        return np.stack([self[name] for name in names]).T
