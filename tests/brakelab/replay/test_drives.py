"""Whole recorded drives of three real cars: what is found, and that nothing is learned for nothing."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.replay.command import replay
from brakelab.replay.prediction import SHORT
from brakelab.results import read_result
from ecu.resources import resource

pytestmark = pytest.mark.drives


def run(log: Path, car: str, config: str, out: Path) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    assert (
        replay(
            [log],
            resource(f"config/{config}.toml"),
            resource(f"config/maps/{car}.toml"),
            None,
            None,
            out,
        )
        == 0
    )
    return read_result(out).columns, read_result(out.with_suffix(".brakes.parquet")).columns


def test_mustang_shows_its_three_brakings(drives: Path, tmp_path: Path) -> None:
    log = drives / "mustang" / "mustang_s550.candump.log"
    columns, brakes = run(log, "mustang", "mustang", tmp_path / "out.parquet")
    assert len(columns["t"]) == 7038
    long = (brakes["duration"] >= SHORT) & (brakes["corner"] == "fl")
    np.testing.assert_allclose(3.6 * brakes["v_in"][long], [45, 48, 53], atol=3)
    np.testing.assert_allclose(3.6 * brakes["v_end"][long], [14, 23, 0.5], atol=2)
    assert (brakes["decel_mean"][long] > 1.5).all()
    np.testing.assert_allclose(brakes["decel_predicted"][long], brakes["decel_mean"][long], rtol=0.25)


@pytest.mark.parametrize(("car", "log"), [("rav4", "rav4_bus0_bus1"), ("kona", "kona")])
def test_nothing_is_learned_where_nothing_can_be(drives: Path, tmp_path: Path, car: str, log: str) -> None:
    columns, brakes = run(drives / car / f"{log}.candump.log", car, "suv", tmp_path / "out.parquet")
    for corner in ("fl", "fr", "rl", "rr"):
        assert set(columns[f"mu_b_{corner}"]) == {0.45}
        assert not (columns[f"mode_{corner}"] == 1).any()
    assert "learned" not in brakes["learning"]
