"""The cost that identification makes small, over two numbers of a law, and how searches go down it (C.1).

The other numbers stay at their best. Both searches of Figure C.1 start at one corner: least squares by the
slopes of residuals, and the simplex of Nelder and Mead. A surface is convex where the matrix of second
differences has no negative eigenvalue; one that is not can still have one valley.
"""

from collections.abc import Callable
from itertools import product
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares, minimize

from brakelab.arrays import Matrix, Vector
from brakelab.identify.friction.fit import PART, STEP, Fitted, residual_function
from brakelab.identify.friction.stops import Stops, some
from brakelab.plant.friction.law import RigBrake

Scalar = Callable[[Vector], float]

POINTS: Final = 25
STARTS: Final = 4  # along each axis of the map, of searches that look for other valleys
APART: Final = 0.01  # in shares: ends further apart are two valleys
NEGATIVE: Final = -1e-3  # of the greatest second difference, that still counts as none


class Path(NamedTuple):
    """A search, in shares of the bounds."""

    points: Matrix  # (steps, 2), each better than the one before
    evaluations: int
    cost: float  # nRMSE [%] at its end


class Cost(NamedTuple):
    """Over two numbers, shares of their bounds."""

    names: tuple[str, str]
    x: Vector  # (POINTS,), shares of the first
    y: Vector
    best: tuple[float, float]
    nrmse: Matrix  # (POINTS of y, POINTS of x) [%]
    least_squares: Path
    simplex: Path
    valleys: int  # distinct ends of least squares from all over the map
    convex: float  # share of the grid


def cost_over(
    fitted: Fitted, brake: RigBrake, stops: Stops, places: tuple[int, int], reach: tuple[float, float]
) -> Cost:
    """Return the cost over the numbers at `places`, `reach` (in shares) to both sides of the best."""
    if len(stops) > PART:
        stops = some(stops, np.linspace(0, len(stops) - 1, PART).astype(np.int64))
    residuals = residual_function(fitted.candidate, brake, stops)
    mean = float(stops.mu.mean())
    chosen = list(places)

    def left(pair: Vector) -> Vector:
        whole = fitted.shares.copy()
        whole[chosen] = pair
        return residuals(whole)

    def nrmse(pair: Vector) -> float:
        return 100.0 * float(np.sqrt(np.mean(left(pair) ** 2))) / mean

    best = fitted.shares[chosen]
    low, high = np.clip(best - reach, 0.0, 1.0), np.clip(best + reach, 0.0, 1.0)
    x, y = (np.linspace(a, b, POINTS) for a, b in zip(low, high, strict=True))
    grid = np.array([[nrmse(np.array([a, b])) for a in x] for b in y])
    start = low + 0.9 * (high - low)
    starts = list(product(*(np.linspace(a, b, STARTS + 2)[1:-1] for a, b in zip(low, high, strict=True))))
    names = tuple(fitted.candidate.free[place].name for place in places)
    return Cost(
        (names[0], names[1]),
        x,
        y,
        (float(best[0]), float(best[1])),
        grid,
        _by_slopes(left, nrmse, start),
        _by_simplex(nrmse, start),
        distinct(np.array([_by_slopes(left, nrmse, np.array(pair)).points[-1] for pair in starts])),
        convex_share(grid**2),
    )


class _Watched:
    """A cost that notes every point better than all before it."""

    def __init__(self, cost: Scalar) -> None:
        self.cost, self.count, self.points = cost, 0, list[Vector]()
        self.least = np.inf

    def note(self, pair: Vector) -> float:
        self.count += 1
        value = self.cost(pair)
        if value < self.least:
            self.least = value
            self.points.append(np.array(pair))
        return value

    def path(self) -> Path:
        return Path(np.array(self.points), self.count, self.least)


def _by_slopes(left: Callable[[Vector], Vector], nrmse: Scalar, start: Vector) -> Path:
    watched = _Watched(nrmse)

    def noted(pair: Vector) -> Vector:
        watched.note(pair)
        return left(pair)

    least_squares(noted, start, bounds=(0.0, 1.0), diff_step=STEP)
    return watched.path()


def _by_simplex(nrmse: Scalar, start: Vector) -> Path:
    watched = _Watched(nrmse)
    minimize(watched.note, start, method="Nelder-Mead", bounds=[(0.0, 1.0)] * 2, options={"xatol": STEP})
    return watched.path()


def distinct(ends: Matrix) -> int:
    """Return how many of the points `ends`, shape (n, 2), lie apart from all before them."""
    found: list[Vector] = []
    for end in ends:
        if all(float(np.max(np.abs(end - known))) > APART for known in found):
            found.append(end)
    return len(found)


def convex_share(grid: Matrix) -> float:
    """Return the share of a surface where its second differences have no negative eigenvalue."""
    xx = grid[1:-1, 2:] - 2.0 * grid[1:-1, 1:-1] + grid[1:-1, :-2]
    yy = grid[2:, 1:-1] - 2.0 * grid[1:-1, 1:-1] + grid[:-2, 1:-1]
    xy = 0.25 * (grid[2:, 2:] - grid[2:, :-2] - grid[:-2, 2:] + grid[:-2, :-2])
    least = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    scale = float(np.max(np.abs(xx) + np.abs(yy)))
    return float(np.mean(least >= NEGATIVE * scale))
