"""Sparklines: demanded and achieved deceleration as SVG, of each brake application or of a whole drive."""

import numpy as np

from brakelab.arrays import Vector
from brakelab.report.brakings import Braking, inside
from brakelab.report.drive import DriveResult

Curve = tuple[Vector, Vector]
"""Positions as shares of the time, and means [m/s^2]."""

WIDTH, HEIGHT = 110, 26
POINTS = 40
DRIVE_WIDTH, DRIVE_POINTS = 240, 120
_LEAST_SCALE = 2.0  # m/s^2


def sparklines(drive: DriveResult, found: list[Braking]) -> list[str]:
    """Return an SVG for each application, empty without data; one scale for all."""
    lines = [_pair(drive, inside(drive, braking), POINTS) for braking in found]
    scale = _scale(lines)
    return [_svg(pair, scale, WIDTH) for pair in lines]


def drive_sparkline(drive: DriveResult) -> str:
    """Return an SVG of a whole drive, empty without data."""
    pair = _pair(drive, slice(None), DRIVE_POINTS)
    return _svg(pair, _scale([pair]), DRIVE_WIDTH)


def _pair(drive: DriveResult, rows: slice, points: int) -> list[Curve]:
    decelerations = drive.column("decel_demand_total"), -drive.column("accel_x_road")
    return [_means(drive.t[rows], values[rows], points) for values in decelerations]


def _scale(lines: list[list[Curve]]) -> float:
    return max([_LEAST_SCALE, *(float(mean.max()) for pair in lines for _, mean in pair if len(mean))])


def _means(t: Vector, values: Vector, points: int) -> Curve:
    """Return at most `points` means of known values, and their positions as shares of the time."""
    known = np.isfinite(values)
    if known.sum() < 2:
        return np.empty(0), np.empty(0)
    share = (t - t[0]) / (t[-1] - t[0])
    stretch = np.minimum((share * points).astype(int), points - 1)[known]
    count = np.bincount(stretch, minlength=points)
    filled = count > 0
    at = np.bincount(stretch, share[known], points)[filled] / count[filled]
    return at, np.bincount(stretch, values[known], points)[filled] / count[filled]


def _svg(pair: list[Curve], scale: float, width: int) -> str:
    if not any(len(mean) for _, mean in pair):
        return ""
    paths = []
    for (at, mean), name in zip(pair, ("demanded", "achieved"), strict=True):
        x = 1.0 + at * (width - 2)
        y = HEIGHT - 2 - np.clip(mean / scale, -0.05, 1.0) * (HEIGHT - 4)
        points = " ".join(f"{a:.0f},{b:.1f}" for a, b in zip(x, y, strict=True))
        if points:
            paths.append(f'<polyline class="{name}" points="{points}"/>')
    box = f'style="width:{width}px" viewBox="0 0 {width} {HEIGHT}"'
    return f'<svg class="spark" {box} role="img">{"".join(paths)}</svg>'
