"""The server beside a loop: what it follows, keeps, answers; what its death and the end of the run cost."""

import signal

import pytest
import structlog

from ecu.contract.faults import LATE, NOT_KEPT, PRESSURE_LOST
from ecu.diagnostics import server as server_module
from ecu.diagnostics.fault_memory import CONFIRMED, TEST_FAILED
from ecu.diagnostics.server import FAILED, NOT_TESTED, PASSED, SELF_TESTS, Server
from ecu.diagnostics.transport import Request
from ecu.diagnostics.trouble_codes import TROUBLE_CODES
from ecu.settings.config import load_config
from ecu.settings.resources import resource

from ..watch.conftest import MONO_NS, START_NS

ABOUT = {
    "store_key": "suv/12345678/8",
    "versions": {"brake-ecu": "1.2.3"},
    "config_hash": "0123456789abcdef",
    "armed": True,
    "configuration": load_config(resource("config/suv.toml")).model_dump(),
}
READY, STARTING = 1, 0
NUMBERS = {code.fault.bit: code.number for code in TROUBLE_CODES}


@pytest.fixture
def begin(loop, tmp_path, monkeypatch):
    """Start a loop and its server; `state` keeps the fault memory."""
    servers = []

    def start(run=None, state=True, **about):
        run = run or loop(**{**ABOUT, **about})
        folder = tmp_path / "state" if state else None
        servers.append(Server(run.ring.path, folder, b"", now_s=lambda: 0.0))
        return run, servers[-1]

    yield start
    for server in servers:
        server.finish()


def ask(server, request, functional=False):
    """Return the responses to a request, both in hexadecimal."""
    found = server.answer(Request(bytes.fromhex(request), functional))
    return [response.hex(" ").upper() for response in found]


def confirmed(server):
    return [number for number, entry in server.memory.entries.items() if entry.status & CONFIRMED]


def test_a_fault_of_the_loop_is_read_with_its_snapshot(begin):
    run, server = begin()
    run.publish(100, mode=READY, vehicle_speed=20.0)
    run.publish(20, active_faults=PRESSURE_LOST, vehicle_speed=10.0)
    assert ask(server, "19 01 08") == ["59 01 7F 00 00 01"]
    assert ask(server, "19 02 01") == ["59 02 7F 50 02 08 2F"]
    snapshot = ask(server, "19 04 50 02 08 01")[0]
    assert snapshot.startswith("59 04 50 02 08 2F 01 06 01 20 ")
    assert "01 03 00 4E 20" in snapshot  # 10 m/s


def test_while_the_ecu_starts_nothing_that_is_received_is_tested(begin):
    run, server = begin()
    run.publish(100, mode=STARTING, active_faults=PRESSURE_LOST | LATE)
    server.follow()
    assert confirmed(server) == [NUMBERS[LATE]]


def test_what_is_read_is_of_the_last_cycle(begin):
    run, server = begin()
    run.publish(5, mode=READY, vehicle_speed=20.0)
    assert ask(server, "22 01 03") == ["62 01 03 00 9C 40"]
    run.publish(1, vehicle_speed=10.0)
    assert ask(server, "22 01 03 01 24") == ["62 01 03 00 4E 20 01 24 00 00 00 06"]
    texts = {"F1 89": "1.2.3", "F1 97": "brake-ecu", "F1 A0": "0123456789abcdef", "F1 A1": "suv"}
    for number, text in texts.items():
        assert ask(server, f"22 {number}") == [f"62 {number} {text.encode().hex(' ').upper()}"]


def test_pads_are_as_thick_as_new_less_their_wear(begin):
    run, server = begin()
    run.publish(1, mode=READY, pad_wear=[0.5, 1.0, 0.0, float("nan")])
    assert ask(server, "22 01 18") == ["62 01 18 04 7E 04 4C 04 B0 FF FF"]


@pytest.mark.parametrize("speaks", [0, 1])
def test_a_daemon_that_is_silent_does_not_answer(speaks, begin):
    run, server = begin()
    assert ask(server, "3E 00") == []  # no cycle yet
    run.cycle["speaks"] = speaks
    run.publish(1)
    assert ask(server, "3E 00") == ["7E 00"] * speaks


def test_a_clear_is_answered_pending_and_is_stored(begin):
    run, server = begin()
    run.publish(20, active_faults=LATE)
    assert ask(server, "14 FF FF FF") == ["7F 14 78", "54"]
    assert ask(server, "14 00 00 00", functional=True) == []
    server.finish()
    _, after = begin(run)
    assert confirmed(after) == []


def test_a_clear_that_a_full_disk_does_not_keep_is_refused(begin, monkeypatch):
    run, server = begin()
    run.publish(20, active_faults=LATE)
    monkeypatch.setattr(server._file, "_save", lambda record: False)
    assert ask(server, "14 FF FF FF") == ["7F 14 78", "7F 14 72"]


def test_without_a_state_folder_a_clear_is_done_at_once(begin):
    run, server = begin(state=False)
    run.publish(20, active_faults=LATE)
    assert ask(server, "14 FF FF FF") == ["54"]


def test_the_next_run_knows_what_the_last_one_saw(begin, loop):
    run, server = begin()
    run.publish(20, active_faults=LATE)
    server.finish()
    _, second = begin(loop(4712, **{**ABOUT, "start_ns": START_NS + 1}))
    entry = second.memory.entries[NUMBERS[LATE]]
    assert (entry.status, entry.occurrences) == (0x6C, 1)


@pytest.mark.parametrize("killed_after", [10, 19, 20, 21, 60])
def test_a_server_that_was_killed_goes_on_where_it_was(killed_after, begin):
    """The fault is there for 40 cycles: its debounce of 20 lies across the death, or is seen once."""
    run, server = begin()
    run.publish(100, mode=READY)
    server.follow()
    run.publish(min(killed_after, 40), active_faults=PRESSURE_LOST)
    run.publish(max(killed_after - 40, 0), active_faults=0)
    server.follow()
    server._file.close(10)  # what a kill leaves: the lock is free, the file as it was saved last
    run.publish(40 - min(killed_after, 40), active_faults=PRESSURE_LOST)
    run.publish(200, active_faults=0)
    _, second = begin(run)
    second.follow()
    entry = second.memory.entries[NUMBERS[PRESSURE_LOST]]
    assert (entry.status, entry.occurrences) == (0x2E, 1)


def test_a_server_that_was_away_for_longer_than_the_ring_holds_loses_only_that(begin):
    run, server = begin()
    run.publish(20, active_faults=LATE)
    server.follow()
    server._file.close(10)
    run.publish(2500, active_faults=0, mode=READY)
    _, second = begin(run)
    second.follow()
    entry = second.memory.entries[NUMBERS[LATE]]
    assert entry.status & CONFIRMED
    assert not entry.status & TEST_FAILED
    assert entry.occurrences == 1


def test_the_end_of_the_run_stores_the_last_cycles(begin, tmp_path):
    run, server = begin()
    run.publish(20, active_faults=LATE)
    server.finish()
    _, second = begin(run)
    assert confirmed(second) == [NUMBERS[LATE]]


def test_the_setting_is_off_only_while_its_session_lasts(begin):
    run, server = begin()
    clock = [100.0]
    server._now_s = lambda: clock[0]
    run.publish(1)
    assert ask(server, "10 03") == ["50 03 00 32 01 F4"]
    assert ask(server, "85 02") == ["C5 02"]
    run.publish(20, active_faults=LATE)
    server.follow()
    assert confirmed(server) == []
    clock[0] += 5.1
    server.follow()
    run.publish(20)
    server.follow()
    assert confirmed(server) == [NUMBERS[LATE]]


@pytest.mark.parametrize(
    ("what", "result"),
    [
        ("well", [PASSED, PASSED, PASSED, PASSED]),
        ("stands still", [FAILED, PASSED, PASSED, PASSED]),
        ("missed", [PASSED, FAILED, PASSED, PASSED]),
        ("not kept", [PASSED, PASSED, FAILED, PASSED]),
        ("no state folder", [PASSED, PASSED, PASSED, NOT_TESTED]),
        ("disk full", [PASSED, PASSED, PASSED, FAILED]),
    ],
)
def test_the_self_test(what, result, begin, monkeypatch):
    run, server = begin(state=what != "no state folder")
    run.publish(10, mode=READY)
    if what == "missed":
        run.cycle["overruns"] = 1
    run.publish(10, active_faults=NOT_KEPT if what == "not kept" else 0)
    age_s = 2.0 if what == "stands still" else 0.05
    now_s = 1e-9 * MONO_NS + 0.01 * 19 + age_s
    monkeypatch.setattr(server_module, "monotonic_s", lambda: now_s)
    if what == "disk full":
        monkeypatch.setattr(server._file, "_save", lambda record: False)
        run.publish(20, active_faults=LATE)
        monkeypatch.setattr(server_module, "monotonic_s", lambda: now_s + 0.2)
    ask(server, "10 03")
    answer = ask(server, "31 01 02 00")[0]
    assert answer == f"71 01 02 00 {bytes(result).hex(' ')}"
    assert ask(server, "31 03 02 00") == [answer.replace("71 01", "71 03")]
    assert len(result) == len(SELF_TESTS)


@pytest.mark.parametrize(
    ("armed", "manager", "held", "answer"),
    [
        (False, True, True, "51 01"),
        (False, False, True, "7F 11 22"),
        (False, True, False, "7F 11 22"),
        (True, True, True, "7F 11 22"),
    ],
)
def test_a_reset_ends_the_loop_of_a_shadow_that_is_started_again(
    armed, manager, held, answer, begin, monkeypatch
):
    killed = []
    monkeypatch.setattr(server_module.os, "kill", lambda *call: killed.append(call))
    monkeypatch.setattr(server_module, "is_held", lambda path: held)
    if manager:
        monkeypatch.setenv("NOTIFY_SOCKET", "/run/x")
    run, server = begin(armed=armed)
    run.publish(1)
    assert ask(server, "11 01") == [answer]
    assert killed == []  # the response leaves first
    with structlog.testing.capture_logs() as lines:
        server.restart_if_asked()
        server.restart_if_asked()
    assert killed == [(4711, signal.SIGTERM)] * (answer == "51 01")
    assert len(lines) == len(killed)
