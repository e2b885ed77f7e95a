"""The daemon as a process, over an interface that every machine has."""

import os
import signal
import time

import numpy as np
import pytest

from ecu.bus.e2e import P01_MODULO
from ecu.contract.records import LEARNED
from ecu.recording.recorder import read_recording
from ecu.recording.store import open_store, restore, save
from ecu.settings.config import load_config, store_key

from .conftest import ROOT, demand_ids

pytestmark = pytest.mark.multicast

CONFIG = ROOT / "config" / "suv.toml"
GROUP = f"239.74.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"  # a bus of this run's own
BUS = ("--config", CONFIG, "-i", "udp_multicast", "-c", GROUP)


def test_it_starts_cycles_records_and_leaves_in_order(daemon, vehicle, tmp_path):
    car = vehicle("udp_multicast", GROUP)
    unit = daemon(*BUS, "--record", tmp_path / "record", "--state", tmp_path / "state")
    assert unit.wait_for("ready")["armed"] is False
    heard = car.drive(100, until=lambda: unit.said("mode", now="ready"))
    assert unit.end(signal.SIGTERM) == 0
    assert set(demand_ids()[:4]) <= set(heard["can_id"].tolist())
    stopped = unit.wait_for("stopped")
    last = car.hear()
    farewell = last["data"][last["can_id"] == demand_ids()[0]][-1]
    assert farewell[1] & 0xF == (stopped["cycles"] + 2) % P01_MODULO  # three more than there were cycles
    assert stopped["by"] == "SIGTERM"
    recording = read_recording(tmp_path / "record")
    assert len(recording.cycles) == stopped["cycles"] >= 100
    assert (np.diff(recording.cycles["number"]) == 1).all()
    assert len(recording.frames.read_text().splitlines()) == recording.cycles["frames"].sum() > 100
    assert not any(
        line["event"] == "fault" and line["fault"] == "compiled in operation" for line in unit.seen
    )


@pytest.mark.requirement("REQ-TWO-1")
def test_a_second_daemon_on_the_same_bus_refuses(daemon, vehicle):
    car = vehicle("udp_multicast", GROUP)
    first = daemon(*BUS)
    first.wait_for("ready")
    second = daemon(*BUS)
    assert second.end(None) == 2
    assert any("someone else already sends it" in line for line in second.other)
    car.drive(1, until=lambda: first.said("mode", now="ready"))
    assert first.end() == 0


def test_a_run_without_any_frame_found_a_fault(daemon):
    unit = daemon(*BUS)
    unit.wait_for("fault")  # a run stopped before its first cycle has found none
    assert unit.end(signal.SIGINT) == 1
    assert any("no frame of the database came in" in line for line in unit.other)


def test_a_quiet_daemon_logs_warnings_and_errors_alone_from_all_its_processes(daemon):
    unit = daemon(*BUS, "--log-format", "json", "--quiet")
    unit.wait_for("fault")  # reported by the side process
    unit.end(signal.SIGINT)
    assert {line["level"] for line in unit.seen} == {"warning"}


def test_a_restart_after_kill_has_what_was_learned(daemon, vehicle, tmp_path):
    config = load_config(CONFIG)
    learned = np.zeros(1, LEARNED)
    learned["mu_b"], learned["sigma_mu_b"], learned["observed_s"] = config.front.mu_nominal * 0.9, 0.02, 9.0
    learned["radius_sigma"], learned["brakings"] = 0.002, 3
    state = tmp_path / "state"
    store = open_store(state)
    save(store, store_key(config), learned)
    store.close()
    car = vehicle("udp_multicast", GROUP)
    for _ in range(2):
        unit = daemon(*BUS, "--state", state, "--record", tmp_path / "record")
        assert unit.wait_for("restored")["brakings"] == 3
        unit.wait_for("ready")
        car.drive(2)
        assert unit.end(signal.SIGKILL) == -signal.SIGKILL
        assert read_recording(tmp_path / "record").initial["learned"]["brakings"][-1] == 3
    nominal = np.full(4, config.front.mu_nominal)
    assert restore(open_store(state), store_key(config), nominal)[1].tobytes() == learned.tobytes()


def test_the_side_process_writes_out_the_ring_when_the_daemon_is_killed(daemon, vehicle, tmp_path):
    begin_ns = time.time_ns()
    car = vehicle("udp_multicast", GROUP)
    unit = daemon(*BUS, "--record", tmp_path)
    unit.wait_for("ready")
    car.drive(50)
    unit.end(signal.SIGKILL)  # returns when the side process has closed the log, too
    recording = read_recording(tmp_path)
    assert len(recording.cycles) >= 49  # the last one heard may not have been published
    assert len(recording.frames.read_text().splitlines()) == recording.cycles["frames"].sum()
    assert begin_ns < recording.cycles["t_ns"][0] < recording.cycles["t_ns"][-1] < time.time_ns()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--config", "nosuch.toml", "-i", "virtual", "-c", "x"), "nosuch.toml"),
        (("--config", CONFIG, "-i", "nonsense", "-c", "x"), "nonsense x: cannot be opened"),
        ((*BUS, "--record", CONFIG), "cannot record here"),
        ((*BUS, "--log-format", "xml"), "--log-format: xml: not known; take console or json"),
    ],
    ids=["config", "interface", "record", "log format"],
)
def test_what_the_user_can_mend_is_one_line_and_exit_code_2(daemon, arguments, line):
    unit = daemon(*arguments)
    assert unit.end(None) == 2
    assert [line in text for text in unit.other] == [True]
