"""Zeros and dive by kinematics: a car on hills whose accelerometer is known in closed form."""

import numpy as np
import pytest

from brakelab.identify.vehicle.sensors import accel_zero, dive_of, lateral_zero, steps_of, yaw_zero
from brakelab.identify.vehicle.windows import cut
from ecu.contract.params import GRAVITY

from .example import RADIUS, drive

T = np.arange(40000) * 0.01
PITCH, ZERO = 0.0035, 0.08


def windows_of(grade_mean=0.0, stands=False):
    """Return windows and steps of a drive that speeds up and brakes each 40 s on hills of 600 m."""
    phase = T % 40.0
    speed = 12.0 + np.where(
        phase < 8.0, 2.0 * phase, np.where(phase < 34.0, 16.0, 16.0 - 8.0 / 3.0 * (phase - 34.0))
    )
    speed = np.where(stands & (T < 5.0), 0.0, speed)
    change = np.gradient(speed, 0.01)
    change[np.abs(change) > 10.0] = 0.0
    place = np.cumsum(speed) * 0.01
    grade = grade_mean + 0.01 * np.sin(2 * np.pi * place / 600.0)
    felt = (1.0 + GRAVITY * PITCH) * (change + GRAVITY * grade) + ZERO
    random = np.random.default_rng(5)
    yaw = 0.003 + 0.002 * random.standard_normal(len(T))
    found = drive(400.0, speed, accel_x=felt + 0.01 * random.standard_normal(len(T)), yaw_rate=yaw)
    windows = cut([found], [np.zeros(4)], RADIUS)
    rolls = windows.omega.mean(axis=0) * RADIUS
    return windows, steps_of(windows, np.where(windows.free, rolls, np.where(windows.standing, 0.0, np.nan)))


def test_dive_is_found_without_the_grade():
    _, steps = windows_of()
    value, sigma, count = dive_of(steps, (0.0028, 0.001))
    assert count > 100
    assert value == pytest.approx(PITCH, abs=2.5 * sigma)
    assert sigma < 0.15 * PITCH


def test_a_closed_drive_tells_the_zero_of_the_accelerometer():
    windows, steps = windows_of()
    value, sigma = accel_zero(windows, steps, PITCH, closed=True)
    assert value == pytest.approx(ZERO, abs=3 * sigma)
    assert sigma < 0.005


def test_wheels_that_turn_backwards_tell_no_less():
    windows, steps = windows_of()
    backwards = np.where(np.arange(steps.speed.size) % 50 == 0, -0.02, steps.speed)
    value, sigma = accel_zero(windows, steps._replace(speed=backwards), PITCH, closed=True)
    assert value == pytest.approx(ZERO, abs=3 * sigma)


def test_a_standstill_that_is_none_does_not_tell_the_zero():
    """Wheels that are locked, or whose speed stands still, stand; the accelerometer reads the braking."""
    windows, steps = windows_of(stands=True)
    value, sigma = accel_zero(windows, steps, PITCH, closed=False)
    slides = windows._replace(accel=np.where(windows.standing, 9.8, windows.accel))
    off, also = accel_zero(slides, steps, PITCH, closed=False)
    assert value == pytest.approx(ZERO, abs=3 * sigma)
    assert off == pytest.approx(ZERO, abs=3 * also)
    assert also < 1.5 * sigma


def slalom_on_hills(begin: float):
    """Return windows and steps of a drive with curves from 100 to 150 s, on closed hills of 2400 m."""
    speed = 20.0 + 4.0 * np.sin(2 * np.pi * T / 50.0)
    change = np.gradient(speed, 0.01)
    place = np.cumsum(speed) * 0.01
    grade = 0.01 * np.sin(2 * np.pi * (place / 2400.0 + begin))
    grade -= np.average(grade, weights=speed)
    random = np.random.default_rng(7)
    turn = np.where((T > 100.0) & (T < 150.0), 0.2 * np.sin(2 * np.pi * T / 12.0), 0.0)
    felt = (1.0 + GRAVITY * PITCH) * (change + GRAVITY * grade) + ZERO - 1.3 * turn**2
    found = drive(
        400.0, speed, accel_x=felt + 0.01 * random.standard_normal(len(T)), yaw_rate=turn + 0.0 * speed
    )
    windows = cut([found], [np.zeros(4)], RADIUS)
    rolls = windows.omega.mean(axis=0) * RADIUS
    return windows, steps_of(windows, np.where(windows.free, rolls, np.nan))


def test_the_hill_under_the_curves_is_in_the_sigma_of_the_zero():
    """What curves add is shown beside the grade of their place: of a closed drive the greatest error."""
    z, off = [], []
    for begin in np.linspace(0.0, 1.0, 12, endpoint=False):
        value, sigma = accel_zero(*slalom_on_hills(float(begin)), PITCH, closed=True)
        off.append(value - ZERO)
        z.append((value - ZERO) / sigma)
    print(
        f"error {1e3 * np.std(off):.1f} mm/s^2, rms of error over sigma {np.sqrt(np.mean(np.square(z))):.2f}"
    )
    assert np.std(off) > 0.004
    assert np.sqrt(np.mean(np.square(z))) < 1.5


def test_an_open_one_is_as_sure_as_its_hills_allow():
    windows, steps = windows_of(grade_mean=0.004)
    value, sigma = accel_zero(windows, steps, PITCH, closed=False)
    assert 0.005 < sigma < 0.1
    assert value == pytest.approx(ZERO, abs=3 * sigma)
    closed, _least = accel_zero(windows, steps, PITCH, closed=True)
    assert closed - ZERO == pytest.approx(
        1.034 * GRAVITY * 0.004, rel=0.15
    )  # what it costs to say so wrongly


def test_a_standstill_tells_the_zero_of_the_yaw_rate():
    windows, _ = windows_of(stands=True)
    assert yaw_zero(windows)[0] == pytest.approx(0.003, abs=4e-4)
    assert yaw_zero(windows_of()[0]) is None


def test_the_lateral_zero_is_what_curves_leave():
    random = np.random.default_rng(6)
    yaw = 0.1 * np.sin(2 * np.pi * T / 13.0)
    across = 1.06 * 15.0 * yaw - 0.07 + 0.01 * random.standard_normal(len(T))
    noisy = yaw + 0.002 * random.standard_normal(len(T)) + 0.002
    windows = cut([drive(400.0, 15.0, yaw_rate=noisy, accel_y=across)], [np.zeros(4)], RADIUS)
    value, sigma = lateral_zero(windows, RADIUS, (0.002, 1e-4))
    assert value == pytest.approx(-0.07, abs=3 * sigma)
    assert lateral_zero(cut([drive(60.0, 15.0)], [np.zeros(4)], RADIUS), RADIUS, (0.0, 1e-4)) is None
