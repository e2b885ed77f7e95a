"""Exported drives are those that entries hear."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.simulation.configured import configured
from brakelab.studies.entries.drives import NAMES, SETS, CarTracks, Track
from brakelab.studies.entries.export import export_car, new_folder
from ecu.contract.signals import INPUT
from ecu.errors import UserError
from ecu.settings.config import load_config


def track(name: str) -> Track:
    values = np.full((10, len(NAMES)), np.nan)
    values[::2, INPUT["accel_x"]] = np.arange(5.0)
    values[:, INPUT["wheel_force_x_fl"]] = -1.0
    return Track(name, configured(), values, np.full((10, 4), 0.4), np.full((10, 4), 20.0), np.arange(10) > 4)


def test_inputs_and_truth_are_files_without_the_wheel_forces(tmp_path: Path) -> None:
    new_folder(tmp_path / "out")
    car = CarTracks(track("ordinary"), [track("stop-1")], [track(name) for name in SETS])
    files = export_car(tmp_path / "out", 3, car)
    assert [path.name.partition(".")[0] for path in files] == [
        "car-3-ordinary", "car-3-stop-1", "car-3-recorded-0", "car-3-recorded-1",
    ]  # fmt: skip
    inputs = pq.read_table(files[0])
    assert inputs.column_names == ["t", "accel_x"]
    assert inputs["accel_x"].to_pylist() == [0.0, None, 1.0, None, 2.0, None, 3.0, None, 4.0, None]
    truth = pq.read_table(tmp_path / "out/car-3-ordinary.truth.parquet")
    assert truth["mu_b_rr"].to_pylist() == [0.4] * 10
    assert truth["counted"].to_pylist() == [0.0] * 5 + [1.0] * 5
    assert load_config(tmp_path / "out/suv.toml") == configured()


def test_a_folder_that_cannot_be_made_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="cannot be written"):
        new_folder(tmp_path / "file" / "out")
