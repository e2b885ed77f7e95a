import fcntl

import pytest

from ecu.errors import UserError
from ecu.watch import watcher as module
from ecu.watch.watcher import LOOK_S, NONE_RUNS, STALLED_S, Watcher


class Clock:
    def __init__(self):
        self.s = 100.0

    def __call__(self):
        return self.s


@pytest.fixture
def clock():
    return Clock()


def turn(watcher, clock, after_s=LOOK_S):
    clock.s += after_s
    return watcher.turn()


def test_it_waits_for_a_daemon_and_attaches_by_itself(loop, clock, rings):
    watcher = Watcher(None, clock)
    assert turn(watcher, clock) == 0
    assert watcher.trouble == NONE_RUNS
    one = loop()
    one.publish(40)
    assert turn(watcher, clock) == 40
    assert watcher.trouble == ""
    assert watcher.history.events[0].text == "attached to suv on socketcan can0, process 4711"


def test_a_daemon_that_ends_is_reported_and_the_next_one_is_attached_to(loop, clock):
    watcher, one = Watcher("4711", clock), loop()
    one.publish(8)
    turn(watcher, clock)
    one.publish(4)
    one.close(by="SIGTERM", cycles=12)
    assert turn(watcher, clock) == 4
    turn(watcher, clock)
    assert "process 4711: stopped by SIGTERM after 12 cycles; waiting" in watcher.trouble
    other, again = loop(5000, channel="can1"), loop(4800)
    again.publish(4)
    turn(watcher, clock)
    assert watcher.daemon.pid == 4800  # another process on the same bus, though 4711 was asked for
    assert watcher.history.kept_s == 0.04  # a recording is of one run
    assert len(watcher.history.rows) == 4
    assert other


def test_a_daemon_that_stands_still_and_one_that_was_killed(loop, clock, monkeypatch):
    watcher, one = Watcher(None, clock), loop()
    one.publish(4)
    turn(watcher, clock)
    turn(watcher, clock, STALLED_S + 1.5)
    assert watcher.trouble == "no cycle for 2 s, yet the process lives"
    one.publish(4)
    turn(watcher, clock)
    assert watcher.trouble == ""
    monkeypatch.setattr(module, "is_held", lambda path: False)
    turn(watcher, clock, STALLED_S + 0.1)
    assert "process 4711: was killed; waiting for the next one" in watcher.trouble


def test_a_name_that_no_daemon_answers_to(loop, clock):
    watcher, one = Watcher("can7", clock), loop()
    turn(watcher, clock)
    assert watcher.trouble == ("no daemon answers to can7; there run: suv on socketcan can0, process 4711")
    assert one


def test_what_happened_before_it_was_attached_is_reported_first(loop, clock):
    one, watcher = loop(), Watcher(None, clock)
    one.publish(300)
    one.publish(300, mode=2)
    turn(watcher, clock)
    assert [event.text[:8] for event in watcher.history.events] == ["ready → ", "attached"]
    assert watcher.history.events[0].clock < watcher.history.events[1].clock


def test_two_daemons_and_no_name(loop, clock):
    kept = [loop(1), loop(2)]
    with pytest.raises(UserError, match="name one by its process"):
        turn(Watcher(None, clock), clock)
    assert kept


@pytest.mark.requirement("REQ-PROC-4")
def test_the_ring_is_only_read(loop, clock):
    """Neither lock nor page of it changes hands."""
    watcher, one = Watcher(None, clock), loop()
    one.publish(8)
    before = one.ring.memory[:]
    turn(watcher, clock)
    assert one.ring.memory[:] == before
    with one.ring.path.open("rb") as file, pytest.raises(BlockingIOError):
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    with pytest.raises(ValueError, match="read-only"):
        watcher.reader.ring.header["written"] = 0


def test_one_that_ends_while_it_is_attached_to(loop, clock, monkeypatch):
    one, watcher = loop(), Watcher(None, clock)

    def gone(path):
        raise UserError(str(path), "", "no ring to read here")

    monkeypatch.setattr(module, "RingReader", gone)
    assert turn(watcher, clock) == 0
    assert watcher.daemon is None
    assert one
