"""Charts as SVG: panels in a grid, a few lines, marks or coloured cells in each."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.results.outputs import write_text

WIDTH, HEIGHT = 330.0, 180.0  # of a panel's inside
LEFT, TOP, GAP_X, GAP_Y = 48.0, 52.0, 64.0, 66.0
GREY, ORANGE, BLUE, GREEN, PINK = "#9aa5b1", "#d55e00", "#0072b2", "#009e73", "#cc79a7"
MOST_POINTS: Final = 400  # points of a line; marks are all drawn


class Line(NamedTuple):
    """One line of a panel."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    colour: str
    dashed: bool = False
    marks: bool = False
    """Points that no line joins."""


class Cells(NamedTuple):
    """A surface as coloured cells; `low` and `high` are the ends of its colours, stated beside the title."""

    x: NDArray[np.float64]  # (columns + 1,), edges
    y: NDArray[np.float64]  # (rows + 1,)
    value: NDArray[np.float64]  # (rows, columns)
    low: float
    high: float


class Panel(NamedTuple):
    """One panel; `x` and `y` are the ends of its axes."""

    title: str
    x_name: str
    x: tuple[float, float]
    y: tuple[float, float]
    lines: Sequence[Line]
    logarithmic: bool = False
    """The axis of x."""
    cells: Cells | None = None
    """Below the lines."""
    names: Sequence[tuple[str, str]] = ()
    """Of its own lines with their colours, in the corner below left."""


SCALE: Final = ((247, 251, 255), (158, 202, 225), (66, 146, 198), (8, 81, 156), (8, 29, 68))
"""Colours from the least value to the greatest, red, green, blue."""


def _colour(share: float) -> str:
    place = min(max(share, 0.0), 1.0) * (len(SCALE) - 1)
    below = min(int(place), len(SCALE) - 2)
    mixed = (a + (place - below) * (b - a) for a, b in zip(SCALE[below], SCALE[below + 1], strict=True))
    return "#" + "".join(f"{round(part):02x}" for part in mixed)


def ends_of(
    *values: NDArray[np.float64], margin: float = 0.04, shown: tuple[float, float] = (0.0, 100.0)
) -> tuple[float, float]:
    """Return the ends of an axis: percentiles `shown` of all values, and a `margin` of their span beyond."""
    every = np.concatenate(values)
    known = every[np.isfinite(every)]
    low, high = np.percentile(known, shown).tolist() if len(known) else (0.0, 1.0)
    beyond = margin * (high - low) if high > low else 0.5 * max(abs(low), 1.0)
    return low - beyond, high + beyond


def _ticks(low: float, high: float) -> NDArray[np.float64]:
    raw = (high - low) / 5.0
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((1.0, 2.0, 2.5, 5.0, 10.0), key=lambda nice: abs(nice - raw / power))
    ticks: NDArray[np.float64] = np.arange(np.ceil(low / step - 1e-9), high / step + 1e-9) * step
    return ticks + 0.0  # no -0


def _draw(panel: Panel, left: float, top: float) -> list[str]:
    def place_x(value: NDArray[np.float64]) -> NDArray[np.float64]:
        low, high = panel.x
        if panel.logarithmic:
            value, low, high = np.log10(value), np.log10(low), np.log10(high)
        return left + WIDTH * (value - low) / (high - low)

    def place_y(value: NDArray[np.float64]) -> NDArray[np.float64]:
        return top + HEIGHT * (panel.y[1] - value) / (panel.y[1] - panel.y[0])

    title, name = escape(panel.title), escape(panel.x_name)
    parts = [
        f'<text x="{left}" y="{top - 8}">{title}</text>',
        f'<rect x="{left}" y="{top}" width="{WIDTH}" height="{HEIGHT}" stroke="#c9ced4"/>',
        f'<text x="{left + 0.5 * WIDTH}" y="{top + HEIGHT + 32}" text-anchor="middle">{name}</text>',
    ]
    if panel.cells is not None:
        parts += _cells(panel.cells, place_x(panel.cells.x), place_y(panel.cells.y))
    for tick in _ticks(*panel.y):
        y = float(place_y(tick))
        if panel.cells is None:
            parts.append(f'<path d="M{left} {y:.1f}h{WIDTH}" stroke="#eceff1"/>')
        parts.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:.4g}</text>')
    ends = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]) if panel.logarithmic else _ticks(*panel.x)
    for tick in ends[(ends >= panel.x[0]) & (ends <= panel.x[1])]:
        x = float(place_x(tick))
        parts.append(f'<text x="{x:.1f}" y="{top + HEIGHT + 16}" text-anchor="middle">{tick:.4g}</text>')
    for line in panel.lines:
        every = 1 if line.marks else max(len(line.x) // MOST_POINTS, 1)
        heights = np.clip(line.y[::every], *panel.y)
        pairs = [
            (a, b)
            for a, b in zip(place_x(line.x[::every]), place_y(heights), strict=True)
            if np.isfinite(a + b)
        ]
        if line.marks:
            dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in pairs)
            parts.append(
                f'<path d="{dots}" stroke="{line.colour}" stroke-width="3" stroke-linecap="round" '
                'stroke-opacity="0.6"/>'
            )
            continue
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in pairs)
        dashes = ' stroke-dasharray="5 4"' if line.dashed else ""
        parts.append(f'<polyline points="{points}" stroke="{line.colour}" stroke-width="1.4"{dashes}/>')
    for place, (name, colour) in enumerate(reversed(panel.names)):
        y = top + HEIGHT - 8 - 13 * place
        parts.append(
            f'<text x="{left + 8}" y="{y}" font-size="10" style="fill:{colour}">{escape(name)}</text>'
        )
    return parts


def _cells(cells: Cells, x: NDArray[np.float64], y: NDArray[np.float64]) -> list[str]:
    """Return the rectangles of a surface; `x` and `y`: its edges in the picture."""
    parts = []
    shares = (cells.value - cells.low) / (cells.high - cells.low)
    for row, column in np.ndindex(*shares.shape):
        if np.isfinite(shares[row, column]):
            width, height = abs(x[column + 1] - x[column]), abs(y[row + 1] - y[row])
            parts.append(
                f'<rect x="{x[column]:.1f}" y="{min(y[row], y[row + 1]):.1f}" width="{width + 0.3:.1f}" '
                f'height="{height + 0.3:.1f}" fill="{_colour(float(shares[row, column]))}"/>'
            )
    return parts


def chart_svg(panels: Sequence[Panel], legend: Sequence[tuple[str, str]], columns: int = 2) -> str:
    """Return panels row by row as SVG, above them the legend's names in their colours."""
    rows = -(-len(panels) // columns)
    width = LEFT + columns * (WIDTH + GAP_X) - GAP_X + 16.0
    height = TOP + rows * (HEIGHT + GAP_Y) - GAP_Y + 44.0
    names = "   ".join(f'<tspan style="fill:{colour}">{escape(name)}</tspan>' for name, colour in legend)
    body = [f'<text x="{LEFT}" y="20" xml:space="preserve">{names}</text>']
    for number, panel in enumerate(panels):
        row, column = divmod(number, columns)
        body += _draw(panel, LEFT + column * (WIDTH + GAP_X), TOP + row * (HEIGHT + GAP_Y))
    return svg(width, height, body)


def write_chart(
    path: Path, panels: Sequence[Panel], legend: Sequence[tuple[str, str]], columns: int = 2
) -> None:
    """Write `chart_svg` as a file; nothing without the folder.

    Raises:
        UserError: the file cannot be written.
    """
    if path.parent.is_dir():
        write_text(path, chart_svg(panels, legend, columns))


def svg(width: float, height: float, body: Sequence[str]) -> str:
    """Return SVG elements as a picture on white."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        'font-family="sans-serif" font-size="12" fill="none">\n'
        '<style>text{fill:#333}</style><rect width="100%" height="100%" fill="#fff"/>\n'
        + "\n".join(body)
        + "\n</svg>\n"
    )


def write_svg(path: Path, width: float, height: float, body: Sequence[str]) -> None:
    """Write SVG elements as a picture on white.

    Raises:
        UserError: the file cannot be written.
    """
    write_text(path, svg(width, height, body))
