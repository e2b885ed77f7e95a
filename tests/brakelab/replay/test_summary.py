"""The table of brakings that `replay` prints."""

import pytest
from rich.console import Console

from brakelab.replay.brakes import LEARNED, BrakeRow
from brakelab.replay.summary import brakings_table
from ecu.signals import CORNERS

NOMINAL = (0.4, 0.4, 0.36, 0.36)


def printed(friction: tuple[float, float, float, float]) -> str:
    rows = [
        BrakeRow(*(0, corner, 1.0, 4.0, 30.0, 10.0), *[0.0] * 10, mu, 0.02, 3.0, LEARNED)
        for corner, mu in zip(CORNERS, friction, strict=True)
    ]
    console = Console(width=150)
    with console.capture() as capture:
        console.print(brakings_table(rows, NOMINAL))
    return capture.get()


@pytest.mark.parametrize(
    ("friction", "front", "rear"),
    [
        ((0.40, 0.40, 0.36, 0.36), "0.400 ± 0.020 ", "0.360 ± 0.020 "),
        ((0.40, 0.40, 0.18, 0.18), "0.400 ± 0.020 ", "0.180 ± 0.020 at its bound"),
        ((0.60, 0.60, 0.19, 0.18), "0.600 ± 0.020 at its bound", "0.185 ± 0.020 at its bound"),
    ],
)
def test_friction_at_its_bound_is_marked(friction, front: str, rear: str) -> None:
    text = printed(friction)
    assert front in text
    assert rear in text
    assert text.count("at its bound") == (front + rear).count("at its bound")
