"""Two that ask the loop at once, and one that died while it asked."""

import multiprocessing

import pytest

from ecu.recording.ring import RingReader, create_ring
from ecu.runtime import asking
from ecu.runtime.asking import Busy, taken_over


@pytest.fixture
def ring(tmp_path, monkeypatch):
    monkeypatch.setattr(asking, "ANSWERS_IN_S", 0.02)
    ring = create_ring(tmp_path / "x.ring", {}, b"", slots=4, frames=4)
    ring.header["followed"] = 0
    return ring


def hold(path, said):
    with asking._alone(RingReader(path, asks=True).ring):
        said.send(True)
        said.recv()


def test_while_another_process_asks_it_is_busy_and_a_dead_one_keeps_nobody_out(ring, params):
    here, there = multiprocessing.Pipe()
    context = multiprocessing.get_context("spawn")
    other = context.Process(target=hold, args=(ring.path, there))
    other.start()
    assert here.recv()
    with pytest.raises(Busy, match="another process asks"):
        taken_over(RingReader(ring.path, asks=True), params, {})
    other.kill()
    other.join()
    assert taken_over(RingReader(ring.path, asks=True), params, {}) is None  # no loop looks at it
    assert ring.asked["number"] == 1


def test_of_a_run_that_has_ended_nothing_is_asked(ring, params):
    reader = RingReader(ring.path, asks=True)
    ring.path.unlink()
    with pytest.raises(Busy, match="the run has ended"):
        taken_over(reader, params, {})
