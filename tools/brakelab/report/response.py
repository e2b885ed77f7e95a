"""Build-up of pressure and balance of left and right, one row per brake application.

Build-up: from 10 to 90 % of the plateau, the median of the values above half of the highest, of the mean
pressure of an axle's callipers. The foot is part of it: the same time of the demand stands beside it.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector, median
from brakelab.report.accuracy import AXLES
from brakelab.report.brakings import Braking, inside, mean_known
from brakelab.report.drive import DriveResult
from brakelab.report.look import DEMAND, LEFT, QUIET, RIGHT, STAGE_COLOURS
from brakelab.report.per_braking import Series, points_by_braking
from brakelab.report.torque import axle_pressure
from brakelab.report.wheels import motors_share
from ecu.contract.signals import OBSERVING

BEFORE: Final = 0.5
"""s of pressure before an application that belong to its build-up."""
LEAST_BAR: Final = 5.0
"""Plateau below which times are the sensors' noise, and means of the sides are not compared."""
LOW, HIGH = 0.1, 0.9


class BuildUp(NamedTuple):
    """NaN: not known."""

    plateau: float
    """bar"""
    begins: float
    """When 10 % of it were reached, s."""
    seconds: float
    """From 10 to 90 %."""


class Response(NamedTuple):
    """One brake application; pairs are front and rear, NaN: not known."""

    number: int
    demand: float
    """Build-up of the demanded front pressure, s."""
    build_up: tuple[float, float]
    """Of the measured pressures, s."""
    delay: tuple[float, float]
    """From 10 % of the demanded pressure to 10 % of the measured one, s."""
    gradient: tuple[float, float]
    """bar/s"""
    plateau: tuple[float, float]
    """bar"""
    pressure_sides: tuple[float, float]
    """Left minus right over their mean."""
    friction_sides: tuple[float, float]
    motors: float
    """Mean part of the motors in the braking torque."""


def build_up(t: Vector, pressure: Vector) -> BuildUp:
    """Return the build-up of a pressure [bar] over the time [s], both of shape (n,)."""
    known = np.isfinite(pressure)
    t, pressure = t[known], pressure[known]
    highest = pressure.max(initial=0.0)
    if highest < LEAST_BAR:
        return BuildUp(float("nan"), float("nan"), float("nan"))
    plateau = median(pressure[pressure > 0.5 * highest])
    high = int(np.argmax(pressure >= HIGH * plateau))
    # The last crossing before it: noise around nothing crosses 10 % early.
    below = np.flatnonzero(pressure[:high] < LOW * plateau)
    if not len(below):
        return BuildUp(plateau, float("nan"), float("nan"))
    low = int(below[-1]) + 1
    begins, ends = (_crossing(t, pressure, *at) for at in ((low, LOW * plateau), (high, HIGH * plateau)))
    return BuildUp(plateau, begins, ends - begins)


def _crossing(t: Vector, pressure: Vector, row: int, level: float) -> float:
    """Return when the level was passed between the row before `row` and it."""
    first, second = float(pressure[row - 1]), float(pressure[row])
    return float(t[row - 1] + (t[row] - t[row - 1]) * (level - first) / (second - first))


def responses(drive: DriveResult, found: list[Braking]) -> list[Response]:
    """Return the rows of all brake applications."""
    share = motors_share(drive) / 100.0
    measured = [axle_pressure(drive, wheels) for wheels in AXLES.values()]
    demanded = [drive.corners("pressure_demand")[:, wheels].mean(axis=1) for wheels in AXLES.values()]
    callipers, friction = drive.corners("calliper_pressure"), drive.corners("mu_b")
    modes = np.column_stack([drive.column(f"mode_{corner}") for corner in ("fl", "fr", "rl", "rr")])
    if np.isfinite(modes).any():
        friction = np.where(modes == OBSERVING, friction, np.nan)
    rows = []
    for braking in found:
        early = inside(drive, braking, BEFORE)
        within = inside(drive, braking)
        built = [build_up(drive.t[early], pressure[early]) for pressure in measured]
        asked = [build_up(drive.t[early], pressure[early]) for pressure in demanded]
        rows.append(
            Response(
                braking.number,
                asked[0].seconds,
                _pair(*(each.seconds for each in built)),
                _pair(*(each.begins - ask.begins for each, ask in zip(built, asked, strict=True))),
                _pair(*((HIGH - LOW) * each.plateau / each.seconds for each in built)),
                _pair(*(each.plateau for each in built)),
                _pair(*(_sides(callipers[within][:, wheels], LEAST_BAR) for wheels in AXLES.values())),
                _pair(*(_sides(friction[within][:, wheels], 0.0) for wheels in AXLES.values())),
                mean_known(share[within]),
            )
        )
    return rows


def _pair(front: float, rear: float) -> tuple[float, float]:
    return front, rear


def _sides(values: Vector, least: float) -> float:
    """Return left minus right over the mean of both in the rows where both are known, shape (n, 2)."""
    known = np.isfinite(values).all(axis=1)
    if not known.any():
        return float("nan")
    left, right = values[known].mean(axis=0)
    mean = 0.5 * (left + right)
    return float((left - right) / mean) if mean > least else float("nan")


def plots_of_response(rows: list[Response]) -> dict[str, Any]:
    """Return the figures by name; empty for fewer than two brake applications."""

    def series(label: str, colour: str, marker: str, values: list[float], factor: float) -> Series:
        return Series(label, colour, marker, factor * np.array(values))

    numbers = [row.number for row in rows]
    build = [
        series("demanded", DEMAND, "dash", [row.demand for row in rows], 1e3),
        series("front", LEFT, "circle", [row.build_up[0] for row in rows], 1e3),
        series("rear", RIGHT, "triangle", [row.build_up[1] for row in rows], 1e3),
    ]
    plots = {"build-up": points_by_braking(numbers, build, "Build-up 10–90 % [ms]", 100.0)}
    pressure, friction = (
        [getattr(row, f"{name}_sides") for row in rows] for name in ("pressure", "friction")
    )
    for name, label, pairs in (("pressure", "Pressure", pressure), ("friction", "Friction", friction)):
        sides = [
            series("front", STAGE_COLOURS[0], "circle", [pair[0] for pair in pairs], 100.0),
            series("rear", STAGE_COLOURS[3], "triangle", [pair[1] for pair in pairs], 100.0),
        ]
        plots[f"sides-{name}"] = points_by_braking(numbers, sides, f"{label} left − right [%]", 10.0, QUIET)
    return {name: plot for name, plot in plots.items() if plot is not None}
