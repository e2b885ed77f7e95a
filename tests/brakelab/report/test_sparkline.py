"""The small curves: one scale for the drive, means of stretches, nothing where nothing is known."""

import re

import numpy as np
import pytest

from brakelab.report.brakings import Braking
from brakelab.report.drive import DriveResult
from brakelab.report.sparkline import DRIVE_POINTS, HEIGHT, POINTS, drive_sparkline, sparklines

from .conftest import braking_between

T = np.arange(0.0, 30.0, 0.01)


def heights(svg: str, name: str) -> np.ndarray:
    points = re.search(rf'class="{name}" points="([^"]+)"', svg)
    assert points
    return np.array([float(point.split(",")[1]) for point in points[1].split()])


@pytest.fixture
def two_brakings() -> tuple[DriveResult, list[Braking]]:
    """From 2 s 4 m/s² demanded and achieved, from 12 s 8 demanded and 4 achieved."""
    demand = 4.0 * ((T >= 2) & (T < 8)) + 8.0 * ((T >= 12) & (T < 18))
    achieved = np.minimum(demand, 4.0) + 0.1 * (-1.0) ** np.arange(len(T))
    columns = {"decel_demand_total": demand, "accel_x_road": -achieved}
    return DriveResult(T, columns, {}), [braking_between(2.0, 7.99), braking_between(12.0, 17.99)]


def test_equal_decelerations_have_equal_heights(two_brakings: tuple[DriveResult, list[Braking]]) -> None:
    first, second = sparklines(*two_brakings)
    top, base = 2.0, HEIGHT - 2.0
    np.testing.assert_allclose(heights(second, "demanded"), top, atol=0.1)
    for svg, name in ((first, "demanded"), (first, "achieved"), (second, "achieved")):
        np.testing.assert_allclose(heights(svg, name), 0.5 * (top + base), atol=0.4)
    assert len(heights(first, "achieved")) == POINTS
    assert len(first) < 1500


def test_a_whole_drive_has_both_brakings(two_brakings: tuple[DriveResult, list[Braking]]) -> None:
    demanded = heights(drive_sparkline(two_brakings[0]), "demanded")
    assert len(demanded) == DRIVE_POINTS
    at = np.linspace(0.0, 30.0, DRIVE_POINTS)
    top, base = 2.0, HEIGHT - 2.0
    for t, height in ((1.0, base), (5.0, 0.5 * (top + base)), (10.0, base), (15.0, top), (25.0, base)):
        assert demanded[np.searchsorted(at, t)] == pytest.approx(height, abs=0.1)
    assert drive_sparkline(DriveResult(T, {}, {})) == ""


def test_what_is_not_known_is_not_drawn(two_brakings: tuple[DriveResult, list[Braking]]) -> None:
    drive, found = two_brakings
    drive.columns["decel_demand_total"][:] = np.nan  # type: ignore[index]
    assert ["demanded" in svg for svg in sparklines(drive, found)] == [False, False]
    assert sparklines(DriveResult(T, {}, {}), found) == ["", ""]
