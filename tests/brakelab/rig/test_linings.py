"""Which fault bits a car's linings account for: against friction and bits written down by hand."""

import numpy as np
import pytest

from brakelab.report.drive import DriveResult
from brakelab.rig.linings import beyond_compensation, tell_linings
from brakelab.rig.outcome import account_for
from brakelab.simulation.faults import Fault
from ecu.contract.faults import BRAKE_FADE, DEMAND_LIMITED, IMU_LOST
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config
from ecu.settings.resources import resource

SUV = load_config(resource("config/suv.toml"))  # nominal friction 0.45
T = 0.01 * np.arange(500)


def truth(front, rear=0.45, change_at=T[-1] + 1.0, then=0.45):
    """Return a drive whose front linings have `front`, and `then` from `change_at` s on."""
    axle = np.where(change_at > T, front, then)
    columns = {f"mu_b_{corner}": axle if corner[0] == "f" else np.full(len(T), rear) for corner in CORNERS}
    return DriveResult(T, columns, {})


@pytest.mark.parametrize(
    ("front", "rear", "beyond"),
    [
        (0.45, 0.45, False),
        (0.36, 0.54, False),  # 20 % off in both directions: compensated
        (0.335, 0.45, False),  # -26 %
        (0.32, 0.45, True),  # -29 %: the estimate may be 5 % off its 30 %
        (0.45, 0.28, True),
        (0.70, 0.45, False),  # the limiter lets torque fall to 0.6: 0.45 / 0.6 = 0.75, by the estimate 0.714
        (0.72, 0.45, True),
    ],
)
def test_linings_beyond_what_is_compensated(front, rear, beyond):
    assert beyond_compensation(truth(front, rear), SUV).all() == beyond


def test_linings_that_fade_are_beyond_by_what_they_had_before():
    # 0.60 is learned, 0.42 is 30 % below it, though it is hardly below the configured 0.45
    rows = beyond_compensation(truth(0.60, change_at=2.0, then=0.42), SUV)
    assert list(rows) == list(T >= 2.0)


def test_what_was_learned_from_weak_linings_counts_after_they_recovered():
    assert beyond_compensation(truth(0.30, change_at=1.0, then=0.45), SUV).all()


def test_the_text_tells_the_furthest_axle():
    assert tell_linings(truth(0.30, 0.50), SUV) == "front linings 33 % below the configured friction"
    assert tell_linings(truth(0.45, 0.60), SUV) == "rear linings 33 % above the configured friction"


@pytest.mark.parametrize(
    ("bits", "front", "alone", "of_linings"),
    [
        (0, 0.30, [], 0),
        (BRAKE_FADE, 0.30, [], 1),
        (BRAKE_FADE | DEMAND_LIMITED, 0.30, [], 2),
        (BRAKE_FADE, 0.45, ["compensation at its limit"], 0),  # sound linings: a false alarm
        (DEMAND_LIMITED, 0.40, ["demand limited"], 0),
        (IMU_LOST, 0.30, ["IMU lost"], 0),  # no lining loses an accelerometer
        (IMU_LOST | BRAKE_FADE, 0.30, ["IMU lost"], 1),
    ],
)
def test_bits_that_nothing_accounts_for(bits, front, alone, of_linings):
    raised = DriveResult(T, {"active_faults": np.where(T > 2.0, float(bits), 0.0)}, {})
    found = account_for(raised, truth(front), [], SUV, frozenset())
    assert (found[0], len(found[1])) == (alone, of_linings)


def test_bits_within_an_injected_fault_need_no_linings():
    raised = DriveResult(T, {"active_faults": np.where(T > 2.0, float(BRAKE_FADE), 0.0)}, {})
    fault = Fault(kind="lost", message=["Imu"], t=1.9, duration=1.0)
    assert account_for(raised, truth(0.45), [fault], SUV, frozenset()) == ([], [])
