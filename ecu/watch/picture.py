"""Terminal picture of a watched daemon, for any width from 40 columns on."""

import math
import time
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from rich.console import Console, Group, RenderableType
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from ecu.contract.signals import CORNERS
from ecu.watch.history import COLUMN, LATENESS_US, SHOWN_S, Row, frames_text
from ecu.watch.inputs import InputRow
from ecu.watch.line import ceiling, corner_values, faults_of, mode_of, number
from ecu.watch.watcher import Watcher

BLOCKS: Final = "▁▂▃▄▅▆▇█"
ESTIMATES: Final = ("nominal", "observing", "holding", "fault")
STYLES: Final = {"active": "bold green", "ready": "green", "degraded": "bold yellow", "failed": "bold red"}
KEYS: Final = "q quit  k keep  space pause  ← → 1 s  ↑ ↓ 10 s  end now"
WIDE, MEDIUM = 100, 64
TALL: Final = 30
RECENT_S: Final = 1.0
"""Age up to which a comparison of an input says something of now."""


def sparkline(values: Sequence[float], width: int, least: float, peers: Sequence[float] = ()) -> str:
    """Return values as a line of blocks; `least` is the least range, NaN is left blank.

    The end of the line is the end of `values`, each block the mean of its part. The scale holds `peers` too.
    """
    if not values or width < 1:
        return ""
    edges = [round(place * len(values) / width) for place in range(width + 1)]
    parts = [[v for v in values[a:b] if math.isfinite(v)] for a, b in pairwise(edges)]
    means = [sum(part) / len(part) if part else math.nan for part in parts]
    known = [mean for mean in means if math.isfinite(mean)]
    if not known:
        return " " * width
    beside = [value for value in peers if math.isfinite(value)]
    low, high = min([*known, *beside]), max([*known, *beside])
    low, high = (low, high) if high - low >= least else ((low + high - least) / 2, (low + high + least) / 2)
    scale = (len(BLOCKS) - 1) / (high - low)
    return "".join(BLOCKS[int(scale * (m - low) + 0.499)] if math.isfinite(m) else " " for m in means)


def shown(rows: Sequence[Row], back_s: float) -> list[Row]:
    """Return the rows of the minute that ends `back_s` before the last row."""
    if not rows:
        return []
    end = rows[-1][COLUMN["t"]] - back_s
    return [row for row in rows if end - SHOWN_S < row[COLUMN["t"]] <= end + 1e-6]


def picture(
    watcher: Watcher, width: int, height: int, back_s: float = 0.0, note: str = "", paused: bool = False
) -> RenderableType:
    """Return the whole picture: `back_s` before the last row, with a `note` to the user."""
    rows = shown(watcher.history.rows, back_s)
    label = watcher.daemon.label if watcher.daemon else "brake-ecu watch"
    parts: list[RenderableType] = [Text(label, "bold", no_wrap=True, overflow="ellipsis")]
    if watcher.trouble:
        parts.append(Text(watcher.trouble, "bold red"))
    if rows:
        parts += [_state(rows[-1], back_s, paused), _corners(rows, width), *_decelerations(rows, width)]
        parts += [Rule(style="dim"), _faults(rows[-1])]
        parts += [_inputs(watcher.history.inputs)] if height >= TALL else []
    if watcher.history.lateness.any():
        parts += [Rule(style="dim"), *_lateness(watcher, width, height)]
    parts.append(Rule(style="dim"))
    kept = f"{watcher.history.kept_s:.0f} s can be kept"
    last = [Text(note or kept, "cyan", overflow="ellipsis", no_wrap=not note)]
    last.append(Text(KEYS, "dim", no_wrap=True, overflow="ellipsis"))
    room = height - 1 - sum(_height(part, width) for part in [*parts, *last])
    return Group(*parts, *_events(watcher, room), *last)


def _height(part: RenderableType, width: int) -> int:
    if isinstance(part, Table):
        return part.row_count + 1
    if isinstance(part, Text) and not part.no_wrap:
        return len(part.wrap(Console(), width))
    return 1


def _state(row: Row, back_s: float, paused: bool) -> Text:
    mode = mode_of(row)
    when = time.strftime("%H:%M:%S", time.localtime(row[COLUMN["clock"]]))
    line = Text(no_wrap=True, overflow="ellipsis")
    line.append(mode.upper(), STYLES.get(mode, ""))
    line.append(f"  {number(row[COLUMN['vehicle_speed']], 1)} m/s  {when}")
    if not row[COLUMN["speaks"]]:
        line.append("  silent", "yellow")
    if back_s > 0.0:
        line.append(f"  {back_s:.0f} s back", "cyan")
    if paused:
        line.append("  paused", "cyan")
    return line


def _corners(rows: Sequence[Row], width: int) -> Table:
    table = Table(
        box=None, pad_edge=False, padding=(0, 2 if width >= MEDIUM else 1, 0, 0), header_style="dim"
    )
    headings = ["", "friction", "bar", "°C"]
    headings += ["wear mm", "left %"] if width >= MEDIUM else []
    headings += ["estimate"] if width >= MEDIUM else []
    spark = max(0, min(60, width - 64)) if width >= WIDE else 0
    headings += ["friction, last minute"] if spark else []
    for heading in headings:
        table.add_column(heading, justify="left" if heading[:1] in ("", "e") else "right", no_wrap=True)
    row = rows[-1]
    for place, corner in enumerate(CORNERS):

        def value(name: str, place: int = place) -> float:
            return corner_values(row, name)[place]

        cells = [
            corner,
            f"{number(value('mu_b'), 3)}±{number(value('sigma_mu_b'), 3)}",
            f"{number(value('pressure_demand'))}→{number(value('calliper_pressure'))}",
            number(value("disc_temperature")),
        ]
        if width >= MEDIUM:
            mode = value("mode_mu_b")
            cells += [number(value("pad_wear"), 3), number(value("pad_remaining"))]
            cells.append(ESTIMATES[int(mode)] if math.isfinite(mode) and 0 <= mode < 4 else "?")
        if spark:
            place_of = COLUMN[f"mu_b_{corner}"]
            cells.append(sparkline([float(one[place_of]) for one in rows], spark, 0.05))
        table.add_row(*cells)
    return table


def _decelerations(rows: Sequence[Row], width: int) -> Iterable[Text]:
    row = rows[-1]
    demanded, measured = number(row[COLUMN["decel_demand_total"]], 2), number(-row[COLUMN["accel_x_road"]], 2)
    text = f"deceleration {demanded} demanded, {measured} measured m/s²{ceiling(row)}"
    yield Text(text if width >= MEDIUM else f"decel {demanded}→{measured} m/s²")
    room = width - 10
    demands = [float(one[COLUMN["decel_demand_total"]]) for one in rows]
    measurements = [-float(one[COLUMN["accel_x_road"]]) for one in rows]
    yield Text(f"demanded  {sparkline(demands, room, 1.0, measurements)}", no_wrap=True, overflow="crop")
    yield Text(f"measured  {sparkline(measurements, room, 1.0, demands)}", no_wrap=True, overflow="crop")


def _faults(row: Row) -> Text:
    names = faults_of(row)
    return Text(", ".join(names), "bold red") if names else Text("no fault", "green")


def _inputs(inputs: Sequence[InputRow]) -> Text:
    """Return which inputs are left out, and which of the others is nearest to its gate."""
    rejected = ", ".join(row.name for row in inputs if row.rejected)
    judged = [row for row in inputs if not row.rejected and row.judged_s < RECENT_S]
    worst = max(judged, key=lambda row: row.ratio, default=None)
    compared = f"test ratio at most {number(worst.ratio, 2)} ({worst.name})" if worst else "no input compared"
    line = Text(f"left out: {rejected}; " if rejected else "", "bold red", no_wrap=True, overflow="ellipsis")
    return line.append(compared, "none")


def _lateness(watcher: Watcher, width: int, height: int) -> Iterable[Text]:
    counts = watcher.history.lateness
    total = int(counts.sum())
    labels = [f"≤ {edge} µs" for edge in LATENESS_US] + ["later"]
    cycles = f"{watcher.history.cycles} cycles, periods missed: {watcher.history.missed}"
    yield Text(cycles, no_wrap=True, overflow="ellipsis")
    yield Text(f"protected frames: {frames_text(watcher.history.frames)}", no_wrap=True, overflow="ellipsis")
    if height < TALL:
        most = labels[int(np.searchsorted(np.cumsum(counts), 0.99 * total))]
        worst = labels[int(np.flatnonzero(counts)[-1])]
        yield Text(f"late: 99 % {most}, worst {worst}", no_wrap=True, overflow="ellipsis")
        return
    yield Text(f"late, of {total} seen:")
    room = max(5, min(60, width - 26))
    for label, count in zip(labels, counts.tolist(), strict=True):
        if count:
            bar = "█" * max(1, round(room * count / total))
            yield Text(f"{label:>10} {bar} {100 * count / total:.2f} %", no_wrap=True, overflow="crop")


def _events(watcher: Watcher, room: int) -> Iterable[Text]:
    for event in list(watcher.history.events)[-room:] if room > 0 else ():
        when = time.strftime("%H:%M:%S", time.localtime(event.clock))
        style = "yellow" if event.serious else ""
        yield Text(f"{when} {event.text}", style, no_wrap=True, overflow="ellipsis")
