"""Both results of a comparison over their brake applications."""

import numpy as np
import pytest

from brakelab.report.comparison import error_by_braking
from brakelab.results.compare import BRAKES, Columns, Part
from ecu.contract.signals import CORNERS

N = 3


def brakes(*, predicted: list[float], left_out: tuple[str, ...] = ("", "", "")) -> Columns:
    """Return brake applications of 4 m/s^2, a row for each corner."""
    return {
        "brake": np.repeat(np.arange(N, dtype=float), len(CORNERS)),
        "corner": np.array([*CORNERS] * N, object),
        "left_out": np.repeat(np.array(left_out, object), len(CORNERS)),
        "specific_force_mean": np.full(N * len(CORNERS), 4.0),
        "specific_force_predicted": np.repeat(np.array(predicted), len(CORNERS)),
    }


def test_errors_of_both_stand_beside_each_other() -> None:
    a = brakes(predicted=[4.0, 4.4, 3.8])
    b = brakes(predicted=[4.2, 4.0, 5.0], left_out=("", "", "below 0.5 m/s²"))
    plot = error_by_braking(Part(BRAKES, a, b, {}, (0, 0), []))
    held = plot.renderers[0].data_source.data
    assert held["number"].tolist() == [1, 2, 3]
    assert held["value_0"] == pytest.approx([0.0, 10.0, -5.0])
    assert held["value_1"] == pytest.approx([5.0, 0.0, np.nan], nan_ok=True)
    assert plot.yaxis.axis_label == "Prediction error [%]"


def test_results_of_an_earlier_version_have_no_errors() -> None:
    old = {name: values for name, values in brakes(predicted=[4.0] * N).items() if name != "left_out"}
    assert error_by_braking(Part(BRAKES, old, old, {}, (0, 0), [])) is None
