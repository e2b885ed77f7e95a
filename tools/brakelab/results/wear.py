"""Wear of one brake application, from its rows: the integrals of (7.16) and their mass.

The same integrals as `ecu/algorithm/monitoring/wear.py` keeps, by what results hold: the wheel turns at
v (1 + slip) / r, its slope is taken over 0.2 s to either side, and the temperature is in degC.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.results.prediction import Vector, corners
from ecu.algorithm.monitoring.wear import ENERGY, ENERGY_T, POWER2, POWER2_T, RATE, RATE_T
from ecu.contract.params import MEGA
from ecu.contract.records import RecordArray
from ecu.contract.signals import OUTPUT

PERIOD: Final = 0.01  # s, one row
HALF_WIDTH: Final = 20  # rows


class Wear(NamedTuple):
    """Of an application."""

    regressors: NDArray[np.float64]
    """Shape (7, 4), units of `REGRESSORS`."""
    mass: NDArray[np.float64]
    """Of both pads by the law, g; shape (4,)."""
    sigma: NDArray[np.float64]
    """g, shape (4,)."""


def regressors_of(
    torque: Vector, omega: Vector, temperature: Vector, period: float, half_width: int
) -> NDArray[np.float64]:
    """Return the integrals of (7.16), shape (7, ...), over the first axis of the arguments.

    `torque` [N m], `omega` [rad/s] and `temperature` [degC], shape (n, ...), every `period` [s]; the slope of
    `omega` is taken over `half_width` samples to either side.
    """
    places = np.arange(len(omega))
    after, before = np.minimum(places + half_width, len(omega) - 1), np.maximum(places - half_width, 0)
    shape = (-1, *([1] * (omega.ndim - 1)))
    seconds = period * np.maximum(after - before, 1).reshape(shape)
    power, rate = MEGA * torque * omega, MEGA * torque * np.abs(omega[after] - omega[before]) / seconds
    parts = (
        power,
        power * temperature,
        power * temperature**2,
        rate,
        rate * temperature,
        power**2,
        power**2 * temperature,
    )
    return np.array([period * part.sum(axis=0) for part in parts])


def wear_of(rows: Vector, params: RecordArray) -> Wear:
    """Return the wear of the application of `rows`, shape (n, N_ROW); NaN where it cannot be known."""
    p = params[0]
    speed = np.nan_to_num(rows[:, OUTPUT["vehicle_speed"]])
    omega = speed[:, None] * (1.0 + np.nan_to_num(corners(rows, "slip"))) / p["wheel_radius"]
    heat, sigma_heat = corners(rows, "disc_temperature"), corners(rows, "sigma_disc_temperature")
    x = regressors_of(corners(rows, "brake_torque"), omega, heat, PERIOD, HALF_WIDTH)
    law = p["wear_law"]
    mass = (law * x).sum(axis=0)
    friction = np.mean(corners(rows, "sigma_mu_b") / corners(rows, "mu_b"), axis=0)
    by_friction = friction * (mass + (law * x)[POWER2:].sum(axis=0))
    slope = law[ENERGY_T] * x[ENERGY] + 2.0 * law[ENERGY_T + 1] * x[ENERGY_T]
    slope += law[RATE_T] * x[RATE] + law[POWER2_T] * x[POWER2]
    by_heat = slope * np.mean(sigma_heat, axis=0)
    return Wear(x, mass, np.sqrt(by_friction**2 + by_heat**2 + (p["wear_sigma"] * mass) ** 2))
