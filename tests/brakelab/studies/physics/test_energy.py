"""The bench of energy: what goes in comes out, in the table too."""

from pathlib import Path
from shutil import copy

import pytest

from brakelab.studies.physics.energy import LOSSES, SOURCES, energy_tables
from ecu.settings.config import load_config
from ecu.settings.resources import resource

NAMES = ("stop-2", "blending-60")


def test_the_shares_of_a_scenario_make_a_whole(tmp_path: Path) -> None:
    for name in NAMES:
        copy(resource(f"config/scenarios/{name}.toml"), tmp_path)
    (table,) = energy_tables(tmp_path, load_config(resource("config/suv.toml")))
    assert [row[0] for row in table.rows] == sorted(NAMES)
    for row in table.rows:
        share = dict(zip(table.columns, row, strict=True))
        shares = [0.0 if cell == "–" else float(cell) for cell in row[3 : 3 + len(SOURCES) + len(LOSSES)]]
        assert sum(shares[: len(SOURCES)]) == pytest.approx(100.0, abs=0.1)
        assert sum(shares[len(SOURCES) :]) == pytest.approx(100.0, abs=0.1)
        assert abs(float(share["missing"])) < 1e-4
    assert float(table.rows[0][7]) > 40.0  # to the motors, which take 60 % of the braking
    assert table.rows[1][7] == "–"
