"""Dynamometer programme for wear: blocks of brake applications from road drives, run on the simulated rig.

Whole trips, their town, country and motorway parts, each by a calm and by a sporty driver: eight blocks as in
section 7.4, each with at least 250 applications. After each the pads are weighed and measured at six points.
"""

import csv
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from brakelab.arrays import Array
from brakelab.plant.draw import draw
from brakelab.plant.records import RecordArray
from brakelab.plant.wear import pad_wear
from brakelab.plant.wear_rig import SAMPLE, STEP, wear_block
from brakelab.simulation.campaigns.instruments import measure_points, weigh
from brakelab.simulation.configured import shipped
from brakelab.simulation.scenario_car import scenario_plant, scenario_widths
from brakelab.simulation.trip.generate import real_driving
from brakelab.simulation.trip.table import KMH, brakings

APPLICATIONS: Final = 300
ROADS: Final = {"trip": (0.0, 999.0), "town": (0.0, 60.0), "country": (60.0, 90.0), "motorway": (90.0, 999.0)}
"""km/h, of the speed before the application."""
DRIVERS: Final = {"calm": (1.0, 1.0), "lively": (1.5, 1.1)}
"""Factors on deceleration and speed."""
RUN_IN: Final = 15.0  # g worn off before the first block
LABORATORY: Final = 0.02  # relative, from block to block
COLUMNS: Final = ("t", "omega", "calliper_pressure", "brake_torque", "disc_temperature")
THICKNESS: Final = 12.0  # mm
PAD_MASS: Final = 450.0  # g, two pads with their plates


class WornBlock(NamedTuple):
    """A block as run."""

    name: str
    trace: Array
    """Shape (rows, 5), `COLUMNS`."""
    worn: float
    """g, true."""


@cache
def _trip_stops(seed: int) -> Array:
    """Return speeds before and after, deceleration and seconds before of all applications of a trip."""
    trip = real_driving(seed)
    found = brakings(trip.t, trip.speed, -np.gradient(trip.speed, trip.t))
    before = np.diff(found.start, prepend=0.0) - np.concatenate([[0.0], found.duration[:-1]])
    return np.column_stack((found.speed_in, found.speed_out, found.mean_decel, np.minimum(before, 120.0)))


def road_stops(road: str, driver: str, seed: int) -> Array:
    """Return speeds before and after [m/s], deceleration [m/s^2], seconds before; shape (APPLICATIONS, 4)."""
    low, high = (KMH * value for value in ROADS[road])
    harder, faster = DRIVERS[driver]
    rows: list[Array] = []
    while sum(map(len, rows)) < APPLICATIONS:
        stops = _trip_stops(seed + 100 * len(rows))
        part = (stops[:, 0] >= low) & (stops[:, 0] < high)
        rows.append(stops[part] * [faster, faster, harder, 1.0])
    return np.concatenate(rows)[:APPLICATIONS]


def drawn_car(seed: int) -> RecordArray:
    """Return the simulated SUV of a seed, shape (1,), without the variation of climate by day."""
    scenario = shipped("real-driving")
    width = scenario_widths(scenario).model_copy(update={"wear_climate": 0.0})
    return draw(scenario_plant(scenario), seed, width)


def run_block(
    car: RecordArray, wheel: int, name: str, stops: Array, worn: float, random: Generator
) -> WornBlock:
    """Run one block on the rig with the brake of `wheel`."""
    share = 0.65 if wheel < 2 else 0.35
    part = car.copy()
    part["wear_scale"] *= np.exp(LABORATORY * random.standard_normal())
    longest = np.sum((stops[:, 0] - stops[:, 1]) / stops[:, 2] + 1.0)
    trace = np.zeros((int(longest / (STEP * SAMPLE)) + 3 * len(stops), len(COLUMNS)))
    radius, mass = float(car["free_radius"][0, wheel]) - 0.01, 0.5 * share * float(car["mass"][0])
    rows, after = wear_block(part[0], wheel, mass, radius, stops, worn, trace)
    return WornBlock(name, trace[:rows], after - worn)


def programme(
    car: RecordArray, wheel: int, seed: int, roads: Sequence[str] = tuple(ROADS)
) -> list[WornBlock]:
    """Run the blocks of `roads` by both drivers."""
    random = np.random.default_rng([seed, 11])
    worn, blocks = RUN_IN, []
    for road in roads:
        for driver in DRIVERS:
            stops = road_stops(road, driver, seed)
            blocks.append(run_block(car, wheel, f"{road}-{driver}", stops, worn, random))
            worn += blocks[-1].worn
    return blocks


def write_programme(car: RecordArray, wheel: int, seed: int, folder: Path, blocks: list[WornBlock]) -> Path:
    """Write files of blocks and their manifest, measured as a laboratory can; return the manifest."""
    random = np.random.default_rng([seed, 12])
    folder.mkdir(parents=True, exist_ok=True)
    manifest = folder / "manifest.csv"
    points = [f"thickness_{when}_{k}" for when in ("before", "after") for k in range(1, 7)]
    worn = RUN_IN
    with manifest.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["block", "file", "mass_before", "mass_after", *points])
        for block in blocks:
            masses = PAD_MASS - np.array([worn, worn + block.worn])
            lost = [pad_wear(car[0]["wear_row"][wheel], PAD_MASS - mass) for mass in masses]
            shape = random.normal(0.0, 0.05, 6)  # mm, how uneven the pads are
            thick = measure_points(np.array([THICKNESS - value + shape for value in lost]), random)
            numbers = [f"{value:.3f}" for value in (*weigh(masses, random), *thick[0], *thick[1])]
            writer.writerow([block.name, f"{block.name}.csv", *numbers])
            header = ",".join(COLUMNS)
            np.savetxt(folder / f"{block.name}.csv", block.trace, "%.4f", ",", header=header, comments="")
            worn += block.worn
    return manifest
