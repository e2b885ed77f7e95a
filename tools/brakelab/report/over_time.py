"""Linked plots over a drive: speed, deceleration, friction, pressures, discs, K_f and modes."""

from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, Range1d, VStrip
from bokeh.models.renderers import GlyphRenderer

from brakelab.arrays import Vector
from brakelab.report.brakings import Braking, inside_any
from brakelab.report.downsample import Buckets, buckets, drawn
from brakelab.report.drive import DriveResult
from brakelab.report.look import (
    BOUND,
    DEMAND,
    ESTIMATE,
    INK,
    LEFT,
    RIGHT,
    SHADE,
    draw_line,
    link_crosshair,
    time_figure,
)
from brakelab.report.modes import modes_plot
from brakelab.report.wheels import plots_of_wheels

# Points per line: 60 s of drive at full resolution, and 40 lines of them stay near 1 MB.
POINTS = 6000

KMH = 3.6
_FRONT, _REAR = ("fl", "fr"), ("rl", "rr")


class _Estimated(NamedTuple):
    """A corner quantity with its standard deviation, and how it is drawn."""

    column: str
    digits: str
    least_span: float
    """Of the axis, in the quantity's unit."""


# Least span of the other axes: a drive without events is drawn flat.
_LEAST_KMH, _LEAST_DECELERATION, _LEAST_BAR, _LEAST_FACTOR = 10.0, 1.0, 20.0, 0.2

_FRICTION = _Estimated("mu_b", "0.000", 0.2)
_DISC = _Estimated("disc_temperature", "0", 40.0)


def plots_over_time(drive: DriveResult, truth: DriveResult | None, found: list[Braking]) -> dict[str, Any]:
    """Return the figures by name in reading order; all share the x range `drive-time` and one source."""
    grid = buckets(inside_any(drive, found), POINTS)
    source = ColumnDataSource(drawn(grid, drive.t, _lines(drive, truth)))
    span = Range1d(start=float(drive.t[0]), end=float(drive.t[-1]), name="drive-time", bounds="auto")
    plots = {
        "speed": _beside_truth(source, span, "Speed [km/h]", _LEAST_KMH, "speed", "0.0"),
        "deceleration": _deceleration(source, span),
        "friction-front": _estimate(source, span, "Friction front [-]", _FRONT, _FRICTION),
        "friction-rear": _estimate(source, span, "Friction rear [-]", _REAR, _FRICTION),
        "pressure-front": _pressure(source, span, "front", _FRONT),
        "pressure-rear": _pressure(source, span, "rear", _REAR),
        "disc-front": _estimate(source, span, "Disc front [°C]", _FRONT, _DISC),
        "disc-rear": _estimate(source, span, "Disc rear [°C]", _REAR, _DISC),
        **plots_of_wheels(drive, truth, _coarse(_coarse(grid)), span),
        "k-f": _beside_truth(source, span, "Tyre factor K_f [-]", _LEAST_FACTOR, "k_f", "0.000"),
        "modes": modes_plot(drive, _coarse(grid), span),
    }
    plots = {name: plot for name, plot in plots.items() if plot.renderers}
    if found:
        shades = _shades(found)
        for plot in plots.values():
            plot.renderers.append(shades)
    link_crosshair(list(plots.values()))
    return plots


def _shades(found: list[Braking]) -> Any:
    """Return the brake applications as one glyph behind grid and lines: boxes take seconds to draw."""
    times = {name: np.array([getattr(braking, name) for braking in found]) for name in ("t_start", "t_end")}
    strips = VStrip(x0="t_start", x1="t_end", fill_color=SHADE, line_color=None)
    return GlyphRenderer(data_source=ColumnDataSource(times), glyph=strips, level="image")


def _coarse(grid: Buckets) -> Buckets:
    """Return half the buckets: neighbours joined, for curves that need no two points per pixel."""
    last = grid.last[1::2]
    if len(grid.first) % 2:
        last = np.append(last, grid.last[-1])
    return Buckets(grid.first[::2], last)


def _lines(drive: DriveResult, truth: DriveResult | None) -> Iterator[tuple[str, Vector]]:
    """Yield every quantity in the units of the plots."""
    yield "speed", drive.column("vehicle_speed") * KMH
    yield "demanded", drive.column("decel_demand_total")
    yield "achieved", -drive.column("accel_x_road")
    yield "k_f", drive.column("k_f")
    yield "grip_limit", drive.column("grip_limit")
    for corner in ("fl", "fr", "rl", "rr"):
        for name in (_FRICTION.column, _DISC.column):
            value, sigma = drive.column(f"{name}_{corner}"), drive.column(f"sigma_{name}_{corner}")
            yield f"{name}_{corner}", value
            yield f"{name}_low_{corner}", value - 2.0 * sigma
            yield f"{name}_high_{corner}", value + 2.0 * sigma
        yield f"pressure_{corner}", drive.column(f"calliper_pressure_{corner}")
        yield f"demand_{corner}", drive.column(f"pressure_demand_{corner}")
    if truth is not None:
        yield "speed_true", truth.column("vehicle_speed") * KMH
        yield "achieved_true", -truth.column("accel_x_road")
        yield "k_f_true", truth.column("k_f")
        for corner in ("fl", "fr", "rl", "rr"):
            for name in (_FRICTION.column, _DISC.column):
                yield f"{name}_true_{corner}", truth.column(f"{name}_{corner}")


def _hover(plot: Any, source: ColumnDataSource, rows: list[tuple[str, str, str]]) -> None:
    """Show the values of (label, column, format) at the time under the mouse."""
    tips = [(label, f"@{name}{{{form}}}") for label, name, form in rows if name in source.column_names]
    if plot.renderers:
        plot.add_tools(
            HoverTool(renderers=plot.renderers[-1:], mode="vline", tooltips=[("time", "@t{0.00} s"), *tips])
        )


def _beside_truth(
    source: ColumnDataSource, span: Range1d, label: str, least_span: float, name: str, digits: str
) -> Any:
    """Return the figure of a quantity of the car as estimated, and true where that is known."""
    plot = time_figure(label, span, least_span)
    draw_line(plot, source, name, "estimated", ESTIMATE)
    draw_line(plot, source, f"{name}_true", "true", INK, line_dash="dashed", line_width=1.2)
    _hover(plot, source, [("estimated", name, digits), ("true", f"{name}_true", digits)])
    return plot


def _deceleration(source: ColumnDataSource, span: Range1d) -> Any:
    plot = time_figure("Deceleration [m/s²]", span, _LEAST_DECELERATION)
    draw_line(plot, source, "achieved", "achieved (measured)", ESTIMATE, line_width=1.0)
    draw_line(plot, source, "achieved_true", "achieved (true)", INK, line_dash="dashed", line_width=1.2)
    draw_line(plot, source, "grip_limit", "ceiling of grip", INK, line_dash="dotted", line_width=1.2)
    draw_line(plot, source, "demanded", "demanded", DEMAND, line_width=2.0)
    rows = [("demanded", "demanded"), ("achieved", "achieved"), ("true", "achieved_true")]
    rows.append(("ceiling", "grip_limit"))
    _hover(plot, source, [(label, name, "0.00") for label, name in rows])
    return plot


def _estimate(
    source: ColumnDataSource, span: Range1d, label: str, corners: tuple[str, str], what: _Estimated
) -> Any:
    plot = time_figure(label, span, what.least_span)
    sides = list(zip(corners, ("left", "right"), (LEFT, RIGHT), strict=True))
    name = what.column
    for (corner, side, colour), bound in product(sides, ("low", "high")):
        draw_line(plot, source, f"{name}_{bound}_{corner}", f"{side}, ±2σ thin", colour, **BOUND)
    bands = len(plot.renderers)
    for corner, side, colour in sides:
        draw_line(plot, source, f"{name}_{corner}", f"{side}, ±2σ thin", colour)
    for corner, side, _ in sides:
        dash = "dashed" if side == "left" else "dotted"
        draw_line(plot, source, f"{name}_true_{corner}", f"{side}, true", INK, line_dash=dash, line_width=1.3)
    # The lines set the range: a band that is briefly wide would compress everything.
    plot.y_range.update(renderers=plot.renderers[bands:], range_padding=0.5)
    kinds = (("", ""), (" +2σ", "_high"), (" −2σ", "_low"), (" true", "_true"))
    rows = [
        (f"{side}{said}", f"{name}{kind}_{corner}", what.digits)
        for corner, side, _ in sides
        for said, kind in kinds
    ]
    _hover(plot, source, rows)
    return plot


def _pressure(source: ColumnDataSource, span: Range1d, axle: str, corners: tuple[str, str]) -> Any:
    plot = time_figure(f"Pressure {axle} [bar]", span, _LEAST_BAR)
    sides = list(zip(corners, ("left", "right"), (LEFT, RIGHT), strict=True))
    for corner, side, colour in sides:
        draw_line(plot, source, f"pressure_{corner}", side, colour, line_width=0.8, line_alpha=0.55)
    for corner, side, _ in sides:
        dash = "solid" if side == "left" else "dashed"
        draw_line(
            plot, source, f"demand_{corner}", f"{side}, demanded", DEMAND, line_width=1.8, line_dash=dash
        )
    kinds = (("demanded", "demand"), ("measured", "pressure"))
    rows = [
        (f"{side} {kind}", f"{name}_{corner}", "0.0") for corner, side, _ in sides for kind, name in kinds
    ]
    _hover(plot, source, rows)
    return plot
