"""Charts hold what they are given: marks, lines and cells at their places, in their colours."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from brakelab.results.chart import (
    BLUE,
    HEIGHT,
    LEFT,
    SCALE,
    TOP,
    WIDTH,
    Cells,
    Line,
    Panel,
    ends_of,
    write_chart,
)


def drawn(tmp_path: Path, panel: Panel) -> str:
    path = tmp_path / "chart.svg"
    write_chart(path, [panel], [("line", BLUE)])
    text = path.read_text("utf-8")
    ElementTree.fromstring(text)
    return text


def test_marks_and_lines_lie_where_their_numbers_are(tmp_path: Path) -> None:
    """What lies outside the axes is drawn at their end, what is no number not at all."""
    x, y = np.array([0.0, 5.0, np.nan, 10.0]), np.array([0.0, 2.0, 3.0, 9.0])
    panel = Panel("t", "x", (0.0, 10.0), (0.0, 4.0), [Line(x, y, BLUE), Line(x, y, BLUE, marks=True)])
    text = drawn(tmp_path, panel)
    expected = [(LEFT, TOP + HEIGHT), (LEFT + WIDTH / 2, TOP + HEIGHT / 2), (LEFT + WIDTH, TOP)]
    line = re.search(r'<polyline points="([^"]+)"', text)
    marks = re.search(r'<path d="(M[^"]+h0)" stroke="' + BLUE, text)
    assert line is not None
    assert marks is not None
    assert re.findall(r"[\d.]+,[\d.]+", line[1]) == [f"{a:.1f},{b:.1f}" for a, b in expected]
    assert re.findall(r"M([\d.]+ [\d.]+)h0", marks[1]) == [f"{a:.1f} {b:.1f}" for a, b in expected]


def test_an_axis_goes_a_little_beyond_all_that_is_known() -> None:
    some, others = np.array([1.0, np.nan, 3.0]), np.array([2.0, 11.0, np.inf])
    assert ends_of(some, others) == pytest.approx((0.6, 11.4))
    assert ends_of(some, others, margin=0.0, shown=(50.0, 100.0)) == (2.5, 11.0)
    assert ends_of(np.full(3, 4.0)) == (2.0, 6.0)
    assert ends_of(np.array([np.nan])) == pytest.approx((-0.04, 1.04))


def test_cells_have_the_colour_of_their_value(tmp_path: Path) -> None:
    """Least, greatest, and one without a value, which is left out."""
    cells = Cells(
        np.array([0.0, 5.0, 10.0]), np.array([0.0, 2.0, 4.0]), np.array([[1.0, 3.0], [np.nan, 1.0]]), 1.0, 3.0
    )
    text = drawn(tmp_path, Panel("t", "x", (0.0, 10.0), (0.0, 4.0), [], cells=cells))
    found = re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" [^>]*fill="#([0-9a-f]{6})"/>', text)
    least, greatest = ("".join(f"{part:02x}" for part in SCALE[end]) for end in (0, -1))
    middle_x, middle_y = LEFT + WIDTH / 2, TOP + HEIGHT / 2
    assert [(float(x), float(y), colour) for x, y, colour in found] == [
        (LEFT, middle_y, least),
        (middle_x, middle_y, greatest),
        (middle_x, TOP, least),
    ]
