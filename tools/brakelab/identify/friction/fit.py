"""Identifies a law from stops: multi-start, simplex search, least squares, confidence (3.6, Appendix C).

The law is integrated over each stop with the measured pressure, speed and temperature as inputs, one step a
sample, and compared with the friction of every block; slowing is what the law's own friction does to the
flywheel (3.22a), since the measured one over the measured pressure is the measured friction. In closed loop
the measured torque is demanded, and the pressure follows from the law's friction, as in a car. Numbers are
searched as shares between their bounds, so they are standardised (C.1). Starts of a Latin hypercube are
walked down by Nelder–Mead on a part of the stops; the best are finished by least squares on all. What several
starts do not agree on is said.

Confidence. Residuals of one stop hang together, those of two stops do not: the covariance is that of sums
over stops (Liang and Zeger's), with Student's t for as many degrees of freedom as stops less one. It holds
for noise and for a law that is wrong differently at every stop, not for one that is wrong everywhere.

Where no stop was. A number that is a friction at a place, as a table's, is held to the mean friction of all
stops by `BAND`, with the weight of a stop that is `CHANCE` off: beyond the data it is the constant, with that
band for its interval; where there are stops, they outweigh it.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize
from scipy.stats import qmc, t

from brakelab.arrays import Matrix, Vector
from brakelab.identify.friction.candidate import Candidate
from brakelab.identify.friction.stops import Stops, some
from brakelab.plant.dynamometer import HIGHEST_PRESSURE, SMALLEST_LEVER
from brakelab.plant.friction.law import START, Law, RigBrake
from brakelab.plant.friction.laws import friction, law_row
from brakelab.plant.jit import Record, kernel

STARTS: Final = 8
WALKS: Final = 40  # evaluations of a walk per free number
POLISHED: Final = 4  # walks that least squares go on from, on the same part
FINISHED: Final = 2  # of these on all stops
NEAR: Final = 0.05  # share within which a friction starts about the mean
PART: Final = 40  # stops of a walk
STEP: Final = 1e-4  # of a share, for slopes
LOST: Final = 10.0  # friction of a law that left the numbers
LEVEL: Final = 0.95
LOOSE: Final = 0.5  # half an interval over the value, or over the bounds: from here not identified
EDGE: Final = 1e-3  # a share this near to a bound lies on it
BAND: Final = 0.3  # of the mean: standard deviation of friction about it, over all that a brake does
CHANCE: Final = 0.1  # of the mean: what the mean of a stop is off a law


class Fitted(NamedTuple):
    """A law with its numbers."""

    candidate: Candidate
    shares: Vector
    law: Law
    residuals: Vector  # (blocks,)
    half: Vector  # (free,), half of the interval of 95 %
    at_bound: tuple[bool, ...]
    agreed: int  # starts whose result costs at most 1 % more than the best
    tried: int

    @property
    def values(self) -> list[float]:
        return self.candidate.values(self.shares)

    def unidentified(self) -> list[str]:
        """Return the names of numbers that the stops do not identify: on a bound, or in a wide interval."""
        named = []
        for free, value, half, bound in zip(
            self.candidate.free, self.values, self.half, self.at_bound, strict=True
        ):
            scale = abs(value) if free.log else max(abs(value), 0.2 * (free.high - free.low))
            if bound or not np.isfinite(half) or half > LOOSE * scale:
                named.append(free.name)
        return named


@kernel
def replay(
    number: int,
    row: Record,
    starts: Record,
    first: Record,
    pressure: Record,
    speed: Record,
    torque: Record,
    temperature: Record,
    brake: tuple[float, float],
    closed: bool,
    dt: float,
    out: Record,
) -> None:
    """Write the law's friction at every sample.

    `starts`: its memory at the start of each stop; `brake`: torque over friction and pressure [m^3], inertia
    [kg m^2]; `closed`: pressure follows from `torque` and the law's friction.
    """
    lever, inertia = brake
    for stop in range(len(first) - 1):
        begin, end = first[stop], first[stop + 1]
        memory = starts[stop]
        memory, mu = friction(number, row, memory, 0.0, speed[begin], 0.0, temperature[begin], 0.0)
        for k in range(begin, end):
            before = max(k - 1, begin)
            pressed = 0.5 * (pressure[before] + pressure[k])
            if closed:
                pressed = min(
                    max(0.5 * (torque[before] + torque[k]), 0.0) / max(lever * mu, SMALLEST_LEVER),
                    HIGHEST_PRESSURE,
                )
            sliding = 0.5 * (speed[before] + speed[k])
            slowing = lever * mu * pressed / inertia
            memory, mu = friction(number, row, memory, pressed, sliding, slowing, temperature[k], dt)
            out[k] = mu


@kernel
def block_means(values: Record, first: Record, per_block: int, out: Record) -> None:
    """Write the means of blocks of `per_block` values, each from its place in `first` on."""
    for block in range(len(first)):
        total = 0.0
        for k in range(first[block], first[block] + per_block):
            total += values[k]
        out[block] = total / per_block


def replayed(
    law: Law, brake: RigBrake, stops: Stops, starts_at_measured: bool, closed: bool = False
) -> Vector:
    """Return the law's friction in every block, shape (blocks,), with measured pressure or in closed loop."""
    number, row = law_row(law, brake)
    starts = np.full(len(stops), row[START])
    if starts_at_measured:
        places = np.searchsorted(stops.block_stop, np.arange(len(stops)))
        starts = stops.mu[places]
    mu, means = np.empty_like(stops.pressure), np.empty_like(stops.mu)
    inputs = (stops.pressure, stops.speed, stops.torque, stops.temperature)
    rig = (stops.lever, stops.inertia)
    replay(number, np.array(row), starts, stops.first, *inputs, rig, closed, stops.dt, mu)
    block_means(mu, stops.block_first, stops.per_block, means)
    return np.nan_to_num(np.clip(means, -LOST, LOST), nan=LOST)


def error_of(law: Law, brake: RigBrake, stops: Stops, closed: bool = False) -> float:
    """Return the nRMSE [%]: RMS of all blocks over their mean friction; see `replayed`."""
    return nrmse(replayed(law, brake, stops, starts_at_measured=False, closed=closed) - stops.mu, stops)


def nrmse(off: Vector, stops: Stops) -> float:
    """Return the RMS of what all blocks are `off`, shape (blocks,), over their mean friction [%]."""
    return 100.0 * float(np.sqrt(np.mean(off**2)) / np.mean(stops.mu))


def residual_function(candidate: Candidate, brake: RigBrake, stops: Stops) -> Callable[[Vector], Vector]:
    """Return the function of shares that least squares make small.

    Shape (blocks + frictions,): what the law leaves, and how far each friction is off the mean of all stops,
    in the weight that the module states.
    """
    mean = float(stops.mu.mean())
    frictions = [place for place, free in enumerate(candidate.free) if free.friction]
    weight = held_by(stops)

    def residuals(shares: Vector) -> Vector:
        values = candidate.values(np.clip(shares, 0.0, 1.0))
        off = replayed(candidate.law(values), brake, stops, candidate.starts_at_measured) - stops.mu
        return np.concatenate([off, [weight * (values[place] - mean) for place in frictions]])

    return residuals


def held_by(stops: Stops) -> float:
    """Return the factor of a friction's distance to the mean of all stops among the residuals."""
    return float(np.sqrt(len(stops.mu) / len(stops))) * CHANCE / BAND


def fit(candidate: Candidate, brake: RigBrake, stops: Stops, seed: int = 0) -> Fitted:
    """Return the law that fits `stops` best, starts drawn by `seed`."""
    if candidate.train is not None:
        return _trained(candidate, brake, stops, seed)
    count = len(candidate.free)
    part = stops
    if len(stops) > PART:
        part = some(stops, np.linspace(0, len(stops) - 1, PART).astype(np.int64))
    walk, finish = (residual_function(candidate, brake, which) for which in (part, stops))

    def cost(shares: Vector) -> float:
        outside = shares - np.clip(shares, 0.0, 1.0)
        return float(np.mean(walk(shares) ** 2) * (1.0 + 10.0 * np.sum(np.abs(outside))))

    ended = []
    for start in _starts(candidate, float(part.mu.mean()), seed):
        found = minimize(
            cost,
            start,
            method="Nelder-Mead",
            options={"maxfev": WALKS * count, "initial_simplex": _simplex(start)},
        )
        ended.append((float(found.fun), found.x))
    ended.sort(key=lambda pair: pair[0])
    polished = [_least_squares(walk, shares) for _, shares in ended[:POLISHED]]
    polished.sort(key=lambda result: result.cost)
    agreed = sum(bool(result.cost <= 1.01 * polished[0].cost) for result in polished)
    best = min((_least_squares(finish, r.x) for r in polished[:FINISHED]), key=lambda r: r.cost)
    return _judged(candidate, brake, stops, best.x, agreed, len(polished))


def refit(fitted: Fitted, brake: RigBrake, stops: Stops) -> Law:
    """Return the law fitted to other `stops`, by least squares from where `fitted` ended."""
    candidate = fitted.candidate
    if candidate.train is not None:
        return _trained(candidate, brake, stops, 0).law
    found = _least_squares(residual_function(candidate, brake, stops), fitted.shares)
    return candidate.law(candidate.values(found.x))


def _trained(candidate: Candidate, brake: RigBrake, stops: Stops, seed: int) -> Fitted:
    assert candidate.train is not None
    found = candidate.train(stops, seed)
    law = candidate.law(found.values)
    left = replayed(law, brake, stops, candidate.starts_at_measured) - stops.mu
    return Fitted(candidate, np.empty(0), law, left, np.empty(0), (), found.agreed, found.tried)


def _starts(candidate: Candidate, mean: float, seed: int) -> Matrix:
    """Return shares to start from, shape (STARTS, free): a Latin hypercube, frictions about the mean."""
    drawn = qmc.LatinHypercube(len(candidate.free), rng=np.random.default_rng(seed)).random(STARTS)
    for place, free in enumerate(candidate.free):
        if free.friction:
            drawn[:, place] = free.share(mean) + NEAR * (drawn[:, place] - 0.5)
    shares: Matrix = drawn
    return shares


def _least_squares(residuals: Callable[[Vector], Vector], start: Vector) -> Any:
    shares = np.clip(start, 0.002, 0.998)
    return least_squares(residuals, shares, bounds=(0.0, 1.0), diff_step=STEP, x_scale=1.0, max_nfev=40)


def _simplex(start: Vector) -> Matrix:
    """Return a simplex of edges 0.15 within the bounds, shape (free + 1, free)."""
    corners = np.tile(start, (len(start) + 1, 1))
    for place in range(len(start)):
        corners[place + 1, place] += 0.15 if start[place] < 0.5 else -0.15
    return corners


def _judged(
    candidate: Candidate, brake: RigBrake, stops: Stops, shares: Vector, agreed: int, tried: int
) -> Fitted:
    residuals = residual_function(candidate, brake, stops)
    slopes = slopes_at(residuals, shares)
    left, held = np.split(residuals(shares), [len(stops.mu)])
    expected = np.full(len(held), held_by(stops) * BAND * float(stops.mu.mean()))
    alone = len(stops) + np.arange(len(held))
    covariance = clustered(
        slopes,
        np.concatenate([left, expected]),
        np.concatenate([stops.block_stop, alone]),
        len(stops) + len(held),
    )
    steps = np.array([free.slope(share) for free, share in zip(candidate.free, shares, strict=True)])
    half = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * np.abs(steps) * quantile(len(stops))
    bound = tuple(bool(share < EDGE or share > 1.0 - EDGE) for share in shares)
    law = candidate.law(candidate.values(shares))
    return Fitted(candidate, shares, law, left, half, bound, agreed, tried)


def quantile(stops: int) -> float:
    """Return Student's t of an interval of 95 % from this many stops."""
    return float(t.ppf(0.5 + 0.5 * LEVEL, max(stops - 1, 1)))


def slopes_at(residuals: Callable[[Vector], Vector], shares: Vector) -> Matrix:
    """Return central differences, shape (residuals, free), one-sided at a bound."""
    columns = []
    for place in range(len(shares)):
        low, high = shares.copy(), shares.copy()
        low[place] = max(low[place] - STEP, 0.0)
        high[place] = min(high[place] + STEP, 1.0)
        columns.append((residuals(high) - residuals(low)) / (high[place] - low[place]))
    return np.stack(columns, axis=1)


def clustered(slopes: Matrix, residuals: Vector, cluster: NDArray[np.int64], count: int) -> Matrix:
    """Return the covariance of least squares whose residuals hang together within `count` clusters."""
    bread = np.linalg.pinv(slopes.T @ slopes, rcond=1e-12, hermitian=True)
    scores = np.zeros((count, slopes.shape[1]))
    np.add.at(scores, cluster, slopes * residuals[:, None])
    small = count / max(count - 1, 1)
    covariance: Matrix = small * bread @ (scores.T @ scores) @ bread
    return covariance
