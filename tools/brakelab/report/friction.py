"""Friction over disc temperature, speed and pressure, as observed in the brake applications of a drive."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.report.accuracy import AXLES
from brakelab.report.brakings import Braking, inside_any
from brakelab.report.cloud import binned, draw_dots, draw_true_mean, thinned
from brakelab.report.drive import DriveResult
from brakelab.report.look import BOUND, INK, LEFT, RIGHT, free_figure
from ecu.contract.signals import CORNERS, OBSERVING

POINTS: Final = 600
"""Of each wheel in a plot."""
BINS: Final = 12
_LEAST_ROWS: Final = 100  # of a plot: 1 s of observation
_LEAST_SPAN: Final = 0.1

# Column of a corner (or of the car), label, factor to the label's unit
_AGAINST: Final = (
    ("disc_temperature", "Disc temperature [°C]", 1.0),
    ("vehicle_speed", "Speed [km/h]", 3.6),
    ("calliper_pressure", "Pressure [bar]", 1.0),
)


def plots_of_friction(drive: DriveResult, truth: DriveResult | None, found: list[Braking]) -> dict[str, Any]:
    """Return the figures by name, front and rear for each quantity; empty where nothing was observed."""
    rows = inside_any(drive, found)
    plots = {}
    for stem, label, factor in _AGAINST:
        for axle, wheels in AXLES.items():
            observed = [_observed(drive, corner, stem, factor, rows) for corner in CORNERS[wheels]]
            if sum(len(at) for at, _ in observed) >= _LEAST_ROWS:
                true = None if truth is None else truth.corners("mu_b")[:, wheels]
                plots[f"{stem}-{axle}"] = _plot(drive, observed, label, axle, true)
    return plots


def _observed(
    drive: DriveResult, corner: str, stem: str, factor: float, rows: NDArray[np.bool_]
) -> tuple[Vector, NDArray[np.int64]]:
    """Return a quantity where the corner's friction was observed, and in which rows."""
    at = drive.column(stem if drive.has(stem) else f"{stem}_{corner}") * factor
    known = np.isfinite(at) & np.isfinite(drive.column(f"mu_b_{corner}"))
    if drive.has(f"mode_{corner}"):
        known = known & (drive.column(f"mode_{corner}") == OBSERVING)
    places = np.flatnonzero(rows & known)
    return at[places], places


def _plot(
    drive: DriveResult,
    observed: list[tuple[Vector, NDArray[np.int64]]],
    label: str,
    axle: str,
    true: Vector | None,
) -> Any:
    wheels = AXLES[axle]
    plot = free_figure(label, f"Friction {axle} [-]", 225)
    mu, sigma = drive.corners("mu_b")[:, wheels], drive.corners("sigma_mu_b")[:, wheels]
    for wheel, (values, places) in enumerate(observed):
        some = thinned(np.arange(len(values)), POINTS)
        colour, label = ((LEFT, "left"), (RIGHT, "right"))[wheel]
        dots = values[some].astype("f4"), mu[places[some], wheel].astype("f4")
        draw_dots(plot, *dots, colour, 0.35, label)
    at = np.concatenate([at for at, _ in observed])
    place = np.concatenate([places for _, places in observed])
    side = np.repeat([0, 1], [len(places) for _, places in observed])
    centre, mean = binned(at, mu[place, side], BINS)
    spread = 2.0 * binned(at, sigma[place, side], BINS)[1]
    # Points and means set the range: a wide band would compress them.
    shown = list(plot.renderers)
    if len(centre) > 1:
        look: dict[str, Any] = {"line_color": INK, "legend_label": "mean, ±2σ thin"}
        for bound in (mean - spread, mean + spread):
            plot.line(centre, bound, **look, **BOUND)
        shown.append(plot.line(centre, mean, line_width=1.6, **look))
        if true is not None:
            shown += draw_true_mean(plot, *binned(at, true[place, side], BINS))
    plot.y_range.update(renderers=shown, range_padding=0.2, min_interval=_LEAST_SPAN)
    return plot
