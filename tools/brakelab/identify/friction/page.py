"""Report of `identify friction`: fit per stop, residuals, numbers, where the law ends.

One HTML file without scripts or anything from elsewhere; its charts are SVG.
"""

import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Final

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.choice import Identified
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.fit import replayed
from brakelab.identify.friction.stops import Stops
from brakelab.results.chart import BLUE, GREY, ORANGE, Line, Panel, chart_svg
from brakelab.results.text_table import Table

WORD: Final = re.compile("[a-z]{3}")
"""Mark of a column of words, which is set from the left."""
MOST_POINTS: Final = 1500  # points of a chart
PARTS: Final = 12  # of a running mean
STYLE: Final = (
    "body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:990px;padding:0 1em;color:#1d2733}"
    "h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em}"
    "table{border-collapse:collapse;font-size:13px}td,th{padding:3px 10px;border-bottom:1px solid #dde2e7;"
    "text-align:right}td:first-child,th:first-child,.words{text-align:left}"
    ".scroll{overflow-x:auto}svg{width:100%;min-width:640px}.limit{background:#fff4e5;"
    "border-left:4px solid #d55e00;padding:.6em 1em}"
    "@media screen and (prefers-color-scheme:dark){body{background:#14181d;color:#e8ebef}"
    "td,th{border-color:#323941}.limit{background:#33291a}}"
)


def write_report(
    path: Path, columns: Columns, stops: Stops, identified: Identified, tables: Sequence[Table]
) -> None:
    """Write the page: the chosen law, its fit, its residuals, where it ends, and `tables`."""
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
    span = _ends(stops.mean, means)
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
    low, high = identified.temperature
    ends = (
        f"{low:.0f} to {high:.0f} °C, {1e-5 * identified.pressure[0]:.0f} to "
        f"{1e-5 * identified.pressure[1]:.0f} bar, sliding at {identified.speed[0]:.1f} to "
        f"{identified.speed[1]:.1f} m/s"
    )
    unsure = ", ".join(chosen.unidentified)
    body = [
        f"<h1>Friction law of {escape(columns.name)}: {escape(chosen.name)}</h1>",
        f"<p>{identified.stops} stops; nRMSE {chosen.error:.2f} % on them, {chosen.held_out:.2f} % unseen. "
        "</p>",
        f'<p class="limit"><b>Do not extrapolate.</b> Seen: {ends}. Beyond: {escape(chosen.extrapolates)}.'
        + (f" Not identified by the data: {escape(unsure)}." if unsure else "")
        + "</p>",
        _scrolling(chart_svg(fit, [("measured", GREY), ("law", BLUE)])),
        "<h2>What the law leaves</h2><p>A mark is a block of 50 ms, the line their mean. A line off zero is "
        "what the law has no term for.</p>",
        _scrolling(chart_svg(left, [("blocks", BLUE), ("their mean", ORANGE)])),
        *(_html(table) for table in tables),
    ]
    title = f"Friction law of {escape(columns.name)}"
    path.write_text(
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="color-scheme" content="light dark"><style>{STYLE}</style>'
        f"<body>{''.join(body)}</body></html>\n",
        encoding="utf-8",
    )


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
    return Panel("residual [%]", name, _ends(values), (-most, most), lines)


def _ends(*values: Vector) -> tuple[float, float]:
    low, high = (float(end) for end in (np.min(np.concatenate(values)), np.max(np.concatenate(values))))
    edge = 0.04 * max(high - low, 1e-9)
    return low - edge, high + edge


def _scrolling(wide: str) -> str:
    return f'<div class="scroll" tabindex="0">{wide}</div>'


def _html(table: Table) -> str:
    wordy = [any(WORD.search(row[k]) for row in table.rows) for k in range(len(table.columns))]
    kinds = [' class="words"' if words else "" for words in wordy]

    def cells(tag: str, values: Sequence[str]) -> str:
        return "".join(f"<{tag}{kind}>{escape(v)}</{tag}>" for kind, v in zip(kinds, values, strict=True))

    rows = "".join(f"<tr>{cells('td', row)}</tr>" for row in table.rows)
    below = f"<p>{escape(table.below)}</p>" if table.below else ""
    lines = f"<table><tr>{cells('th', table.columns)}</tr>{rows}</table>"
    return f"<h2>{escape(table.title)}</h2>{_scrolling(lines)}{below}"
