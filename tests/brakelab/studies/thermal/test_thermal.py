"""Tables and figures of the study of disc temperature, of cars made up for it."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.thermal.fit import Fit
from brakelab.identify.thermal.model import Cooling
from brakelab.identify.thermal.page import Judged
from brakelab.identify.thermal.result import Errors
from brakelab.results.chart import chart_svg
from brakelab.results.text_table import markdown
from brakelab.studies.thermal.study import Appraised, Car, Series
from brakelab.studies.thermal.thermal import LEGEND, thermal_panels, thermal_tables
from ecu.settings.config import load_config

CONFIG = load_config(Path(__file__).parents[4] / "config" / "suv.toml")


def judged(name: str) -> Judged:
    identified = np.array([True, True, True, True, False, True])
    new, old = Cooling(2e-3, 1e-4, 3e-3, 2e-4), Cooling(1e-3, 1e-4, 1e-3, 2e-4)
    some = np.zeros(2)
    fit = Fit(
        2.2e-4,
        new,
        0.03 * np.ones(6),
        identified,
        6,
        2.0,
        some,
        some,
        2.0,
        200.0,
        np.array([0.03, 0.05, 0.1]),
    )
    before = fit._replace(heating=2e-4, cooling=old)
    return Judged(name, CONFIG.front, [], fit, before, Errors(0.03, 0.06, 0.17), [])


def car(seed: int, rmse: float) -> Car:
    def appraised(trip: str) -> Appraised:
        four = np.ones(4)
        return Appraised(
            trip, 30.0 * four, rmse * four, -2.0 * four, 0.97 * four, 5.0 * four, 0.8 * four, 150.0 * four
        )

    warm = np.linspace(20.0, 120.0, 600)[:, None] * np.ones(4)
    series = Series(np.full(600, 20.0), warm, 0.1 * warm, warm + 3.0, warm + 20.0)
    axles = [judged("front"), judged("rear")]
    return Car(seed, axles, [appraised("dry"), appraised("rain")], [series, series], 12.0 * np.ones(4))


@pytest.fixture(scope="module")
def cars() -> list[Car]:
    return [car(0, 4.0), car(1, 11.0)]


def test_the_first_table_has_the_goals_beside_the_figures(cars) -> None:
    table = thermal_tables(cars)[0]
    assert table.rows[0] == (
        "dry (7.13)", "front", "150–150", "30.0 (30.0)", "7.5 (11.0)", "2 of 4", "-2.0", "5.0", "97.0",
        "0.80", "missed: worst by 1",
    )  # fmt: skip
    assert len(table.rows) == 4
    assert "8 of 16 discs within 10 K, inside 2σ at 97.0 %" in table.below


def test_every_car_has_its_parameters_against_the_configuration(cars) -> None:
    table = thermal_tables(cars)[1]
    assert table.rows[0][:7] == ("0 front", "+10", "+100", "+0", "+200", "+0", "δ1 in rain")
    assert table.rows[3][-4:] == ("11.0", "11.0", "97", "97")


def test_an_unknown_rest_is_listed_apart(cars) -> None:
    assert thermal_tables(cars)[2].rows[0] == ("front", "7.5 (11.0)", "12.0 (12.0)")
    assert all(markdown(table) for table in thermal_tables(cars))


def test_the_figures_are_those_of_the_thesis(cars) -> None:
    panels = thermal_panels(cars)
    assert [panel.title.split()[0] for panel in panels] == [
        "7.13", "7.13", "7.13", "7.15:", "7.14", "7.14", "7.14", "7.15:"
    ]  # fmt: skip
    assert ["front" in panels[3].title, "rear" in panels[7].title] == [True, True]
    assert "nan" not in chart_svg(panels, LEGEND)
