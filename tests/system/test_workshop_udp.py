"""A tester of a workshop (udsoncan): refused on the road, done at rest, stored, replayed to the bit."""

import os
import random
import threading
import time
from contextlib import closing, suppress

import can
import numpy as np
import pytest
from udsoncan.exceptions import (
    InvalidResponseException,
    NegativeResponseException,
    TimeoutException,
    UnexpectedResponseException,
)

from brakelab.testing.daemon import patience, wait_for
from ecu.algorithm.step import new_state
from ecu.contract.work import Kind, Work
from ecu.diagnostics import tester
from ecu.diagnostics.identifiers import PAD_THICKNESS
from ecu.diagnostics.services import FORGET, NEW_PADS
from ecu.errors import RunFault
from ecu.recording.recorder import read_recording
from ecu.recording.store import open_store, restore
from ecu.settings.config import load_config, new_params, store_key

from . import uds_tester
from .conftest import ROOT, unharmed
from .test_xcp_calibration import same_bits, stop
from .uds_tester import asked

pytestmark = pytest.mark.multicast

GROUP = f"239.84.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
CONFIG = load_config(ROOT / "config" / "suv.toml")
THICKNESS = PAD_THICKNESS.number
WORKS = {
    "new pads": lambda one: one.start_routine(NEW_PADS, b"\x03"),
    "measured pads": lambda one: one.write_data_by_identifier(THICKNESS, [None, None, 8.5, None]),
    "forget": lambda one: one.start_routine(FORGET),
}
AGAIN = (TimeoutException, UnexpectedResponseException, InvalidResponseException, NegativeResponseException)


def foreign_tester(**config):
    patience = {"p2_timeout": 10, "request_timeout": 20, **config}
    return uds_tester.foreign_tester(interface="udp_multicast", channel=GROUP, **patience)


def unlocked(client):
    asked(client, lambda one: one.change_session(3))
    asked(client, lambda one: one.unlock_security_access(1))
    return client


def done(client, work):
    """Ask for work; return whether the loop did it."""
    unlocked(client)
    try:
        work(client)
    except NegativeResponseException as refused:
        if refused.response.code_name not in ("ConditionsNotCorrect", "BusyRepeatRequest"):
            raise
        return False
    return True


@pytest.mark.requirement("REQ-WORK-1")
def test_refused_on_the_road_done_at_rest_stored_and_replayed_to_the_bit(unit, car, tmp_path):
    with foreign_tester() as client:
        assert not any(done(client, work) for work in WORKS.values())
        car.set(decel_demand=0)
        stop(car)
        wait_for(lambda: done(client, WORKS["new pads"]))
        assert done(client, WORKS["measured pads"])
        front = CONFIG.front.pad.thickness_new
        read = client.read_data_by_identifier_first([THICKNESS])
        assert read[:3] == pytest.approx([front, front, 8.5], abs=0.1)
        car.set(pedal_position=40, pedal_pressed=1)  # somebody holds it by the brake
        wait_for(lambda: not done(client, WORKS["forget"]))
        car.set(pedal_position=0, pedal_pressed=0)
        wait_for(lambda: done(client, WORKS["forget"]))
    unharmed(unit, tmp_path / "record")
    lines = [line for line in unit.seen if line["event"] == "serviced"]
    assert [line["kind"] for line in lines][:2] == ["new_pads", "measured_pads"]
    recorded = read_recording(tmp_path / "record")
    works = [note.work for note in recorded.calibrations]
    assert works[0] == Work(Kind.NEW_PADS, {"fl": 0.0, "fr": 0.0})
    assert [work.kind for work in works] == [Kind[line["kind"].upper()] for line in lines]
    assert same_bits(recorded.folder, tmp_path / "result.parquet") == []
    params = new_params(CONFIG)
    with closing(open_store(tmp_path / "state")) as store:
        learned = restore(store, store_key(CONFIG), params["mu_nominal"][0])[1]
    assert learned["wear"]["told"].tolist() == [[1, 1, 0, 0]]
    assert learned["wear"]["measurements"].tolist() == [[0, 0, 1, 0]]
    assert np.array_equal(learned["mu_b"], new_state(params)["learned"]["mu_b"])


@pytest.mark.study
def test_two_testers_at_once_do_whole_works_or_none(unit, car, tmp_path, monkeypatch):
    """Ours and a foreign one on one pair of identifiers: each may take the other's answer, and asks again."""
    car.set(decel_demand=0)
    stop(car)
    monkeypatch.setattr(tester, "PATIENCE_S", 0.3)
    wanted = {"new_pads": {"fl": 0.0, "fr": 0.0}, "measured_pads": {"rl": 1.5, "rr": 1.5}}
    rear = CONFIG.rear.pad.thickness_new - 1.5
    counts = dict.fromkeys(wanted, 0)

    def measure():
        for _ in patience():
            with suppress(RunFault):
                names = [f"rl={rear:g}", f"rr={rear:g}"]
                tester.diag("measured", names, "udp_multicast", GROUP, "0x7E0:0x7E8", tmp_path / "key")
                counts["measured_pads"] += 1
            if min(counts.values()) >= 2:
                break

    thread = threading.Thread(target=measure)
    thread.start()
    with foreign_tester(request_timeout=1, p2_timeout=1) as client:
        for _ in patience():
            with suppress(*AGAIN):
                counts["new_pads"] += done(client, WORKS["new pads"])
            if min(counts.values()) >= 2:
                break
    thread.join(120)
    unharmed(unit, tmp_path / "record")
    works = [line for line in unit.seen if line["event"] == "serviced"]
    assert {line["kind"] for line in works} == set(wanted)
    assert all(line["wear"] == pytest.approx(wanted[line["kind"]], abs=0.011) for line in works)
    assert [line["number"] for line in works] == list(range(1, len(works) + 1))
    assert same_bits(read_recording(tmp_path / "record").folder, tmp_path / "result.parquet") == []


@pytest.mark.study
def test_a_tester_that_dies_in_the_middle_leaves_all_or_nothing(unit, car, tmp_path):
    """In its first frame, and once it has asked: then it is done, and said in the log."""
    car.set(decel_demand=0)
    stop(car)
    with foreign_tester() as client:
        wait_for(lambda: done(client, WORKS["new pads"]))
        start = b"\x10\x0b\x2e\x01\x18\x03\x52\x03"
        client.bus.send(can.Message(arbitration_id=0x7E0, is_extended_id=False, data=start))
    with foreign_tester() as client:
        unlocked(client)
        data = b"\x05\x31\x01\x02\x01\x0c"
        client.bus.send(can.Message(arbitration_id=0x7E0, is_extended_id=False, data=data))
    assert unit.wait_for("serviced", wear={"rl": 0.0, "rr": 0.0})["number"] == 2
    with foreign_tester() as client:
        assert done(client, WORKS["measured pads"])
    unharmed(unit, tmp_path / "record")
    assert same_bits(read_recording(tmp_path / "record").folder, tmp_path / "result.parquet") == []


@pytest.mark.study
def test_a_standby_does_what_is_done_to_the_first_one(unit, daemon, car, tmp_path):
    bus = ("--config", ROOT / "config" / "suv.toml", "--armed", "-i", "udp_multicast", "-c", GROUP)
    second = daemon(*bus, "--standby", "--state", tmp_path / "second")
    second.wait_for("learned_from_ring")
    car.set(decel_demand=0)
    stop(car)
    with foreign_tester() as client:
        wait_for(lambda: done(client, WORKS["new pads"]))
    assert second.wait_for("serviced", wear={"fl": 0.0, "fr": 0.0})["kind"] == "new_pads"
    assert second.end() == 0
    with closing(open_store(tmp_path / "second")) as store:
        learned = restore(store, store_key(CONFIG), new_params(CONFIG)["mu_nominal"][0])[1]
    assert learned["wear"]["told"].tolist() == [[1, 1, 0, 0]]
    unharmed(unit, tmp_path / "record")


@pytest.mark.requirement("REQ-WORK-1")
def test_fuzzed_work_never_reaches_a_loop_that_drives(unit, tmp_path):
    draw = random.Random(31)
    with foreign_tester(request_timeout=1, p2_timeout=1) as client:
        end_s = time.monotonic() + 8
        while time.monotonic() < end_s:
            unlocked(client)
            for _ in range(8):
                head = draw.choice([b"\x31\x01\x02\x01", b"\x31\x01\x02\x02", b"\x2e\x01\x18"])
                try:
                    client.conn.send(head + draw.randbytes(draw.choice([0, 1, 1, 8])))
                    client.conn.wait_frame(timeout=0.3)
                except TimeoutException:
                    pass
            client.conn.empty_rxqueue()
    unharmed(unit, tmp_path / "record")
    assert unit.said("service_refused")
    assert not unit.said("serviced")
    assert read_recording(tmp_path / "record").calibrations == []
