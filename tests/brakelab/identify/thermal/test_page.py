"""The page of a fit: tables, picture, and the lines of what is not identified."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.thermal.fit import fit_axle, fit_nothing
from brakelab.identify.thermal.page import Judged, cooling_panel, unidentified, write_page
from brakelab.identify.thermal.result import errors_of, judge, start_of
from ecu.settings.config import load_config

from .series import DRY, discs, series

FRONT = load_config(Path(__file__).parents[4] / "config" / "suv.toml").front


@pytest.fixture(scope="module")
def axle() -> Judged:
    both, start = discs(series(1500)), start_of(FRONT)
    fit = fit_axle(both, FRONT.disc_heating, start)
    before, errors = fit_nothing(both, FRONT.disc_heating, start, fit), errors_of(fit, FRONT)
    predictions = [judge(disc, np.zeros(1500), fit, k, errors, before) for k, disc in enumerate(both)]
    return Judged("front", FRONT, both, fit, before, errors, predictions)


def test_a_page_has_parameters_logs_and_a_picture(axle, tmp_path) -> None:
    write_page(tmp_path / "car.md", [axle])
    page = (tmp_path / "car.md").read_text()
    assert all(
        text in page for text in ("`disc_heating`", "| drive | fl |", "RMSE now [K]", "Rank", "car.svg")
    )
    assert "in rain" in page
    picture = (tmp_path / "car.svg").read_text()
    assert picture.count("<rect") == 1 + 3  # cooling, two discs
    assert "nan" not in picture


def test_what_is_not_identified_names_the_drive_that_would(axle) -> None:
    lines = unidentified(axle)
    assert [line.split(":")[0] for line in lines] == ["front δ0 in rain", "front δ1 in rain"]
    assert "cruise at 100 km/h" in lines[1]


def test_the_cooling_of_figure_7_15_is_the_line_that_was_fitted(axle) -> None:
    panel = cooling_panel("front", axle.fit.cooling)
    dry, wet = panel.lines
    assert dry.y[0] == pytest.approx(1e3 * DRY[0], rel=0.05)
    assert np.diff(dry.y) / np.diff(dry.x) == pytest.approx(1e3 * DRY[1], rel=0.1)
    assert (wet.y >= dry.y).all()
