"""Instrumented Gauss-Newton fit with priors: parameters, and covariance robust to correlated errors.

Residuals r(theta) have two versions, by the even and by the odd samples of every signal, whose noise is
independent. With Jacobians J_0, J_1 of the two, weights W and priors N(m, P), a step solves

    [ (J_0' W J_1 + J_1' W J_0) / 2 + P^-1 ] d = -(J_1' W r_0 + J_0' W r_1) / 2 - P^-1 (theta - m)

Each Jacobian is an instrument for the other: E[J_1' n_0] = 0 although both regressors are noisy, so slopes
are not attenuated as those of least squares are. Weights: residuals beyond three robust standard deviations
of their kind count less (Huber); a kind whose residuals are correlated within a manoeuvre counts as fewer
(its design effect). The covariance is the sandwich over manoeuvres, plus what the priors leave. A manoeuvre
that shows much of a parameter pulls it towards its own errors, so that its residuals are too small: its score
is taken as it would be had the manoeuvre not been in the fit (the jackknife's correction, CR3),

    s_g -> (1 - A_g M^-1)^-1 s_g          A_g = J_g' W J_g, M: the matrix above

and few manoeuvres do not make sigma too small.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector

Places = NDArray[np.int64]

HUBER: Final = 3.0  # robust standard deviations
STEPS: Final = 25
PASSES: Final = 4  # of scales and weights
SMALL: Final = 1e-5  # of a prior's sigma, for derivatives
DONE: Final = 1e-4  # of a prior's sigma, a step that ends the search
SINGULAR: Final = 1e-12
FEWEST_RESIDUALS: Final = 8  # residuals of a kind that set its scale


class Residuals(NamedTuple):
    """What is to be explained."""

    of: Callable[[Vector, int], Vector]
    """Residuals for parameters and a half of the samples (0 or 1), shape (m,)."""
    kind: Places
    """Residuals of a kind share one scale, shape (m,)."""
    cluster: Places
    """Manoeuvre that a residual belongs to, shape (m,)."""
    least: Vector
    """Standard deviation by the noise of sensors alone, shape (m,)."""


class Prior(NamedTuple):
    """What is assumed before the drive; a sigma of 0 holds a parameter."""

    mean: Vector
    sigma: Vector


class Fit(NamedTuple):
    """What was found."""

    theta: Vector
    covariance: Vector
    scale: Vector
    """Standard deviation of the residuals of each kind."""
    residuals: Vector
    """By all samples, shape (m,)."""
    weight: Vector
    """Of Huber, shape (m,)."""

    @property
    def sigma(self) -> Vector:
        """Standard deviations of the parameters."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def _jacobian(residuals: Residuals, theta: Vector, half: int, free: Places, steps: Vector) -> Vector:
    columns = []
    for place in free:
        moved = np.zeros_like(theta)
        moved[place] = steps[place]
        columns.append(residuals.of(theta + moved, half) - residuals.of(theta - moved, half))
    return np.stack(columns, axis=1) / (2.0 * steps[free])


def _solve(residuals: Residuals, theta: Vector, weight: Vector, prior: Prior, free: Places) -> Vector:
    precision = 1.0 / prior.sigma[free] ** 2
    for _ in range(STEPS):
        r = [residuals.of(theta, half) for half in range(2)]
        j = [_jacobian(residuals, theta, half, free, SMALL * prior.sigma) for half in range(2)]
        cross = j[0].T @ (weight[:, None] * j[1])
        matrix = 0.5 * (cross + cross.T) + np.diag(precision)
        slope = 0.5 * (j[1].T @ (weight * r[0]) + j[0].T @ (weight * r[1]))
        slope += precision * (theta[free] - prior.mean[free])
        step = -_inverse(matrix) @ slope
        size = float(np.max(np.abs(step) / prior.sigma[free]))
        theta = theta.copy()
        theta[free] += step * min(1.0, 2.0 / max(size, 1e-12))
        if size < DONE:
            break
    return theta


def _inverse(matrix: Vector) -> Vector:
    """Return the inverse; directions that noise has made negative are left where they are."""
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-30))
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    inverse = np.where(values > SINGULAR, 1.0 / np.maximum(values, SINGULAR), 0.0)
    return np.asarray((vectors * inverse) @ vectors.T * np.outer(scale, scale))


def _scales(residuals: Residuals, r: Vector) -> tuple[Vector, Vector]:
    """Return scale and design effect of each kind."""
    kinds = int(residuals.kind.max()) + 1
    scale, effect = np.ones(kinds), np.ones(kinds)
    for kind in range(kinds):
        rows = residuals.kind == kind
        if not rows.any():
            continue
        least = float(np.sqrt(np.mean(residuals.least[rows] ** 2)))
        spread = 1.4826 * float(np.median(np.abs(r[rows]))) if rows.sum() >= FEWEST_RESIDUALS else 0.0
        scale[kind] = max(spread, least)
        clipped = np.clip(r[rows] / scale[kind], -HUBER, HUBER)
        sums = np.bincount(residuals.cluster[rows], clipped)
        effect[kind] = max(float((sums**2).sum()) / len(clipped), 1.0)
    return scale, effect


def fit(residuals: Residuals, prior: Prior, start: Vector | None = None) -> Fit:
    """Return the parameters, from `start` on (None: the prior's mean)."""
    theta = (prior.mean if start is None else start).copy()
    free = np.flatnonzero(prior.sigma > 0.0)
    weight = 1.0 / residuals.least**2
    scale, effect, huber = np.ones(1), np.ones(1), np.ones_like(weight)
    for _ in range(PASSES):
        r = 0.5 * (residuals.of(theta, 0) + residuals.of(theta, 1))
        scale, effect = _scales(residuals, r)
        relative = np.abs(r) / scale[residuals.kind]
        huber = np.minimum(1.0, HUBER / np.maximum(relative, 1e-12))
        weight = huber / (scale**2 * effect)[residuals.kind]
        theta = _solve(residuals, theta, weight, prior, free)
    return _found(residuals, theta, weight, huber, prior, free)


def _left_out(cluster: Places, scores: Vector, j: list[Vector], weight: Vector, inverse: Vector) -> Vector:
    """Return the scores of the manoeuvres, shape (k, n), each by parameters fitted without it."""
    outer = np.empty_like(scores)
    for number, score in enumerate(scores):
        rows = cluster == number
        own = j[0][rows].T @ (weight[rows, None] * j[1][rows])
        outer[number] = np.linalg.solve(np.eye(len(score)) - 0.5 * (own + own.T) @ inverse, score)
    return outer


def _found(
    residuals: Residuals, theta: Vector, weight: Vector, huber: Vector, prior: Prior, free: Places
) -> Fit:
    r = [residuals.of(theta, half) for half in range(2)]
    mean = 0.5 * (r[0] + r[1])
    scale, _ = _scales(residuals, mean)
    j = [_jacobian(residuals, theta, half, free, SMALL * prior.sigma) for half in range(2)]
    cross = j[0].T @ (weight[:, None] * j[1])
    inverse = _inverse(0.5 * (cross + cross.T) + np.diag(1.0 / prior.sigma[free] ** 2))
    each = 0.5 * (j[1] * (weight * r[0])[:, None] + j[0] * (weight * r[1])[:, None])
    sums = [np.asarray(np.bincount(residuals.cluster, column), np.float64) for column in each.T]
    scores = np.stack(sums, axis=1)
    there = int(np.count_nonzero(np.bincount(residuals.cluster)))
    alone = _left_out(residuals.cluster, scores, j, weight, inverse)
    meat = alone.T @ alone * (there - 1) / there
    model = 0.5 * (cross + cross.T)
    # Few manoeuvres understate their own scatter: never less than what the weights themselves say.
    sandwich = inverse @ (meat + np.diag(1.0 / prior.sigma[free] ** 2)) @ inverse
    usual = inverse @ (model + np.diag(1.0 / prior.sigma[free] ** 2)) @ inverse
    widen = np.sqrt(np.maximum(np.diag(usual) / np.maximum(np.diag(sandwich), 1e-300), 1.0))
    covariance = np.zeros((len(theta), len(theta)))
    covariance[np.ix_(free, free)] = sandwich * np.outer(widen, widen)
    return Fit(theta, covariance, scale, mean, huber)
