"""A trip of some 100 minutes as real driving has it: speed and grade, drawn from a seed.

The trip goes through a town, over country roads and along a motorway. Each road is a chain of legs: the
driver accelerates to the admissible speed, holds it as traffic permits, releases the accelerator and brakes
for the end of the leg (a light, a junction, a bend, a queue). Accelerations are trapezia with limited jerk.
Every trip meets Table 1.1: as on the road, one that violates a row is discarded and repeated.

```
python -m brakelab.simulation.trip.generate [--seed N] [--svg PICTURE.svg] [DRIVE.truth.parquet…]
```
prints the trip of a seed, or a drive of the simulated car that followed it, beside Tables 1.1 and 1.2; of
several drives applications and wear by road, with 2σ of the drivers (Figure 7.4).
"""

import argparse
import math
import signal
import sys
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from brakelab.arrays import Array
from brakelab.report.drive import DriveResult, read_drive
from brakelab.simulation.trip import report as trip_report
from brakelab.simulation.trip.picture import write_picture
from brakelab.simulation.trip.table import KMH, Brakings, brakings, distance_driven, trip_rows
from ecu.errors import UserError

DT: Final = 0.1  # s, of the samples
# Assumptions, as all figures of roads and driver below.
COAST: Final = 0.35  # m/s^2, accelerator released
COAST_SECONDS: Final = (1.0, 5.0)  # before the brake is touched
BRAKE_JERK: Final = 2.0  # m/s^3
DRIVE_JERK: Final = 1.0  # m/s^3
STRONGEST_BRAKING: Final = 4.0  # m/s^2
UNEVEN: Final = 0.025  # of the speed, standard deviation added by traffic while it is held
STEEPEST_GRADE: Final = 0.08  # rad
SHORTEST_LEG: Final = 60.0  # m


class Cycle(NamedTuple):
    """A trip to be driven."""

    t: Array
    """s, every `DT` from 0; shape (n,)"""
    speed: Array
    """m/s, at standstill exactly 0; shape (n,)"""
    grade: Array
    """Rows of distance [m] and grade [rad], uphill positive, linear in between; shape (rows, 2). They go on
    beyond the trip's end."""

    def grade_by_time(self) -> Array:
        """Return the grade [rad] at each `t` for a car that follows the speed; shape (n,)."""
        place = distance_driven(self.t, self.speed)
        return np.asarray(np.interp(place, self.grade[:, 0], self.grade[:, 1]))


class _End(NamedTuple):
    """End of a leg."""

    share: float
    speed: tuple[float, float]
    """km/h, at which it is passed; (0, 0) is a stop."""
    wait: tuple[float, float] = (0.0, 0.0)
    """s"""


class _Road(NamedTuple):
    """Kind of road, of a length with which the parts of the trip, by speed, come near Table 1.1."""

    length: float
    """m"""
    leg: float
    """m, mean"""
    allowed: tuple[float, ...]
    """km/h, one for each leg"""
    ends: tuple[_End, ...]
    hilly: float
    """rad, standard deviation of the grade"""


LIGHT: Final = _End(0.30, (0.0, 0.0), (8.0, 48.0))
QUEUE: Final = _End(0.10, (0.0, 0.0), (2.0, 12.0))
TURN: Final = _End(0.29, (12.0, 22.0))
ROUNDABOUT: Final = _End(0.31, (20.0, 35.0))
TOWN: Final = _Road(
    29_200.0, 420.0, (30.0, 40.0, 50.0, 50.0, 50.0, 50.0), (LIGHT, QUEUE, TURN, ROUNDABOUT), 0.026
)
COUNTRY: Final = _Road(
    32_600.0,
    1600.0,
    (70.0, 80.0, 80.0, 85.0),
    (_End(0.55, (50.0, 65.0)), _End(0.35, (20.0, 32.0)), _End(0.10, (0.0, 0.0), (3.0, 20.0))),
    0.042,
)
FREEWAY: Final = _Road(
    23_800.0, 3600.0, (107.0, 112.0, 116.0), (_End(0.5, (80.0, 92.0)), _End(0.5, (95.0, 105.0))), 0.022
)


class _Driver(NamedTuple):
    """Braking and acceleration of a driver."""

    braking: float
    """m/s^2, median of the plateau"""
    scatter: float
    """-, standard deviation of its logarithm"""
    lively: float
    """Factor on the acceleration."""


@dataclass
class _Trace:
    """Speed trace under construction."""

    pieces: list[Array] = field(default_factory=lambda: [np.zeros(1)])
    distance: float = 0.0

    @property
    def speed(self) -> float:
        return float(self.pieces[-1][-1])

    def add(self, *pieces: Array) -> None:
        for piece in pieces:
            if len(piece):
                self.distance += _length(self.speed, piece)
                self.pieces.append(piece)


def _length(start: float, piece: Array) -> float:
    return float(DT * (piece.sum() + 0.5 * (start - piece[-1]))) if len(piece) else 0.0


def _along(start: float, end: float, seconds: list[float], accel: list[float]) -> Array:
    """Return speeds every DT after `start` up to `end`.

    The acceleration runs linearly through `accel`, `seconds` apart, up to a factor near 1; time is stretched
    to a whole number of samples.
    """
    knots = np.concatenate([[0.0], np.cumsum(seconds)])
    grid = np.linspace(0.0, knots[-1], max(math.ceil(knots[-1] / DT), 2) + 1)
    a = np.interp(grid, knots, accel)
    gained = np.cumsum(a[1:] + a[:-1])
    piece: Array = start + (end - start) * gained / gained[-1]
    piece[-1] = end
    return piece


def _ramp(start: float, end: float, peak: float, jerk: float) -> Array:
    """Return a change of speed with at most `peak` [m/s^2]; a small one stays below it."""
    change = abs(end - start)
    if change == 0.0:
        return np.empty(0)
    peak = min(peak, math.sqrt(change * jerk))
    rise = peak / jerk
    return _along(start, end, [rise, change / peak - rise, rise], [0.0, peak, peak, 0.0])


def _brake(start: float, end: float, plateau: float, coast: float) -> Array:
    """Return a brake application with `plateau` [m/s^2] after `coast` [s]; a small one has neither."""
    rises = [COAST / BRAKE_JERK, (plateau - COAST) / BRAKE_JERK, plateau / BRAKE_JERK]
    lost = COAST * (0.5 * rises[0] + coast) + 0.5 * (COAST + plateau) * rises[1] + 0.5 * plateau * rises[2]
    held = (start - end - lost) / plateau
    if held <= 0.0:
        return _ramp(start, end, plateau, BRAKE_JERK)
    seconds = [rises[0], coast, rises[1], held, rises[2]]
    return _along(start, end, seconds, [0.0, COAST, COAST, plateau, plateau, 0.0])


def _cruise(rng: Generator, speed: float, metres: float) -> Array:
    """Return a speed held for about `metres`, with fluctuations of some 25 s."""
    seconds = metres / speed
    swells = max(round(seconds / 25.0), 1)
    samples = round(seconds / swells / DT)
    shape = np.sin(np.pi * np.arange(1, samples + 1) / samples) ** 2
    most = 0.01 * (samples * DT) ** 2  # m/s: keeps a short swell flat, 0.2 m/s^3
    heights = np.clip(UNEVEN * speed * rng.standard_normal(swells), -most, most)
    return np.asarray(speed + np.outer(heights, shape).ravel())


def _leg(trace: _Trace, rng: Generator, driver: _Driver, metres: float, allowed: float, end: float) -> None:
    """Drive about `metres` at up to `allowed` and arrive with `end` [m/s]."""
    start = trace.speed
    plateau = min(driver.braking * math.exp(driver.scatter * rng.standard_normal()), STRONGEST_BRAKING)
    coast = rng.uniform(*COAST_SECONDS)
    slowest = max(start, end)
    held = max(allowed * rng.normal(1.0, 0.04), slowest)
    while True:
        peak = driver.lively * max(1.7 - 0.02 * (start + held), 0.6)
        up = _ramp(start, held, peak, DRIVE_JERK)
        down = _brake(held, end, plateau, coast)
        rest = metres - _length(start, up) - _length(held, down)
        if rest > 0.0 or held <= slowest:
            break
        held = max(0.95 * held, slowest)
    trace.add(up, _cruise(rng, held, max(rest, 0.0)), down)


def _drive_road(trace: _Trace, rng: Generator, driver: _Driver, road: _Road) -> None:
    """Drive along a road, leg by leg."""
    shares = [end.share for end in road.ends]
    until = trace.distance + road.length
    while trace.distance < until:
        end = road.ends[rng.choice(len(shares), p=shares)]
        allowed = KMH * rng.choice(road.allowed)
        metres = max(road.leg * rng.gamma(2.0, 0.5), SHORTEST_LEG)
        metres = min(metres, max(until - trace.distance, SHORTEST_LEG))
        _leg(trace, rng, driver, metres, allowed, KMH * rng.uniform(*end.speed))
        if end.speed[1] == 0.0:
            trace.add(np.zeros(round(rng.uniform(*end.wait) / DT)))
        if end is QUEUE:  # and forward by a few cars
            for _ in range(rng.integers(1, 4)):
                _leg(trace, rng, driver, rng.uniform(12.0, 50.0), KMH * rng.uniform(10.0, 20.0), 0.0)
                trace.add(np.zeros(round(rng.uniform(*end.wait) / DT)))


def _hills(rng: Generator, parts: list[tuple[float, float]]) -> Array:
    """Return rows of distance and grade: `parts` give where each road ends [m] and how hilly it is [rad]; the
    trip ends as high as it began."""
    rows = [(0.0, 0.0)]
    while rows[-1][0] < parts[-1][0]:
        place = rows[-1][0] + rng.uniform(300.0, 1000.0)
        hilly = next((hilly for end, hilly in parts if place <= end), parts[-1][1])
        rows.append((place, hilly * rng.standard_normal()))
    table = np.array(rows)
    steps, means = np.diff(table[:, 0]), 0.5 * (table[1:, 1] + table[:-1, 1])
    table[:, 1] = np.clip(table[:, 1] - steps @ means / table[-1, 0], -STEEPEST_GRADE, STEEPEST_GRADE)
    return table


def _trip(rng: Generator) -> Cycle:
    driver = _Driver(rng.uniform(1.67, 1.90), rng.uniform(0.26, 0.36), rng.uniform(0.85, 1.05))
    trace = _Trace()
    trace.add(np.zeros(round(rng.uniform(5.0, 20.0) / DT)))
    parts = []
    for road in (TOWN, COUNTRY, FREEWAY):
        _drive_road(trace, rng, driver, road)
        parts.append((trace.distance, road.hilly))
        if road is not TOWN:  # a slip road, up to the motorway or down from it
            _leg(trace, rng, driver, 500.0, KMH * 70.0, KMH * 50.0)
    _leg(trace, rng, driver, 400.0, KMH * 50.0, 0.0)
    trace.add(np.zeros(round(rng.uniform(5.0, 20.0) / DT)))
    speed = np.concatenate(trace.pieces)
    hills = _hills(rng, [*parts, (trace.distance + 1000.0, 0.0)])
    return Cycle(np.linspace(0.0, DT * (len(speed) - 1), len(speed)), speed, hills)


def real_driving(seed: int) -> Cycle:
    """Return the trip of a seed: about 87 km in 100 min that meets every row of Table 1.1 (section 1.3)."""
    trips = (_trip(np.random.default_rng([seed, attempt])) for attempt in count())
    return next(
        trip for trip in trips if all(row.met for row in trip_rows(trip.t, trip.speed, trip.grade_by_time()))
    )


def _read(path: Path) -> DriveResult:
    drive = read_drive(path, trip_report.DRIVE_COLUMNS, "give the truth of a simulated drive")
    if not drive.columns["vehicle_speed"].max() > 0.0:
        raise UserError(str(path), "vehicle_speed", "never above 0; give a car that moves")
    return drive


def _brakings(drive: DriveResult) -> Brakings:
    speed = drive.columns["vehicle_speed"]
    return brakings(drive.t, speed, -np.gradient(speed, drive.t))


def main(argv: list[str] | None = None) -> int:
    """Print, and draw, a trip or a drive; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m brakelab.simulation.trip.generate",
        description="A trip beside the thesis' Tables 1.1 and 1.2.",
    )
    parser.add_argument(
        "drive",
        nargs="*",
        type=Path,
        help="NAME.truth.parquet of a car that followed it; several: by road, ± 2σ",
    )
    parser.add_argument("--seed", type=int, default=1, help="of the trip, from 0 on")
    parser.add_argument("--svg", type=Path, metavar="FILE", help="where to draw it")
    arguments = parser.parse_args(argv)
    try:
        if arguments.seed < 0:
            raise UserError("--seed", str(arguments.seed), "give a whole number from 0 on")
        drives = [_read(path) for path in arguments.drive]
        if len(drives) > 1:
            print("\n".join(trip_report.spread_lines([(drive, _brakings(drive)) for drive in drives])))
            return 0
        trip = real_driving(arguments.seed)
        t, speed, grade = trip.t, trip.speed, trip.grade_by_time()
        lines = [f"Trip of seed {arguments.seed}", ""]
        discs = np.empty((len(t), 0))  # none are known
        for drive in drives:
            t, speed, grade = drive.t, drive.columns["vehicle_speed"], drive.columns["grade"]
            discs = drive.corners("disc_temperature")
            lines = [f"{arguments.drive[0].name} beside the trip of seed {arguments.seed}"]
            lines += [trip_report.follow_line(t, speed, trip.t, trip.speed), ""]
            lines += [*trip_report.brake_lines(drive), ""]
        found = brakings(t, speed, -np.gradient(speed, t))
        lines += [*trip_report.trip_lines(t, speed, grade, found), ""]
        lines += [*trip_report.part_lines(t, speed, discs, found), ""]
        for drive in drives:
            lines += [*trip_report.friction_lines(drive, found), ""]
        print("\n".join([*lines, *trip_report.braking_lines(found)]))
        if arguments.svg is not None:
            write_picture(arguments.svg, t, speed, grade, discs)
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # as `| head` needs it
    raise SystemExit(main())
