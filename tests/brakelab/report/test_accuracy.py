import numpy as np
import pytest

from brakelab.report.accuracy import accuracy, achieved_deceleration, evaluated, tracking
from brakelab.report.brakings import Braking
from brakelab.report.drive import DriveResult
from ecu.contract.signals import CORNERS

from .conftest import braking_between

T = np.arange(0.0, 12.0, 0.01)
DEMANDED = 5.0


def stop(achieved: float) -> tuple[DriveResult, list[Braking]]:
    """A stop from 108 km/h that begins at 2 s and reaches its deceleration after 0.3 s."""
    decel = achieved * np.clip((T - 2.0) / 0.3, 0.0, 1.0)
    speed = np.maximum(30.0 - np.cumsum(decel) * 0.01, 0.0)
    demand = np.where((T >= 2.0) & (T < 9.0), DEMANDED, 0.0)
    columns = {"vehicle_speed": speed, "decel_demand_total": demand, "accel_x_road": -decel}
    return DriveResult(T, columns, {}), [braking_between(2.0, 9.0)]


def test_window_begins_half_a_second_after_the_demand_and_ends_at_15_kmh() -> None:
    drive, found = stop(achieved=5.0)
    rows = np.flatnonzero(evaluated(drive, None, found))
    assert T[rows[0]] == pytest.approx(2.0 + 0.8 * 0.3 + 0.5, abs=0.011)
    assert drive.columns["vehicle_speed"][rows[-1]] == pytest.approx(15.0 / 3.6, abs=0.06)
    assert np.diff(rows).max() == 1


@pytest.mark.parametrize(("achieved", "counts"), [(5.0, True), (4.1, True), (3.9, False)])
def test_demand_must_be_reached(achieved: float, counts: bool) -> None:
    drive, found = stop(achieved)
    assert evaluated(drive, None, found).any() == counts


def test_tracking_is_achieved_over_demanded() -> None:
    drive, found = stop(achieved=4.5)
    assert tracking(drive, None, found) == pytest.approx([-0.1])


@pytest.mark.parametrize(
    ("motor", "asked", "counts"),
    [(0.0, 0.0, True), (80.0, 0.0, True), (150.0, 0.0, False), (150.0, 150.0, True)],
)
def test_motors_that_brake_on_another_demand_hide_the_brakes(
    motor: float, asked: float, counts: bool
) -> None:
    drive, found = stop(achieved=5.0)
    torques = {"brake_torque": 1000.0, "motor_torque": motor, "motor_demand": asked}
    more = {
        f"{name}_{corner}": np.full_like(T, value) for name, value in torques.items() for corner in CORNERS
    }
    (share,) = tracking(drive._replace(columns={**drive.columns, **more}), None, found)
    assert np.isfinite(share) == counts


def test_true_deceleration_goes_before_the_measured_one() -> None:
    drive, _ = stop(achieved=4.5)
    truth = DriveResult(T, {"accel_x_road": np.full_like(T, -1.0)}, {})
    assert achieved_deceleration(drive, truth)[0] == 1.0


@pytest.mark.parametrize(
    ("estimate", "sigma", "nrmse", "bias", "inside"),
    [
        ([[0.4, 0.4]], 0.01, 0.0, 0.0, 1.0),
        ([[0.44, 0.44]], 0.01, 0.1, 0.1, 0.0),
        ([[0.44, 0.36]], 0.02, 0.1, 0.0, 1.0),  # 2σ is just as wide as the error
        ([[0.44, 0.40]], 0.01, 0.1 / np.sqrt(2), 0.05, 0.5),
        ([[0.44, np.nan]], 0.01, 0.1, 0.1, 0.0),  # what is not known does not count
    ],
)
def test_errors_are_shares_of_the_mean_truth(
    estimate: list[list[float]], sigma: float, nrmse: float, bias: float, inside: float
) -> None:
    values = np.array(estimate)
    got = accuracy(values, np.full_like(values, sigma + 1e-12), np.full_like(values, 0.4), dt=0.01)
    assert got == pytest.approx((nrmse, bias, inside, 0.01))


def test_nothing_evaluated_is_not_perfect() -> None:
    got = accuracy(np.empty((0, 2)), np.empty((0, 2)), np.empty((0, 2)), 0.01)
    assert np.isnan(got.nrmse)
    assert got.seconds == 0.0
