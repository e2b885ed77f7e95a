"""Wear and dust by kind of road: town, country, motorway, separated by speed.

A moment belongs to the kind of the highest speed within `AROUND` before or after it, so that a junction in
the country is country, and half an hour's jam is town. The limits are those of real-driving emission tests
(Regulation (EU) 2017/1151, annex IIIA: 60 and 90 km/h).
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector, median
from brakelab.report.accuracy import AXLES
from brakelab.report.drive import DriveResult
from brakelab.report.wear_applications import Application

KINDS: Final = (("town", 60.0), ("country", 90.0), ("motorway", float("inf")))
"""Name and highest speed [km/h]."""
AROUND: Final = 60.0  # s
LEAST_KM: Final = 1.0  # km of a kind, below which nothing is said per distance


class Road(NamedTuple):
    """One kind of road in a drive; NaN: not known."""

    name: str
    speeds: str
    km: float
    brakings: int
    kilojoules: float
    """Of friction per km, all brakes."""
    front: float
    """Wear in mm per 1,000 km, mean of left and right."""
    rear: float
    mass: float
    """Of particles, mg per km."""


def distance(drive: DriveResult) -> Vector:
    """Return the distance from the start of the drive [m], shape (n,)."""
    step = np.diff(drive.t, prepend=drive.t[0])
    return np.asarray(np.cumsum(np.nan_to_num(np.abs(drive.column("vehicle_speed"))) * step))


def kinds(drive: DriveResult) -> NDArray[np.int64]:
    """Return the place in `KINDS` of each row, shape (n,)."""
    speed = 3.6 * np.nan_to_num(np.abs(drive.column("vehicle_speed")))
    around, rows = int(AROUND / median(np.diff(drive.t))), np.arange(len(speed))
    first, end = np.maximum(rows - around, 0), np.minimum(rows + around + 1, len(speed))
    kind = np.zeros(len(speed), np.int64)
    for _, limit in KINDS:
        faster = np.cumsum(np.append(0, speed > limit))
        kind += faster[end] > faster[first]
    return kind


def roads(drive: DriveResult, applications: list[Application]) -> list[Road]:
    """Return a row for each kind of road with `LEAST_KM` or more, none without wear."""
    if not any(drive.has(f"pad_wear_{corner}") for corner in ("fl", "fr", "rl", "rr")):
        return []
    kind, driven = kinds(drive), np.diff(distance(drive), prepend=0.0) * 1e-3
    worn = np.diff(drive.corners("pad_wear"), axis=0, prepend=drive.corners("pad_wear")[:1])
    at = kind[np.clip(np.searchsorted(drive.t, [each.t_start for each in applications]), 0, len(kind) - 1)]
    found, low = [], 0.0
    for place, (name, high) in enumerate(KINDS):
        rows, own = kind == place, [a for a, k in zip(applications, at, strict=True) if k == place]
        km = float(driven[rows].sum())
        speeds = f"up to {high:.0f} km/h" if low == 0.0 else f"above {low:.0f} km/h"
        if low and np.isfinite(high):
            speeds = f"{low:.0f} to {high:.0f} km/h"
        low = high
        if km < LEAST_KM:
            continue
        front, rear = (1e3 * float(worn[rows][:, axle].sum(axis=0).mean()) / km for axle in AXLES.values())
        energy = 1e-3 * sum(each.energy for each in own) / km if applications else float("nan")
        mass = sum(each.mass for each in own) / km if applications else float("nan")
        found.append(Road(name, speeds, km, len(own), energy, front, rear, mass))
    return found
