from pathlib import Path

import numpy as np
import pytest

from brakelab.report.brakings import brakings
from brakelab.report.drive import DriveResult, read_drive

STOPS = [(5.0, 6.94, 4.0), (22.0, 4.63, 6.0), (40.0, 3.47, 8.0)]  # start, duration, deceleration


@pytest.mark.parametrize("with_file", [True, False])
def test_both_sources_find_the_same_brakings(drive_files: dict[str, Path], with_file: bool) -> None:
    if not with_file:
        drive_files["brakes"].unlink()
    found = brakings(read_drive(drive_files["result"], (), ""), drive_files["result"])
    assert [braking.number for braking in found] == [1, 2, 3]
    for braking, (start, duration, deceleration) in zip(found, STOPS, strict=True):
        assert braking.t_start == pytest.approx(start, abs=0.02)
        assert braking.t_end - braking.t_start == pytest.approx(duration, abs=0.02)
        assert braking.demanded == pytest.approx(deceleration, rel=0.02)
        assert braking.achieved == pytest.approx(deceleration, rel=0.02)
        assert braking.v_in == pytest.approx(27.8, abs=0.2)


def own_copy(path: Path) -> DriveResult:
    drive = read_drive(path, (), "")
    return drive._replace(columns={name: values.copy() for name, values in drive.columns.items()})


def test_a_tap_on_the_pedal_is_no_braking(drive_files: dict[str, Path]) -> None:
    drive_files["brakes"].unlink()
    drive = own_copy(drive_files["result"])
    drive.columns["braking"][1000:1045] = 0.0  # 5.0 to 11.9 s becomes two, the second of 0.4 s
    drive.columns["braking"][1045:1085] = 1.0
    drive.columns["braking"][1085:1300] = 0.0
    found = brakings(drive, drive_files["result"])
    assert [round(braking.t_start) for braking in found] == [5, 22, 40]


def test_standing_counts_as_zero_and_an_unknown_demand_stays_unknown(drive_files: dict[str, Path]) -> None:
    drive = own_copy(drive_files["result"])
    drive.columns["decel_demand_total"][:] = np.nan
    drive.columns["vehicle_speed"][4200:] = 0.0
    assert np.isnan([braking.demanded for braking in brakings(drive, drive_files["result"])]).all()
    drive.columns["decel_demand_total"][:] = 8.0
    assert brakings(drive, drive_files["result"])[2].demanded == pytest.approx(8.0 * 2.0 / 3.47, rel=0.01)


def test_only_the_file_knows_prediction_and_energy(drive_files: dict[str, Path]) -> None:
    first = brakings(read_drive(drive_files["result"], (), ""), drive_files["result"])[0]
    assert first.predicted == pytest.approx(4.16)
    assert first.energy == pytest.approx(6e5)
    assert first.friction.tolist() == [0.38, 0.38, 0.49, 0.50]
    assert first.friction_sigma.tolist() == [0.005] * 4
    assert first.force == pytest.approx((4.0, 4.16, 0.08, 4.4, 0.1))
    assert (first.before.tolist(), first.before_sigma.tolist()) == ([0.45] * 4, [0.055] * 4)
    assert first.left_out == ""


def test_without_the_file_friction_is_that_of_the_rows_around_the_braking(
    drive_files: dict[str, Path],
) -> None:
    drive_files["brakes"].unlink()
    drive = read_drive(drive_files["result"], (), "")
    for braking in brakings(drive, drive_files["result"]):
        first, last = (round(100.0 * t) for t in (braking.t_start, braking.t_end))
        for friction, sigma, row in (
            (braking.before, braking.before_sigma, first - 1),
            (braking.friction, braking.friction_sigma, last + 1),
        ):
            np.testing.assert_array_equal(friction, drive.corners("mu_b")[row])
            np.testing.assert_array_equal(sigma, drive.corners("sigma_mu_b")[row])
        assert np.isnan(braking.force).all()
        assert braking.left_out == "no prediction"
