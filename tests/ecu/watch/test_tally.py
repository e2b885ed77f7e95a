import numpy as np
import pytest

from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.errors import UserError
from ecu.watch.health import STALLED_S
from ecu.watch.tally import EDGES_S, Tally

from .conftest import MONO_NS


@pytest.fixture
def one(loop):
    return loop()


def test_counts_of_cycles_and_lateness(one):
    now = [MONO_NS * 1e-9]
    tally = Tally(one.ring.path, lambda: now[0])
    assert tally.ailment() == "no cycle yet"
    one.cycle["overruns"], one.cycle["stage_ns"] = 3, [1000, 2000, 3000, 4000, 5000]
    one.publish(100, lateness_us=40.0)
    one.cycle["stage_ns"] = [1000, 2000, 2_000_001, 1_000_000, 5000]
    one.publish(2, lateness_us=20_000.0)
    tally.follow()
    assert dict(zip([*EDGES_S, "inf"], tally.lateness, strict=True)) == {
        **dict.fromkeys([*EDGES_S, "inf"], 0),
        50e-6: 100,
        100e-3: 2,
    }
    assert tally.lateness_sum_s == pytest.approx(100 * 40e-6 + 2 * 20e-3)
    assert tally.stages_s == pytest.approx(np.array([102, 204, 4300.002, 2400, 510]) * 1e-6)
    assert tally.stages_slow.tolist() == [0, 0, 2, 0, 0]
    assert tally.last["cycle"]["overruns"][0] == 3
    now[0] += 101 * CYCLE_NS * 1e-9 + 0.02
    assert tally.age_s == pytest.approx(0.02)
    assert tally.ailment() == ""
    now[0] += STALLED_S
    assert tally.ailment() == "no cycle for 0.5 s"
    one.close(by="SIGTERM")
    assert tally.ailment() == "the run has ended: SIGTERM"


def test_frames_are_counted_by_message_and_reason(one, contract_frames):
    """Of ten frames of WheelSpeedFront: one damaged, one left out, one twice."""
    good = contract_frames("WheelSpeedFront", 10)
    frames = new_record(FRAME, 10)
    frames[:5], frames[5:9], frames[9] = good[:5], good[6:10], good[9]
    frames["data"][2, 3] ^= 0xFF
    tally = Tally(one.ring.path)
    one.publish_frames(frames)
    tally.follow()
    row = tally.plan.messages["name"].tolist().index("WheelSpeedFront")
    counted = tally.reception.messages[row]
    assert (counted["received"], counted["checksum_errors"], counted["repeated"]) == (10, 1, 1)
    assert counted["lost"] == 2  # after the damaged one, and where one was left out
    assert counted["accepted"] == 8


def test_a_map_that_is_gone_costs_the_counts_by_message_alone(loop):
    one = loop(map="/nowhere/map.toml")
    one.publish(4, frames=2)
    tally = Tally(one.ring.path)
    tally.follow()
    assert tally.plan is None
    assert tally.last["cycle"]["number"][0] == 3


def test_without_a_ring(tmp_path):
    with pytest.raises(UserError, match="no ring to read here"):
        Tally(tmp_path / "none.ring")
