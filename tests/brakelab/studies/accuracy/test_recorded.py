"""The bench of recorded cars: goals on the one drive with brake applications, and cuts that teach nothing."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.replay.command import replay_into
from brakelab.studies.accuracy.recorded import (
    FOLDER,
    MUSTANG,
    PASSES,
    SIGMAS,
    WORSE,
    Pass,
    application_table,
    drive_passes,
    other_table,
    pass_table,
)
from ecu.contract.faults import IMPLAUSIBLE, fault_mask
from ecu.errors import UserError
from ecu.settings.resources import resource

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def passes() -> list[Pass]:
    return drive_passes(ROOT / FOLDER / MUSTANG, "mustang", PASSES)


def test_no_pass_is_worse_than_the_first(passes: list[Pass]) -> None:
    means = [100.0 * one.off.mean for one in passes]
    print(means)
    assert all(mean <= means[0] + WORSE for mean in means)
    assert [line[-1] for line in pass_table(passes).rows] == ["met"] * PASSES


def test_what_came_is_within_what_was_said(passes: list[Pass]) -> None:
    distances = np.concatenate([one.distances for one in passes])
    assert len(distances) == 3 * PASSES
    assert np.abs(distances).max() < SIGMAS
    lines = application_table(passes).rows
    assert [line[0] for line in lines] == ["1"] * 3 + ["2"] * 3 + ["3"] * 3
    assert all(line[-1] == "met" for line in lines)


@pytest.mark.parametrize(
    ("log", "config", "map"),
    [(MUSTANG, "mustang", "mustang"), ("kona.log", "suv", "kona"), ("rav4.log", "suv", "rav4")],
)
def test_no_sound_sensor_of_a_recorded_car_is_named(tmp_path: Path, log: str, config: str, map: str) -> None:
    """The Mustang's rear wheels spin three times, up to 25 %, and shake."""
    out = tmp_path / "drive.parquet"
    replay_into(
        [ROOT / FOLDER / log],
        resource(f"config/{config}.toml"),
        resource(f"config/maps/{map}.toml"),
        None,
        None,
        out,
    )
    columns = pq.read_table(out, columns=["active_faults", "active_faults_2"]).to_pydict()
    assert not (fault_mask(columns) & sum(IMPLAUSIBLE.values())).any()


def test_cuts_of_other_cars_teach_nothing() -> None:
    for line in other_table(ROOT / FOLDER).rows:
        assert line[-2:] == ("0", "0.0"), line[0]


def test_outside_of_a_checkout_it_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="measure it in a checkout"):
        drive_passes(tmp_path / MUSTANG, "mustang", 1)
