"""Report of `identify friction`: fit per stop, residuals, numbers, where the law ends."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Final

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.choice import Identified
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.fit import replayed
from brakelab.identify.friction.sheet import html_of, scrolling, write_sheet
from brakelab.identify.friction.stops import Stops
from brakelab.results.chart import BLUE, GREY, ORANGE, Line, Panel, chart_svg, ends_of
from brakelab.results.text_table import Table

MOST_POINTS: Final = 1500  # points of a chart
PARTS: Final = 12  # of a running mean
FIRST: Final = 3  # blocks of 50 ms that are the first contact
WARM: Final = 100.0  # °C


def write_report(
    path: Path,
    columns: Columns,
    stops: Stops,
    identified: Identified,
    tables: Sequence[Table],
    unseen: Stops | None = None,
) -> None:
    """Write the page: the chosen law, its fit, its residuals, where it ends, and `tables`.

    `unseen`: stops of another programme, on which the law is drawn as it is used (Figure 3.13).
    """
    chosen = identified.chosen
    law = replayed(chosen.law, columns.brake, stops, chosen.starts_at_measured)
    off = 100.0 * (law - stops.mu) / stops.mu.mean()
    speed = stops.speed[stops.block_first]
    means = np.array(
        [
            np.average(law[at], weights=speed[at])
            for at in (stops.block_stop == stop for stop in range(len(stops)))
        ]
    )
    number = np.arange(1, len(stops) + 1, dtype=float)
    span = ends_of(stops.mean, means)
    diagonal = np.array(span)
    fit = [
        Panel(
            "mean friction of every stop",
            "stop",
            (0.0, len(stops) + 1.0),
            span,
            [Line(number, stops.mean, GREY, marks=True), Line(number, means, BLUE, marks=True)],
        ),
        Panel(
            "law over measurement, a mark a stop",
            "measured",
            span,
            span,
            [Line(diagonal, diagonal, GREY), Line(stops.mean, means, BLUE, marks=True)],
        ),
    ]
    left = [
        _residuals(name, values, off)
        for name, values in (
            ("disc temperature [°C]", stops.temperature[stops.block_first]),
            ("sliding speed [m/s]", speed),
            ("pressure [bar]", 1e-5 * stops.pressure[stops.block_first]),
        )
    ]
    adhesion, kappa = _adhesion(stops)
    low, high = identified.temperature
    ends = (
        f"{low:.0f} to {high:.0f} °C, {1e-5 * identified.pressure[0]:.0f} to "
        f"{1e-5 * identified.pressure[1]:.0f} bar, sliding at {identified.speed[0]:.1f} to "
        f"{identified.speed[1]:.1f} m/s"
    )
    unsure = ", ".join(chosen.unidentified)
    within = _over_time(stops, law)
    beyond: list[str] = []
    if unseen is not None:
        used = replayed(chosen.law, columns.brake, unseen, False, closed=True)
        beyond = [
            "<h2>Friction over time, held out</h2><p>Stops that the law has not seen, in closed loop.</p>",
            scrolling(chart_svg(_over_time(unseen, used), [("measured", GREY), ("law", BLUE)])),
        ]
    body = [
        f"<h1>Friction law of {escape(columns.name)}: {escape(chosen.name)}</h1>",
        f"<p>{identified.stops} stops; nRMSE {chosen.error:.2f} % on them, {chosen.held_out:.2f} % unseen. "
        "</p>",
        f'<p class="limit"><b>Do not extrapolate.</b> Seen: {ends}. Beyond: {escape(chosen.extrapolates)}.'
        + (f" Not identified by the data: {escape(unsure)}." if unsure else "")
        + "</p>",
        scrolling(chart_svg(fit, [("measured", GREY), ("law", BLUE)])),
        "<h2>Friction over time</h2><p>From the stop that the law explains best to that which it explains "
        "worst.</p>",
        scrolling(chart_svg(within, [("measured", GREY), ("law", BLUE)])),
        *beyond,
        "<h2>First contact</h2><p>Friction of the first blocks of every stop over the disc's temperature, "
        f"κ of (3.12): {kappa}.</p>",
        scrolling(chart_svg([adhesion], [("stops", GREY), ("κ", BLUE)])),
        "<h2>What the law leaves</h2><p>A mark is a block of 50 ms, the line their mean. A line off zero is "
        "what the law has no term for.</p>",
        scrolling(chart_svg(left, [("blocks", BLUE), ("their mean", ORANGE)])),
        *(html_of(table) for table in tables),
    ]
    write_sheet(path, f"Friction law of {columns.name}", body)


def _adhesion(stops: Stops) -> tuple[Panel, str]:
    """Return friction at first contact over the disc's temperature (Figure 3.10), and its straight line."""
    begins, counts = np.unique(stops.block_stop, return_index=True, return_counts=True)[1:]
    first = np.array(
        [stops.mu[at : at + min(FIRST, count)].mean() for at, count in zip(begins, counts, strict=True)]
    )
    heat = stops.start_temperature[stops.block_stop[begins]]
    (slope, level), covariance = np.polyfit(heat - WARM, first, 1, cov="unscaled")
    off = first - level - slope * (heat - WARM)
    sigma = np.sqrt(np.diag(covariance) * float(off @ off) / max(len(off) - 2, 1))
    line = ends_of(heat)
    lines = [
        Line(heat, first, GREY, marks=True),
        Line(np.array(line), level + slope * (np.array(line) - WARM), BLUE),
    ]
    said = (
        f"{level:.3f} ± {1.96 * sigma[1]:.3f} at {WARM:.0f} °C, {1e5 * slope:+.1f} ± {196e3 * sigma[0]:.1f} "
        "10⁻³ per 100 K"
    )
    return Panel("κ", "disc before the stop [°C]", line, ends_of(first), lines), said


def _over_time(stops: Stops, law: Vector) -> list[Panel]:
    """Return measured friction and the law's over time, as Figure 3.12, of four stops."""
    off = np.array([np.mean((law - stops.mu)[stops.block_stop == stop] ** 2) for stop in range(len(stops))])
    order = np.argsort(off, kind="stable")
    picked = order[np.linspace(0, len(order) - 1, 4).astype(int)].tolist()
    shown = [stops.block_stop == stop for stop in picked]
    span = ends_of(*(values[at] for at in shown for values in (law, stops.mu)))
    panels = []
    for stop, at in zip(picked, shown, strict=True):
        t = (stops.block_first[at] - stops.first[stop]) * stops.dt
        title = (
            f"stop {stop + 1}: {1e-5 * stops.held_pressure[stop]:.0f} bar, "
            f"from {stops.start_temperature[stop]:.0f} °C, {stops.start_speed[stop]:.1f} m/s"
        )
        lines = [Line(t, stops.mu[at], GREY), Line(t, law[at], BLUE)]
        panels.append(Panel(title, "s", ends_of(t), span, lines))
    return panels


def _residuals(name: str, values: Vector, off: Vector) -> Panel:
    """Return the residuals, thinned evenly, zero, and their running mean."""
    order = np.argsort(values, kind="stable")
    thin = order[:: max(len(order) // MOST_POINTS, 1)]
    parts = np.array_split(order, PARTS)
    middle = np.array([values[part].mean() for part in parts])
    mean = np.array([off[part].mean() for part in parts])
    ends = np.array([values.min(), values.max()])
    most = float(np.quantile(np.abs(off), 0.995))
    lines = [
        Line(values[thin], off[thin], BLUE, marks=True),
        Line(ends, np.zeros(2), "#333"),
        Line(middle, mean, ORANGE),
    ]
    return Panel("residual [%]", name, ends_of(values), (-most, most), lines)
