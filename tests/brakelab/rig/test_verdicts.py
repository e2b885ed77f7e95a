"""Each expectation held against a drive that is known to the row."""

import math
from typing import Any

import numpy as np
import pytest

from brakelab.report.drive import DriveResult
from brakelab.rig.figures import Figures, Stop, last_stop
from brakelab.rig.reaction import reactions
from brakelab.rig.verdicts import judge
from brakelab.simulation.expectations import Expectation
from brakelab.simulation.faults import Fault
from ecu.contract.faults import E2E_REJECTIONS, IMU_LOST
from ecu.contract.signals import ACTIVE, DEGRADED

T = 0.01 * np.arange(600)
LOST = (T >= 2.095) & (T < 3.055)
FAULTS = [Fault(kind="lost", t=2.0, duration=1.0)]


def figures(stop: Stop) -> Figures:
    """Return a drive whose IMU is lost from 2.1 to 3.05 s; E2E rejections stand all the time."""
    masks = np.where(LOST, IMU_LOST | E2E_REJECTIONS, E2E_REJECTIONS).astype(float)
    drive = DriveResult(
        T, {"active_faults": masks, "mode": np.where(LOST, DEGRADED, ACTIVE).astype(float)}, {}
    )
    truth = DriveResult(T, {"demand_heard": np.ones(len(T))}, {})
    error = {"front": 0.021, "rear": math.nan}
    return Figures(drive, truth, 0.25, {}, error, stop, reactions(drive, truth, FAULTS))


@pytest.mark.parametrize(
    ("keys", "found", "passed"),
    [
        ({"what": "bit", "bit": "IMU lost", "within": 0.1}, "after 0.1 s", True),
        ({"what": "bit", "bit": "IMU lost", "within": 0.09}, "after 0.1 s", False),
        ({"what": "bit", "bit": "IMU lost", "within": 0.6, "t": 1.5}, "after 0.6 s", True),
        ({"what": "bit", "bit": "IMU lost", "within": 0.6, "t": 2.5}, "never", False),
        ({"what": "bit", "bit": "wheel slips", "within": 9.0}, "never", False),
        ({"what": "bit", "bit": "E2E rejections", "within": 9.0}, "never", False),  # it stood before
        ({"what": "no_bit", "bit": "wheel slips"}, "never", True),
        ({"what": "no_bit", "bit": "IMU lost"}, "at t = 2.10 s", False),
        ({"what": "no_bit", "bit": "IMU lost", "t": 2.0}, "at t = 2.10 s", False),
        ({"what": "no_bit", "bit": "wheel slips", "t": 4.0}, "never", True),
        ({"what": "no_bit", "bit": "IMU lost", "t": 90.0}, "the run ended at t = 5.99 s", False),
        ({"what": "mode", "mode": "degraded", "within": 0.1}, "after 0.1 s", True),
        ({"what": "mode", "mode": "failed", "within": 1.0}, "never", False),
        ({"what": "mode", "mode": "active", "within": 0.6, "t": 2.5}, "after 0.56 s", True),
        ({"what": "mode", "mode": "degraded", "t": 2.5}, "degraded", True),
        ({"what": "mode", "mode": "degraded", "t": 3.5}, "active", False),
        ({"what": "mode", "mode": "active", "t": 9.0}, "silent", False),
        ({"what": "recovered", "within": 0.06}, "after 0.06 s", True),
        ({"what": "recovered", "within": 0.04}, "after 0.06 s", False),
        ({"what": "stopping_distance", "at_least": 40.0, "at_most": 45.0}, "42.000 m", True),
        ({"what": "stopping_distance", "at_least": 43.0}, "42.000 m", False),
        ({"what": "stopping_time", "at_most": 4.0}, "4.500 s", False),
        ({"what": "longer_stop", "at_most": 5.0}, "5.000 %", True),
        ({"what": "longer_stop", "at_most": 4.9}, "5.000 %", False),
        ({"what": "friction_error", "axle": "front", "at_most": 2.0}, "2.100 %", False),
        ({"what": "friction_error", "axle": "rear", "at_most": 2.0}, "none", False),
        ({"what": "decel_error", "at_most": 0.25}, "0.250 m/s²", True),
    ],
)  # fmt: skip
def test_a_verdict_says_what_was_found(keys: dict[str, Any], found: str, passed: bool) -> None:
    (verdict,) = judge([Expectation(**keys)], figures(Stop(42.0, 4.5)), 0.05, FAULTS)
    assert (verdict.found, verdict.passed) == (found, passed)
    assert verdict.line.startswith("passed: " if passed else "FAILED: ")
    assert (verdict.margin >= 0.0) == passed


@pytest.mark.parametrize(
    ("keys", "margin"),
    [
        ({"what": "bit", "bit": "IMU lost", "within": 0.15}, 0.05),
        ({"what": "bit", "bit": "IMU lost", "within": 0.09}, -0.01),
        ({"what": "bit", "bit": "wheel slips", "within": 9.0}, -math.inf),
        ({"what": "no_bit", "bit": "wheel slips"}, math.inf),
        ({"what": "mode", "mode": "active", "t": 2.5}, -math.inf),
        ({"what": "stopping_distance", "at_least": 40.0, "at_most": 45.0}, 2.0),
        ({"what": "stopping_distance", "at_most": 40.0}, -2.0),
        ({"what": "friction_error", "axle": "rear", "at_most": 2.0}, -math.inf),
    ],
)
def test_the_margin_tells_which_run_is_the_worst(keys: dict[str, Any], margin: float) -> None:
    (verdict,) = judge([Expectation(**keys)], figures(Stop(42.0, 4.5)), 0.05, FAULTS)
    assert verdict.margin == pytest.approx(margin)


def test_a_drive_without_a_stop_keeps_no_distance() -> None:
    expected = [
        Expectation(what="stopping_distance", at_most=1e6),
        Expectation(what="longer_stop", at_most=1e6),
    ]
    verdicts = judge(expected, figures(Stop()), math.nan, FAULTS)
    assert [(one.found, one.passed) for one in verdicts] == [("none", False)] * 2


def test_the_last_stop_is_that_from_the_demand_to_rest() -> None:
    speed = np.where(T < 1.0, 4.0, np.maximum(4.0 - 2.0 * (T - 1.0), 0.0))
    columns = {
        "vehicle_speed": speed,
        "decel_demand": np.where(T >= 1.0, 2.0, 0.0),
        "pedal_position": np.zeros(len(T)),
        "distance": np.cumsum(speed) * 0.01,
    }
    stop = last_stop(DriveResult(T, columns, {}))
    assert stop.seconds == pytest.approx(1.9, abs=0.02)
    assert stop.distance == pytest.approx(4.0, abs=0.05)
