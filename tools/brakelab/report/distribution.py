"""Brake force of the axles beside the ideal distribution and what Annex 5 of ECE R13-H forbids.

F = (brake torque + braking motor torque) / rolling radius of an axle, as the ECU estimates the torques; the
braking rate is z = (F_front + F_rear) / (m g) with the mass of CONFIG. Ideal: F_front / F = (l_r + z h) / L.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from bokeh.models import ColumnDataSource, Range1d

from brakelab.arrays import Vector
from brakelab.report.brakings import Braking, inside_any
from brakelab.report.cloud import binned, draw_dots, draw_true_mean, thinned
from brakelab.report.drive import DriveResult
from brakelab.report.look import DEGRADED, DEMAND, ESTIMATE, GRID, QUIET, free_figure
from brakelab.results.car import RATES, Car
from brakelab.stretches import stretches
from ecu.contract.params import GRAVITY
from ecu.settings.annex5_picture import forbidden

POINTS: Final = 900
LEAST_RATE: Final = 0.05
"""Below it the share is noise of the sensors."""
_LEAST_ROWS: Final = 50
_SHARES: Final = np.arange(0.300, 1.0001, 0.005)
_STEP: Final = 0.02  # of the braking rate


class Forces(NamedTuple):
    """Brake forces of the axles over the weight of the car, shape (n,)."""

    front: Vector
    rear: Vector


def plots_of_distribution(
    drive: DriveResult, truth: DriveResult | None, found: list[Braking], car: Car
) -> dict[str, Any]:
    """Return the two figures by name, empty where no brake application shows it."""
    forces = forces_of(drive, car)
    z = forces.front + forces.rear
    places = np.flatnonzero(inside_any(drive, found) & (z >= LEAST_RATE))  # NaN is not
    if len(places) < _LEAST_ROWS:
        return {}
    some = thinned(places, POINTS)
    source = ColumnDataSource(
        {
            "z": z[some].astype("f4"),
            "share": (100.0 * forces.front[some] / z[some]).astype("f4"),
            "front": forces.front[some].astype("f4"),
            "rear": forces.rear[some].astype("f4"),
        }
    )
    end = max(0.5, min(1.2, 1.15 * float(z[some].max())))
    true = None
    if truth is not None and truth.has("brake_torque_fl"):
        true_forces = forces_of(truth, car)
        rate = true_forces.front[places] + true_forces.rear[places]
        true = binned(rate, 100.0 * true_forces.front[places] / np.where(rate > LEAST_RATE, rate, np.nan))
    return {"distribution": _shares(car, source, end, true), "forces": _forces(car, source, end)}


def forces_of(drive: DriveResult, car: Car) -> Forces:
    """Return the brake forces of the axles over the weight; driving motors count against them."""
    torque = drive.corners("brake_torque") + np.nan_to_num(drive.corners("motor_torque"))
    weight = car.mass * GRAVITY
    return Forces(
        np.asarray(torque[:, :2].sum(axis=1) / (car.radius[0] * weight)),
        np.asarray(torque[:, 2:].sum(axis=1) / (car.radius[1] * weight)),
    )


def ideal_share(car: Car, z: Vector) -> Vector:
    """Return the front share at which both axles use the same adhesion, 0 to 1."""
    return np.asarray(np.clip((car.rear_axle + z * car.cog_height) / car.wheelbase, 0.0, 1.0))


def forbidden_stretches(car: Car, end: float) -> dict[str, list[float]]:
    """Return rectangles of braking rate and front share [%] that Annex 5 forbids in any state of load."""
    found: dict[str, list[float]] = {"left": [], "right": [], "bottom": [], "top": []}
    sizes = {"mass": car.mass, "wheelbase": car.wheelbase}
    half = 0.5 * (_SHARES[1] - _SHARES[0])
    for z in np.arange(0.5 * _STEP, end, _STEP):
        wrong = np.any([forbidden(sizes, float(z), load, _SHARES) for load in car.loads], axis=0)
        for first, after in stretches(wrong):
            found["left"].append(round(float(z) - 0.5 * _STEP, 3))
            found["right"].append(round(min(float(z) + 0.5 * _STEP, end), 3))
            found["bottom"].append(round(100.0 * float(_SHARES[first] - half), 2))
            found["top"].append(round(100.0 * float(_SHARES[after - 1] + half), 2))
    return found


def _shares(car: Car, source: ColumnDataSource, end: float, true: tuple[Vector, Vector] | None) -> Any:
    low = min(float(np.percentile(source.data["share"], 1)), 100.0 * float(ideal_share(car, RATES).min()))
    spans: dict[str, Any] = {
        "x_range": Range1d(start=0.0, end=end),
        "y_range": Range1d(start=max(30.0, low - 8.0), end=100.0),
    }
    plot = free_figure("Braking rate z [-]", "Front share [%]", **spans)
    stretches = forbidden_stretches(car, end)
    if stretches["left"]:
        look: dict[str, Any] = {"fill_color": DEGRADED, "fill_alpha": 0.22, "line_color": None}
        sides, label = ("left", "right", "bottom", "top"), "forbidden by Annex 5"
        plot.quad(*sides, source=ColumnDataSource(stretches), legend_label=label, **look)
    draw_dots(plot, "z", "share", ESTIMATE, 0.4, "this drive", source=source)
    shown = end >= RATES
    rates, control = RATES[shown], 100.0 * np.array(car.share)[shown]
    _draw_laws(plot, (rates, control), (rates, 100.0 * ideal_share(car, rates)))
    if true is not None:
        draw_true_mean(plot, *true)
    return plot


def _forces(car: Car, source: ColumnDataSource, end: float) -> Any:
    z = np.linspace(0.0, end, 41)
    front, rear = z * ideal_share(car, z), z * (1.0 - ideal_share(car, z))
    tallest = 1.15 * max(float(rear.max()), float(np.percentile(source.data["rear"], 99)))
    spans: dict[str, Any] = {
        "x_range": Range1d(start=0.0, end=end),
        "y_range": Range1d(start=0.0, end=tallest),
    }
    plot = free_figure("Front brake force over weight [-]", "Rear over weight [-]", **spans)
    ends = [[[0.0, rate], [rate, 0.0]] for rate in np.arange(0.2, 1.2 * end, 0.2)]
    xs, ys = ([end[k] for end in ends] for k in (0, 1))
    plot.multi_line(xs, ys, line_color=GRID, line_width=1.5, legend_label="z = 0.2, 0.4, …")
    draw_dots(plot, "front", "rear", ESTIMATE, 0.4, "this drive", source=source)
    share = np.array(car.share)
    _draw_laws(plot, (RATES * share, RATES * (1.0 - share)), (front, rear))
    return plot


def _draw_laws(plot: Any, control: tuple[Vector, Vector], ideal: tuple[Vector, Vector]) -> None:
    plot.line(*control, line_color=DEMAND, line_width=2.0, legend_label="control, by CONFIG")
    plot.line(*ideal, line_color=QUIET, line_width=1.6, legend_label="ideal")
