"""Tracks and roads of strangers' drives: laps by chance, and how their drivers take each corner in each."""

import numpy as np

from .car import Body
from .kinds import Kind
from .route import Lap, Route, Straight, drive_route, lay

MEANT = {"race": 40, "student": 80, "road": 40}  # brakings meant in a drive: not each can be judged
MOST_LAPS = 30
SLOPE = {"race": 0.022, "student": 0.006, "road": 0.02}  # root mean square, tangent


def draw_lap(track: str, rng: np.random.Generator) -> Lap:
    """Return a lap of 7 to 11 straights and corners."""
    straights = []
    for _ in range(int(rng.integers(7, 12))):
        turn = rng.choice([-1.0, 1.0])
        if track == "race":
            length = float(np.clip(rng.lognormal(np.log(230.0), 0.6), 60.0, 900.0))
            radius, angle, kerb = rng.uniform(22.0, 130.0), rng.uniform(0.6, 2.9), bool(rng.random() < 0.5)
            one = Straight(length, 90.0, radius, turn * angle, 0.0, kerb)
        elif track == "student":
            length, radius, angle = rng.uniform(30.0, 80.0), rng.uniform(6.0, 18.0), rng.uniform(1.0, 3.0)
            one = Straight(length, 40.0, radius, turn * angle, 0.0, False)
        else:
            stop = rng.uniform(4.0, 25.0) if rng.random() < 0.4 else 0.0
            length = float(np.clip(rng.lognormal(np.log(280.0), 0.5), 120.0, 900.0))
            limit = float(rng.choice([13.9, 13.9, 19.4, 27.8]))
            one = Straight(length, limit, rng.uniform(12.0, 120.0), turn * rng.uniform(0.4, 1.6), stop, False)
        straights.append(one)
    return lay(straights, SLOPE[track] * rng.uniform(0.3, 1.3), rng)


def draw_route(
    kind: Kind, body: Body, grip: float, stamps: bool, blends: bool, rng: np.random.Generator
) -> Route:
    """Return a route of as many laps as the brakings meant take.

    Args:
        kind: of the car.
        body: of the car.
        grip: peak friction of the session.
        stamps: the driver trusts a slip control and uses more of the grip.
        blends: motors do most of its brakings, so it takes twice as many.
        rng: random numbers.
    """
    lap, race = draw_lap(kind.track, rng), kind.track != "road"
    shape = (MOST_LAPS, int(lap.zone[-1]) + 1)
    corner = rng.normal(1.0, 0.06, shape[1]) * np.linspace(1.0, rng.normal(1.0, 0.05), shape[0])[:, None]
    wind, taps = rng.uniform(-8.0, 8.0), np.zeros(shape)
    if race:
        lateral = 30.0
        daring = np.clip(rng.normal(0.9 if stamps else 0.82, 0.07, shape), 0.5, 1.1)
        if rng.random() < 0.5:
            daring[0] *= rng.uniform(0.65, 0.85)  # an out-lap
        traffic = rng.random(shape) < 0.15
        decel = np.where(traffic, rng.uniform(3.0, 6.0, shape), 30.0)
        if rng.random() < 0.4:
            taps = np.where(rng.random(shape) < 0.25, rng.uniform(4.0, 18.0, shape), 0.0)
    else:
        lateral, daring, hard = rng.uniform(2.0, 4.0), np.full(shape, 0.8), rng.random(shape) < 0.08
        gentle = np.clip(rng.lognormal(0.8, 0.35, shape), 1.2, 4.5)
        decel = np.where(hard, rng.uniform(5.0, 9.0, shape), gentle)

    def of(laps: int) -> Route:
        some = slice(0, laps)
        return drive_route(
            lap,
            laps,
            grip * corner[some],
            decel[some],
            daring[some],
            lateral,
            body.lift / body.mass,
            wind,
            taps[some],
        )

    per_lap = count_brakings(of(3)) / 3.0
    meant = MEANT[kind.track] * (2 if blends else 1)
    return of(int(np.clip(np.ceil(meant / max(per_lap, 1.0)), 2, MOST_LAPS)))


def count_brakings(route: Route) -> int:
    """Return how many times a driver means to lose more than 4 m/s."""
    edges = np.diff((route.decel > 0.8).astype(int), prepend=0, append=0)
    last = len(route.speed) - 1
    return sum(
        bool(route.speed[start] - route.speed[min(end, last)] > 4.0)
        for start, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    )
