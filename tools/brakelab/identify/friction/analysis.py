"""Describes the stops of a programme: principal components, shares of variance, the stop before.

Corrected: Table 3.2 calls the loadings of the first component relative weights, and its text reads them as
shares of variance. In a full factorial the inputs are not correlated, so a share is r^2, and the loadings
of standardised data are r_i / (R sqrt 2), R^2 the sum of all r^2 (eigenvalues 1 + R, 1, 1, 1 - R).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Matrix, Vector
from brakelab.identify.friction.fit import quantile
from brakelab.identify.friction.stops import Stops

LEVEL_GAPS = (0.4, 2.5e5, 6.0)
"""Initial speeds (sliding, m/s), pressures (Pa), initial temperatures (K) this far apart are two levels."""


class Components(NamedTuple):
    """Of initial speed, pressure, initial temperature, mean friction, in this order."""

    loadings: Matrix  # (4, 3), of the first three components; the first with a positive friction
    shares: Vector  # (4,), of the variance of all four, falling
    first_three: float
    correlation: Vector  # (3,), with mean friction
    linear: float  # share of friction's variance that straight lines explain
    any_form: Vector  # (3,), share that the mean at each level explains (eta squared)
    overlap: float  # largest correlation between two inputs: 0 in a full factorial
    together: float  # share that the levels of all three explain, without interactions


class History(NamedTuple):
    """Of the stop before."""

    slope: float  # relative friction per 100 K that the stop before ended hotter
    half: float  # of its interval of 95 %
    explained: float  # share of the residual variance of a second-order surface


def inputs_of(stops: Stops) -> Matrix:
    """Return initial sliding speed [m/s], pressure [Pa] and initial temperature [degC], shape (stops, 3)."""
    return np.stack([stops.start_speed, stops.held_pressure, stops.start_temperature], axis=1)


def levels(inputs: Matrix) -> NDArray[np.int64]:
    """Return the number of the level of each input, shape as `inputs`, counted from the least."""
    out = np.empty(inputs.shape, np.int64)
    for place, gap in enumerate(LEVEL_GAPS):
        order = np.argsort(inputs[:, place], kind="stable")
        steps = np.diff(inputs[order, place], prepend=inputs[order[0], place]) > gap
        out[order, place] = np.cumsum(steps)
    return out


def principal_components(stops: Stops) -> Components:
    """Return the components of the correlation matrix of inputs and mean friction (B.3)."""
    data = np.column_stack([inputs_of(stops), stops.mean])
    correlations = np.corrcoef(data.T)
    values, vectors = np.linalg.eigh(correlations)
    order = np.argsort(values)[::-1]
    values, vectors = values[order], vectors[:, order]
    for place in range(4):
        strongest = 3 if place == 0 else int(np.argmax(np.abs(vectors[:, place])))
        vectors[:, place] *= np.sign(vectors[strongest, place])
    shares = values / values.sum()
    with_friction = correlations[3, :3]
    inverse = np.linalg.inv(correlations[:3, :3])
    of_levels = [level[:, None] == np.unique(level) for level in levels(inputs_of(stops)).T]
    any_form = np.array([_explained(stops.mean, columns) for columns in of_levels])
    return Components(
        vectors[:, :3],
        shares,
        float(shares[:3].sum()),
        with_friction,
        float(with_friction @ inverse @ with_friction),
        any_form,
        float(np.abs(correlations[:3, :3] - np.eye(3)).max()),
        _explained(stops.mean, np.hstack(of_levels)),
    )


def _explained(values: Vector, columns: NDArray[np.bool_]) -> float:
    """Return the share of the variance of `values` that a sum over `columns`, shape (n, levels), explains."""
    terms = columns.astype(np.float64)
    fitted = terms @ np.linalg.lstsq(terms, values)[0]
    return float(np.var(fitted) / np.var(values))


def second_order(inputs: Matrix) -> Matrix:
    """Return the terms of a second-order surface over the columns of `inputs`, standardised; first is 1."""
    scaled = (inputs - inputs.mean(axis=0)) / np.maximum(inputs.std(axis=0), 1e-12)
    columns = [np.ones(len(scaled)), *scaled.T]
    count = scaled.shape[1]
    columns += [scaled[:, i] * scaled[:, j] for i in range(count) for j in range(i, count)]
    return np.stack(columns, axis=1)


def history_effect(stops: Stops) -> History:
    """Return the effect of the previous stop's end temperature on mean friction, inputs accounted for.

    NaN where the stops are too few for it.
    """
    ends = np.array([stops.temperature[end - 1] for end in stops.first[1:]])
    terms = second_order(inputs_of(stops))[1:]
    before = ends[:-1] / 100.0
    relative = stops.mean[1:] / stops.mean.mean()
    base, _, _, _ = np.linalg.lstsq(terms, relative, rcond=None)
    whole = np.column_stack([terms, before - before.mean()])
    found, _, _, _ = np.linalg.lstsq(whole, relative, rcond=None)
    left, left_base = relative - whole @ found, relative - terms @ base
    free = len(relative) - whole.shape[1]
    if free < 1:
        return History(math.nan, math.nan, math.nan)
    variance = float(left @ left) / free * np.linalg.pinv(whole.T @ whole)[-1, -1]
    explained = 1.0 - float(left @ left) / float(left_base @ left_base)
    return History(float(found[-1]), float(np.sqrt(variance)) * quantile(free), explained)
