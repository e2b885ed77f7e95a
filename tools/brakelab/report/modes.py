"""Timeline of the ECU's mode, of each corner's estimator and of every fault that was active."""

from typing import Any, NamedTuple

import numpy as np
from bokeh.models import ColumnDataSource, FactorRange, HoverTool, Range1d
from bokeh.models.annotations import Legend

from brakelab.arrays import Vector
from brakelab.report.downsample import Buckets, worst
from brakelab.report.drive import DriveResult
from brakelab.report.look import DEGRADED, ESTIMATE, FAILED, HOLDING, IDLE, new_figure
from ecu.contract.faults import FAULTS, WORD, WORDS, fault_mask
from ecu.contract.signals import CORNERS, STARTING

# Appearance of each state: (label of the legend, colour)
_KINDS = {
    "idle": ("ready, no estimate yet", IDLE),
    "working": ("active, observing", ESTIMATE),
    "holding": ("holding", HOLDING),
    "degraded": ("degraded", DEGRADED),
    "fault": ("failed, fault", FAILED),
}
_ECU = (("starting", "idle"), ("ready", "idle"), ("active", "working"), ("degraded", "degraded"),
        ("failed", "fault"))  # fmt: skip
_CORNER = (("no estimate yet", "idle"), ("observing", "working"), ("holding", "holding"), ("fault", "fault"))


class Bar(NamedTuple):
    """A stretch of time in one state."""

    row: str
    start: float
    end: float
    state: str
    kind: str


def fault_masks(drive: DriveResult) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return the mask of active faults per row, 0 where it is not available, shape (n,).

    While the ECU starts, inputs not yet received count as lost, which is no fault.
    """
    words = {name: drive.column(name) for name in WORDS}
    return np.where(drive.column("mode") == STARTING, 0, fault_mask(words))


def faults_seen(drive: DriveResult) -> dict[int, str]:
    """Return bit mask and name of every fault that was active at some time."""
    seen = int(np.bitwise_or.reduce(fault_masks(drive)))
    names = {fault.bit: fault.name for fault in FAULTS}
    return {
        1 << bit: names.get(1 << bit, f"fault bit {bit}") for bit in range(2 * WORD - 1) if seen >> bit & 1
    }


def _bars(row: str, t: Vector, end: float, levels: Vector, states: tuple[tuple[str, str], ...]) -> list[Bar]:
    """Return the stretches of equal level; `t` is where each level begins, NaN leaves a gap."""
    known = np.where(np.isfinite(levels), levels, -1).astype(int)
    starts = np.flatnonzero(np.diff(known, prepend=-2))
    ends = np.append(t[starts[1:]], end)
    return [
        Bar(row, float(t[start]), float(until), *states[known[start]])
        for start, until in zip(starts, ends, strict=True)
        if 0 <= known[start] < len(states)
    ]


def mode_bars(drive: DriveResult, grid: Buckets) -> list[Bar]:
    """Return the bars of all rows; in each bucket the most severe state counts."""
    t, end = drive.t[grid.first], float(drive.t[-1])
    bars = _bars("ECU", t, end, worst(grid, drive.column("mode")), _ECU)
    for corner in CORNERS:
        bars += _bars(corner.upper(), t, end, worst(grid, drive.column(f"mode_{corner}")), _CORNER)
    masks = fault_masks(drive)
    for bit, name in faults_seen(drive).items():
        levels = worst(grid, np.where(masks & bit, 0.0, np.nan))
        bars += _bars(name, t, end, levels, ((name, "fault"),))
    return bars


def modes_plot(drive: DriveResult, grid: Buckets, span: Range1d) -> Any:
    """Return the timeline as a figure."""
    rows = ["ECU", *(corner.upper() for corner in CORNERS), *faults_seen(drive).values()]
    height = max(225, 75 + 22 * len(rows))
    plot = new_figure(
        "Time [s]", "Mode and faults", height, x_range=span, y_range=FactorRange(factors=rows[::-1])
    )
    bars = mode_bars(drive, grid)
    for kind, (label, colour) in _KINDS.items():
        mine = [bar for bar in bars if bar.kind == kind]
        if mine:
            columns = dict(zip(Bar._fields, map(list, zip(*mine, strict=True)), strict=True))
            plot.hbar(
                y="row", left="start", right="end", height=0.72, source=ColumnDataSource(columns),
                fill_color=colour, line_color=None, legend_label=label,
            )  # fmt: skip
    plot.grid.grid_line_color = None
    for legend in plot.select(type=Legend):
        legend.glyph_width = 14
        legend.glyph_height = 14
    tips = [("@row", "@state"), ("from", "@start{0.00} s"), ("to", "@end{0.00} s")]
    plot.add_tools(HoverTool(renderers=list(plot.renderers), tooltips=tips))
    return plot
