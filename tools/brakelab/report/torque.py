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
from brakelab.report.brakings import Braking, inside_any
from brakelab.report.cloud import binned, draw_dots, draw_true_mean, thinned
from brakelab.report.drive import DriveResult
from brakelab.report.look import STAGE_COLOURS, free_figure, style_axis
from brakelab.results.car import Car
from ecu.contract.signals import CORNERS, OBSERVING

POINTS: Final = 300
"""Of a class in a plot."""
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
    rows = inside_any(drive, found)
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
    plot = free_figure(classes.label, f"T/p {axle} [N m/bar]", 225, y_range=Range1d(start=low, end=high))
    plot.extra_y_ranges = {"c": Range1d(start=low / gain, end=high / gain)}
    plot.add_layout(style_axis(LinearAxis(y_range_name="c", axis_label="C* [-]")), "right")
    number = np.digitize(other, classes.limits)
    for place, name in enumerate(classes.names):
        mine = np.flatnonzero(number == place)
        if not len(mine):
            continue
        some = thinned(mine, POINTS)
        colour = STAGE_COLOURS[(0, 1, 3)[place]]
        draw_dots(plot, at[some].astype("f4"), torque[some].astype("f4"), colour, 0.35, name)
        centre, mean = binned(at[mine], torque[mine])
        if len(centre) > 1:
            style = {"line_color": colour, "line_width": 1.6, "line_dash": _DASHES[place]}
            plot.line(centre, mean, legend_label=name, **style)
    if true is not None:
        draw_true_mean(plot, *binned(at, true))
    return plot
