"""Running-in of new pads, taken off the masses of blocks before a law is fitted to them.

Until its surface conforms a lining wears faster than later, by a share that decays with what was worn off:

    dm / dm_s = 1 + b exp(-m / m_r)        m worn since the first weighing, m_s what run-in pads would lose

(transient wear after Queener, Smith and Mitchell, Wear 8 (1965) 391-400; how it depends on the surface worn
off: doi 10.1007/s11249-022-01602-6). Between two weighings that is

    m_s = m_r (ln(exp(m_2 / m_r) + b) - ln(exp(m_1 / m_r) + b))

What was worn off comes of the masses, so the order of the rows does not matter. b and m_r are not chosen:
each pair of `GAINS` and `DECAYS` counts by how laws of work and its heat predict blocks left out of the m_s,
and by how much blocks that repeat one another differ in them. Without a block that repeats, a law of heat and
running-in explain the same masses where the order follows the heat; `sigma` says what that leaves open.
"""

from itertools import combinations, pairwise
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.wear.fit import LEAST_ERROR, WORK, fit_terms, left_out_by, sigma_of
from brakelab.identify.wear.fusion import Fused, fuse

GAINS: Final = (0.2, 0.4, 0.8)
"""b: fresh pads wear by so much faster."""
DECAYS: Final = (2.0, 4.0, 8.0, 16.0)
"""m_r: g of both pads of a calliper, 0.1 to 0.6 mm of each."""
NONE: Final = 0.5  # prior odds that pads are run in, or hardly do
ALIKE: Final = 0.1  # by which work, heat and power of two blocks differ at most, of those that repeat
REPEATS: Final = 0.05  # relative standard deviation of the wear of a block run again
TARE: Final = 0.5  # g by which pads may gain between two blocks: moisture, another day's balance

LINKED: Final = 0.15  # g, likewise, of blocks that follow one another


class RunIn(NamedTuple):
    """What running-in added to the masses of blocks."""

    factor: Array
    """Mass over that of pads run in, shape (n,)."""
    sigma: float
    """Relative standard deviation of what pads run in lost in all blocks, by what remains open."""
    known: bool
    """Weighings are of one set of pads, so that what was worn off before each block is known."""
    repeated: bool
    """A block repeats another one."""


class Measured(NamedTuple):
    """Wear of blocks, of balance and thickness blended."""

    regressors: Array
    """Shape (n, 7)."""
    fused: Fused
    run_in: RunIn
    mass: Array
    """Of pads run in, g, shape (n,)."""
    variance: Array
    """g^2"""


def measured(regressors: Array, wear: Array, mass: Array, begun: Array | None) -> Measured:
    """Return the wear of blocks by thickness [mm] and balance [g], shape (n,); others as of `running_in`."""
    fused = fuse(wear, mass)
    variance = np.diag(fused.covariance)
    run_in = running_in(regressors, fused.mass, variance, begun)
    return Measured(regressors, fused, run_in, fused.mass / run_in.factor, variance / run_in.factor**2)


def worn_before(before: Array, after: Array) -> Array | None:
    """Return what was worn off before each block [g] by the masses `before` and `after` it, shape (n,).

    None: they are not of one set of pads that is worn from block to block.
    """
    gained = np.array([grams for _, _, grams in _between(before, after)])
    mistyped = 1 if unlinked(before, after) else 0
    if np.count_nonzero(gained > TARE) > mistyped:
        return None
    return np.asarray(before.max() - before)


def unlinked(before: Array, after: Array) -> list[tuple[int, int, float]]:
    """Return which blocks do not begin with the mass [g] that another one ended with, as most do.

    Places of the block that ended and of that which began, and what was gained between them.
    """
    between = _between(before, after)
    if len(between) < 3 or np.median([abs(grams) for _, _, grams in between]) > LINKED:
        return []
    return [one for one in between if abs(one[2]) > TARE]


def _between(before: Array, after: Array) -> list[tuple[int, int, float]]:
    order = [int(place) for place in np.argsort(-before, kind="stable")]
    return [(one, other, float(before[other] - after[one])) for one, other in pairwise(order)]


def run_in_mass(begun: Array, mass: Array, gain: float, decay: float) -> Array:
    """Return what pads run in would have lost [g] in blocks that lost `mass`, `begun` worn off before."""
    ends = np.logaddexp((begun + mass) / decay, np.log(gain))
    return np.asarray(decay * (ends - np.logaddexp(begun / decay, np.log(gain))))


def running_in(regressors: Array, mass: Array, variance: Array, begun: Array | None) -> RunIn:
    """Return what running-in added to blocks: `regressors` (n, 7), `mass` [g] and its `variance` [g^2] (n,).

    `begun`: worn off before each [g], shape (n,); None: not known, each may have begun with new pads.
    """
    pairs = _repeated(regressors)
    start = np.zeros(len(mass)) if begun is None else begun
    steady = [mass, *(run_in_mass(start, mass, gain, decay) for gain in GAINS for decay in DECAYS)]
    logarithm = np.log([NONE, *np.full(len(steady) - 1, (1.0 - NONE) / (len(steady) - 1))])
    if begun is not None and len(mass) > len(WORK):
        logarithm += [_likelihood(regressors, one, variance * (one / mass) ** 2, pairs) for one in steady]
    weight = np.exp(logarithm - logarithm.max())
    weight /= weight.sum()
    total = np.sum(steady, axis=1)
    mean = float(weight @ total)
    sigma = float(np.sqrt(weight @ (total - mean) ** 2)) / mean
    factor = np.ones(len(mass)) if begun is None else mass / (weight @ np.array(steady))
    return RunIn(factor, sigma, begun is not None, bool(pairs))


def _likelihood(regressors: Array, mass: Array, variance: Array, pairs: list[tuple[int, int]]) -> float:
    """Return the logarithm of the likelihood of blocks left out, and of those that repeat one another."""
    errors = []
    for terms in ((WORK[0],), (WORK[1],), WORK):
        _, scatter, _ = fit_terms(regressors, mass, variance, terms)
        unseen = left_out_by(regressors, mass, sigma_of(mass, variance, scatter), terms)
        errors.append(float(np.sqrt(np.mean((unseen / mass - 1.0) ** 2))))
    found = -0.5 * len(mass) * float(np.log(max(min(errors), LEAST_ERROR)))
    relative = variance / mass**2
    specific = np.log(mass / regressors[:, 0])
    for one, other in pairs:
        spread = 2.0 * REPEATS**2 + relative[one] + relative[other]
        found -= 0.5 * float((specific[one] - specific[other]) ** 2 / spread)
    return found


def _repeated(regressors: Array) -> list[tuple[int, int]]:
    """Return the pairs of blocks whose heat, slowing and power are alike."""
    seen = np.log(np.maximum(regressors[:, [1, 3, 5]] / regressors[:, :1], 1e-9))
    pairs = combinations(range(len(seen)), 2)
    return [(one, other) for one, other in pairs if np.all(np.abs(seen[one] - seen[other]) < ALIKE)]
