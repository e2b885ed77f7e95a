"""Choice of an emission model and its error, by trips not used in its fit.

Every trip but the tests is left out once; the others fit the model, which then predicts it (the left-out
predictions, for applications within the range of the others). From these follow

    factor       sum of particles over sum of 10^EF: a model of the logarithm gives the median, not the mean,
                 and sums of medians are too small (Table 8.2 has all of its models low)
    interval     95 % of EF by conformal calibration: quantiles of measured minus left-out, with the finite
                 sample's correction (n + 1) / n
    choice       the least root mean square error of the square root of left-out particles: between EF, which
                 counts the cleanest application like the dirtiest, and the sum, which few applications make

KPIs are those of Table 8.3. The cumulated error has the sign of Table 8.2, too few is negative; the
definition that Table 8.3 prints has the other.
"""

import time
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Array
from brakelab.identify.dust.features import FEATURES, Applications
from brakelab.identify.dust.model import FITS, LEAST_PARTICLES, Model, samples_of

COVERAGE: Final = 0.95
MARGIN: Final = 0.02  # of a range, beyond the outermost application


class Judged(NamedTuple):
    """A model beside the counted emission. Errors are predicted over counted minus 1."""

    name: str
    model: Model
    seconds: float
    """To train it once."""
    factor: float
    below: float
    above: float
    left_out_rms: float
    """Of EF."""
    left_out_sum: float
    """Root mean square over trips of the error of their particles."""
    left_out_root: float
    """Root mean square error of the square root of the particles, over the root of their mean."""
    test: "Kpis | None"


class Kpis(NamedTuple):
    """Of trips that are held out (Table 8.3)."""

    sum_error: float
    vaf: float
    nrmse: float
    covered: float
    """Share of applications whose EF lies in the interval."""
    known: float
    """Share of the work within the training range."""


def ranges(trips: list[Applications]) -> tuple[Array, Array]:
    """Return the least and greatest of each feature, with a margin, shapes (6,)."""
    features = np.concatenate([trip.features for trip in trips])
    low, high = features.min(axis=0), features.max(axis=0)
    margin = MARGIN * (high - low)
    least = np.where(np.array(FEATURES) == "temperature", -np.inf, 1e-3)  # of the others nothing is below 0
    return np.maximum(low - margin, least), high + margin


def inside_of(features: Array, trained: tuple[Array, Array]) -> NDArray[np.bool_]:
    """Return whether each of `features`, shape (n, 6), lies within the training range, shape (n,)."""
    return np.asarray(np.all((features >= trained[0]) & (features <= trained[1]), axis=1))


def conformal(residuals: Array) -> tuple[float, float]:
    """Return the ends of the interval that holds `COVERAGE` of the next residual, not above and below 0."""
    n, tail = len(residuals), 0.5 * (1.0 - COVERAGE)
    ordered = np.sort(residuals)
    k = max(int(np.floor(tail * (n + 1))), 1)
    return min(float(ordered[k - 1]), 0.0), max(float(ordered[n - k]), 0.0)


def kpis(
    test: list[Applications],
    model: Model,
    factor: float,
    interval: tuple[float, float],
    trained: tuple[Array, Array],
) -> Kpis:
    """Return the KPIs of a model on held-out trips."""
    features, sequences, counted, energy = (
        np.concatenate([getattr(trip, name) for trip in test])
        for name in ("features", "sequences", "particles", "energy")
    )
    factors = model.predict(features, sequences)
    said = factor * 10.0**factors
    known = counted > LEAST_PARTICLES
    measured = np.log10(counted[known])
    off = measured - factors[known]
    within = inside_of(features, trained)
    return Kpis(
        float(said.sum() / counted.sum() - 1.0),
        float(1.0 - np.var(counted - said) / np.var(counted)),
        float(np.sqrt(np.mean(off**2)) / measured.mean()),
        float(np.mean((off >= interval[0]) & (off <= interval[1]))),
        float(energy[within].sum() / energy.sum()),
    )


def judge(name: str, trips: list[Applications], test: list[Applications], seed: int = 0) -> Judged:
    """Fit one of `FITS` to `trips` and judge it by each of them left out, and by `test`."""
    fit = FITS[name]
    said, counted = [], []
    for k, trip in enumerate(trips):
        rest = trips[:k] + trips[k + 1 :]
        others, within = fit(samples_of(rest), seed), inside_of(trip.features, ranges(rest))
        said.append(others.predict(trip.features, trip.sequences)[within])
        counted.append(trip.particles[within])
    factor = float(np.concatenate(counted).sum() / (10.0 ** np.concatenate(said)).sum())
    sums = [factor * (10.0**ef).sum() / n.sum() - 1.0 for ef, n in zip(said, counted, strict=True)]
    known = np.concatenate(counted) > LEAST_PARTICLES
    residuals = np.log10(np.concatenate(counted)[known]) - np.concatenate(said)[known]
    below, above = conformal(residuals)
    began = time.process_time()
    model = fit(samples_of(trips), seed)
    seconds = time.process_time() - began
    found = kpis(test, model, factor, (below, above), ranges(trips)) if test else None
    total = np.maximum(np.concatenate(counted), 0.0)
    off = np.sqrt(factor * 10.0 ** np.concatenate(said)) - np.sqrt(total)
    return Judged(
        name, model, seconds, factor, below, above,
        float(np.sqrt(np.mean(residuals**2))),
        float(np.sqrt(np.mean(np.square(sums)))),
        float(np.sqrt(np.mean(off**2) / total.mean())),
        found,
    )  # fmt: skip


def judge_all(trips: list[Applications], test: list[Applications], seed: int = 0) -> list[Judged]:
    """Judge every model of `FITS`."""
    import sklearn.ensemble  # noqa: F401  the threads that are limited
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # so few rows gain nothing, and threads that wait take a CPU from others
        return [judge(name, trips, test, seed) for name in FITS]


def choose(judged: list[Judged]) -> Judged:
    """Return the on-board model with the least error on left-out trips."""
    return min((one for one in judged if one.model.on_board is not None), key=lambda one: one.left_out_root)


def spearman(trips: list[Applications]) -> tuple[tuple[str, ...], Array]:
    """Return names and rank correlations of (8.2), energy and EF, a symmetric matrix (Figure 8.6)."""
    from scipy.stats import rankdata

    features, energy, particles = (
        np.concatenate([getattr(trip, name) for trip in trips])
        for name in ("features", "energy", "particles")
    )
    known = particles > LEAST_PARTICLES
    columns = (*features[known, :5].T, energy[known], np.log10(particles[known]))
    ranks = np.array([rankdata(column) for column in columns])
    names = ("v_in", "v_end", "T_b", "τ", "Δt_b", "E_b", "EF")
    return names, np.corrcoef(ranks)
