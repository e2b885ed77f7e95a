"""Whether the brakes that drives identify predict other brake applications better than START's do.

The applications are dealt out to `FOLDS` folds; parameters that are fitted without a fold predict its
applications. The error of one is the mean residual of its balance of forces. START's parameters stand beside
the same kinematics: dive, zero of the accelerometer.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.identify.vehicle.fit import Prior, Residuals, fit
from brakelab.identify.vehicle.parameters import Parameter

FOLDS: Final = 5
FEWEST_APPLICATIONS: Final = 5
"""Applications below which it stays open which of the two is better."""
BRAKING: Final = 1
"""Kind of the residuals that are the balance of a braked car."""
BRAKES: Final = tuple(
    f"{axle}.{key}" for axle in ("front", "rear") for key in ("mu_nominal", "push_out_pressure")
)
"""Keys that are left at START's value where it is better."""


class CrossCheck(NamedTuple):
    """Errors of the brake applications [m/s^2], means of the magnitude; NaN where there are none."""

    applications: int
    fitted: float
    """Each by what the others of them identify."""
    start: float

    @property
    def worse(self) -> bool:
        """Return whether START's brakes are the better ones: without an application nothing shows others."""
        if not self.applications:
            return True
        return self.applications >= FEWEST_APPLICATIONS and self.start < self.fitted

    @property
    def line(self) -> str:
        """Return what is to be said of the brakes."""
        if not self.applications:
            return "no steady brake application on a straight road: START's brakes are kept"
        count = f"{self.applications} brake application" + "s" * (self.applications > 1)
        errors = (
            f"predicted from the others to {self.fitted:.2g} m/s^2, by START's brakes to {self.start:.2g}"
        )
        if self.applications < FEWEST_APPLICATIONS:
            verdict = f"fewer than {FEWEST_APPLICATIONS} cannot tell whose brakes are better"
        else:
            verdict = "START's brakes are kept" if self.worse else "the brakes that were found are better"
        return f"{count}, {errors}: {verdict}"


def _without(residuals: Residuals, rows: NDArray[np.bool_]) -> Residuals:
    def of(theta: Vector, half: int) -> Vector:
        return residuals.of(theta, half)[~rows]

    return Residuals(of, residuals.kind[~rows], residuals.cluster[~rows], residuals.least[~rows])


def cross_check(residuals: Residuals, prior: Prior, theta: Vector) -> CrossCheck:
    """Return how well applications are predicted; `theta`: of all of them, from where the fits begin."""
    braked = residuals.kind == BRAKING
    applications = np.unique(residuals.cluster[braked])
    errors = np.full((2, len(applications)), np.nan)
    for fold in range(min(FOLDS, len(applications))):
        own = applications[fold::FOLDS]
        left_out = np.isin(residuals.cluster, own)
        found = prior.mean if left_out.all() else fit(_without(residuals, left_out), prior, theta).theta
        for by, state in enumerate((found, prior.mean)):
            balance = 0.5 * (residuals.of(state, 0) + residuals.of(state, 1))
            errors[by, fold::FOLDS] = [balance[braked & (residuals.cluster == one)].mean() for one in own]
    fitted, start = np.abs(errors).mean(axis=1) if len(applications) else (np.nan, np.nan)
    return CrossCheck(len(applications), float(fitted), float(start))


def keep_start(parameters: Sequence[Parameter], check: CrossCheck) -> list[Parameter]:
    """Return the parameters with START's brakes where these predict better."""
    if not check.worse:
        return list(parameters)
    remedy = "a drive whose brake applications predict each other better than START's value does"
    return [
        one._replace(value=one.start, remedy=remedy) if one.key in BRAKES and not one.remedy else one
        for one in parameters
    ]
