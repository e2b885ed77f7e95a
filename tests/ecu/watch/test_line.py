import json

import numpy as np
import pytest

from ecu.contract.faults import IMU_LOST
from ecu.watch.line import json_line, text_line
from ecu.watch.watcher import Watcher


@pytest.fixture
def watched(loop):
    one = loop()
    one.cycle["e2e"] = 7, 3, 2, 1
    one.find("yaw_rate", value=3.0, innovation=2.9, sigma=0.02, ratio=2336.1, rejected=1, unused_s=12.3)
    one.find("reverse", value=0.0, unused_s=0.0)
    one.find("vehicle_speed", rejected=0, unused_s=4.0)  # it came once
    one.publish(
        4,
        mode=3,
        active_faults=IMU_LOST,
        vehicle_speed=20.04,
        decel_demand_total=3.0,
        accel_x_road=-2.9,
        mu_b=[0.4, 0.41, 0.42, 0.43],
        sigma_mu_b=0.02,
        calliper_pressure=[30, 31, 12, -0.4],
        disc_temperature=[100, 101, 102, np.nan],
    )
    watcher = Watcher(None)
    watcher.turn()
    yield watcher
    assert one


def test_the_line_of_text(watched):
    assert text_line(watched)[9:] == (
        "degraded 20.0 m/s decel 3.00→2.90 m/s² mu 0.400±0.020 0.410±0.020 0.420±0.020 0.430±0.020"
        " 30/31/12/0 bar 100/101/102/– °C late 50 µs missed 0"
        " frames 7 late, 3 lost, 2 repeated, 1 wrong; IMU lost"
    )


def test_the_line_of_json(watched):
    said = json.loads(json_line(watched))
    assert said["mu_b"] == [0.4, 0.41, 0.42, 0.43]
    assert said["disc_temperature"] == [100, 101, 102, None]
    assert (said["mode"], said["faults"], said["missed"], said["cycles"]) == ("degraded", ["IMU lost"], 0, 4)
    assert said["lateness_us"]["50"] == 4
    assert said["frames"] == {"late": 7, "lost": 3, "repeated": 2, "wrong": 1}
    assert list(said["inputs"]) == ["yaw_rate", "vehicle_speed", "reverse"]
    assert said["inputs"]["yaw_rate"] == {
        "unit": "rad/s",
        "value": 3,
        "innovation": 2.9,
        "sigma": 0.02,
        "ratio": 2336.1,
        "judged_s": 0,
        "rejected": True,
        "unused_s": 12.3,
    }
    found = [said["inputs"]["vehicle_speed"][name] for name in ("value", "ratio", "rejected", "unused_s")]
    assert found == [None, None, False, 4]
    assert said["clock"] == 1_800_000_000.03


def test_what_is_not_available_and_who_is_silent(loop):
    one = loop()
    one.cycle["speaks"] = 0
    one.publish(4, mode=2, vehicle_speed=np.nan, accel_x_road=0.001, decel_demand_total=-0.0, mu_b=np.nan)
    watcher = Watcher(None)
    watcher.turn()
    line = text_line(watcher)
    assert "active (silent) – m/s decel 0.00→0.00 m/s² mu –±" in line
    assert "nan" not in line
    said = json_line(watcher)
    assert '"speaks": 0, ' in said
    assert '"vehicle_speed": null' in said


def test_the_ceiling_of_grip_where_one_is_estimated(loop):
    one = loop()
    one.publish(4, decel_demand_total=3.0, accel_x_road=-2.9, grip_limit=9.14, sigma_grip_limit=0.82)
    watcher = Watcher(None)
    watcher.turn()
    assert "decel 3.00→2.90 m/s², ceiling of grip 9.1±0.8 mu" in text_line(watcher)
    assert '"grip_limit": 9.14, "sigma_grip_limit": 0.82' in json_line(watcher)


def test_without_a_daemon(rings):
    watcher = Watcher(None)
    watcher.turn()
    assert "no daemon of this user runs" in text_line(watcher)
    assert json.loads(json_line(watcher))["trouble"].startswith("no daemon")
