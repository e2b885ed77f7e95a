"""Gears, and what the driver of a drawn car does."""

import numpy as np
import pytest

from .car import NO_ABS
from .draw import draw
from .driver import Engine, change_gear

pytestmark = [pytest.mark.study, pytest.mark.compiled]


ENGINE = Engine(
    2e5, 400.0, (12.0, 9.6, 7.7, 6.1, 4.9, 3.9), 700.0, 400.0, 20.0, 0.05, 0.1, 0.0, 0.2, 0.0, 0.0, 0.0
)


@pytest.mark.parametrize(
    ("gear", "wheel", "braking", "expected"),
    [
        (0, 60.0, False, 1),  # 720 rad/s: up
        (5, 200.0, False, 5),  # there is no seventh
        (2, 50.0, True, 1),  # 385 rad/s: down while braking
        (2, 50.0, False, 2),  # not on the straight
        (1, 38.0, True, 0),
        (0, 5.0, True, 0),
    ],
)
def test_gears(gear: int, wheel: float, braking: bool, expected: int) -> None:
    assert change_gear(ENGINE, gear, wheel, braking) == expected


def test_drivers_down_shift_brake_into_corners_and_yield_to_locked_wheels() -> None:
    racers = draw(1, range(0, 24, 6)) + draw(1, range(1, 24, 6))
    drives = [one.drive() for one in racers]
    braked = [rows[(rows["line"][:, 0] > 3.0) & (rows["speed"] > 5.0)] for rows in drives]
    assert all(np.any(np.diff(rows["gear"]) < 0) for rows in braked)
    trailing = [np.mean(np.abs(rows["lateral"]) > 4.0) for rows in braked]
    assert 0.1 < np.median(trailing) < 0.6
    for one, rows in zip(racers, braked, strict=True):
        assert np.mean(rows["slip"].max(axis=1) > 0.3) < 0.35
        assert one.car.abs_.kind == NO_ABS or rows["habit"].min() == 1.0
