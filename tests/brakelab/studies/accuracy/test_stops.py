"""The stops of Table 4.2 with two cars: what is counted, and whether the figures belong together."""

from pathlib import Path

import pytest

from brakelab.bench import command
from brakelab.results.text_table import markdown
from brakelab.studies import output
from brakelab.studies.accuracy import stops as study
from brakelab.studies.accuracy.stops import TABLE_4_3, Stops, stop_tables, stops
from ecu import cli
from ecu.settings.config import load_config
from ecu.settings.resources import resource


@pytest.fixture(scope="module")
def result() -> Stops:
    return stops(load_config(resource("config/suv.toml")), seeds=2, tests=(1,), draw="nominal")


def test_every_axle_with_and_without_vehicle_speed(result: Stops) -> None:
    assert [(row.test, row.vehicle_speed, row.axle) for row in result.friction] == [
        (1, True, "front"),
        (1, True, "rear"),
        (1, False, "front"),
        (1, False, "rear"),
    ]
    for row in result.friction:
        assert row.thesis == TABLE_4_3[1][row.axle]
        assert 0.0 < row.nrmse.low <= row.nrmse.median <= row.nrmse.high
        assert 0.0 <= row.inside_2_sigma <= 100.0
        # The linings are 15 % below and 10 % above what the ECU is configured with.
        assert 5.0 < row.nominal.median < 40.0


def test_the_ideal_is_nearer_to_the_compensated_run(result: Stops) -> None:
    for row in result.compensation:
        print(row)
        assert row.to_ideal.median < row.to_ideal_uncompensated.median
        assert row.to_demand.median < row.to_demand_uncompensated.median


def test_without_compensation_vehicle_speed_changes_next_to_nothing(result: Stops) -> None:
    """The watch over the rear's slip knows it, and the rear's friction is 29 % ahead of the front's."""
    with_speed, without = result.compensation
    found, beside = with_speed.to_demand_uncompensated, without.to_demand_uncompensated
    assert tuple(found) == pytest.approx(tuple(beside), rel=3e-4)


def test_page_names_config_seeds_and_every_figure(
    result: Stops, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "docs" / "results").mkdir(parents=True)
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "suv.toml").write_bytes(resource("config/suv.toml").read_bytes())
    monkeypatch.setattr(command, "resource", lambda name: tmp_path / name)
    monkeypatch.setattr(study, "resource", lambda name: tmp_path / name)
    monkeypatch.setattr(output, "resource", lambda name: tmp_path / name)
    monkeypatch.setattr(study, "stops", lambda config, seeds, spread, draw: result)
    assert command.bench("stops", write=True) == 0
    page = (tmp_path / "docs" / "results" / "observer-accuracy.md").read_text(encoding="utf-8")
    assert "config/suv.toml" in page
    assert "seeds 0–19" in page
    for table in stop_tables(result, 20):
        assert markdown(table).rstrip() in page
    assert f"| #1 rear | yes | {result.friction[1].nrmse.median:.2f} |" in page
    assert cli.main(["bench", "stops", "--json"]) == 0
    assert '"to_ideal_uncompensated"' in capsys.readouterr().out
