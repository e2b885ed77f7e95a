"""The study of chapter 6: which brake applications a row of the thesis counts, beside which figures."""

import numpy as np
import pytest

from brakelab.identify.tuning.recording import Application
from brakelab.simulation.scenario import load_scenario
from brakelab.studies.accuracy import tuning as study
from brakelab.studies.accuracy.tuning import (
    CARS,
    FADE,
    PRINTED,
    TUNINGS,
    beside_the_thesis,
    drive_case,
    fade_panels,
    row_figures,
    tuning_tables,
)
from ecu.settings.config import load_config
from ecu.settings.resources import resource

SESSIONS = {row.session: 12 if row.session == "bursts" else 10 for row in PRINTED}


def made_up() -> study.Driven:
    """Errors that name their session's place, tuning, car and brake application."""
    return {
        (session, tuning, car): [
            Application(
                np.array([number + 100.0 * tuning, 10.0 * car]),
                np.full(2, 95.0),
                np.full(2, 0.4),
                np.full(2, 0.44),
            )
            for number in range(count)
        ]
        for session, count in SESSIONS.items()
        for tuning in range(len(TUNINGS))
        for car in range(CARS, 2 * CARS)
    }


@pytest.mark.parametrize(
    ("row", "front"), [(0, 0.0), (2, 2.0), (3, 5.5), (9, 5.0), (12, 8.0)], ids=lambda value: str(value)
)
def test_a_row_counts_its_brake_applications(row, front) -> None:
    for tuning in range(len(TUNINGS)):
        found = row_figures(made_up(), PRINTED[row], tuning)
        assert found.nrmse == pytest.approx([front + 100.0 * tuning, 55.0])
        assert found.deviation == pytest.approx([10.0, 10.0])


@pytest.mark.parametrize(
    ("nrmse", "expected"),
    [((3.0, 10.0), "met"), ((4.75, 10.0), "missed: front by 1"), ((3.0, 12.11), "missed: rear by 2")],
)
def test_the_verdict_is_by_the_printed_figures(nrmse, expected) -> None:
    figures = study.Figures(np.array(nrmse), np.zeros(2))
    assert beside_the_thesis(figures, PRINTED[2]) == expected


def test_the_sessions_have_the_brake_applications_that_the_rows_name() -> None:
    for session in SESSIONS:
        scenario = load_scenario(resource(f"config/scenarios/{session}.toml"))
        brakes = sum(phase.kind == "brake" for phase in scenario.phase) * scenario.repeat
        last = max(row.first + row.applications for row in PRINTED if row.session == session)
        assert last <= brakes


def test_the_page_has_every_row_and_figure() -> None:
    config = load_config(resource("config/suv.toml"))
    errors, deviations, keys = tuning_tables(made_up(), config, config)
    assert len(errors.rows) == len(deviations.rows) == len(PRINTED)
    assert "0 of 13" in errors.below
    assert len(keys.rows) == 5
    assert [panel.title[-9:-4] for panel in fade_panels(made_up())] == ["front", " rear"]


def test_one_session_driven() -> None:
    """The fade test of the thesis: ten brake applications, and friction that falls."""
    found = drive_case((load_config(resource("config/suv.toml")),), "nominal", (FADE, 0, 0))
    assert len(found) == 10
    assert found[-1].true[0] < found[0].true[0]
