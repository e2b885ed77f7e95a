"""What `replay` prints of the brakings."""

import pytest
from rich.console import Console

from brakelab.replay.brakes import LEARNED, BrakeRow
from brakelab.replay.summary import brakings_table, prediction_lines
from ecu.signals import CORNERS

NOMINAL = (0.4, 0.4, 0.36, 0.36)


def printed(friction: tuple[float, float, float, float]) -> str:
    rows = [
        BrakeRow(*(0, corner, 1.0, 4.0, 30.0, 10.0), *[0.0] * 10, mu, 0.02, 3.0, LEARNED, 0.1, 1, "")
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


def told(*brakings: tuple[float, float, int, str]) -> list[str]:
    """Lines for brakings of measured and predicted deceleration, learned before, left out."""
    rows = []
    for number, (measured, predicted, learned, left_out) in enumerate(brakings):
        for corner in CORNERS:
            numbers = (number, corner, 1.0, 4.0, 30.0, 10.0, measured, predicted, *[0.0] * 8, 0.4, 0.02, 3.0)
            rows.append(BrakeRow(*numbers, LEARNED, 0.1, learned if corner == "rl" else 0, left_out))
    return prediction_lines(rows)


def test_prediction_is_told_in_two_lines() -> None:
    assert told() == ["prediction: no braking to judge it by"]
    assert told((4.0, 4.2, 1, "")) == [
        "prediction of 1 brakings: off by 5.0 % in the median, 5.0 % at worst, bias +5.0 %"
    ]
    assert told(
        (2.0, 2.2, 0, ""), (4.0, 3.8, 1, ""), (0.1, 9.0, 1, "below 0.5 m/s²"), (2.0, 9.0, 1, "x")
    ) == [
        "prediction of 2 brakings: off by 7.5 % in the median, 10.0 % at worst, bias +2.5 %; "
        "1 with nominal friction, as nothing was learned before",
        "left out of the prediction: 1 below 0.5 m/s², 1 x",
    ]
    assert told((0.1, 9.0, 1, "below 0.5 m/s²")) == [
        "prediction: no braking to judge it by",
        "left out of the prediction: 1 below 0.5 m/s²",
    ]
