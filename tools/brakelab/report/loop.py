"""Histograms of the loop's lateness and of its stages."""

from typing import Any

import numpy as np

from brakelab.arrays import Vector
from brakelab.report.look import ESTIMATE, STAGE_COLOURS, free_figure
from brakelab.report.timing import Timing

# Shorter than the clock's own grain here: drawn in the first bin.
SHORTEST_US = 0.1
BINS_PER_DECADE = 12


def plots_of_loop(timing: Timing) -> dict[str, Any]:
    """Return the figures by name, both with logarithmic axes."""
    lateness = _figure("Lateness [µs]")
    _histogram(lateness, timing.lateness, "start of the cycle after its deadline", ESTIMATE, 0.5)
    stages = _figure("Duration [µs]")
    for (name, durations), colour in zip(timing.stages.items(), STAGE_COLOURS, strict=True):
        _histogram(stages, durations, name, colour, 0.0)
    return {"lateness": lateness, "stages": stages}


def _figure(label: str) -> Any:
    return free_figure(label, "Cycles per bin", 225, x_axis_type="log", y_axis_type="log")


def _histogram(plot: Any, durations: Vector, label: str, colour: str, alpha: float) -> None:
    shown = np.maximum(durations, SHORTEST_US)
    first = np.floor(np.log10(shown.min()) * BINS_PER_DECADE)
    last = np.floor(np.log10(shown.max()) * BINS_PER_DECADE) + 1
    edges = 10.0 ** (np.arange(first, last + 1) / BINS_PER_DECADE)
    counts = np.histogram(shown, edges)[0].astype(float)
    # A logarithmic axis has no zero: a bin without a cycle ends at half a cycle.
    height = np.maximum(counts, 0.5)
    look: dict[str, Any] = {
        "step_mode": "after",
        "fill_color": colour,
        "fill_alpha": alpha,
        "legend_label": label,
    }
    plot.varea_step(edges, np.full(len(edges), 0.5), np.append(height, 0.5), **look)
    outline = np.concatenate([[0.5], np.repeat(height, 2), [0.5]])
    plot.line(np.repeat(edges, 2), outline, line_color=colour, line_width=1.6, legend_label=label)
