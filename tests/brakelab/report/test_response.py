"""Build-up of pressure and sides, on ramps whose times are known."""

import numpy as np
import pytest

from brakelab.report.drive import DriveResult
from brakelab.report.response import build_up, plots_of_response, responses
from ecu.contract.signals import CORNERS

from .conftest import braking_between

T = np.arange(0.0, 10.0, 0.01)


def ramp(begins: float, seconds: float, plateau: float) -> np.ndarray:
    return plateau * np.clip((T - begins) / seconds, 0.0, 1.0) * (T < 8.0)


@pytest.mark.parametrize("seconds", [0.05, 0.2, 1.0])
def test_ramp_takes_eight_tenths_of_its_length(seconds: float) -> None:
    found = build_up(T, ramp(2.0, seconds, 40.0))
    assert found.plateau == pytest.approx(40.0)
    assert found.begins == pytest.approx(2.0 + 0.1 * seconds, abs=0.002)
    assert found.seconds == pytest.approx(0.8 * seconds, abs=0.002)


def test_noise_does_not_begin_a_build_up() -> None:
    noise = np.random.default_rng(4).normal(0.0, 1.5, T.shape)
    assert build_up(T, ramp(2.0, 0.3, 40.0) + noise).seconds == pytest.approx(0.24, abs=0.05)


@pytest.mark.parametrize(
    "pressure", [np.full_like(T, np.nan), np.zeros_like(T), 4.0 * np.ones_like(T), 40.0 * np.ones_like(T)]
)
def test_what_does_not_rise_has_no_build_up(pressure: np.ndarray) -> None:
    assert np.isnan(build_up(T, pressure).seconds)


def made_up() -> DriveResult:
    """Front pressure 0.1 s after the demand, left 44, right 36 bar; motors brake with a quarter."""
    columns = {"braking": ((T >= 2.0) & (T < 8.0)).astype(float)}
    for corner in CORNERS:
        pressure = ramp(2.1, 0.2, 44.0 if corner.endswith("l") else 36.0)
        columns[f"calliper_pressure_{corner}"] = pressure
        columns[f"pressure_demand_{corner}"] = ramp(2.0, 0.2, 40.0)
        columns[f"brake_torque_{corner}"] = np.where(T < 8.0, 300.0, 0.0)
        columns[f"motor_torque_{corner}"] = np.where(T < 8.0, 100.0, 0.0)
        columns[f"mu_b_{corner}"] = np.full_like(T, 0.38 if corner.endswith("l") else 0.42)
    return DriveResult(T, columns, {})


def test_delay_sides_and_motors() -> None:
    (row,) = responses(made_up(), [braking_between(2.0, 7.99)])
    assert row.delay == pytest.approx((0.1, 0.1), abs=0.003)
    assert row.gradient == pytest.approx((200.0, 200.0), rel=0.02)
    assert row.pressure_sides[0] == pytest.approx(0.2, rel=1e-6)
    assert row.friction_sides[1] == pytest.approx(-0.1, rel=1e-6)
    assert row.motors == pytest.approx(0.25)


def test_one_braking_has_no_plot() -> None:
    rows = responses(made_up(), [braking_between(2.0, 7.99)])
    assert plots_of_response(rows) == {}
    assert set(plots_of_response([rows[0], rows[0]._replace(number=2)])) == {
        "build-up",
        "sides-pressure",
        "sides-friction",
    }
