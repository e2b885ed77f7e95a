"""Errors of a drive against its truth: the figure, and the rows that count."""

import numpy as np
import pytest

from brakelab.simulation.accuracy import nrmse, window
from brakelab.simulation.closed_loop import Drive
from ecu.contract.records import FRAME, new_record


@pytest.mark.parametrize(
    ("estimate", "true", "percent"),
    [
        ([0.5, 0.5], [0.5, 0.5], 0.0),
        ([0.55, 0.45], [0.5, 0.5], 10.0),
        ([0.6, 0.5], [0.5, 0.5], 100.0 * np.sqrt(0.005) / 0.5),
        ([0.4, 0.4], [0.3, 0.5], 25.0),
    ],
)
def test_nrmse(estimate: list[float], true: list[float], percent: float) -> None:
    assert nrmse(np.array(estimate), np.array(true)) == pytest.approx(percent)


def test_window_begins_half_a_second_after_the_full_demand_and_ends_at_15_kmh() -> None:
    t = 0.01 * np.arange(1000)
    demand = np.clip(4.0 * (t - 1.0), 0.0, 4.0)  # full at 2 s
    speed = 30.0 - 4.0 * np.clip(t - 1.5, 0.0, 7.0)
    drive = Drive(t, {}, {}, {"decel_demand": demand, "vehicle_speed": speed}, new_record(FRAME, 0))
    counted = t[window(drive)]
    assert counted[0] == pytest.approx(2.5, abs=0.015)
    assert counted[-1] == pytest.approx(1.5 + (30.0 - 15.0 / 3.6) / 4.0, abs=0.015)
