"""A recorded braking through the whole ECU must give the committed numbers.

Tolerance: 1e-6 relative (1e-9 absolute): other processors and versions of libm round differently, an
algorithm that changed does more than that. See README.md for an intended change.
"""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from brakelab.replay.command import replay
from brakelab.results.compare import differences
from brakelab.results.files import read_result
from ecu.settings.resources import resource

HERE = Path(__file__).parent
REFERENCE = HERE / "mustang_braking.csv"
FOUR = (
    *("slip", "wheel_force_x", "wheel_force_z", "mu_b", "sigma_mu_b", "mode", "brake_torque"),
    *("disc_temperature", "sigma_disc_temperature"),
)
NAMES = [
    *("t", "vehicle_speed", "k_f", "mode", "active_faults", "braking"),
    *(f"{name}_{corner}" for name in FOUR for corner in ("fl", "fr", "rl", "rr")),
]
EVERY = 10  # rows
RELATIVE, ABSOLUTE = 1e-6, 1e-9


def test_a_recorded_braking_gives_the_committed_numbers(tmp_path: Path) -> None:
    out = tmp_path / "out.parquet"
    logs = [HERE / "mustang_braking.log.gz"]
    replay(logs, resource("config/mustang.toml"), resource("config/maps/mustang.toml"), None, None, out)
    columns = read_result(out).columns
    found = np.transpose([columns[name][::EVERY] for name in NAMES])
    if os.environ.get("BRAKE_ECU_UPDATE_GOLDEN") == "1":
        with REFERENCE.open("w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(
                [NAMES, *([f"{x:.9g}" for x in row] for row in found)]
            )
        pytest.skip(f"{REFERENCE.name} was written anew")
    with REFERENCE.open() as file:
        assert next(csv.reader(file)) == NAMES
        expected = np.loadtxt(file, delimiter=",")
    assert found.shape == expected.shape
    wrong = ~np.isclose(found, expected, RELATIVE, ABSOLUTE, equal_nan=True)
    before, after = (dict(zip(NAMES, table.T, strict=True)) for table in (expected, found))
    first = [
        f"{before['t'][row.place]:.2f} s {row.name}: {after[row.name][row.place]:.9g}, "
        f"was {before[row.name][row.place]:.9g}"
        for row in differences(before, after, {})[:5]
    ]
    assert not wrong.any(), f"{wrong.sum()} numbers changed, most: " + "; ".join(first)


def test_the_drive_is_what_its_description_says(tmp_path: Path) -> None:
    out = tmp_path / "out.parquet"
    logs = [HERE / "mustang_braking.log.gz"]
    replay(logs, resource("config/mustang.toml"), resource("config/maps/mustang.toml"), None, None, out)
    brakes = read_result(tmp_path / "out.brakes.parquet").columns
    assert list(brakes["brake"]) == [0, 0, 0, 0]
    assert 3.6 * brakes["v_in"][0] == pytest.approx(54, abs=3)
    assert brakes["v_end"][0] < 1.0
    assert brakes["decel_mean"][0] == pytest.approx(2.2, abs=0.2)
    off = abs(brakes["decel_predicted"][0] - brakes["decel_mean"][0])
    assert off < min(brakes["sigma_specific_force"][0], 0.3 * brakes["decel_mean"][0])
