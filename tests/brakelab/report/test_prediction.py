"""The page's part on predictions: which brakings it counts and what it shows of them."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.report.brakings import Braking, brakings
from brakelab.report.drive import read_drive
from brakelab.report.prediction import plots_of_prediction, prediction_errors, prediction_rows

NONE = np.full(4, np.nan)


def braking(
    number: int, measured: float, predicted: float, learned: float = 1.0, left_out: str = ""
) -> Braking:
    nan = float("nan")
    return Braking(
        number, 0.0, 4.0, 30.0, 10.0, nan, measured, predicted, NONE, NONE, nan, 0.1, learned, left_out
    )


DRIVE = [
    braking(1, 2.0, 2.5, learned=0.0),
    braking(2, 4.0, 3.8, learned=0.5),
    braking(3, 3.0, 0.5, left_out="driving torque"),
    braking(4, 0.0, 0.7, left_out="below 0.5 m/s²"),
]


def test_rows_tell_error_origin_and_reason() -> None:
    rows = prediction_rows(DRIVE)
    assert [row.error for row in rows] == pytest.approx([0.25, -0.05, np.nan, np.nan], nan_ok=True)
    assert [row.sigma_error for row in rows] == pytest.approx([0.05, 0.025, np.nan, np.nan], nan_ok=True)
    assert [row.friction for row in rows] == ["nominal", "learned in part", "learned", "learned"]
    assert [row.left_out for row in rows] == ["", "", "driving torque", "below 0.5 m/s²"]


def test_what_is_left_out_does_not_count() -> None:
    found = prediction_errors(DRIVE)
    assert (found.counted, found.nominal) == (2, 1)
    assert found[2:] == pytest.approx((0.15, 0.25, 0.1))


@pytest.mark.parametrize("found", [[], DRIVE[2:], [braking(1, 2.0, np.nan, left_out="no prediction")]])
def test_where_none_counts_there_is_no_plot(found: list[Braking]) -> None:
    assert plots_of_prediction(found) == {}
    assert prediction_errors(found).counted == 0


def test_axes_show_all_points_and_are_the_same() -> None:
    over_measured, over_number = plots_of_prediction(DRIVE).values()
    assert over_measured.x_range.end == over_measured.y_range.end > 4.0
    assert over_number.y_range.end == -over_number.y_range.start > 25.0


def test_a_table_of_brakings_without_the_marks_is_judged_by_its_numbers(drive_files: dict[str, Path]) -> None:
    """As another program may write it, with the columns of the contract alone."""
    table = pq.read_table(drive_files["brakes"])
    old = table.drop_columns(["sigma_decel_predicted", "learned_before", "left_out"])
    slow = [0.0 if number == 0 else 6.0 for number in table.column("brake").to_pylist()]
    pq.write_table(
        old.set_column(old.column_names.index("decel_mean"), "decel_mean", [slow]), drive_files["brakes"]
    )
    found = brakings(read_drive(drive_files["result"], (), ""), drive_files["result"])
    assert [row.left_out for row in found] == ["below 0.5 m/s²", "", ""]
    assert [row.friction for row in prediction_rows(found)] == ["–"] * 3
    assert prediction_errors(found).nominal == 0
    assert plots_of_prediction(found)
