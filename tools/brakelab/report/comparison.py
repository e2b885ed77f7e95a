"""Page of two results side by side: `brake-ecu compare A.parquet B.parquet --out PAGE.html`."""

from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, Range1d

from brakelab.report.downsample import buckets, extremes, times
from brakelab.report.look import LEFT, QUIET, RIGHT, TIME, draw_line, link_crosshair, new_figure
from brakelab.report.over_time import POINTS
from brakelab.report.page import Tile, fill, fixed, percent, signed_percent
from brakelab.report.per_braking import Series, points_by_braking
from brakelab.results.compare import Comparison, Judged, Part, cells
from brakelab.results.outputs import write_text
from ecu.contract.faults import WORDS
from ecu.contract.signals import CORNERS

_ALWAYS: Final = ("vehicle_speed", "mu_b_fl", "mu_b_rl")
_PLOTS: Final = 9
"""With those of `_ALWAYS`; the rest stands in the table."""


def write_page(found: Comparison, a: Path, b: Path, out: Path) -> None:
    """Write the page on results `a` and `b`; it needs no other file. Raises UserError where it cannot."""
    rows, *brakes = found.parts
    plots = _over_time(rows)
    errors = error_by_braking(brakes[0]) if brakes else None
    content = {
        "names": (str(a), str(b)),
        "tiles": _tiles(found),
        "provenance": found.provenance,
        "faults": found.faults,
        "differing": [(part.title, [cells(part, row) for row in part.worst()]) for part in found.parts],
        "only": [(part.title, *part.only) for part in found.parts if any(part.only)],
        "reduced": len(rows.before["t"]) > POINTS,
    }
    groups = {"over_time": plots, "by_braking": {} if errors is None else {"prediction-error": errors}}
    write_text(out, fill(groups, content, files("brakelab.report") / "comparison.html.j2"))


def _tiles(found: Comparison) -> list[Tile]:
    columns = sum(len(set(part.before) & set(part.after)) for part in found.parts)
    differing = sum(part.matter for part in found.parts)
    tiles = [Tile("Columns that differ", str(differing), "", f"of {columns}, by more than is visible", False)]
    if found.judged is not None:
        tiles = [*_judged_tiles(*found.judged), *tiles]
    return tiles


def _judged_tiles(a: Judged, b: Judged) -> list[Tile]:
    counted = f"{a.prediction.counted} and {b.prediction.counted} brake applications"
    bias = (
        f"bias {signed_percent(a.prediction.bias, 1)} → {signed_percent(b.prediction.bias, 1)} %, {counted}"
    )
    mean = f"{percent(a.prediction.mean, 1)} → {percent(b.prediction.mean, 1)}"
    return [
        Tile("Prediction error, mean", mean, "%", bias, b.prediction.mean > a.prediction.mean),
        Tile("Friction front, at the end", f"{fixed(a.front, 3)} → {fixed(b.front, 3)}", "", "A → B"),
        Tile("Friction rear, at the end", f"{fixed(a.rear, 3)} → {fixed(b.rear, 3)}", "", "A → B"),
    ]


def _over_time(rows: Part) -> dict[str, Any]:
    """Return figures of speed, friction and what differs most, each of A and B, over one time axis."""
    t, both = rows.before["t"], set(rows.before) & set(rows.after)
    differing = (row.name for row in rows.worst() if row.name not in WORDS)
    names = [name for name in dict.fromkeys([*_ALWAYS, *differing]) if name in both][:_PLOTS]
    grid = buckets(np.nan_to_num(rows.before["braking"]) > 0.5 if "braking" in both else t < t[0], POINTS)
    span = Range1d(start=float(t[0]), end=float(t[-1]), bounds="auto")
    at, plots = times(grid, t), {}
    for name in names:
        lines = {"A": rows.before[name], "B": rows.after[name]}
        drawn = {side: extremes(grid, values).astype("f4") for side, values in lines.items()}
        source = ColumnDataSource({"t": at, **drawn})
        plot = new_figure(TIME, f"{name} [{rows.units.get(name, '')}]", x_range=span, window_axis="x")
        draw_line(plot, source, "A", "A", LEFT, line_width=2.2)
        draw_line(plot, source, "B", "B", RIGHT, line_width=1.2)
        tips = [("time", "@t{0.00} s"), ("A", "@A{0.000}"), ("B", "@B{0.000}")]
        plot.add_tools(HoverTool(renderers=plot.renderers[-1:], mode="vline", tooltips=tips))
        plots[f"both-{name}"] = plot
    link_crosshair(list(plots.values()))
    return plots


def error_by_braking(brakes: Part) -> Any:
    """Return the figure of both prediction errors, None for fewer than two brake applications."""
    if not {"left_out", "specific_force_predicted"} <= set(brakes.before) & set(brakes.after):
        return None
    car = brakes.before["corner"] == CORNERS[0]
    series = []
    for label, colour, marker, columns in (
        ("A", LEFT, "circle", brakes.before),
        ("B", RIGHT, "triangle", brakes.after),
    ):
        error = 100.0 * (columns["specific_force_predicted"] / columns["specific_force_mean"] - 1.0)
        series.append(Series(label, colour, marker, np.where(columns["left_out"] == "", error, np.nan)[car]))
    numbers = [int(number) + 1 for number in brakes.before["brake"][car]]
    return points_by_braking(numbers, series, "Prediction error [%]", 5.0, QUIET)
