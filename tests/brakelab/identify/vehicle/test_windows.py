"""Windows of a drive: free, braking, steady, standing; zeros of pressures."""

import numpy as np
import pytest

from brakelab.identify.vehicle.windows import cut, pressure_zeros
from ecu.contract.signals import CORNERS

from .example import RADIUS, drive

T = np.arange(12000) * 0.01
BRAKED = (T > 60.0) & (T < 66.0)
SPEED = np.where(T < 60.0, 25.0, np.maximum(25.0 - 3.0 * (T - 60.0), 7.0)) * (T < 100.0)


def example(zero=0.4, floored=False):
    random = np.random.default_rng(4)
    pressures = {}
    for corner in CORNERS:
        pressure = np.where(BRAKED, 20.0, 0.0) + zero + 1.8 * random.standard_normal(len(T))
        pressures[f"calliper_pressure_{corner}"] = np.maximum(pressure, 0.0) if floored else pressure
    return drive(120.0, SPEED, **pressures)


def test_windows_are_free_braking_or_standing():
    found = example()
    windows = cut([found], [pressure_zeros(found)], RADIUS)
    braking = (windows.t > 61.0) & (windows.t < 65.0)
    free = (windows.t < 59.0) | ((windows.t > 68.0) & (windows.t < 99.0))
    stands = windows.t > 101.0
    assert windows.braking[braking].all()
    assert not windows.braking[(windows.t < 60.0) | (windows.t > 66.5)].any()
    assert windows.free[free].all()
    assert not windows.free[braking | stands].any()
    assert windows.standing[stands].all()
    assert not windows.standing[~stands & (windows.t < 99.0)].any()
    assert windows.steady[free].all()
    assert not windows.steady[120]  # 60.0 to 60.5 s: the brakes begin
    assert len(np.unique(windows.cluster[braking])) == 1


@pytest.mark.parametrize("zero", [-0.7, 0.0, 0.7])
def test_the_zero_of_a_pressure_is_that_of_released_brakes(zero):
    assert pressure_zeros(example(zero)) == pytest.approx(np.full(4, zero), abs=0.08)


def test_a_sensor_that_reports_nothing_below_zero_has_none():
    assert pressure_zeros(example(floored=True)).tolist() == [0.0] * 4


def test_steps_of_the_accelerometers_integral_are_those_of_a_mean_speed():
    found = drive(120.0, 15.0 + 5.0 * np.sin(0.3 * T))
    windows = cut([found], [np.zeros(4)], RADIUS)
    change = np.diff(windows.omega.mean(axis=(0, 1))) * RADIUS
    assert np.diff(windows.accel_sum.mean(axis=0)) == pytest.approx(change, abs=0.03)


def test_drives_are_joined():
    found = example()
    windows = cut([found, found], [pressure_zeros(found)] * 2, RADIUS)
    assert windows.drive.tolist() == [0] * 240 + [1] * 240
    assert not set(windows.cluster[:240]) & set(windows.cluster[240:])
