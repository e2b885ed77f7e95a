"""Coefficients of a wear law from blocks (7.15–7.19): scaled, weighted, not negative, few.

Every column is scaled to 1, every block weighted by its standard deviation: that of the measurement and a
share of its mass, the scatter unexplained by any law, estimated with it. All sets of terms admitted by the
rank of the scaled regressors are tried, and each is judged by the blocks that it did not see. The law is the
mean of all sets, each by the root of its likelihood of the blocks left out, (error)^(-n/2), as the laws that
left them out share all the others: few blocks do not select one set, and a law chosen as if they did is wrong
by what was left out of it. Of sets that predict alike those count more that have work and its heat alone: on
blocks of other laws than these the rest is chance (`RARE`). Confidence: parametric bootstrap, the set
drawn anew every time.
"""

from itertools import combinations
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from brakelab.arrays import Array
from ecu.errors import UserError

TERMS: Final = ("γ10", "γ11", "γ12", "γ20", "γ21", "γ30", "γ31")
UNITS: Final = ("g/MJ", "g/MJ/K", "g/MJ/K^2", "g/MW", "g/MW/K", "g s/MJ^2", "g s/(MJ^2 K)")
QUASI_STATIC: Final = (0, 1, 2)
LEAST_SINGULAR: Final = 1e-3  # of the greatest, of regressors scaled by row and column
LEAST_SCATTER: Final = 0.005  # relative
ROUNDS: Final = 400
CONFIDENCE: Final = (2.5, 97.5)  # %
ELSEWHERE: Final = 50.0  # K by which roads differ from a programme
LEAST_ERROR: Final = 0.02  # of blocks left out: weighings are no better
WORK: Final = (0, 2)  # terms of work and of its heat, which most linings show
RARE: Final = 0.3
"""Prior odds of a set for each of its other terms."""
LEAST_WEIGHT: Final = 0.02  # of the best set's, below which a set is left out
STRANGE: Final = 0.25
"""Logarithm of a block's mass over its law's; pressure and running-in, in no law, can make as much."""
FAR: Final = 4.0  # of what the others miss by, RMS
FEWEST_BLOCKS: Final = 4  # blocks that must agree


class Fit(NamedTuple):
    """A law with its confidence."""

    coefficients: Array
    """Shape (7,), 0: in no set that counts."""
    low: Array
    high: Array
    predicted: Array
    """g, shape (n,)."""
    left_out: Array
    """g, each block by the law of the others; shape (n,)."""
    elsewhere: float
    """Relative standard deviation of the wear at discs `ELSEWHERE` hotter or cooler than the blocks', by the
    sets that predict the blocks as well as each other."""
    scatter: float
    """Relative standard deviation that is not the measurement's."""
    r2: float
    criterion: float
    """Least AICc of the sets."""
    rank: int


def _scaled(regressors: Array) -> tuple[Array, Array]:
    scale = np.max(regressors, axis=0)
    scale[scale == 0.0] = 1.0
    return regressors / scale, scale


def rank_of(regressors: Array) -> int:
    """Return the numerical rank of the regressors, shape (n, 7).

    Rows count by their direction: a block twice as long adds no information.
    """
    rows = regressors / regressors[:, :1]
    columns, _ = _scaled(rows)
    singular = np.linalg.svd(columns, compute_uv=False)
    return int(np.count_nonzero(singular > LEAST_SINGULAR * singular[0]))


def _solve(regressors: Array, mass: Array, sigma: Array, terms: tuple[int, ...]) -> Array:
    part, scale = _scaled(regressors[:, terms])
    found, _ = nnls(part / sigma[:, None], mass / sigma)
    coefficients = np.zeros(regressors.shape[1])
    coefficients[list(terms)] = found / scale
    return coefficients


def sigma_of(mass: Array, variance: Array, scatter: float) -> Array:
    """Return the standard deviation of masses: of the balance, and a scatter in proportion to the mass."""
    return np.asarray(np.sqrt(variance + (scatter * mass) ** 2))


def fit_terms(
    regressors: Array, mass: Array, variance: Array, terms: tuple[int, ...]
) -> tuple[Array, float, float]:
    """Return coefficients, scatter and the criterion for a set of terms."""
    scatter, count = 0.03, len(mass)
    coefficients = np.zeros(regressors.shape[1])
    for _ in range(20):
        coefficients = _solve(regressors, mass, sigma_of(mass, variance, scatter), terms)
        residual = (mass - regressors @ coefficients) / mass
        free = max(count - int(np.count_nonzero(coefficients)), 1)
        own = float(residual @ residual) / free - float(np.mean(variance / mass**2))
        scatter = max(float(np.sqrt(max(own, 0.0))), LEAST_SCATTER)
    sigma = sigma_of(mass, variance, scatter)
    residual = (mass - regressors @ coefficients) / sigma
    k = float(np.count_nonzero(coefficients)) + 1.0  # the scatter is one more
    likelihood = float(residual @ residual + 2.0 * np.sum(np.log(sigma / mass)))
    punished = 2.0 * k + 2.0 * k * (k + 1) / max(count - k - 1, 0.5)
    return coefficients, scatter, likelihood + punished


def fit_law(
    regressors: Array,
    mass: Array,
    variance: Array,
    allowed: tuple[int, ...] = tuple(range(7)),
    seed: int = 0,
    rare: float = RARE,
) -> Fit:
    """Return the law of the blocks: `regressors` (n, 7), `mass` [g] and its `variance` [g^2] (n,).

    `allowed`: indices of admissible terms; `rare`: see `RARE`.

    Raises:
        UserError: there are too few blocks, or all are similar.
    """
    if len(mass) < 3:
        raise UserError("blocks", str(len(mass)), "too few to tell one law from another; give 3 or more")
    rank = rank_of(regressors[:, allowed])
    if rank < 2:
        raise UserError(
            "blocks",
            f"{len(mass)}",
            "all alike, their regressors are collinear: add other roads, drivers or temperatures",
        )
    most = min(rank, len(mass) - 2, len(allowed))
    sets = [terms for size in range(1, most + 1) for terms in combinations(allowed, size)]
    tried = [fit_terms(regressors, mass, variance, terms) for terms in sets]
    sigmas = [sigma_of(mass, variance, scatter) for _, scatter, _ in tried]
    unseen = np.array([left_out_by(regressors, mass, *one) for one in zip(sigmas, sets, strict=True)])
    error = np.maximum(np.sqrt(np.mean((unseen / mass - 1.0) ** 2, axis=1)), LEAST_ERROR)
    prior = np.array([rare ** len(set(terms) - set(WORK)) for terms in sets])
    weight = prior * (error / error.min()) ** (-0.5 * len(mass))
    weight /= weight.max()
    weight = np.where(weight < LEAST_WEIGHT, 0.0, weight) / np.sum(weight[weight >= LEAST_WEIGHT])
    coefficients = weight @ np.array([found for found, _, _ in tried])
    scatter = float(weight @ np.array([one for _, one, _ in tried]))
    criterion = min(one for _, _, one in tried)
    predicted, left_out = regressors @ coefficients, weight @ unseen
    random = np.random.default_rng(seed)
    drawn = np.empty((ROUNDS, regressors.shape[1]))
    for k, place in enumerate(random.choice(len(sets), ROUNDS, p=weight)):
        noisy = predicted + sigmas[place] * random.standard_normal(len(mass))
        drawn[k] = _solve(regressors, np.maximum(noisy, 1e-9), sigmas[place], sets[place])
    low, high = np.percentile(drawn, CONFIDENCE, axis=0)
    roads = np.array([_warmer(regressors, kelvin).sum(axis=0) for kelvin in (-ELSEWHERE, ELSEWHERE)])
    elsewhere = float(np.max(np.std(drawn @ roads.T, axis=0) / (roads @ coefficients)))
    spread = float(np.sum((mass - mass.mean()) ** 2))
    r2 = 1.0 - float(np.sum((mass - predicted) ** 2)) / spread
    return Fit(coefficients, low, high, predicted, left_out, elsewhere, scatter, r2, criterion, rank)


def _warmer(regressors: Array, kelvin: float) -> Array:
    """Return the regressors (7.16) of the same applications with discs `kelvin` hotter, not below 0 degC."""
    e, et, ett, r, rt, p, pt = regressors.T
    k = np.maximum(kelvin, -et / e)
    return np.column_stack([e, et + k * e, ett + 2.0 * k * et + k * k * e, r, rt + k * r, p, pt + k * p])


def left_out_by(regressors: Array, mass: Array, sigma: Array, terms: tuple[int, ...]) -> Array:
    """Return the mass [g] of each block by the law of the others, shape (n,)."""
    found = np.empty(len(mass))
    for i in range(len(mass)):
        others = np.arange(len(mass)) != i
        found[i] = regressors[i] @ _solve(regressors[others], mass[others], sigma[others], terms)
    return found


def strangers(regressors: Array, mass: Array, variance: Array) -> list[int]:
    """Return the blocks whose mass the law of the others does not come near, worst first.

    A wrong block spoils the law of all, so that everybody seems off; without it the others agree. So a block
    is held against how well the others predict each other once it is gone, by laws of whatever terms.
    Arguments as of `fit_law`. At most one block of four is left out, and four must agree.
    """
    kept = np.arange(len(mass))
    found: list[int] = []
    while len(kept) > FEWEST_BLOCKS and len(found) < len(mass) // FEWEST_BLOCKS:
        law = fit_law(regressors[kept], mass[kept], variance[kept], rare=1.0)
        worst = int(np.argmax(_off(mass[kept], law.left_out)))
        one, others = kept[worst], np.delete(kept, worst)
        rest = fit_law(regressors[others], mass[others], variance[others], rare=1.0)
        usual = float(np.sqrt(np.mean(_off(mass[others], rest.left_out) ** 2)))
        off = float(_off(mass[one], regressors[one] @ rest.coefficients))
        if off < max(STRANGE, FAR * usual) or not _amid(regressors, one, others):
            break
        found.append(int(one))
        kept = others
    return found


def _off(mass: Array, predicted: Array) -> Array:
    return np.abs(np.log(mass / np.maximum(predicted, 1e-9)))


def _amid(regressors: Array, one: int, others: NDArray[np.int64]) -> bool:
    """Return whether the mean temperature of a block lies among those of the others: they predict it."""
    heat = regressors[:, 1] / regressors[:, 0]
    return bool(heat[others].min() <= heat[one] <= heat[others].max())


def explains(fit: Fit, mass: Array) -> bool:
    """Return whether the law predicts blocks left out within 30 %, or any better than their mean does."""
    return fit.r2 > 0.0 or leave_one_out(fit, mass) < 0.3


def leave_one_out(fit: Fit, mass: Array) -> float:
    """Return the RMS relative error of blocks by the law identified from the others."""
    return float(np.sqrt(np.mean((fit.left_out / mass - 1.0) ** 2)))
