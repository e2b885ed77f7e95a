"""The picture of the distribution: what it forbids is what Annex 5 forbids, by moments about the tyres."""

from pathlib import Path

import numpy as np
import pytest

from ecu import cli
from ecu.settings.annex5 import DEMANDED, Load, utilisation
from ecu.settings.annex5_picture import ACTUAL, FORBIDDEN, IDEAL, forbidden
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

SUV = resource("config/suv.toml")


@pytest.mark.parametrize("load", load_config(SUV).vehicle.loads(), ids=lambda load: load.name)
@pytest.mark.parametrize("share", [0.45, 0.55, 0.65, 0.8, 0.95])
def test_a_share_is_forbidden_where_its_utilisation_is(load: Load, share: float) -> None:
    params = new_params(load_config(SUV))[0]
    curve = utilisation(params, np.full(len(DEMANDED), share), load)
    for asked in (0.1, 0.2, 0.4, 0.6, 0.8):
        at = int(np.argmin(np.abs(DEMANDED - asked)))
        z, front, rear = (float(row[at]) for row in curve)
        k = max(front, rear)
        wrong = (0.15 <= z <= 0.8 and rear > front) or (0.2 <= k <= 0.8 and z < 0.1 + 0.7 * (k - 0.2))
        assert forbidden(params, asked, load, np.array([share]))[0] == wrong, asked


def test_a_share_that_is_forbidden_is_drawn_in_what_is_forbidden(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "car.toml"
    text = SUV.read_text("utf-8").replace(
        "[control]", '[control]\ndistribution = "fixed"\nfront_share = 0.55'
    )
    path.write_text(text, "utf-8")
    assert cli.main(["config", "check", str(path), "--picture"]) == 2
    rows = [line for line in capsys.readouterr().out.splitlines() if line.endswith("|")]
    (row,) = [line for line in rows if line.startswith("z = 0.60")]
    row = row.partition("|")[2]
    assert row[row.index(ACTUAL) + 1] == FORBIDDEN
    assert row.index(ACTUAL) < row.index(IDEAL)
    assert len({len(row) for row in rows}) == 1
