"""Friction by speed, pressure and disc temperature, as AK-Master (SAE J2522) sorts it; fade and recovery.

A drive has no sections: its applications are sorted by the conditions of the programme's sections. Of each
braking the mean by distance, the least and the greatest friction that was observed.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector, median
from brakelab.report.accuracy import AXLES
from brakelab.report.brakings import Braking, inside
from brakelab.report.drive import DriveResult
from brakelab.report.torque import axle_pressure
from ecu.contract.signals import CORNERS, OBSERVING

SPEEDS: Final = (60.0, 100.0, 140.0, 180.0)
"""km/h, between sections from 40, 80, 120, 160 and 200 km/h."""
PRESSURES: Final = (20.0, 40.0, 60.0)
"""bar"""
TEMPERATURES: Final = (50.0, 150.0, 300.0)
"""degC: cold, as most sections (100 degC), warm, fade."""
LEAST_SPEED: Final = 5.0 / 3.6
LEAST_SECONDS: Final = 0.3
"""Of observation in a brake application that counts."""
RECOVERED: Final = 3
"""Brake applications after the hot ones that show the recovery."""


class Observed(NamedTuple):
    """Friction of one axle in one brake application."""

    number: int
    speed: float
    """At the start, km/h."""
    pressure: float
    """Mean, bar."""
    temperature: float
    """Of the discs at the start, degC; NaN: not known."""
    mean: float
    least: float
    greatest: float


class Section(NamedTuple):
    """Row of the table."""

    axle: str
    speed: str
    pressure: str
    temperature: str
    brakings: int
    mean: float
    """Of the brake applications' means."""
    least: float
    greatest: float


def observed(drive: DriveResult, found: list[Braking]) -> dict[str, list[Observed]]:
    """Return by axle the brake applications in which its friction was observed."""
    period = median(np.diff(drive.t))
    speed = np.abs(drive.column("vehicle_speed"))
    by_axle = {}
    for axle, wheels in AXLES.items():
        friction, pressure = _friction(drive, wheels), axle_pressure(drive, wheels)
        known = np.isfinite(friction) & np.isfinite(pressure) & (speed > LEAST_SPEED)
        rows = []
        for braking in found:
            within = inside(drive, braking)
            places = within.start + np.flatnonzero(known[within])
            if len(places) * period < LEAST_SECONDS:
                continue
            mu = friction[places]
            rows.append(
                Observed(
                    braking.number,
                    3.6 * abs(braking.v_in),
                    float(pressure[places].mean()),
                    float(np.mean(braking.temperature_in[wheels])),
                    float(mu @ speed[places] / speed[places].sum()),
                    float(mu.min()),
                    float(mu.max()),
                )
            )
        by_axle[axle] = rows
    return by_axle


def _friction(drive: DriveResult, wheels: slice) -> Vector:
    """Return the mean friction of an axle's wheels where it was observed, else NaN, shape (n,)."""
    friction = drive.corners("mu_b")[:, wheels]
    modes = np.column_stack([drive.column(f"mode_{corner}") for corner in CORNERS[wheels]])
    if np.isfinite(modes).any():
        friction = np.where(modes == OBSERVING, friction, np.nan)
    count = np.isfinite(friction).sum(axis=1)
    return np.where(count > 0, np.nansum(friction, axis=1) / np.maximum(count, 1), np.nan)


def sections(by_axle: dict[str, list[Observed]]) -> list[Section]:
    """Return the sections that the drive has, by axle, speed, pressure and temperature."""
    table = []
    for axle, rows in by_axle.items():
        by_class: dict[tuple[int, int, int], list[Observed]] = {}
        for row in rows:
            heat = int(np.digitize(row.temperature, TEMPERATURES)) if np.isfinite(row.temperature) else -1
            key = int(np.digitize(row.speed, SPEEDS)), int(np.digitize(row.pressure, PRESSURES)), heat
            by_class.setdefault(key, []).append(row)
        for (speed, pressure, heat), mine in sorted(by_class.items()):
            table.append(
                Section(
                    axle,
                    _class(SPEEDS, speed),
                    _class(PRESSURES, pressure),
                    _class(TEMPERATURES, heat) if heat >= 0 else "not known",
                    len(mine),
                    float(np.mean([row.mean for row in mine])),
                    min(row.least for row in mine),
                    max(row.greatest for row in mine),
                )
            )
    return table


def _class(limits: tuple[float, ...], place: int) -> str:
    if place == 0:
        return f"up to {limits[0]:.0f}"
    if place == len(limits):
        return f"above {limits[-1]:.0f}"
    return f"{limits[place - 1]:.0f} to {limits[place]:.0f}"


def fade(axle: str, rows: list[Observed]) -> str:
    """Return fade and recovery of an axle in the drive, or why it shows none."""
    known = [row for row in rows if np.isfinite(row.temperature)]
    if not known:
        return f"Fade {axle}: no disc temperature at the start of a brake application is known."
    hot = [row for row in known if row.temperature >= TEMPERATURES[2]]
    if not hot:
        hottest = max(row.temperature for row in known)
        return (
            f"Fade {axle}: not shown; discs began an application with {hottest:.0f} °C at most, "
            "and fade asks for "
            f"{TEMPERATURES[2]:.0f} °C."
        )
    cool = [row for row in known if row.temperature < TEMPERATURES[1]]
    before = [row.mean for row in cool if row.number < hot[0].number]
    if not before:
        return f"Fade {axle}: no application from below {TEMPERATURES[1]:.0f} °C came before the hot ones."
    usual, least = float(np.mean(before)), min(row.mean for row in hot)
    text = f"Fade {axle}: {usual:.3f} before, {least:.3f} at the least from {hot[0].temperature:.0f} °C up"
    text += f" ({100.0 * (least / usual - 1.0):+.0f} %)"
    after = [row.mean for row in cool if row.number > hot[-1].number][:RECOVERED]
    if not after:
        return (
            f"{text}; no application from below {TEMPERATURES[1]:.0f} °C after them: recovery is not shown."
        )
    again = float(np.mean(after))
    return f"{text}; recovery to {again:.3f} ({100.0 * (again / usual - 1.0):+.0f} %)."
