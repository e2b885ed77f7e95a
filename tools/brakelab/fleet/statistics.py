"""Statistics of a fleet: over its vehicles, over weeks, and outliers.

A vehicle stands out by its distance from the median of the vehicles with the same configuration, in units of
their spread, (x − median) / (1.4826 · median |x − median|); 3.5 is the usual limit (Iglewicz and Hoaglin,
1993).
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector

Summary = Mapping[str, Any]

WEEK_NS: Final = 7 * 86_400 * 10**9
MONDAY_NS: Final = 4 * 86_400 * 10**9  # 5 January 1970
LEVELS: Final = (5.0, 25.0, 50.0, 75.0, 95.0)
LIMIT: Final = 3.5
LEAST_VEHICLES: Final = 5
"""Of one configuration, below which none of them stands out."""
LEAST_METRES: Final = 500.0
"""A drive below says nothing about energy per distance."""


class Quantity(NamedTuple):
    """Quantity by which vehicles are compared."""

    name: str
    title: str
    digits: int
    scale: float
    """Of the page's unit."""


QUANTITIES: Final = (
    Quantity("mu_b_front", "Friction front [-]", 3, 1.0),
    Quantity("mu_b_rear", "Friction rear [-]", 3, 1.0),
    Quantity("prediction_bias", "Prediction error [%]", 1, 100.0),
    Quantity("energy_per_distance", "Brake energy [kJ/km]", 0, 1.0),
)


class Vehicles(NamedTuple):
    """The vehicles of a fleet."""

    names: list[str]
    groups: list[str]
    """Hash of the configuration of the last drive."""
    drives: NDArray[np.int64]
    values: dict[str, Vector]
    """Median over a vehicle's drives by quantity, NaN: not known; shape (vehicles,)."""


class Outlier(NamedTuple):
    """Vehicle that stands out by one quantity."""

    vehicle: str
    drives: int
    quantity: Quantity
    value: float
    usual: float
    """Median of its group."""
    score: float


class Note(NamedTuple):
    """A note on one drive."""

    vehicle: str
    drive: str
    lines: list[str]


class Weeks(NamedTuple):
    """A quantity over weeks."""

    start_ms: Vector
    """Monday 00:00 UTC since 1970, shape (weeks,)."""
    drives: NDArray[np.int64]
    quantiles: Vector
    """At `LEVELS`, shape (weeks, 5)."""


def values_of(done: Sequence[Summary], name: str) -> Vector:
    """Return a quantity of each drive, NaN where unknown, shape (drives,)."""
    if name == "energy_per_distance":
        return np.array(
            [
                row["brake_energy"] / row["distance"] if row["distance"] >= LEAST_METRES else np.nan
                for row in done
            ]
        )
    return np.array([np.nan if row[name] is None else row[name] for row in done], np.float64)


def per_vehicle(done: Sequence[Summary]) -> Vehicles:
    """Return the vehicles of completed drives."""
    names = list(dict.fromkeys(row["vehicle"] for row in done))
    place = {name: k for k, name in enumerate(names)}
    owner = np.array([place[row["vehicle"]] for row in done], np.int64)
    last = {row["vehicle"]: row["config_hash"] for row in done}
    values = {}
    for quantity in QUANTITIES:
        column = values_of(done, quantity.name)
        known = np.isfinite(column)
        order = np.lexsort((column[known], owner[known]))
        parts = np.split(column[known][order], np.searchsorted(owner[known][order], np.arange(1, len(names))))
        values[quantity.name] = np.array([np.median(part) if len(part) else np.nan for part in parts])
    return Vehicles(names, [last[name] for name in names], np.bincount(owner, minlength=len(names)), values)


def outliers(vehicles: Vehicles) -> list[Outlier]:
    """Return the vehicles that stand out, the farthest first; one may do so by several quantities."""
    groups = np.array(vehicles.groups)
    found = []
    for quantity in QUANTITIES:
        column = vehicles.values[quantity.name]
        for group in dict.fromkeys(vehicles.groups):
            members = np.flatnonzero((groups == group) & np.isfinite(column))
            if len(members) < LEAST_VEHICLES:
                continue
            usual = float(np.median(column[members]))
            spread = 1.4826 * float(np.median(np.abs(column[members] - usual)))
            for k in members if spread > 0.0 else ():
                score = float(column[k] - usual) / spread
                if abs(score) > LIMIT:
                    drives = int(vehicles.drives[k])
                    found.append(Outlier(vehicles.names[k], drives, quantity, float(column[k]), usual, score))
    return sorted(found, key=lambda outlier: -abs(outlier.score))


def lines_of(row: Summary, column: str) -> list[str]:
    """Return the lines of `fault` or `notes` without the names of the logs, implied by the drive's."""
    text = row[column]
    for log in row["logs"].splitlines():
        text = text.replace(f"{log}: ", "")
    return list(text.splitlines())


def notes(done: Sequence[Summary]) -> list[Note]:
    """Return the peculiarities of a drive's logs, not shared by more than half of the vehicle's drives."""
    drives = Counter(row["vehicle"] for row in done)
    times = Counter((row["vehicle"], line) for row in done for line in set(lines_of(row, "notes")))
    found = []
    for row in done:
        name = row["vehicle"]
        lines = [line for line in lines_of(row, "notes") if 2 * times[name, line] <= drives[name]]
        if lines:
            found.append(Note(name, row["drive"], lines))
    return found


def by_week(done: Sequence[Summary], name: str) -> Weeks:
    """Return the spread of a quantity over the drives of each week that has any with a known start."""
    start = np.array([row["start_time"] or -1 for row in done], np.int64)
    values = values_of(done, name)
    known = (start >= 0) & np.isfinite(values)
    week = (start[known] - MONDAY_NS) // WEEK_NS
    weeks, drives = np.unique(week, return_counts=True)
    quantiles = np.array([np.percentile(values[known][week == one], LEVELS) for one in weeks]).reshape(-1, 5)
    start_ms = np.asarray((weeks * WEEK_NS + MONDAY_NS) * 1e-6, np.float64)
    return Weeks(start_ms, drives.astype(np.int64), quantiles)
