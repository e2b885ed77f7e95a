"""A trip as an SVG: speed, grade, height and, of a drive, the discs' temperatures over time."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from brakelab.arrays import Array
from brakelab.report.downsample import buckets, extremes, times
from brakelab.results.outputs import write_text
from brakelab.simulation.trip.table import KMH, RURAL, URBAN, height_gained
from ecu.contract.signals import CORNERS

LEFT, WIDTH, TOP, HEIGHT, GAP = 60.0, 920.0, 24.0, 130.0, 34.0
POINTS: Final = 1400
COLOURS: Final = ("#0072b2", "#56b4e9", "#d55e00", "#e69f00")


def _ticks(low: float, high: float) -> Array:
    step = next(s for s in (1, 2, 5, 10, 20, 50, 100, 200, 500) if (high - low) / s <= 6)
    return np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step + 0.0


def _panel(
    title: str, top: float, t: Array, lines: Sequence[Array], marks: Sequence[float] = ()
) -> list[str]:
    low, high = min(float(line.min()) for line in lines), max(float(line.max()) for line in lines)
    scale = HEIGHT / max(high - low, 1.0)
    grid = buckets(np.zeros(len(t), np.bool_), POINTS)
    x = LEFT + WIDTH * times(grid, t) / t[-1]
    parts = [f'<text x="{LEFT}" y="{top - 6:.0f}">{title}</text>']
    for tick in _ticks(low, high):
        y = top + scale * (high - tick)
        parts.append(f'<path d="M{LEFT} {y:.1f}h{WIDTH}" stroke="#e3e6ea"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for mark in marks:
        y = top + scale * (high - mark)
        parts.append(f'<path d="M{LEFT} {y:.1f}h{WIDTH}" stroke="#888" stroke-dasharray="4 4"/>')
    for line, colour in zip(lines, COLOURS, strict=False):
        y = top + scale * (high - extremes(grid, line))
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        parts.append(f'<polyline points="{points}" stroke="{colour}"/>')
    return parts


def write_picture(path: Path, t: Array, speed: Array, grade: Array, discs: Array) -> None:
    """Draw a trip (as for `trip_rows`) and the discs' temperatures [degC], shape (n, 4) or (n, 0), to `path`.

    Raises:
        UserError: the file cannot be written.
    """
    panels: list[tuple[str, list[Array], tuple[float, ...]]] = [
        (
            "speed [km/h]; dashed: where rural and motorway operation begin",
            [speed / KMH],
            (URBAN / KMH, RURAL / KMH),
        ),
        ("grade [%]", [100.0 * np.tan(grade)], ()),
        ("height over the start [m]", [height_gained(t, speed, grade)], ()),
    ]
    if discs.size:
        names = (f'<tspan style="fill:{c}">{name}</tspan>' for name, c in zip(CORNERS, COLOURS, strict=True))
        title = f"disc temperature [degC]: {', '.join(names)}"
        panels.append((title, list(discs.T), ()))
    body: list[str] = []
    for place, (title, lines, marks) in enumerate(panels):
        body += _panel(title, TOP + place * (HEIGHT + GAP), t, lines, marks)
    bottom = TOP + len(panels) * (HEIGHT + GAP)
    for minute in range(0, int(t[-1] / 60.0) + 1, 10):
        x = LEFT + WIDTH * 60.0 * minute / t[-1]
        body.append(f'<text x="{x:.1f}" y="{bottom - 12:.0f}" text-anchor="middle">{minute} min</text>')
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {LEFT + WIDTH + 30:.0f} {bottom:.0f}" '
        'font-family="sans-serif" font-size="13" fill="none">\n'
        '<style>text{fill:#333}</style><rect width="100%" height="100%" fill="#fff"/>\n'
        + "\n".join(body)
        + "\n</svg>\n"
    )
    write_text(path, text, "--svg")
