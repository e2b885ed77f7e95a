"""Specific brake torque of an axle over pressure and speed, with C*, as observed in the brake applications.

With A_k the piston area of one side and r_eff the effective radius, of one wheel T = 2 A_k r_eff mu p (A.19),
so that the axle's T/p = gain (mu_left + mu_right), and C* = F_friction / F_clamp = 2 mu.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from bokeh.models import LinearAxis, Range1d
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.report.accuracy import AXLES
from brakelab.report.brakings import Braking, inside
from brakelab.report.drive import DriveResult
from brakelab.report.look import INK, QUIET, STAGE_COLOURS, new_figure
from brakelab.results.car import Car
from ecu.contract.signals import CORNERS, OBSERVING

POINTS: Final = 300
"""Of a class in a plot."""
BINS: Final = 10
_FEWEST_ROWS: Final = 20  # rows of a bin
_LEAST_ROWS: Final = 100  # of a plot: 1 s of observation
_LEAST_SPAN: Final = 0.2  # of the axis, in C*
_DASHES: Final = ("solid", "dashed", "dotdash")


class Classes(NamedTuple):
    """Abscissa, and the classes that have a colour each."""

    stem: str
    label: str
    limits: tuple[float, float]
    names: tuple[str, str, str]
    """Of the classes of the other quantity, whose limits are `limits`."""


AGAINST: Final = (
    Classes("torque-speed", "Speed [km/h]", (20.0, 40.0), ("up to 20 bar", "20 to 40", "above 40")),
    Classes("torque-pressure", "Pressure [bar]", (60.0, 100.0), ("up to 60 km/h", "60 to 100", "above 100")),
)


def plots_of_torque(
    drive: DriveResult, truth: DriveResult | None, found: list[Braking], car: Car
) -> dict[str, Any]:
    """Return the figures by name, each axle over pressure and speed; empty where nothing was observed."""
    rows = np.zeros(len(drive.t), bool)
    for braking in found:
        rows |= inside(drive, braking)
    plots = {}
    for (axle, wheels), gain in zip(AXLES.items(), car.gain, strict=True):
        torque = gain * drive.corners("mu_b")[:, wheels].sum(axis=1)
        true = None if truth is None else gain * truth.corners("mu_b")[:, wheels].sum(axis=1)
        quantities = (drive.column("vehicle_speed") * 3.6, axle_pressure(drive, wheels))
        places = np.flatnonzero(
            rows & _observed(drive, wheels) & np.isfinite(torque + quantities[0] + quantities[1])
        )
        if len(places) < _LEAST_ROWS:
            continue
        for which, classes in enumerate(AGAINST):
            at, other = quantities[which][places], quantities[1 - which][places]
            plots[f"{classes.stem}-{axle}"] = _plot(
                classes, axle, at, other, torque[places], None if true is None else true[places], gain
            )
    return plots


def axle_pressure(drive: DriveResult, wheels: slice) -> Vector:
    """Return the mean pressure of an axle's callipers, zeros of the sensors taken off [bar], shape (n,)."""
    zero = np.nan_to_num(drive.corners("pressure_zero")[:, wheels])
    return np.asarray((drive.corners("calliper_pressure")[:, wheels] - zero).mean(axis=1))


def _observed(drive: DriveResult, wheels: slice) -> NDArray[np.bool_]:
    columns = [f"mode_{corner}" for corner in CORNERS[wheels]]
    if not any(drive.has(name) for name in columns):
        return np.ones(len(drive.t), bool)
    return np.any([drive.column(name) == OBSERVING for name in columns], axis=0)


def _plot(
    classes: Classes, axle: str, at: Vector, other: Vector, torque: Vector, true: Vector | None, gain: float
) -> Any:
    low, high = (float(value) for value in np.percentile(torque, (0.5, 99.5)))
    margin = max(0.15 * (high - low), 0.5 * (_LEAST_SPAN * gain - (high - low)))
    low, high = max(low - margin, 0.0), high + margin
    plot = new_figure(
        classes.label, f"T/p {axle} [N m/bar]", tools="pan,box_zoom,reset,save", active_drag="box_zoom",
        y_range=Range1d(start=low, end=high),
    )  # fmt: skip
    plot.extra_y_ranges = {"c": Range1d(start=low / gain, end=high / gain)}
    plot.add_layout(
        LinearAxis(
            y_range_name="c", axis_label="C* [-]", axis_label_text_font_style="normal",
            axis_label_text_font_size="12px", major_label_text_font_size="11px", axis_label_text_color=INK,
            major_label_text_color=QUIET, axis_line_color=QUIET, major_tick_line_color=QUIET,
            minor_tick_line_color=None,
        ),
        "right",
    )  # fmt: skip
    number = np.digitize(other, classes.limits)
    for place, name in enumerate(classes.names):
        mine = np.flatnonzero(number == place)
        if not len(mine):
            continue
        some = mine[:: max(1, -(-len(mine) // POINTS))]
        colour = STAGE_COLOURS[(0, 1, 3)[place]]
        plot.scatter(
            at[some].astype("f4"), torque[some].astype("f4"), size=3, line_color=None, fill_color=colour,
            fill_alpha=0.35, legend_label=name,
        )  # fmt: skip
        centre, mean = binned(at[mine], torque[mine])
        if len(centre) > 1:
            style = {"line_color": colour, "line_width": 1.6, "line_dash": _DASHES[place]}
            plot.line(centre, mean, legend_label=name, **style)
    if true is not None:
        centre, mean = binned(at, true)
        if len(centre) > 1:
            plot.line(
                centre, mean, line_color=INK, line_dash="dashed", line_width=1.3, legend_label="mean, true"
            )
    return plot


def binned(at: Vector, values: Vector) -> tuple[Vector, Vector]:
    """Return the means of `at` and `values` in intervals of `at`; intervals of few rows are left out."""
    known = np.isfinite(at) & np.isfinite(values)
    at, values = at[known], values[known]
    if not len(at) or np.ptp(at) == 0.0:
        return np.empty(0), np.empty(0)
    number = np.minimum(((at - at.min()) / np.ptp(at) * BINS).astype(int), BINS - 1)
    count = np.bincount(number, minlength=BINS)
    kept = count >= _FEWEST_ROWS
    first, second = (np.bincount(number, of, BINS)[kept] / count[kept] for of in (at, values))
    return first, second
