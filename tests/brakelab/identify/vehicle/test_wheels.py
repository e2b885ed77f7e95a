"""Left against right wheels of a rigid car in curves, by its geometry."""

import numpy as np
import pytest

from brakelab.identify.vehicle.wheels import pairs_of
from brakelab.identify.vehicle.windows import cut

from .example import RADIUS, drive, suv

T = np.arange(20000) * 0.01
TRACK, ZERO, DIFFERENCE, DEFLECTION = 1.70, 0.004, 0.003, 0.0006


def curves(amplitude=0.12):
    """Return a drive of curves at 8 to 24 m/s: wheels by the rigid body, radii by lateral acceleration."""
    speed = 16.0 + 8.0 * np.sin(2 * np.pi * T / 90.0)
    yaw = amplitude * np.sin(2 * np.pi * T / 11.0) * 16.0 / speed
    random = np.random.default_rng(2)
    wheels = {}
    for corner, side in (("fl", 1), ("fr", -1), ("rl", 1), ("rr", -1)):
        unequal = DIFFERENCE if corner[0] == "f" else 0.0
        radius = RADIUS * (1.0 + side * (unequal / 2.0 + DEFLECTION * speed * yaw))
        wheels[f"wheel_speed_{corner}"] = (speed - side * yaw * TRACK / 2.0) / radius
        wheels[f"wheel_speed_{corner}"] += 0.1 * random.standard_normal(len(T))
    noise = 0.002 * random.standard_normal(len(T))
    return drive(200.0, speed, yaw_rate=yaw + ZERO + noise, **wheels)


def pairs_in(found, yaw=None):
    windows = cut([found], [np.zeros(4)], RADIUS)
    rolls = np.zeros((2, len(windows.t)))
    return pairs_of(windows, np.array([RADIUS, RADIUS]), rolls, yaw, suv()[0])


def test_track_zero_radii_and_deflection_are_identified():
    pairs = pairs_in(curves())
    assert pairs.track[0] == pytest.approx(TRACK, abs=3 * pairs.track[1])
    assert pairs.track[1] < 0.02 * TRACK
    assert pairs.yaw_zero[0] == pytest.approx(ZERO, abs=3 * pairs.yaw_zero[1])
    assert pairs.difference[0][0] == pytest.approx(DIFFERENCE, abs=2e-4)
    assert pairs.difference[1][0] == pytest.approx(0.0, abs=2e-4)
    base = float(suv()[0]["wheelbase"])
    assert pairs.deflection[0] == pytest.approx(2 * DEFLECTION * TRACK / (2 * base), rel=0.05)


def test_a_straight_drive_identifies_nothing():
    assert pairs_in(curves(0.001)) is None
    assert pairs_in(drive(60.0, 20.0)) is None
