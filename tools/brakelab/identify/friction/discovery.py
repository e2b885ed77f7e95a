"""Finds the terms of a friction law in stops instead of taking them as given (C.1).

Model. mu_b = kappa alpha, alpha 1 at the start of an application,

    kappa = sum k_j g_j(T, p, v),    alpha' = sum w_i f_i(p, v, T, |omega'|, mu, alpha)

g and f come from a library; every f is normalised by the root mean square of its integral over a stop and
every g by its own, so that a coefficient shows how much its term moves friction (C.1). |omega'| is p mu, as
on a flywheel: the measured slowing over the measured pressure is the measured friction, which a term that
follows it fast would only copy, noise and all. T in K.

Two searches, both judged by Schwarz's criterion with stops as observations (`choice.criterion`):

sparse   the integrals are taken of the measured mu (weak form), so that friction is bilinear; all terms are
         fitted, those below a threshold dropped, until none is (sequentially thresholded least squares), then
         those without which the criterion is less; the threshold of the least criterion wins
greedy   the model is shot through every stop; the term that would lower the cost most is added as long as
         the criterion falls, then those are dropped without which it is less, and so on
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Matrix, Vector
from brakelab.identify.friction.stops import Stops
from brakelab.plant.friction.law import KELVIN
from brakelab.plant.jit import Record, kernel

Support = tuple[int, ...]

PLAIN, BY_MU, BY_ALPHA = range(3)

LEVEL_TERMS: Final = ("1", "T", "T²", "p", "v")
RATE_TERMS: Final = (
    ("p v μ", BY_MU),
    ("|ω'|", BY_MU),
    ("p T", PLAIN),
    ("1", PLAIN),
    ("p", PLAIN),
    ("v", PLAIN),
    ("T", PLAIN),
    ("p v", PLAIN),
    ("v T", PLAIN),
    ("p v T", PLAIN),
    ("v μ", BY_MU),
    ("α", BY_ALPHA),
    ("p α", BY_ALPHA),
    ("v α", BY_ALPHA),
    ("p T α", BY_ALPHA),
)
NAMES: Final = tuple(f"κ: {name}" for name in LEVEL_TERMS) + tuple(f"α': {name}" for name, _ in RATE_TERMS)
LEVELS: Final = len(LEVEL_TERMS)
ILVO: Final = (0, 1, LEVELS, LEVELS + 1, LEVELS + 2)
"""The terms of ILVO: kappa_0, kappa_1, a, b, c (3.22c)."""
THRESHOLDS: Final = tuple(np.geomspace(5e-4, 0.05, 14))
ROUNDS: Final = 20  # of adding and dropping, at most
ITERATIONS: Final = 20
HALVINGS: Final = 8


class Library(NamedTuple):
    """All terms over a recording, normalised."""

    stops: Stops
    levels: Matrix  # (samples, LEVELS)
    rates: Matrix  # (samples, rate terms), without mu or alpha
    kinds: NDArray[np.int64]  # (rate terms,)
    scale: Vector  # (terms,), of a coefficient in SI units over the normalised one
    level_blocks: Matrix  # (blocks, LEVELS)
    integrals: Matrix  # (blocks, rate terms), of the measured mu


class Found(NamedTuple):
    """Terms, as places in `NAMES`, with normalised coefficients."""

    terms: Support
    coefficients: Vector
    error: float  # nRMSE [%]

    def names(self) -> list[str]:
        return [NAMES[term] for term in self.terms]


def library(stops: Stops) -> Library:
    """Return all terms over `stops`."""
    p, v, heat = stops.pressure, stops.speed, stops.temperature + KELVIN
    one = np.ones_like(p)
    levels = np.stack([one, heat, heat**2, p, v], axis=1)
    plain = {"p v μ": p * v, "|ω'|": p, "v μ": v, "α": one, "p α": p, "v α": v, "p T α": p * heat}
    plain |= {"p T": p * heat, "1": one, "p": p, "v": v, "T": heat, "p v": p * v, "v T": v * heat}
    plain |= {"p v T": p * v * heat}
    rates = np.stack([plain[name] for name, _ in RATE_TERMS], axis=1)
    kinds = np.array([kind for _, kind in RATE_TERMS])
    mu = _along(stops)
    level = np.repeat([mu[a] for a in stops.first[:-1]], np.diff(stops.first))
    factors = {PLAIN: one, BY_MU: mu, BY_ALPHA: mu / level}
    integrals = np.empty((len(stops.mu), len(kinds)))
    for place, kind in enumerate(kinds):
        integrals[:, place] = _blocks(_integral(rates[:, place] * factors[int(kind)], stops), stops)
    size = np.sqrt(np.mean(integrals**2, axis=0))
    heights = np.sqrt(np.mean(levels**2, axis=0))
    levels /= heights
    level_blocks = np.stack([_blocks(level, stops) for level in levels.T], axis=1)
    scale = 1.0 / np.concatenate([heights, size])
    return Library(stops, levels, rates / size, kinds, scale, level_blocks, integrals / size)


def _along(stops: Stops) -> Vector:
    """Return measured friction at every sample: that of the blocks, the first one held back to the start."""
    mu = np.empty_like(stops.pressure)
    middle = stops.block_first + 0.5 * (stops.per_block - 1)
    for stop in range(len(stops)):
        begin, end = stops.first[stop], stops.first[stop + 1]
        of = stops.block_stop == stop
        mu[begin:end] = np.interp(np.arange(begin, end), middle[of], stops.mu[of])
    return mu


def _integral(values: Vector, stops: Stops) -> Vector:
    """Return the integral from the start of each stop, by trapezoids."""
    out = np.zeros_like(values)
    for begin, end in zip(stops.first[:-1], stops.first[1:], strict=True):
        part = values[begin:end]
        out[begin + 1 : end] = np.cumsum(0.5 * (part[1:] + part[:-1])) * stops.dt
    return out


def _blocks(values: Vector, stops: Stops) -> Vector:
    means: Vector = values[stops.block_first[:, None] + np.arange(stops.per_block)].mean(axis=1)
    return means


@kernel
def shoot(
    level_terms: Record,
    rate_terms: Record,
    kinds: Record,
    weights: Record,
    first: Record,
    dt: float,
    out: Record,
) -> None:
    """Write mu_b of the model at every sample, by Heun's method; `weights`: of all terms, normalised."""
    levels = level_terms.shape[1]
    for stop in range(len(first) - 1):
        alpha = 1.0
        before = 0.0
        for k in range(first[stop], first[stop + 1]):
            kappa = 0.0
            for j in range(levels):
                kappa += weights[j] * level_terms[k, j]
            if k > first[stop]:
                guess = alpha + dt * before
                now = rate(rate_terms, kinds, weights, levels, k, kappa, guess)
                alpha += 0.5 * dt * (before + now)
            before = rate(rate_terms, kinds, weights, levels, k, kappa, alpha)
            out[k] = kappa * alpha


@kernel
def rate(
    terms: Record, kinds: Record, weights: Record, levels: int, k: int, kappa: float, alpha: float
) -> float:
    """Return alpha' at sample k."""
    total = 0.0
    for i in range(terms.shape[1]):
        weight = weights[levels + i]
        if weight != 0.0:
            factor = 1.0
            if kinds[i] == BY_MU:
                factor = kappa * alpha
            elif kinds[i] == BY_ALPHA:
                factor = alpha
            total += weight * terms[k, i] * factor
    return total


def _shot(of: Library, weights: Vector) -> Vector:
    """Return the model's friction less the measured one, shape (blocks,)."""
    mu = np.empty_like(of.stops.pressure)
    shoot(of.levels, of.rates, of.kinds, weights, of.stops.first, of.stops.dt, mu)
    off: Vector = np.nan_to_num(_blocks(np.clip(mu, -10.0, 10.0), of.stops) - of.stops.mu, nan=10.0)
    return off


def _weak(of: Library, weights: Vector) -> Vector:
    """Return the same with the integrals of the measured friction."""
    kappa = of.level_blocks @ weights[:LEVELS]
    off: Vector = kappa * (1.0 + of.integrals @ weights[LEVELS:]) - of.stops.mu
    return off


def _weak_slopes(of: Library, weights: Vector, terms: Support) -> Matrix:
    alpha = 1.0 + of.integrals @ weights[LEVELS:]
    kappa = of.level_blocks @ weights[:LEVELS]
    whole = np.hstack([of.level_blocks * alpha[:, None], of.integrals * kappa[:, None]])
    return np.asarray(whole[:, terms])


def _shot_slopes(of: Library, weights: Vector, terms: Support) -> Matrix:
    base = _shot(of, weights)
    columns = []
    for place in terms:
        moved = weights.copy()
        moved[place] += 1e-5
        columns.append((_shot(of, moved) - base) / 1e-5)
    return np.stack(columns, axis=1)


Residuals = Callable[[Library, Vector], Vector]
Slopes = Callable[[Library, Vector, Support], Matrix]


def _fit(of: Library, terms: Support, start: Vector, residuals: Residuals, slopes: Slopes) -> Vector:
    """Return the weights of all terms, zero but for `terms`, by Gauss and Newton's steps from `start`."""
    at = np.array(terms)
    weights = np.zeros(len(NAMES))
    weights[at] = start[at]
    off = residuals(of, weights)
    square = float(off @ off)
    for _ in range(ITERATIONS):
        step = np.zeros(len(NAMES))
        step[at] = np.linalg.lstsq(slopes(of, weights, terms), -off, rcond=None)[0]
        for _ in range(HALVINGS):
            tried = residuals(of, weights + step)
            if float(tried @ tried) < square:
                break
            step *= 0.5
        else:
            break
        weights, off, before, square = weights + step, tried, square, float(tried @ tried)
        if square > (1.0 - 1e-7) * before:
            break
    return weights


def _cost(of: Library, weights: Vector, terms: Support, residuals: Residuals) -> float:
    count = len(of.stops)
    square = float(np.mean(residuals(of, weights) ** 2))
    return count * float(np.log(square)) + len(terms) * float(np.log(count))


def _found(of: Library, weights: Vector, terms: Support, residuals: Residuals) -> Found:
    error = 100.0 * float(np.sqrt(np.mean(residuals(of, weights) ** 2)) / of.stops.mu.mean())
    return Found(tuple(sorted(terms)), weights[sorted(terms)], error)


def sparse(of: Library) -> Found:
    """Return the terms that sequentially thresholded least squares keeps."""
    mean = float(of.stops.mu.mean())
    size = np.ones(len(NAMES))
    size[:LEVELS] = 1.0 / mean
    everything = tuple(range(len(NAMES)))
    begin = np.zeros(len(NAMES))
    begin[0] = mean
    full = _fit(of, everything, begin, _weak, _weak_slopes)
    best: tuple[float, Vector, Support] | None = None
    known = {everything: full}
    for threshold in THRESHOLDS:
        terms, weights = everything, full
        while True:
            kept = tuple(term for term in terms if abs(weights[term]) * size[term] >= threshold)
            if kept == terms or not kept:
                break
            if kept not in known:
                known[kept] = _fit(of, kept, weights, _weak, _weak_slopes)
            terms, weights = kept, known[kept]
        terms, weights = _drop(of, terms, weights, _weak, _weak_slopes)
        cost = _cost(of, weights, terms, _weak)
        if best is None or cost < best[0]:
            best = cost, weights, terms
    assert best is not None
    return _found(of, best[1], best[2], _weak)


def greedy(of: Library) -> Found:
    """Return the terms that shooting adds and keeps."""
    weights = np.zeros(len(NAMES))
    weights[0] = of.stops.mu.mean()
    terms: Support = (0,)
    weights = _fit(of, terms, weights, _shot, _shot_slopes)
    cost = _cost(of, weights, terms, _shot)
    for _ in range(ROUNDS):
        added = _add(of, weights, terms)
        new, moved = _drop(of, *added, _shot, _shot_slopes)
        new_cost = _cost(of, moved, new, _shot)
        if new_cost >= cost - 1e-6:
            break
        terms, weights, cost = new, moved, new_cost
    return _found(of, weights, terms, _shot)


def _add(of: Library, weights: Vector, terms: Support) -> tuple[Support, Vector]:
    """Return the terms with the one whose step of least squares lowers the cost most, fitted."""
    others = tuple(term for term in range(len(NAMES)) if term not in terms)
    left = _shot(of, weights)
    known = _shot_slopes(of, weights, terms)
    new = _shot_slopes(of, weights, others)
    basis, _ = np.linalg.qr(known)
    left = left - basis @ (basis.T @ left)
    new = new - basis @ (basis.T @ new)
    gain = (new.T @ left) ** 2 / np.maximum(np.sum(new**2, axis=0), 1e-12)
    more = (*terms, others[int(np.argmax(gain))])
    return more, _fit(of, more, weights, _shot, _shot_slopes)


def _drop(
    of: Library, terms: Support, weights: Vector, residuals: Residuals, slopes: Slopes
) -> tuple[Support, Vector]:
    """Return the terms without those whose loss lowers the criterion, the least needed first."""
    cost = _cost(of, weights, terms, residuals)
    while len(terms) > 1:
        tried = []
        for term in terms:
            fewer = tuple(other for other in terms if other != term)
            moved = _fit(of, fewer, weights, residuals, slopes)
            tried.append((_cost(of, moved, fewer, residuals), fewer, moved))
        least = min(tried, key=lambda each: each[0])
        if least[0] >= cost:
            break
        cost, terms, weights = least
    return terms, weights
