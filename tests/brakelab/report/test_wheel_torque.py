"""Friction and brake factors by wheel torque against the made-up brakes that give it."""

from typing import Any

import numpy as np
import pytest

from brakelab.report.brakings import Braking
from brakelab.report.drive import DriveResult
from brakelab.report.wheel_torque import reference_of
from brakelab.results.car import Car
from ecu.contract.params import GRAVITY
from ecu.contract.signals import CORNERS

from .conftest import braking_between

T = np.arange(0.0, 20.0, 0.01)
CAR = Car(2000.0, 2.9, 1.5, 0.6, (), (), (0.35, 0.35), (60.0, 30.0), (np.nan, np.nan), (1.0, 2.0))
HOLD_OFF = np.array([1.0, 1.0, 2.0, 2.0])  # bar
FRICTION = np.array([0.40, 0.40, 0.45, 0.45])
GAIN = np.array([60.0, 60.0, 30.0, 30.0])  # N m/bar
STOPS = [braking_between(2.0, 8.0), braking_between(10.0, 16.0)]


def pressed(rise: float) -> Any:
    """Pressure [bar] that grows by the factor `rise` in each stop, shape (n,)."""
    within = sum(np.where((one.t_start <= T) & (one.t_end > T), 1.0, 0.0) for one in STOPS)
    return within * 20.0 * (1.0 + (rise - 1.0) * ((T - 2.0) % 8.0) / 6.0)


def drive(rise: float = 2.5, motor: float = 0.0, sign: float = -1.0, decel: float = 4.0) -> DriveResult:
    """Brakes of `FRICTION`, transducers and pressures with noise, all with motors of `motor` N m."""
    rng = np.random.default_rng(5)
    pressure = pressed(rise)
    columns = {"accel_x_road": np.where(pressure > 0.0, -decel, 0.0)}
    for i, corner in enumerate(CORNERS):
        torque = GAIN[i] * FRICTION[i] * np.maximum(pressure - HOLD_OFF[i], 0.0) + motor
        columns[f"wheel_torque_y_{corner}"] = sign * torque + rng.normal(0.0, 10.0, T.shape)
        columns[f"calliper_pressure_{corner}"] = pressure + 0.7 + rng.normal(0.0, 1.0, T.shape)
        columns[f"pressure_zero_{corner}"] = np.full_like(T, 0.7)
        columns[f"motor_torque_{corner}"] = np.full_like(T, motor)
    return DriveResult(T, columns, {})


@pytest.mark.parametrize(("motor", "sign"), [(0.0, -1.0), (150.0, -1.0), (150.0, 1.0)])
def test_factor_hold_off_pressure_and_friction_are_those_of_the_brakes(motor: float, sign: float) -> None:
    measured = reference_of(drive(motor=motor, sign=sign), CAR, STOPS)
    assert measured is not None
    for place, factor in zip((0, 2), measured.factors.values(), strict=True):
        assert factor.factor == pytest.approx(GAIN[place] * FRICTION[place], rel=0.02)
        assert factor.friction == pytest.approx(FRICTION[place], rel=0.02)
        assert factor.hold_off == pytest.approx(HOLD_OFF[place], abs=0.6)
        assert factor.lines == 2 * len(STOPS)
    within = (T > 3.0) & (T < 7.5)
    assert measured.drive.corners("mu_b")[within].mean(axis=0) == pytest.approx(FRICTION, rel=0.02)


def test_a_constant_pressure_gives_friction_and_no_line() -> None:
    measured = reference_of(drive(rise=1.0), CAR, STOPS)
    assert measured is not None
    assert [factor.lines for factor in measured.factors.values()] == [0, 0]
    assert np.isnan(measured.factors["front"].hold_off)
    within = (T > 3.0) & (T < 7.5)
    assert measured.drive.corners("mu_b")[within].mean(axis=0) == pytest.approx(FRICTION, rel=0.02)


@pytest.mark.parametrize(("decel", "counts"), [(0.14, False), (0.16, True), (0.79, True), (0.81, False)])
def test_only_0_15_to_0_8_g_count(decel: float, counts: bool) -> None:
    measured = reference_of(drive(decel=decel * GRAVITY), CAR, STOPS)
    assert measured is not None
    assert (measured.factors["front"].lines > 0) == counts
    assert np.isfinite(measured.drive.corners("mu_b")).any() == counts


def test_friction_of_a_gap_is_unknown() -> None:
    columns = dict(drive().columns)
    gap = (T > 4.0) & (T < 5.0)
    columns["wheel_torque_y_fl"] = np.where(gap, np.nan, columns["wheel_torque_y_fl"])
    measured = reference_of(DriveResult(T, columns, {}), CAR, STOPS)
    assert measured is not None
    friction = measured.drive.column("mu_b_fl")
    assert np.isnan(friction[gap]).all()
    assert friction[(T > 5.5) & (T < 7.5)].mean() == pytest.approx(FRICTION[0], rel=0.02)


@pytest.mark.parametrize("found", [[], STOPS])
def test_without_transducers_nothing_is_measured(found: list[Braking]) -> None:
    columns = {name: values for name, values in drive().columns.items() if "wheel_torque" not in name}
    assert reference_of(DriveResult(T, columns, {}), CAR, found) is None
