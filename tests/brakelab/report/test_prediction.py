"""The page's part on predictions: which brakings it counts, what it shows of them and what beside them."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.report.brakings import Braking, Force, brakings
from brakelab.report.drive import read_drive
from brakelab.report.prediction import (
    friction_text,
    peer_errors,
    plots_of_prediction,
    prediction_errors,
    prediction_rows,
)
from brakelab.results.prediction import LEAST_ROWS, PRESSED, SHORT, WEAK
from ecu.algorithm.estimation.friction import DRIVEN

from .conftest import braking_between

ROOT = Path(__file__).parents[3]
NAN = float("nan")
BEFORE, BEFORE_SIGMA = np.array([0.38, 0.40, 0.45, 0.45]), np.array([0.01, 0.02, 0.05, 0.05])


def braking(
    number: int, measured: float, predicted: float, configured: float = NAN, why: str = ""
) -> Braking:
    """A braking whose prediction has a sigma of 0.1 m/s^2; 0.2 m/s^2 are not the linings'."""
    force = Force(measured, predicted, 0.1, configured, 0.2)
    known = {"force": force, "before": BEFORE, "before_sigma": BEFORE_SIGMA, "left_out": why}
    return braking_between(0.0, 4.0, number, **known)


DRIVE = [
    braking(1, 2.0, 2.5, 2.2),
    braking(2, 4.0, 3.8, 4.2),
    braking(3, 3.0, 0.5, 3.2, "driven against the brakes"),
    braking(4, 0.3, 0.7, 0.3, "below 0.5 m/s²"),
]


def test_rows_tell_error_origin_and_reason() -> None:
    rows = prediction_rows(DRIVE)
    assert [row.error for row in rows] == pytest.approx([0.25, -0.05, NAN, NAN], nan_ok=True)
    assert [row.sigma_error for row in rows] == pytest.approx([0.05, 0.025, NAN, NAN], nan_ok=True)
    assert [row.configured for row in rows] == [2.2, 4.2, 3.2, 0.3]
    assert {(row.front, row.rear) for row in rows} == {("0.390 ± 0.015", "0.450 ± 0.050")}
    assert [row.left_out for row in rows] == ["", "", "driven against the brakes", "below 0.5 m/s²"]


@pytest.mark.parametrize(
    ("friction", "sigma", "text"),
    [(0.4, 0.02, "0.400 ± 0.020"), (0.4, NAN, "0.400"), (NAN, 0.02, "–")],
    ids=["known", "sigma unknown", "unknown"],
)
def test_friction_as_text(friction: float, sigma: float, text: str) -> None:
    assert friction_text(np.full(2, friction), np.full(2, sigma)) == text


def test_what_is_left_out_does_not_count() -> None:
    found = prediction_errors(DRIVE)
    assert found.counted == 2
    assert (found.mean, found.median, found.worst, found.bias) == pytest.approx((0.15, 0.15, 0.25, 0.1))


def test_what_else_could_have_predicted_them() -> None:
    """Of the two that count linings are expected to give 2.0 and 4.0 m/s^2, and give 1.8 and 3.8.

    Scales 0.9 and 0.95: the running average takes 1, then 0.95; one in hindsight is 0.9 or 0.95 throughout.
    """
    never, running, hindsight = peer_errors(DRIVE).values()
    assert never.mean == pytest.approx(np.mean([0.2 / 2.0, 0.2 / 4.0]))
    assert running.mean == pytest.approx(np.mean([0.2 / 2.0, 0.0]))
    assert hindsight.mean == pytest.approx(min(np.mean([0.0, 0.2 / 4.0]), np.mean([0.1 / 2.0, 0.0])))
    assert {peer.counted for peer in (never, running, hindsight)} == {2}


@pytest.mark.parametrize(
    "found", [[], DRIVE[2:], [braking(1, 2.0, 2.1)]], ids=["none", "none counts", "not predicted so"]
)
def test_nothing_is_compared_where_the_configured_prediction_is_not_known(found: list[Braking]) -> None:
    assert peer_errors(found) == {}


@pytest.mark.parametrize("found", [[], DRIVE[2:], [braking(1, 2.0, NAN, why="no prediction")]])
def test_where_none_counts_there_is_no_plot(found: list[Braking]) -> None:
    assert plots_of_prediction(found) == {}
    assert prediction_errors(found).counted == 0


def test_axes_show_all_points_and_are_the_same() -> None:
    over_measured, over_number = plots_of_prediction(DRIVE).values()
    assert over_measured.x_range.end == over_measured.y_range.end > 4.0
    assert over_number.y_range.end == -over_number.y_range.start > 25.0


def test_a_table_of_brakings_of_the_contract_alone_tells_of_no_prediction(
    drive_files: dict[str, Path],
) -> None:
    """As another program may write it: deceleration measured and predicted, no specific force, no marks."""
    table = pq.read_table(drive_files["brakes"])
    kept = [name for name in table.column_names if "specific_force" not in name and "before" not in name]
    slow = [0.0 if number == 0 else 6.0 for number in table.column("brake").to_pylist()]
    old = table.select([name for name in kept if name not in ("left_out", "mu_b_end", "sigma_mu_b_end")])
    pq.write_table(
        old.set_column(old.column_names.index("decel_mean"), "decel_mean", [slow]), drive_files["brakes"]
    )
    found = brakings(read_drive(drive_files["result"], (), ""), drive_files["result"])
    assert [row.left_out for row in found] == ["below 0.5 m/s²", "", ""]
    assert [row.friction.tolist() for row in found] == [[0.38, 0.38, 0.49, 0.5]] * 3
    assert prediction_rows(found) == []
    assert plots_of_prediction(found) == {}


def test_the_documentation_says_which_predictions_count() -> None:
    text = (ROOT / "docs/report.md").read_text("utf-8")
    section = " ".join(text.partition("## Prediction\n")[2].partition("\n## ")[0].split())
    assert DRIVEN == 1 / 5
    assert "more than a fifth of the brakes' force" in section
    limits = (f"{LEAST_ROWS} rows", f"({PRESSED:g} %)", f"below {WEAK:g} m/s²", f"shorter than {SHORT:g} s")
    assert [limit for limit in limits if limit not in section] == []
