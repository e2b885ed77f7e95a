"""Fusion of linear wear and wear mass, weighted by their variances (7.7–7.11).

Points (x_i, y_i): linear wear [mm] and mass [g] of each block; through the origin runs the line of slope K by
least squares (7.7). Each point moves onto it in the direction -alpha/K (7.9); the most likely position has
alpha = (sigma_y / sigma_x)^2: small where the balance is the more accurate, as on a dynamometer. The result
has the variance 1 / (1/sigma_y^2 + 1/(K sigma_x)^2), K's own beside it, which is the same for all points.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

BALANCE: Final = 0.03  # g, two weighings of two pads: balance and moisture
POINT: Final = 0.010  # mm, of one thickness at one point
POINTS: Final = 6
UNEVEN: Final = 0.25  # of the mass: by it six points may miss what wears unevenly
SURE: Final = 5.0  # standard deviations
FAR: Final = 4.0  # likewise, of a block that counts less
NORMAL: Final = 0.6745  # median of the magnitude of a normal deviate


class Fused(NamedTuple):
    """Wear of the blocks after blending."""

    mass: NDArray[np.float64]
    """g, shape (n,)."""
    covariance: NDArray[np.float64]
    """g^2, shape (n, n)."""
    slope: float
    """K, g/mm; NaN: no thickness was measured."""
    slope_error: float
    """Standard deviation of K, g/mm."""
    alpha: float


def disagreeing(wear: NDArray[np.float64], mass: NDArray[np.float64]) -> list[tuple[int, float]]:
    """Return the blocks of which balance and thickness cannot both be right, and the mass by thickness [g].

    `wear` [mm], NaN where not measured, and `mass` [g], shape (n,); three or more show what is usual.
    """
    known = np.flatnonzero(np.isfinite(wear))
    if len(known) < 3:
        return []
    usual = float(np.median(mass[known] / wear[known]))
    by_thickness = usual * wear
    noise = np.hypot(np.sqrt(2.0) * BALANCE, usual * POINT * np.sqrt(2.0 / POINTS))
    allowed = SURE * noise + UNEVEN * np.minimum(mass, by_thickness)
    return [(int(k), float(by_thickness[k])) for k in known if abs(mass[k] - by_thickness[k]) > allowed[k]]


def doubtful(wear: NDArray[np.float64], mass: NDArray[np.float64]) -> list[tuple[int, float]]:
    """Return the blocks of which balance and thickness differ by far more than in the others, as above.

    Beside what both are sure to counts how much they differ in most of the blocks, of which five are needed.
    """
    known = np.flatnonzero(np.isfinite(wear))
    if len(known) < 5:
        return []
    usual = float(np.median(mass[known] / wear[known]))
    off = (mass - usual * wear)[known]
    noise = float(np.hypot(np.sqrt(2.0) * BALANCE, usual * POINT * np.sqrt(2.0 / POINTS)))
    uneven = max(float(np.median(off**2)) / NORMAL**2 - noise**2, 0.0)
    share = mass[known] / float(np.median(mass[known]))
    allowed = FAR * np.sqrt(noise**2 + uneven * share**2)
    return [(int(k), usual * float(wear[k])) for k in known[np.abs(off) > allowed]]


def unequal(inboard: NDArray[np.float64], outboard: NDArray[np.float64]) -> list[tuple[int, float]]:
    """Return the blocks of which the pads share their wear unlike in the others, and the usual ratio.

    `inboard` and `outboard` [g], NaN where not weighed apart, shape (n,); three or more show what is usual.
    """
    known = np.flatnonzero(np.isfinite(inboard) & np.isfinite(outboard))
    if len(known) < 3:
        return []
    usual = float(np.median(inboard[known] / outboard[known]))
    allowed = SURE * BALANCE * np.hypot(1.0, usual) + UNEVEN * np.minimum(inboard, usual * outboard)
    return [(int(k), usual) for k in known if abs(inboard[k] - usual * outboard[k]) > allowed[k]]


def fuse(wear: NDArray[np.float64], mass: NDArray[np.float64]) -> Fused:
    """Return the blended masses of `wear` [mm], NaN where not measured, and `mass` [g], shape (n,)."""
    own = np.full(len(mass), 2.0 * BALANCE**2)
    known = np.isfinite(wear)
    if np.count_nonzero(known) < 2:
        return Fused(mass.copy(), np.diag(own), math.nan, math.nan, 0.0)
    x, y = wear[known], mass[known]
    slope = float(x @ y / (x @ x))
    sigma_x, sigma_y = POINT * np.sqrt(2.0 / POINTS), np.sqrt(2.0) * BALANCE
    alpha = (sigma_y / sigma_x) ** 2
    per_slope = alpha / slope
    fused, variance = mass.copy(), own.copy()
    fused[known] = slope * (y + per_slope * x) / (slope + per_slope)  # (7.11) on y = K x
    variance[known] = 1.0 / (1.0 / sigma_y**2 + 1.0 / (slope * sigma_x) ** 2)
    for place, by_thickness in doubtful(wear, mass):
        variance[place] += (mass[place] - by_thickness) ** 2  # one of the two is wrong
    share = np.zeros(len(mass))
    share[known] = x * per_slope / (slope + per_slope)  # d fused / d K, the direction held
    of_slope = (sigma_y**2 + (slope * sigma_x) ** 2) / float(x @ x)
    covariance = np.diag(variance) + of_slope * np.outer(share, share)
    return Fused(fused, covariance, slope, math.sqrt(of_slope), float(alpha))
