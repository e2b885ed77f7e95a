"""Plots of wheels, motors and pedals: lines only of what the drive tells."""

from typing import Any

import numpy as np
import pytest
from bokeh.models import Range1d

from brakelab.report.downsample import buckets
from brakelab.report.drive import DriveResult
from brakelab.report.wheels import motors_share, plots_of_wheels, road_speed
from ecu.contract.signals import CORNERS

T = np.arange(0.0, 10.0, 0.01)


def drive(**columns: Any) -> DriveResult:
    return DriveResult(
        T, {"vehicle_speed": np.full_like(T, 20.0), "braking": (T > 5.0).astype(float)} | columns, {}
    )


def names(found: DriveResult, truth: DriveResult | None = None) -> set[str]:
    grid = buckets(np.zeros(len(T), bool), 6000)
    plots = plots_of_wheels(found, truth, grid, Range1d(start=0.0, end=10.0))
    return {name for name, plot in plots.items() if plot.renderers}


def of_corners(stem: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{stem}_{corner}": values for corner in CORNERS}


def test_motors_share_while_braking_only() -> None:
    torques = of_corners("motor_torque", np.full_like(T, 100.0)) | of_corners(
        "brake_torque", np.full_like(T, 300.0)
    )
    share = motors_share(drive(**torques))
    assert np.isnan(share[T <= 5.0]).all()
    assert share[T > 5.0] == pytest.approx(25.0)
    driving = of_corners("motor_torque", np.full_like(T, -100.0)) | of_corners(
        "brake_torque", np.full_like(T, 300.0)
    )
    assert motors_share(drive(**driving))[T > 5.0] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("columns", "plots"),
    [
        ({}, set()),
        (of_corners("slip", np.full_like(T, -0.01)), {"slip-front", "slip-rear", "wheel-speed"}),
        (of_corners("motor_torque", np.zeros_like(T)), set()),
        ({"accelerator_position": np.full_like(T, 30.0)}, {"pedals"}),
        ({"accel_y": np.sin(T)}, {"across"}),
        ({"steering_angle": 0.1 * np.sin(T)}, {"yaw"}),
        (
            of_corners("motor_torque", np.full_like(T, 90.0))
            | of_corners("brake_torque", np.full_like(T, 9.0)),
            {"torques", "motor-share"},
        ),
    ],
)
def test_only_what_is_known_is_drawn(columns: dict[str, np.ndarray], plots: set[str]) -> None:
    assert names(drive(**columns)) == plots


def test_a_measured_wheel_is_drawn_where_slip_is_not_known() -> None:
    slip = np.where((T > 4.0) & (T < 5.0), np.nan, -0.1)
    turned = np.full_like(T, 20.0 * 0.9 / 0.33)
    turned[T > 8.0] = 0.0
    np.testing.assert_allclose(
        road_speed(turned, 72.0 * (1.0 + slip)), np.where(T > 8.0, 0.0, 3.6 * 18.0), rtol=1e-12
    )
    unmeasured = np.full_like(T, np.nan)
    np.testing.assert_array_equal(np.isnan(road_speed(unmeasured, slip)), np.isnan(slip))


def test_pedal_of_the_truth() -> None:
    assert names(drive(), drive(pedal_position=np.full_like(T, 40.0))) == {"pedals"}
