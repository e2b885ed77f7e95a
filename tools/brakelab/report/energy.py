"""Work and power of each brake: P = T omega, T the brake torque and omega the wheel's speed by its slip."""

from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector, median
from brakelab.report.brakings import Braking, inside, inside_any
from brakelab.report.drive import DriveResult
from brakelab.report.per_braking import CORNER_MARKS, Series, points_by_braking
from brakelab.results.car import Car
from ecu.contract.signals import CORNERS

SMOOTHING: Final = 0.2
"""s that a peak of power is a mean over."""


class Work(NamedTuple):
    """One brake over the drive; NaN: not known."""

    corner: str
    kilojoules: float
    share: float
    """Of the four."""
    kilowatts: float
    """Mean over the brake applications."""
    peak: float
    """kW"""
    density: float
    """Mean over the brake applications, W/mm^2 of both pads."""
    peak_density: float


def power(drive: DriveResult, car: Car) -> Vector:
    """Return the power of each brake [W], shape (n, 4); a wheel that stands takes none."""
    speed = np.abs(drive.column("vehicle_speed"))[:, np.newaxis]
    radius = np.repeat(car.radius, 2)
    turning = np.maximum(1.0 + np.nan_to_num(drive.corners("slip")), 0.0)
    return np.asarray(drive.corners("brake_torque") * speed * turning / radius)


def peaks(drive: DriveResult, found: list[Braking], watts: Vector) -> Vector:
    """Return the greatest power of each brake application, smoothed [W], shape (brake applications, 4)."""
    period = median(np.diff(drive.t))
    width = max(1, round(SMOOTHING / period))
    window = np.full(width, 1.0 / width)
    rows = np.full((len(found), len(CORNERS)), np.nan)
    for place, braking in enumerate(found):
        mine = watts[inside(drive, braking)]
        if len(mine) >= width:
            known = np.isfinite(mine).any(axis=0)
            smooth = [
                np.convolve(np.nan_to_num(mine[:, i]), window, "valid").max() for i in range(len(CORNERS))
            ]
            rows[place] = np.where(known, smooth, np.nan)
    return rows


def works(drive: DriveResult, found: list[Braking], car: Car) -> list[Work]:
    """Return the four brakes; empty without brake applications or torque."""
    watts = power(drive, car)
    known = inside_any(drive, found) & np.isfinite(watts).any(axis=1)
    if not known.any():
        return []
    period = median(np.diff(drive.t))
    mean = np.nanmean(np.where(np.isfinite(watts[known]), watts[known], 0.0), axis=0)
    known_corners = [bool(np.isfinite(one).any()) for one in watts[known].T]
    joules = np.where(known_corners, mean * period * known.sum(), np.nan)
    highest = np.fmax.reduce(peaks(drive, found, watts), axis=0)
    area = np.repeat(car.pad_area, 2)
    whole = float(np.nansum(joules))
    return [
        Work(
            corner.upper(),
            1e-3 * float(joules[i]),
            float(joules[i]) / whole if whole > 0.0 else float("nan"),
            1e-3 * float(mean[i]) if known_corners[i] else float("nan"),
            1e-3 * float(highest[i]),
            float(mean[i] / area[i]) if known_corners[i] else float("nan"),
            float(highest[i] / area[i]),
        )
        for i, corner in enumerate(CORNERS)
    ]


def plots_of_energy(drive: DriveResult, found: list[Braking], car: Car) -> dict[str, Any]:
    """Return the figures by name: work, and the greatest power or power density, per application."""
    watts = power(drive, car)
    numbers = [braking.number for braking in found]
    period = median(np.diff(drive.t))
    joules = np.array([_sum(watts[inside(drive, braking)]) * period for braking in found]).reshape(-1, 4)
    dense = bool(np.isfinite(car.pad_area).all())
    label = "Greatest power density [W/mm²]" if dense else "Greatest power [kW]"
    scale = 1.0 / np.repeat(car.pad_area, 2) if dense else np.full(4, 1e-3)
    plots = {}
    for name, values, of, least in (
        ("energy", 1e-3 * joules, "Energy of a brake [kJ]", 10.0),
        ("power", peaks(drive, found, watts) * scale, label, 0.5 if dense else 5.0),
    ):
        series = [Series(*mark, values[:, i]) for i, mark in enumerate(CORNER_MARKS)]
        if (plot := points_by_braking(numbers, series, of, least)) is not None:
            plots[name] = plot
    return plots


def _sum(watts: Vector) -> Vector:
    return np.where(np.isfinite(watts).any(axis=0), np.nansum(watts, axis=0), np.nan)
