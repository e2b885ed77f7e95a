"""Sparkline of a brake application: demanded and achieved deceleration as SVG, one scale for the drive."""

import numpy as np

from brakelab.report.brakings import Braking, inside
from brakelab.report.drive import Drive, Vector

WIDTH, HEIGHT = 110, 26
POINTS = 40
_LEAST_SCALE = 2.0  # m/s^2


def sparklines(drive: Drive, found: list[Braking]) -> list[str]:
    """Return an SVG for each application, empty without data; intervals are drawn by their means."""
    decelerations = drive.column("decel_demand_total"), -drive.column("accel_x_road")
    lines = []
    for braking in found:
        rows = inside(drive, braking)
        lines.append([_means(drive.t[rows], values[rows]) for values in decelerations])
    tops = [float(mean.max()) for pair in lines for _, mean in pair if len(mean)]
    scale = max([_LEAST_SCALE, *tops])
    return [_svg(pair, scale) if any(len(mean) for _, mean in pair) else "" for pair in lines]


def _means(t: Vector, values: Vector) -> tuple[Vector, Vector]:
    """Return at most `POINTS` means of known values, and their positions as shares of the application."""
    known = np.isfinite(values)
    if known.sum() < 2:
        return np.empty(0), np.empty(0)
    share = (t - t[0]) / (t[-1] - t[0])
    stretch = np.minimum((share * POINTS).astype(int), POINTS - 1)[known]
    count = np.bincount(stretch, minlength=POINTS)
    filled = count > 0
    at = np.bincount(stretch, share[known], POINTS)[filled] / count[filled]
    return at, np.bincount(stretch, values[known], POINTS)[filled] / count[filled]


def _svg(pair: list[tuple[Vector, Vector]], scale: float) -> str:
    paths = []
    for (at, mean), name in zip(pair, ("demanded", "achieved"), strict=True):
        x = 1.0 + at * (WIDTH - 2)
        y = HEIGHT - 2 - np.clip(mean / scale, -0.05, 1.0) * (HEIGHT - 4)
        points = " ".join(f"{a:.0f},{b:.1f}" for a, b in zip(x, y, strict=True))
        if points:
            paths.append(f'<polyline class="{name}" points="{points}"/>')
    return f'<svg class="spark" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">{"".join(paths)}</svg>'
