"""Fleet page: outliers, spread of friction, prediction and energy, failed drives."""

from collections import Counter
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool

from brakelab.fleet.lines import FEW, lines_of_vehicles
from brakelab.fleet.output import page_file
from brakelab.fleet.statistics import (
    LEAST_VEHICLES,
    QUANTITIES,
    Note,
    Quantity,
    Summary,
    Vehicles,
    Weeks,
    by_week,
    lines_of,
    notes,
    outliers,
    per_vehicle,
    values_of,
)
from brakelab.fleet.wear import Due, pads_due
from brakelab.report.look import ESTIMATE, SHADE, new_figure
from brakelab.report.page import Tile, fill, fixed
from brakelab.results import euro7
from brakelab.results.outputs import write_text
from ecu import __version__

ROWS: Final = 200
"""Of each table; `drives.parquet` has them all."""
BINS: Final = 30


def write_page(done: Sequence[Summary], out: Path) -> None:
    """Write the page on `done`, summaries of drives; it needs no other file. Raises UserError."""
    good = [row for row in done if not row["fault"]]
    pages = [_page_of(out.parent, row) for row in good[:ROWS]]
    vehicles = per_vehicle(good)
    due = pads_due(good)
    weeks = {quantity.name: by_week(good, quantity.name) for quantity in QUANTITIES}
    page = fill(
        {
            "by_week": {
                f"week-{q.name}": _weeks(q, weeks[q.name])
                for q in QUANTITIES
                if len(weeks[q.name].drives) > 1
            },
            "by_vehicle": _by_vehicle(good, vehicles),
        },
        {
            "name": out.parent.name,
            "facts": [("Drives", f"{len(done)}"), ("brake-ecu", __version__)],
            "tiles": [*_tiles(done, good, vehicles), *_next_pads(due)],
            "due": due[:ROWS],
            "euro_7": euro7.WORDS,
            "due_left": max(len(due) - ROWS, 0),
            "outliers": outliers(vehicles)[:ROWS],
            "compared": max(Counter(vehicles.groups).values(), default=0) >= LEAST_VEHICLES,
            "failed": [
                Note(row["vehicle"], row["drive"], lines_of(row, "fault")) for row in done if row["fault"]
            ],
            "drives_done": list(zip(good[:ROWS], pages, strict=True)),
            "drives_left": max(len(good) - ROWS, 0),
            "noted": notes(good),
            "few": len(vehicles.names) <= FEW,
            "undated": sum(row["start_time"] is None for row in good),
            "rows": ROWS,
        },
        files("brakelab.fleet") / "fleet.html.j2",
    )
    write_text(out, page)


def _page_of(folder: Path, row: Summary) -> str:
    """Return the address of a drive's page, as seen from the fleet's; empty: there is none."""
    page = page_file(folder, row["vehicle"], row["drive"])
    return quote(page.relative_to(folder).as_posix()) if page.exists() else ""


def _tiles(done: Sequence[Summary], good: Sequence[Summary], vehicles: Vehicles) -> list[Tile]:
    hours, metres = (sum(row[name] for row in good) for name in ("duration", "distance"))
    brakings = sum(row["brakings"] for row in good)
    taught = sum(row["learned"] for row in good)
    faults = len(done) - len(good)
    counted = "1 vehicle" if len(vehicles.names) == 1 else f"{len(vehicles.names)} vehicles"
    tiles = [
        Tile("Drives done", f"{len(good)}", f"of {len(done)}", f"{faults} failed", faults > 0),
        Tile(
            "Driven",
            f"{metres / 1000.0:.0f}",
            "km",
            f"{hours / 3600.0:.1f} h, {counted}",
        ),
        Tile(
            "Brake applications",
            f"{brakings}",
            "",
            f"{taught} of them taught friction",
            brakings > 0 == taught,
        ),
    ]
    errors = values_of(good, "prediction_error")
    tiles.append(_spread_tile("Prediction error [%]", errors, 100.0, 1, "drives"))
    for quantity in (QUANTITIES[0], QUANTITIES[1], QUANTITIES[3]):
        values = vehicles.values[quantity.name]
        tiles.append(_spread_tile(quantity.title, values, quantity.scale, quantity.digits, "vehicles"))
    return tiles


def _next_pads(due: Sequence[Due]) -> list[Tile]:
    """Return the vehicle that needs pads first, none where no remaining distance is known."""
    if not due or not np.isfinite(due[0].pad.remaining):
        return []
    pad = due[0].pad
    note = (
        f"{due[0].vehicle}, {pad.corner}; {fixed(pad.remaining_low, 0)} to {fixed(pad.remaining_high, 0)} km"
    )
    return [Tile("Next pads in", fixed(pad.remaining, 0), "km", note)]


def _spread_tile(title: str, values: Any, scale: float, digits: int, among: str) -> Tile:
    """Return the median, and the range of nine in ten."""
    name, _, unit = title.rstrip("]").partition(" [")
    known = values[np.isfinite(values)] * scale
    low, middle, high = np.percentile(known, (5, 50, 95)) if len(known) else [float("nan")] * 3
    ends = fixed(low, digits), fixed(high, digits)
    note = f"median; {ends[0]} … {ends[1]} are 90 % of the {among}" if ends[0] != ends[1] else "median"
    note = note if len(known) else f"not known of any of the {among}"
    return Tile(name, fixed(middle, digits), unit.replace("-", ""), note)


def _weeks(quantity: Quantity, weeks: Weeks) -> Any:
    plot = new_figure("Week from", quantity.title, x_axis_type="datetime")
    columns = dict(zip(("p5", "p25", "p50", "p75", "p95"), weeks.quantiles.T * quantity.scale, strict=True))
    source = ColumnDataSource({"week": weeks.start_ms, "drives": weeks.drives, **columns})
    for low, high, alpha in (("p5", "p95", 0.14), ("p25", "p75", 0.26)):
        label = f"{low[1:]} to {high[1:]} % of drives"
        plot.varea(
            "week", low, high, source=source, fill_color=ESTIMATE, fill_alpha=alpha, legend_label=label
        )
    line = plot.line("week", "p50", source=source, line_color=ESTIMATE, line_width=1.8, legend_label="median")
    digits = "0." + "0" * quantity.digits if quantity.digits else "0"
    tips = [("week from", "@week{%d %b %Y}"), ("median", f"@p50{{{digits}}}")]
    tips += [("5 to 95 %", f"@p5{{{digits}}} to @p95{{{digits}}}"), ("drives", "@drives")]
    plot.add_tools(HoverTool(renderers=[line], mode="vline", tooltips=tips, formatters={"@week": "datetime"}))
    return plot


def _by_vehicle(good: Sequence[Summary], vehicles: Vehicles) -> dict[str, Any]:
    """Return a line per vehicle when they are few, else their spread; unknown quantities are left out."""
    plots = {}
    for quantity in QUANTITIES:
        values = vehicles.values[quantity.name]
        if np.isfinite(values).any():
            few = len(vehicles.names) <= FEW
            plot = lines_of_vehicles(good, quantity) if few else _spread(quantity, values)
            plots[f"vehicle-{quantity.name}"] = plot
    return plots


def _spread(quantity: Quantity, values: Any) -> Any:
    plot = new_figure(quantity.title, "Vehicles")
    known = values[np.isfinite(values)] * quantity.scale
    counts, edges = np.histogram(known, min(BINS, max(5, len(known) // 3)))
    source = ColumnDataSource({"left": edges[:-1], "right": edges[1:], "count": counts})
    bars = plot.quad("left", "right", "count", 0, source=source, fill_color=ESTIMATE, line_color=SHADE)
    plot.y_range.start = 0
    plot.add_tools(
        HoverTool(renderers=[bars], tooltips=[("vehicles", "@count"), ("from", "@left"), ("to", "@right")])
    )
    return plot
