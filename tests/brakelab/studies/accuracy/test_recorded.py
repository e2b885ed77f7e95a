"""The bench of recorded cars: goals on the one drive with brake applications, and cuts that teach nothing."""

from pathlib import Path

import numpy as np
import pytest

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
from ecu.errors import UserError

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


def test_cuts_of_other_cars_teach_nothing() -> None:
    for line in other_table(ROOT / FOLDER).rows:
        assert line[-2:] == ("0", "0.0"), line[0]


def test_outside_of_a_checkout_it_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="measure it in a checkout"):
        drive_passes(tmp_path / MUSTANG, "mustang", 1)
