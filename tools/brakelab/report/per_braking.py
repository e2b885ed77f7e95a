"""Plots with one point per brake application: change of friction, and tracking of the demand."""

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, Range1d, SingleIntervalTicker

from brakelab.report.brakings import Braking
from brakelab.report.look import DEMAND, ESTIMATE, LEFT, RIGHT, new_figure
from ecu.contract.signals import CORNERS

_MARKERS = (("front left", LEFT, "circle"), ("front right", RIGHT, "circle"),
            ("rear left", LEFT, "triangle"), ("rear right", RIGHT, "triangle"))  # fmt: skip

_DECELERATIONS = (
    ("demanded", DEMAND, "dash", 18),
    ("achieved", ESTIMATE, "circle", 8),
    ("predicted", RIGHT, "x", 9),
)


def plots_per_braking(found: list[Braking]) -> dict[str, Any]:
    """Return the two figures by name, linked to each other; empty for fewer than two applications."""
    if len(found) < 2:
        return {}
    number = np.array([braking.number for braking in found], float)
    mean = np.array([braking.friction for braking in found])
    columns = {
        "number": number,
        "demanded": np.array([braking.demanded for braking in found]),
        "achieved": np.array([braking.achieved for braking in found]),
        "predicted": np.array([braking.predicted for braking in found]),
        **{corner: mean[:, place] for place, corner in enumerate(CORNERS)},
        **{f"at_{corner}": number + (place - 1.5) * 0.12 for place, corner in enumerate(CORNERS)},
    }
    source = ColumnDataSource(columns)
    span = Range1d(start=0.5, end=len(found) + 0.5, bounds="auto")
    friction = _figure(span, "Friction after it [-]", len(found), 0.1)
    for place, (corner, (label, colour, marker)) in enumerate(zip(CORNERS, _MARKERS, strict=True)):
        if np.isfinite(mean[:, place]).any():
            friction.line(f"at_{corner}", corner, source=source, line_color=colour, line_alpha=0.35)
            friction.scatter(
                f"at_{corner}", corner, source=source, marker=marker, size=8, line_color=colour,
                fill_color=colour, fill_alpha=0.35 if place > 1 else 0.9, legend_label=label,
            )  # fmt: skip
    deceleration = _figure(span, "Mean deceleration [m/s²]", len(found), 1.0)
    for name, colour, marker, size in _DECELERATIONS:
        if np.isfinite(columns[name]).any():
            deceleration.scatter(
                "number", name, source=source, marker=marker, size=size, line_color=colour, fill_color=colour,
                line_width=2, legend_label=name,
            )  # fmt: skip
    _hover(deceleration, [(name, f"@{name}{{0.00}} m/s²") for name, *_ in _DECELERATIONS])
    _hover(friction, [(corner.upper(), f"@{corner}{{0.000}}") for corner in CORNERS])
    return {"braking-friction": friction, "braking-deceleration": deceleration}


def _hover(plot: Any, tips: list[tuple[str, str]]) -> None:
    plot.add_tools(HoverTool(tooltips=[("braking", "@number"), *tips]))


def _figure(span: Range1d, label: str, count: int, least_span: float) -> Any:
    plot = new_figure("Braking", label, x_range=span)
    plot.y_range.min_interval = least_span
    plot.xaxis.ticker = SingleIntervalTicker(interval=max(1, -(-count // 15)))
    plot.xgrid.grid_line_color = None
    return plot
