"""Line charts as SVG: panels in a grid, a few lines in each."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.errors import UserError

WIDTH, HEIGHT = 330.0, 180.0  # of a panel's inside
LEFT, TOP, GAP_X, GAP_Y = 48.0, 52.0, 64.0, 66.0
GREY, ORANGE, BLUE, GREEN, PINK = "#9aa5b1", "#d55e00", "#0072b2", "#009e73", "#cc79a7"
LARGEST: Final = 400  # points of a line


class Line(NamedTuple):
    """One line of a panel."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    colour: str
    dashed: bool = False


class Panel(NamedTuple):
    """One panel; `x` and `y` are the ends of its axes."""

    title: str
    x_name: str
    x: tuple[float, float]
    y: tuple[float, float]
    lines: Sequence[Line]
    logarithmic: bool = False
    """The axis of x."""


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

    parts = [
        f'<text x="{left}" y="{top - 8}">{panel.title}</text>',
        f'<rect x="{left}" y="{top}" width="{WIDTH}" height="{HEIGHT}" stroke="#c9ced4"/>',
        f'<text x="{left + 0.5 * WIDTH}" y="{top + HEIGHT + 32}" text-anchor="middle">{panel.x_name}</text>',
    ]
    for tick in _ticks(*panel.y):
        y = float(place_y(tick))
        parts.append(f'<path d="M{left} {y:.1f}h{WIDTH}" stroke="#eceff1"/>')
        parts.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:.3g}</text>')
    ends = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]) if panel.logarithmic else _ticks(*panel.x)
    for tick in ends[(ends >= panel.x[0]) & (ends <= panel.x[1])]:
        x = float(place_x(tick))
        parts.append(f'<text x="{x:.1f}" y="{top + HEIGHT + 16}" text-anchor="middle">{tick:.3g}</text>')
    for line in panel.lines:
        every = max(len(line.x) // LARGEST, 1)
        heights = np.clip(line.y[::every], *panel.y)
        pairs = zip(place_x(line.x[::every]), place_y(heights), strict=True)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in pairs if np.isfinite(a + b))
        dashes = ' stroke-dasharray="5 4"' if line.dashed else ""
        parts.append(f'<polyline points="{points}" stroke="{line.colour}" stroke-width="1.4"{dashes}/>')
    return parts


def write_chart(
    path: Path, panels: Sequence[Panel], legend: Sequence[tuple[str, str]], columns: int = 2
) -> None:
    """Write panels row by row, above them the legend's names in their colours; nothing without the folder.

    Raises:
        UserError: the file cannot be written.
    """
    if not path.parent.is_dir():
        return
    rows = -(-len(panels) // columns)
    width = LEFT + columns * (WIDTH + GAP_X) - GAP_X + 16.0
    height = TOP + rows * (HEIGHT + GAP_Y) - GAP_Y + 44.0
    names = "   ".join(f'<tspan style="fill:{colour}">{name}</tspan>' for name, colour in legend)
    body = [f'<text x="{LEFT}" y="20" xml:space="preserve">{names}</text>']
    for number, panel in enumerate(panels):
        row, column = divmod(number, columns)
        body += _draw(panel, LEFT + column * (WIDTH + GAP_X), TOP + row * (HEIGHT + GAP_Y))
    write_svg(path, width, height, body)


def write_svg(path: Path, width: float, height: float, body: Sequence[str]) -> None:
    """Write SVG elements as a picture on white.

    Raises:
        UserError: the file cannot be written.
    """
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        'font-family="sans-serif" font-size="12" fill="none">\n'
        '<style>text{fill:#333}</style><rect width="100%" height="100%" fill="#fff"/>\n'
        + "\n".join(body)
        + "\n</svg>\n"
    )
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(str(path), "", f"cannot be written ({error.strerror}); make it writable") from None
