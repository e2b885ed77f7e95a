"""The bench of simulated loggers: what a logger writes, and that a bystander learns the sum from it."""

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive
from brakelab.studies.accuracy.loggers import LOGGERS, Logger, logger_columns, recorded_of, recorded_table
from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import CORNERS

pytestmark = pytest.mark.study


@pytest.fixture(scope="module")
def car():
    return recorded_of(2)


def test_a_logger_has_one_pressure_per_axle_at_20_hz_and_no_reference() -> None:
    n = 100
    names = [f"{stem}_{c}" for stem in ("wheel_speed", "calliper_pressure", "motor_torque") for c in CORNERS]
    names += ["accel_x", "accel_y", "yaw_rate", "vehicle_speed", "pedal_pressed"]
    inputs = {name: np.random.default_rng(1).normal(30.0, 1.0, n) for name in names}
    columns = logger_columns(Drive(np.arange(n) * 0.01, inputs, {}, {}, new_record(FRAME)), Logger(10, False))
    assert set(columns) == {*names[:8], "accel_x", "pedal_pressed"}
    front = columns["calliper_pressure_fl"]
    np.testing.assert_array_equal(front, columns["calliper_pressure_fr"])
    assert np.flatnonzero(np.isfinite(front)).tolist() == list(range(0, n, 5))
    assert front[20] == pytest.approx(inputs["calliper_pressure_fl"][16:21].mean())
    assert np.isfinite(columns["accel_x"]).sum() == 10


def test_the_sum_is_learned_from_the_third_application_on(car) -> None:
    """Seed 2: linings 20 % rougher than configured."""
    for found in car:
        assert found.sum_error < 8.0
        assert found.predicted < 0.6 * found.others[0]  # the configured friction
        assert found.inside > 80.0


def test_the_table_has_a_line_per_logger(car) -> None:
    assert [line[0] for line in recorded_table([car]).rows] == list(LOGGERS)
