"""Plots with one point per brake application: change of friction, and tracking of the demand."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, Range1d
from bokeh.models.annotations import Span

from brakelab.arrays import Vector
from brakelab.report.brakings import Braking
from brakelab.report.look import DEMAND, ESTIMATE, LEFT, RIGHT, new_figure, number_applications
from ecu.contract.signals import CORNERS

CORNER_MARKS = tuple(
    (f"{axle} {side}", colour, marker)
    for axle, marker in (("front", "circle"), ("rear", "triangle"))
    for side, colour in (("left", LEFT), ("right", RIGHT))
)

_DECELERATIONS = (
    ("demanded", DEMAND, "dash", 18),
    ("achieved", ESTIMATE, "circle", 8),
    ("predicted", RIGHT, "x", 9),
)


class Series(NamedTuple):
    """One quantity of every brake application."""

    label: str
    colour: str
    marker: str
    values: Vector
    """NaN: not known, shape (brake applications,)."""


def points_by_braking(
    numbers: Sequence[int], series: Sequence[Series], label: str, least_span: float, zero: str | None = None
) -> Any:
    """Return the figure, None for fewer than two brake applications or nothing known.

    Args:
        numbers: of the brake applications.
        series: drawn beside each other.
        label: of the axis.
        least_span: of the axis.
        zero: colour of a line at 0.
    """
    shown = [one for one in series if np.isfinite(one.values).any()]
    if len(numbers) < 2 or not shown:
        return None
    plot = _figure(Range1d(start=0.5, end=numbers[-1] + 0.5, bounds="auto"), label, len(numbers), least_span)
    columns: dict[str, Any] = {"number": np.array(numbers, float)}
    for place, one in enumerate(shown):
        columns[f"at_{place}"] = columns["number"] + (place - 0.5 * (len(shown) - 1)) * 0.15
        columns[f"value_{place}"] = one.values
    source = ColumnDataSource(columns)
    for place, one in enumerate(shown):
        look: dict[str, Any] = {
            "marker": one.marker,
            "size": 8,
            "fill_alpha": 0.7,
            "line_width": 2,
            **_of(one.colour),
        }
        plot.scatter(f"at_{place}", f"value_{place}", source=source, legend_label=one.label, **look)
    if zero is not None:
        plot.add_layout(Span(location=0.0, dimension="width", line_color=zero, line_width=1))
    _hover(plot, [(one.label, f"@value_{place}{{0.00}}") for place, one in enumerate(shown)])
    return plot


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
    for place, (corner, (label, colour, marker)) in enumerate(zip(CORNERS, CORNER_MARKS, strict=True)):
        if np.isfinite(mean[:, place]).any():
            friction.line(f"at_{corner}", corner, source=source, line_color=colour, line_alpha=0.35)
            alpha = 0.35 if place > 1 else 0.9
            look: dict[str, Any] = {"marker": marker, "size": 8, "fill_alpha": alpha, **_of(colour)}
            friction.scatter(f"at_{corner}", corner, source=source, legend_label=label, **look)
    deceleration = _figure(span, "Mean deceleration [m/s²]", len(found), 1.0)
    for name, colour, marker, size in _DECELERATIONS:
        if np.isfinite(columns[name]).any():
            look = {"marker": marker, "size": size, "line_width": 2, **_of(colour)}
            deceleration.scatter("number", name, source=source, legend_label=name, **look)
    _hover(deceleration, [(name, f"@{name}{{0.00}} m/s²") for name, *_ in _DECELERATIONS])
    _hover(friction, [(corner.upper(), f"@{corner}{{0.000}}") for corner in CORNERS])
    return {"braking-friction": friction, "braking-deceleration": deceleration}


def _of(colour: str) -> dict[str, Any]:
    return {"line_color": colour, "fill_color": colour}


def _hover(plot: Any, tips: list[tuple[str, str]]) -> None:
    plot.add_tools(HoverTool(tooltips=[("application", "@number"), *tips]))


def _figure(span: Range1d, label: str, count: int, least_span: float) -> Any:
    plot = new_figure("Brake application", label, x_range=span)
    plot.y_range.min_interval = least_span
    number_applications(plot, count)
    return plot
