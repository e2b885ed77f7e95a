"""A cycle with the published totals of the WLTP-Brake cycle: ten trips, 303 applications, 192 km, 15,826 s.

The trace of UN GTR 24 (UN R179) is not at hand: this one is generated to what is published of it, `TOTALS`.
How the totals divide among the trips, and the speeds and decelerations of the single brake applications, are
assumptions (`TRIPS`, `_draws`). Applications are of constant deceleration; between two the car accelerates
and holds a speed. Cooling between trips is no part of the cycle: a trip begins with its disc at
`DISC_AT_START`.

```
trip of duration T, distance D, brake applications k = 1..n from u_k to w_k [m/s] by d_k [m/s^2]:
  D = sum (u_k^2 - w_{k-1}^2) / 2 a_k + sum u_k h_k + sum (u_k^2 - w_k^2) / 2 d_k     h_k: time held, ~ a draw
  T = sum of the same pieces' times + waits at rest, by the speeds' level: `WAITING` of T
```

Source of the totals: UN GTR 24. The cycle is named and tested by Grigoratos et al. 2020
(doi 10.3390/atmos11121309).
"""

from functools import cache
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.simulation.trip.table import KMH


class Totals(NamedTuple):
    """Published figures of the cycle."""

    seconds: float
    metres: float
    brakings: int
    fastest: float
    """m/s"""
    mean_decel: float
    """m/s^2, over the brake applications."""


TOTALS: Final = Totals(15_826.0, 192e3, 303, 132.5 * KMH, 0.97)


class Division(NamedTuple):
    """One trip's part of the totals. Assumption."""

    seconds: float
    metres: float
    brakings: int


TRIPS: Final = (
    Division(1200.0, 9.5e3, 26),
    Division(900.0, 5.5e3, 24),
    Division(1300.0, 13.0e3, 27),
    Division(850.0, 7.0e3, 19),
    Division(1500.0, 20.0e3, 25),
    Division(700.0, 4.0e3, 17),
    Division(1250.0, 14.5e3, 22),
    Division(1476.0, 24.5e3, 18),
    Division(1350.0, 13.0e3, 25),
    Division(5300.0, 81.0e3, 100),
)
DISC_AT_START: Final = (23.0, *(40.0,) * (len(TRIPS) - 1))
"""degC; a trip is begun once the disc has cooled to it."""
LEAST_DECEL, LARGEST_DECEL = 0.49, 2.2  # m/s^2. Assumption
MEDIAN_DECEL, DECEL_SCATTER = 0.92, 0.33  # m/s^2, of the logarithm. Assumption
SPEED_SCATTER: Final = 0.45  # of the logarithm of the speed a brake application begins with. Assumption
TO_REST: Final = 0.55  # share of the brake applications from a trip's slower half of speeds. Assumption
SLOWED_TO: Final = (0.3, 0.8)  # of the speed, where not to rest. Assumption
FAST_ROADS: Final = 2.0  # the time that a speed is held grows with its power: fewer applications. Assumption
LOWEST_SPEED: Final = 15.0 * KMH
ACCEL: Final = (0.6, 1.3)  # m/s^2. Assumption
WAITING: Final = 0.13  # share of a trip's time at rest. Assumption
LEAST_HELD: Final = 2.0  # s
SEED: Final = 24


class _Draws(NamedTuple):
    """Random draws of a trip's brake applications; shape (n,)."""

    speed: Array
    """Relative."""
    left: Array
    """Speed after over speed before."""
    decel: Array
    accel: Array
    held: Array
    """Relative."""
    wait: Array
    """Relative."""


@cache
def _draws() -> tuple[_Draws, ...]:
    random, trips = np.random.default_rng(SEED), []
    for trip in TRIPS:
        n = trip.brakings
        speed = np.exp(SPEED_SCATTER * random.normal(size=n))
        rests = (speed < np.median(speed)) & (random.random(n) < TO_REST)
        left = np.where(rests, 0.0, random.uniform(*SLOWED_TO, n))
        left[-1] = 0.0
        decel = MEDIAN_DECEL * np.exp(DECEL_SCATTER * random.normal(size=n))
        held = speed**FAST_ROADS * random.gamma(2.0, 0.5, n)
        trips.append(_Draws(speed, left, decel, random.uniform(*ACCEL, n), held, random.random(n)))
    every = np.concatenate([trip.decel for trip in trips])
    low, high = 0.5, 2.0
    while high - low > 1e-12:  # one factor for the mean
        level = 0.5 * (low + high)
        less = np.clip(level * every, LEAST_DECEL, LARGEST_DECEL).mean() < TOTALS.mean_decel
        low, high = (level, high) if less else (low, level)
    return tuple(trip._replace(decel=np.clip(low * trip.decel, LEAST_DECEL, LARGEST_DECEL)) for trip in trips)


class _Plan(NamedTuple):
    """A trip's applications: speeds before and after [m/s], time held before and time waited after [s]."""

    before: Array
    after: Array
    held: Array
    wait: Array


def _plan(trip: Division, draws: _Draws, level: float, fastest: bool) -> _Plan:
    """Return the trip with speeds of `level` [m/s]; its waits come out as the time that is left."""
    before = np.clip(level * draws.speed, LOWEST_SPEED, TOTALS.fastest)
    if fastest:
        before[np.argmax(draws.speed)] = TOTALS.fastest
    after = draws.left * before
    from_speed = np.concatenate([[0.0], after[:-1]])
    before = np.maximum(before, from_speed + 1.0)
    up = before**2 - from_speed**2
    down = before**2 - after**2
    moved = (0.5 * up / draws.accel + 0.5 * down / draws.decel).sum() + (LEAST_HELD * before).sum()
    held = LEAST_HELD + (trip.metres - moved) * draws.held / (draws.held @ before)
    spent = ((before - from_speed) / draws.accel + (before - after) / draws.decel + held).sum()
    waits = np.where(after == 0.0, 0.2 + draws.wait, 0.0)
    return _Plan(before, after, held, (trip.seconds - spent) * waits / waits.sum())


def _trip_rows(number: int) -> Array:
    """Return the knots of a trip, numbered from 0: time [s] from 0 and speed [m/s], shape (m, 2)."""
    trip, draws, fastest = TRIPS[number], _draws()[number], number == len(TRIPS) - 1
    low, high = LOWEST_SPEED, TOTALS.fastest
    while high - low > 1e-9:  # faster: less time held, more at rest
        level = 0.5 * (low + high)
        less = _plan(trip, draws, level, fastest).wait.sum() < WAITING * trip.seconds
        low, high = (level, high) if less else (low, level)
    plan = _plan(trip, draws, low, fastest)
    rows, t, last = [(0.0, 0.0)], 0.0, 0.0
    for k in range(trip.brakings):
        before, after = float(plan.before[k]), float(plan.after[k])
        for seconds, speed in (
            ((before - last) / draws.accel[k], before),
            (plan.held[k], before),
            ((before - after) / draws.decel[k], after),
            (plan.wait[k], after),
        ):
            if seconds > 0.0:
                t += float(seconds)
                rows.append((t, speed))
        last = after
    return np.array(rows)


@cache
def wltp_brake(trip: int | None = None) -> Array:
    """Return a trip of 1 to 10, or all of them in a row; rows of time [s] and speed [m/s], shape (n, 2)."""
    if trip is not None:
        return _trip_rows(trip - 1)
    rows, end = [np.zeros((1, 2))], 0.0
    for number, division in enumerate(TRIPS):
        rows.append(_trip_rows(number)[1:] + np.array([end, 0.0]))
        end += division.seconds
    return np.concatenate(rows)
