"""Clouds of points: what each row of the brake applications shows, and the mean over it."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.report.look import INK

FEWEST_ROWS: Final = 20
"""Of an interval that has a mean."""


def thinned(places: NDArray[np.int64], points: int) -> NDArray[np.int64]:
    """Return at most `points` of `places`, evenly."""
    return places[:: max(1, -(-len(places) // points))]


def draw_dots(plot: Any, x: Any, y: Any, colour: str, alpha: float, label: str, **source: Any) -> None:
    """Draw a small dot for each row."""
    style = {"size": 3, "line_color": None, "fill_color": colour, "fill_alpha": alpha}
    plot.scatter(x, y, legend_label=label, **style, **source)


def draw_true_mean(plot: Any, at: Vector, mean: Vector) -> list[Any]:
    """Draw the mean of the truth, if it has two points; return what was drawn."""
    style = {"line_color": INK, "line_dash": "dashed", "line_width": 1.3}
    return [plot.line(at, mean, legend_label="mean, true", **style)] if len(at) > 1 else []


def binned(at: Vector, values: Vector, bins: int = 10) -> tuple[Vector, Vector]:
    """Return the means of `at` and `values` in intervals of `at`; intervals of few rows are left out."""
    known = np.isfinite(at) & np.isfinite(values)
    at, values = at[known], values[known]
    if not len(at) or np.ptp(at) == 0.0:
        return np.empty(0), np.empty(0)
    number = np.minimum(((at - at.min()) / np.ptp(at) * bins).astype(int), bins - 1)
    count = np.bincount(number, minlength=bins)
    kept = count >= FEWEST_ROWS
    first, second = (np.bincount(number, of, bins)[kept] / count[kept] for of in (at, values))
    return first, second
