"""Left against right wheels in curves: track, zero of the yaw rate, radii of a pair, deflection under load.

    r (omega_l - omega_r) = -b (psi' - z) - d r omega - 2 (lambda - chi s) r omega a_y      a_y = v (psi' - z)

of an axle whose wheels have the radii r (1 +- d / 2) (left: plus) and r (1 +- lambda a_y): the outer tyre
is pressed flat. s is the slip of the axle's drive, which changes with the load by chi a_y (START's height
and track are good enough for that). lambda of both axles together is the share by which radii change with
all of the transferred load, so braking presses the front tyres flat by (lambda_f + lambda_r) b / (2 L) for
each m/s^2.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.vehicle.fit import Fit, Prior, Residuals, fit
from brakelab.identify.vehicle.model import select
from brakelab.identify.vehicle.windows import Windows
from ecu.contract.params import GRAVITY

CURVES: Final = 0.02  # rad/s, standard deviation of a yaw rate that shows the wheels' differences
FEWEST_WINDOWS: Final = 20  # windows
LARGEST_LATERAL: Final = 4.0  # m/s^2 across


class Pairs(NamedTuple):
    """What left and right wheels show; without curves the prior."""

    track: tuple[float, float]
    """m, and its standard deviation; likewise the others."""
    yaw_zero: tuple[float, float]
    """rad/s"""
    difference: tuple[tuple[float, float], tuple[float, float]]
    """Radius left over right, less 1, of front and rear."""
    deflection: tuple[float, float]
    """Relative change of a front radius by longitudinal acceleration [s^2/m]."""
    windows: int


def pairs_of(
    windows: Windows, radius: Vector, slip: Vector, yaw: tuple[float, float] | None, params: Any
) -> Pairs | None:
    """Return the differences of wheels of `radius` [m], shape (2,), by `slip`, shape (2, n); None: no curves.

    `yaw`: zero of the yaw rate by a standstill [rad/s], and its standard deviation.
    """
    rate = windows.yaw_rate.mean(axis=0)
    speed = windows.omega.mean(axis=(0, 1)) * float(radius.mean())
    rows = np.flatnonzero(windows.free & np.isfinite(rate) & (np.abs(rate) * speed < LARGEST_LATERAL))
    if len(rows) < FEWEST_WINDOWS or float(np.std(rate[rows])) < CURVES:
        return None
    own, driven = select(windows, rows), slip[:, rows]
    shift = 2.0 * float(params["cog_height"]) / (GRAVITY * float(params["track"]))

    def of(theta: Vector, half: int) -> Vector:
        track, zero = theta[:2]
        turn = own.yaw_rate[half] - zero
        pairs = own.omega[:, half].reshape(2, 2, -1)
        along = radius[:, None] * pairs.mean(axis=1)
        across = turn * along.mean(axis=0)
        left = radius[:, None] * (pairs[:, 0] - pairs[:, 1])
        left = (
            left
            + track * turn
            + along * (theta[2:4, None] + 2.0 * (theta[4:6, None] - shift * driven) * across)
        )
        return np.asarray(left.reshape(-1))

    n = len(rows)
    zero, sure = yaw or (0.0, 0.02)
    mean = np.array([float(params["track"]), zero, 0.0, 0.0, 0.0005, 0.0005])
    prior = Prior(mean, np.array([0.4, sure, 0.02, 0.02, 0.002, 0.002]))
    found = fit(Residuals(of, np.repeat([0, 1], n), np.tile(own.cluster, 2), np.full(2 * n, 0.003)), prior)
    return _read(found, params, n)


def _read(found: Fit, params: Any, count: int) -> Pairs:
    value, sigma = found.theta, found.sigma
    half_base = 0.5 / float(params["wheelbase"])
    both = float(value[4] + value[5])
    variance = float(np.array([1.0, 1.0]) @ found.covariance[4:6, 4:6] @ np.array([1.0, 1.0]))
    lever = float(value[0]) * half_base

    def with_sigma(place: int) -> tuple[float, float]:
        return float(value[place]), float(sigma[place])

    return Pairs(
        with_sigma(0),
        with_sigma(1),
        (with_sigma(2), with_sigma(3)),
        (both * lever, float(np.sqrt(variance)) * lever),
        count,
    )
