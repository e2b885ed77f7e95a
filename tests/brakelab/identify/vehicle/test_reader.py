"""Samples of a drive by halves, and drives that cannot be used: one line each."""

import numpy as np
import pytest

from brakelab.identify.vehicle.reader import PRESENT, check, contradictions, drive_of
from brakelab.logs.physics.samples import Collector
from ecu.errors import UserError

from .example import RADIUS, drive, samples, suv


def test_halves_are_of_different_samples():
    random = np.random.default_rng(1)
    noise = 0.02 * random.standard_normal(6000)
    halves = drive(60.0, 20.0, yaw_rate=noise).halves["yaw_rate"]
    assert halves[0][::2] == pytest.approx(noise[::2])
    assert halves[1][1::2] == pytest.approx(noise[1::2])
    blocks = halves.reshape(2, 120, 50).mean(axis=2)
    assert abs(np.corrcoef(blocks)[0, 1]) < 0.25  # 120 windows: 1 / sqrt(120) = 0.09


def test_noise_is_that_of_second_differences():
    t = np.arange(6000) * 0.01
    found = drive(60.0, 20.0 + 3.0 * np.sin(0.2 * t), accel_y=np.sin(0.5 * t))
    assert found.spread["wheel_speed_fl"] == pytest.approx(0.1, rel=0.05)
    assert found.spread["accel_y"] < 1e-4


def test_a_gap_is_not_known_and_a_slow_reference_is():
    rows = samples(60.0, 20.0, vehicle_speed=20.0)
    rows[np.arange(6000) % 10 != 0, PRESENT["vehicle_speed"]] = np.nan
    rows[1000:1200, PRESENT["accel_x"]] = np.nan
    found = drive_of("drive.csv", rows)
    assert found.known["vehicle_speed"].all()
    assert not found.known["accel_x"][1020:1180].any()
    assert found.known["accel_x"][:1000].all()
    assert "yaw_rate" not in found


BAD = {
    "a wheel missing": (60.0, 20.0, ["wheel_speed_rl"], "wheel_speed_rl: is missing"),
    "no wheels": (60.0, 20.0, [f"wheel_speed_{c}" for c in ("fl", "fr", "rl", "rr")], "rr: are missing"),
    "no accelerometer": (60.0, 20.0, ["accel_x"], "accel_x: is missing"),
    "standing": (60.0, 0.0, [], "moves for 0 s only"),
    "ten seconds": (10.0, 20.0, [], "moves for 10 s only"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_drive_that_cannot_be_used_is_refused(name):
    seconds, speed, without, line = BAD[name]
    rows = samples(seconds, speed)
    rows[:, [PRESENT[signal] for signal in without]] = np.nan
    with pytest.raises(UserError, match=line):
        check(drive_of("drive.csv", rows), [], suv()[0])


def test_what_physics_finds_wrong_is_reported_but_a_zero_is_not():
    good = drive(60.0, 20.0)
    check(
        good,
        ["accel_x: reads +0.40 m/s^2 at constant speed; offset = -0.40, unless the road falls"],
        suv()[0],
    )
    with pytest.raises(UserError, match="turned against dv/dt; factor = -1 \\(1 more"):
        check(good, ["accel_x: turned against dv/dt; factor = -1", "yaw_rate: 57 times"], suv()[0])


@pytest.mark.parametrize(
    ("radius", "line"),
    [
        pytest.param(0.33, None, id="any car's"),
        pytest.param(0.42, None, id="a pick-up's, near START's"),
        pytest.param(1.0 / 3.6, "all read", id="km/h"),
        pytest.param(1.0, "all read", id="m/s"),
    ],
)
def test_tyres_are_any_car_s_or_start_s(radius: float, line: str | None):
    """START's are 0.42 m."""
    start = suv()
    start["wheel_radius"] = 0.42
    speed = 20.0 + 8.0 * np.sin(0.1 * np.arange(20_000) * 0.01)
    rows = samples(200.0, speed, vehicle_speed=speed)
    rows[:, [PRESENT[f"wheel_speed_{corner}"] for corner in ("fl", "fr", "rl", "rr")]] *= RADIUS / radius
    collector = Collector()
    collector.add(rows)
    found = contradictions(collector.series(), start[0])
    assert not found if line is None else line in found[0]
