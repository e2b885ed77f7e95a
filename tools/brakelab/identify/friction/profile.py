"""Profile likelihood: how much worse the fit becomes when one number is held and all others follow.

Where a profile stays flat the data do not identify the number, whatever its interval from slopes says. The
height is scaled as `fitting.clustered` has it: a quadratic cost gives the same interval as the slopes.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import brentq, least_squares

from brakelab.arrays import Vector
from brakelab.identify.friction.fit import STEP, Fitted, residual_function, slopes_at
from brakelab.identify.friction.stops import Stops
from brakelab.plant.friction.law import RigBrake

REACH: Final = 4.0  # half intervals in which a profile's end is sought
EVALUATIONS: Final = 12


class Interval(NamedTuple):
    """Of one number; infinite where the profile stays below the height of 95 %."""

    name: str
    low: float
    high: float


class Profile(NamedTuple):
    """Of one number."""

    name: str
    values: Vector  # (points,), of the number
    rise: Vector  # (points,), of the cost, the others following; 1 is the height of 95 %


def profile_interval(fitted: Fitted, brake: RigBrake, stops: Stops, place: int) -> Interval:
    """Return the interval of 95 % of the number at `place`."""
    free, best = fitted.candidate.free[place], float(fitted.shares[place])
    rise, half = _rise_of(fitted, brake, stops, place)

    def end(sign: float) -> float:
        edge = float(np.clip(best + sign * REACH * half, 0.0, 1.0))
        if rise(edge) < 1.0:
            return sign * np.inf
        found, _ = brentq(
            lambda share: rise(share) - 1.0,
            best,
            edge,
            xtol=0.01 * half,
            maxiter=20,
            full_output=True,
            disp=False,
        )
        return free.value(float(found))

    return Interval(free.name, end(-1.0), end(1.0))


def profile_over(fitted: Fitted, brake: RigBrake, stops: Stops, place: int, points: int) -> Profile:
    """Return the profile of the number at `place`, two half intervals to both sides."""
    free = fitted.candidate.free[place]
    rise, half = _rise_of(fitted, brake, stops, place)
    shares = np.clip(fitted.shares[place] + half * np.linspace(-2.0, 2.0, points), 0.0, 1.0)
    return Profile(
        free.name, np.array([free.value(s) for s in shares]), np.array([rise(float(s)) for s in shares])
    )


def _rise_of(
    fitted: Fitted, brake: RigBrake, stops: Stops, place: int
) -> tuple[Callable[[float], float], float]:
    """Return the rise of the cost over the share of the number at `place`, and half its interval."""
    free = fitted.candidate.free[place]
    best = fitted.shares
    residuals = residual_function(fitted.candidate, brake, stops)
    least = float(np.sum(residuals(best) ** 2))
    half = max(float(fitted.half[place]) / max(abs(free.slope(best[place])), 1e-300), 1e-6)
    slopes = slopes_at(residuals, best)
    bread = np.linalg.pinv(slopes.T @ slopes, rcond=1e-12, hermitian=True)
    # What a quadratic cost, its other numbers following, rises by at the end of the interval of slopes.
    height = half**2 / max(float(bread[place, place]), 1e-300)
    follows = bread[:, place] / max(float(bread[place, place]), 1e-300)
    others = np.arange(len(best)) != place

    def rise(share: float) -> float:
        whole = best + (share - best[place]) * follows
        whole[place] = share

        def held(rest: Vector) -> Vector:
            whole[others] = rest
            return residuals(whole)

        start = np.clip(whole[others], 1e-6, 1.0 - 1e-6)
        if not len(start):
            return (float(np.sum(residuals(whole) ** 2)) - least) / height
        found = least_squares(held, start, bounds=(0.0, 1.0), diff_step=STEP, max_nfev=EVALUATIONS)
        return (2.0 * float(found.cost) - least) / height

    return rise, half
