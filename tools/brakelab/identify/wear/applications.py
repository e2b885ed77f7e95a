"""Brake applications of drives, grouped into blocks for a dynamometer (Figure 7.2).

The applications of an axle's brake come from `RESULT.brakes.parquet`, which `replay` writes; both corners
are one brake, by their mean. Those of one kind of road, the gentler half or the harder, make a block. The rig
runs a block in steps: groups of applications much alike,

    v_in = sqrt(mean (v_in^2 - v_end^2) + v_end^2), v_end, tau_in: means;  a = (v_in - v_end) / mean duration

so that a group does the work and takes the time of its applications. The group that varies most is divided,
at the mean of what varies most in it, until there are `STEPS`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Array
from brakelab.results.files import brakes_path, read_result
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

KMH: Final = 1.0 / 3.6  # m/s
ROADS: Final = {"trip": (0.0, 999.0), "town": (0.0, 60.0), "country": (60.0, 90.0), "motorway": (90.0, 999.0)}
"""km/h, of the speed before the application, as in section 7.4."""
HALVES: Final = ("gentle", "hard")
STEPS: Final = 24
FEWEST_APPLICATIONS: Final = 20
"""Applications that stand for a kind of road."""
SMALLEST_GROUP: Final = 4
LEAST_DROP: Final = 1.0  # m/s
LEAST_WORK: Final = 500.0  # J: below it, motors or drag slowed the car
HIGHEST_SPEED: Final = 90.0  # m/s
UNITS: Final = np.array([5.0, 5.0, 0.5, 25.0])
"""m/s, m/s, m/s^2, K by which `Applications` vary alike."""
NEEDED: Final = ("brake", "corner", "v_in", "v_end", "duration", "brake_energy", "disc_temperature_in",
                 "mu_b_mean")  # fmt: skip


class Applications(NamedTuple):
    """Brake applications at one brake; each of shape (n,)."""

    speed_in: Array
    """m/s"""
    speed_end: Array
    seconds: Array
    energy: Array
    """J"""
    heat: Array
    """Of the disc at the start, degC."""
    friction: Array
    """NaN: not known."""

    @property
    def decel(self) -> Array:
        """Return the mean deceleration [m/s^2]."""
        return np.asarray((self.speed_in - self.speed_end) / self.seconds)

    @property
    def kinetic(self) -> Array:
        """Return what the speeds lose of v^2 / 2 [J/kg]."""
        return np.asarray(0.5 * (self.speed_in**2 - self.speed_end**2))

    def part(self, chosen: NDArray[Any]) -> "Applications":
        """Return those of a mask or of places."""
        return Applications(*(values[chosen] for values in self))


class Step(NamedTuple):
    """A number of equal applications on the rig."""

    times: int
    speed_in: float  # m/s
    speed_end: float  # m/s
    decel: float  # m/s^2
    heat: float  # degC, at the start


class RoadBlock(NamedTuple):
    """Applications of one kind, and what stands for them on the rig."""

    name: str
    road: Applications
    steps: list[Step]

    @property
    def applications(self) -> int:
        """Return the number of applications on the rig."""
        return sum(step.times for step in self.steps)


def read_drives(drives: Sequence[Path], axle: str) -> tuple[Applications, int]:
    """Return the brake applications of an `axle` in results of `replay`, and how many say too little.

    Raises:
        UserError: a drive is no result of replay, has no brake application, or is given twice.
    """
    found, left_out = [], 0
    for place, drive in enumerate(drives):
        if drive.resolve() in {before.resolve() for before in drives[:place]}:
            raise UserError(str(drive), "", "is given twice; a drive counts once")
        one, silent = _of_drive(drive, axle)
        found.append(one)
        left_out += silent
    joined = Applications(*(np.concatenate(values) for values in zip(*found, strict=True)))
    if len(joined.energy) < FEWEST_APPLICATIONS:
        remedy = (
            f"{len(joined.energy)} brake applications in which its linings worked and the disc's temperature "
            f"is known; {FEWEST_APPLICATIONS} or more stand for a kind of road: give more drives"
        )
        raise UserError(str(drives[0]), axle, remedy)
    return joined, left_out


def _of_drive(drive: Path, axle: str) -> tuple[Applications, int]:
    table = brakes_path(drive)
    if drive.suffix != ".parquet" or not table.is_file():
        missing = f"{table.name} is not beside it" if drive.suffix == ".parquet" else "is no result"
        remedy = f"{missing}; `brake-ecu replay LOG --config CAR.toml --out DRIVE.parquet` makes both"
        raise UserError(str(drive), "", remedy)
    columns = read_result(table).columns
    if lacking := [name for name in NEEDED if name not in columns]:
        remedy = "no such column; give results of `brake-ecu replay`"
        raise UserError(str(table), lacking[0], remedy)
    corners = CORNERS[:2] if axle == "front" else CORNERS[2:]
    sides = [columns["corner"] == corner for corner in corners]
    both = [
        np.asarray(0.5 * (columns[name][sides[0]] + columns[name][sides[1]]), np.float64)
        for name in ("v_in", "v_end", "duration", "brake_energy", "disc_temperature_in", "mu_b_mean")
    ]
    every = Applications(*both)
    known = np.isfinite(np.array(both[:5])).all(axis=0)
    with np.errstate(invalid="ignore"):
        worked = (every.speed_in - every.speed_end > LEAST_DROP) & (every.energy > LEAST_WORK)
        sane = (every.seconds > 0.0) & (every.speed_in < HIGHEST_SPEED)
    return every.part(known & worked & sane), int(np.count_nonzero(~known | ~sane))


def road_blocks(road: Applications, count: int) -> list[RoadBlock]:
    """Return blocks of `count` applications each, for every kind of road that the drives have."""
    blocks = []
    for name, (low, high) in ROADS.items():
        here = road.part((road.speed_in >= low * KMH) & (road.speed_in < high * KMH))
        if len(here.energy) < 2 * FEWEST_APPLICATIONS:
            continue
        harder = here.decel > np.median(here.decel)
        for half, chosen in zip(HALVES, (~harder, harder), strict=True):
            part = here.part(chosen)
            if len(part.energy) >= FEWEST_APPLICATIONS:
                blocks.append(RoadBlock(f"{name}-{half}", part, steps_of(part, count)))
    return blocks or [RoadBlock("trip", road, steps_of(road, count))]


def steps_of(road: Applications, count: int) -> list[Step]:
    """Return `count` applications that stand for those of the road, coolest first."""
    places = np.column_stack([road.speed_in, road.speed_end, road.decel, road.heat]) / UNITS
    groups = [np.arange(len(places))]
    while len(groups) < STEPS:
        spread = [len(group) * places[group].var(axis=0) for group in groups]
        divisible = [len(group) >= 2 * SMALLEST_GROUP for group in groups]
        width = np.where(divisible, np.max(spread, axis=1), 0.0)
        widest = int(np.argmax(width))
        if not width[widest] > 0.0:
            break
        group = groups.pop(widest)
        values = places[group, int(np.argmax(spread[widest]))]
        order = group[np.argsort(values, kind="stable")]
        cut = int(np.count_nonzero(values <= values.mean()))
        cut = min(max(cut, SMALLEST_GROUP), len(order) - SMALLEST_GROUP)
        groups += [order[:cut], order[cut:]]
    share = np.array([len(group) for group in groups]) * count / len(places)
    times = np.floor(share).astype(int)
    times[np.argsort(times - share, kind="stable")[: count - times.sum()]] += 1
    steps = [_step(road.part(group), int(n)) for group, n in zip(groups, times, strict=True) if n]
    return sorted(steps, key=lambda step: step.heat)


def _step(part: Applications, times: int) -> Step:
    end = float(part.speed_end.mean())
    first = float(np.sqrt(2.0 * part.kinetic.mean() + end**2))
    decel = (first - end) / float(part.seconds.mean())
    return Step(times, first, end, decel, float(part.heat.mean()))
