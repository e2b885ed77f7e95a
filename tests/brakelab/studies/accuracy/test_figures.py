"""Figures over time: what is drawn of a drive, and the error of a wrong friction."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.plant.description import read_file
from brakelab.plant.linings import Linings
from brakelab.results.chart import write_chart
from brakelab.studies.accuracy import figures
from brakelab.studies.accuracy.figures import BEFORE, Shown, _driven, _error_row, _rows, error_of, panels
from brakelab.studies.physics.heat import heat_panels
from ecu.settings.resources import resource

pytestmark = pytest.mark.study


def test_a_drive_is_drawn_from_before_its_braking_and_counted(tmp_path: Path) -> None:
    shown = Shown("5.4", "blending-60", ("brake_torque", "mu_b"))
    drive, decel = _driven(shown)
    rows = _rows(drive)
    first = np.flatnonzero(drive.truth["decel_demand"] > 0.0)[0]
    assert drive.t[rows][0] == pytest.approx(drive.t[first] - BEFORE, abs=0.02)
    drawn = panels(shown, drive, decel)
    assert [panel.title.partition(",")[2].strip() for panel in drawn[1:]] == ["front", "rear"] * 2
    assert all(panel.x == drawn[0].x for panel in drawn)
    write_chart(tmp_path / "drawn.svg", drawn, figures.LEGEND, 5)
    assert "5.4: friction [–], rear" in (tmp_path / "drawn.svg").read_text("utf-8")
    row = _error_row(shown, drive, decel)
    assert row[:2] == ("5.4", "blending-60")
    assert row[4:8] == ("–",) * 4
    assert all(0.5 < float(cell) < 25.0 for cell in (*row[2:4], *row[8:]))


def test_of_several_stops_the_last_is_drawn() -> None:
    drive, _ = _driven(Shown("6.1", "fixed-pedal", ()))
    rows = np.flatnonzero(_rows(drive))
    assert 0.01 * len(rows) < 30.0
    assert drive.truth["vehicle_speed"][rows[0]] == pytest.approx(27.8, abs=0.5)


def test_the_disc_cools_the_faster_the_more_the_speed_counts() -> None:
    drawn = heat_panels(read_file(resource("config/plant/linings.toml"), Linings))
    assert [panel.title[:4].strip() for panel in drawn] == ["3.6b", "3.7", "3.7", "3.8", "3.8"]
    for panel in drawn[1:]:
        conventional, plant, printed = (line.y[-1] for line in panel.lines)
        assert conventional > plant > printed
    slow, fast = (panel.lines[0].y[-1] - panel.lines[2].y[-1] for panel in drawn[1:3])
    assert fast > slow


@pytest.mark.parametrize("wrong", [-0.2, 0.2])
def test_friction_taken_too_low_brakes_too_hard(wrong: float) -> None:
    assert error_of(wrong) == pytest.approx(100.0 / (1.0 + wrong) - 100.0, abs=3.0)
