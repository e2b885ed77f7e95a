"""Prediction of each brake application's deceleration: rows of the table, errors and two plots.

Without a friction sensor this is the criterion of an estimate.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, Range1d
from bokeh.models.annotations import BoxAnnotation, Span

from brakelab.arrays import Vector
from brakelab.report.brakings import Braking, Force
from brakelab.report.look import DEMAND, ESTIMATE, INK, QUIET, free_figure, number_applications
from brakelab.results.prediction import Errors, errors, one_scale, running_average

BAND: Final = 0.05
_BAND_ALPHA: Final = 0.14


class Row(NamedTuple):
    """A line of the table; decelerations in m/s^2."""

    number: int
    measured: float
    predicted: float
    sigma: float
    error: float
    """Predicted over measured, less 1."""
    sigma_error: float
    configured: float
    """Predicted with the configured friction."""
    front: str
    """Friction before the brake application, with its standard deviation."""
    rear: str
    left_out: str


def prediction_rows(found: list[Braking]) -> list[Row]:
    """Return a row for each brake application, none without predictions."""
    if not any(np.isfinite(braking.force.predicted) for braking in found):
        return []
    return [
        Row(
            braking.number,
            *braking.force[:3],
            *_shares(braking),
            braking.force.configured,
            friction_text(braking.before[:2], braking.before_sigma[:2]),
            friction_text(braking.before[2:], braking.before_sigma[2:]),
            braking.left_out,
        )
        for braking in found
    ]


def _shares(braking: Braking) -> tuple[float, float]:
    if braking.left_out:
        return float("nan"), float("nan")
    force = braking.force
    return force.predicted / force.measured - 1.0, force.sigma / force.measured


def friction_text(friction: Vector, sigma: Vector) -> str:
    """Return an axle's friction with its standard deviation, shapes (2,), as text."""
    mean, spread = float(np.mean(friction)), float(np.mean(sigma))
    if not np.isfinite(mean):
        return "–"
    return f"{mean:.3f} ± {spread:.3f}" if np.isfinite(spread) else f"{mean:.3f}"


def prediction_errors(found: list[Braking]) -> Errors:
    """Return the errors of the predictions evaluated."""
    counted = _counted(found)
    return errors([force.measured for force in counted], [force.predicted for force in counted])


def _counted(found: list[Braking]) -> list[Force]:
    return [braking.force for braking in found if not braking.left_out]


def peer_errors(found: list[Braking]) -> dict[str, Errors]:
    """Return the errors of alternative predictors for these applications, by name; empty: not known."""
    counted = _counted(found)
    measured = [force.measured for force in counted]
    configured = [force.configured for force in counted]
    rest = [force.configured_rest for force in counted]
    if not counted or not np.isfinite(configured).all():
        return {}
    return {
        "the configured friction, never learning": errors(measured, configured),
        "a running average of the friction's scale": errors(
            measured, running_average(measured, configured, rest)
        ),
        "one scale chosen in hindsight": errors(measured, one_scale(measured, configured, rest)),
    }


def plots_of_prediction(found: list[Braking]) -> dict[str, Any]:
    """Return predicted over measured and error over number by name; empty without evaluated predictions."""
    counted = [row for row in prediction_rows(found) if not row.left_out]
    if not counted:
        return {}
    rest = [row for row in prediction_rows(found) if row.left_out]
    source, others = _source(counted), _source(rest)
    return {
        "prediction": _over_measured(source, others),
        "prediction-error": _over_number(source, len(found)),
    }


def _source(rows: list[Row]) -> ColumnDataSource:
    numbers = np.array([row[:6] for row in rows], float).reshape(-1, 6)
    number, measured, predicted, sigma, error, sigma_error = numbers.T
    return ColumnDataSource(
        {
            "number": number, "measured": measured, "predicted": predicted, "error": 100.0 * error,
            "low": predicted - 2.0 * sigma, "high": predicted + 2.0 * sigma,
            "error_low": 100.0 * (error - 2.0 * sigma_error),
            "error_high": 100.0 * (error + 2.0 * sigma_error),
            **{name: [getattr(row, name) for row in rows] for name in ("front", "rear", "left_out")},
        }
    )  # fmt: skip


def _over_measured(source: ColumnDataSource, others: ColumnDataSource) -> Any:
    end = _reach(source, ("measured", "predicted"), "high")
    spans = [Range1d(start=0.0, end=end) for _ in range(2)]
    plot = free_figure("Measured [m/s²]", "Predicted [m/s²]", x_range=spans[0], y_range=spans[1])
    band: dict[str, Any] = {
        "fill_color": DEMAND,
        "fill_alpha": _BAND_ALPHA,
        "legend_label": f"±{100 * BAND:.0f} %",
    }
    plot.varea([0.0, end], [0.0, (1.0 - BAND) * end], [0.0, (1.0 + BAND) * end], **band)
    plot.line([0.0, end], [0.0, end], line_color=INK, line_dash="dashed", legend_label="1:1")
    _points(plot, source, "measured", "predicted", "low", "high")
    if len(others.data["number"]):
        look: dict[str, Any] = {"marker": "x", "size": 8, "line_color": QUIET, "line_width": 1.6}
        shown = plot.scatter("measured", "predicted", source=others, legend_label="left out", **look)
        _hover(plot, shown, [("left out", "@left_out")])
    return plot


def _over_number(source: ColumnDataSource, count: int) -> Any:
    largest = max(_reach(source, ("error",), "error_low", "error_high"), 200.0 * BAND)
    along, across = Range1d(start=0.5, end=count + 0.5, bounds="auto"), Range1d(start=-largest, end=largest)
    plot = free_figure("Brake application", "Predicted over measured − 1 [%]", x_range=along, y_range=across)
    number_applications(plot, count)
    band: dict[str, Any] = {"fill_color": DEMAND, "fill_alpha": _BAND_ALPHA, "line_color": None}
    plot.add_layout(BoxAnnotation(bottom=-100.0 * BAND, top=100.0 * BAND, **band))
    plot.add_layout(Span(location=0.0, dimension="width", line_color=INK, line_dash="dashed"))
    _points(plot, source, "number", "error", "error_low", "error_high")
    return plot


def _reach(source: ColumnDataSource, points: tuple[str, ...], *bars: str) -> float:
    """Return the range of an axis that shows all points and nine in ten of the bars."""
    farthest = max(float(np.abs(np.asarray(source.data[name])).max()) for name in points)
    ends = np.abs(np.concatenate([np.asarray(source.data[name]) for name in bars]))
    return 1.08 * max(farthest, float(np.quantile(ends, 0.9)) if np.isfinite(ends).all() else 0.0)


def _points(plot: Any, source: ColumnDataSource, x: str, y: str, low: str, high: str) -> None:
    if np.isfinite(source.data[low]).any():
        plot.segment(x, low, x, high, source=source, line_color=ESTIMATE, line_alpha=0.45, legend_label="±2σ")
    look: dict[str, Any] = {"size": 8, "line_color": ESTIMATE, "fill_color": ESTIMATE, "fill_alpha": 0.85}
    shown = plot.scatter(x, y, source=source, legend_label="brake applications", **look)
    _hover(plot, shown, [("error", "@error{+0.0} %"), ("friction front", "@front"), ("rear", "@rear")])


def _hover(plot: Any, shown: Any, more: list[tuple[str, str]]) -> None:
    values = [(name, f"@{name}{{0.00}} m/s²") for name in ("measured", "predicted")]
    plot.add_tools(HoverTool(renderers=[shown], tooltips=[("application", "@number"), *values, *more]))
