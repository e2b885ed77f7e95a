"""The server's loop: a bus that goes and comes back, requests in, responses out, the end of the run."""

import itertools

import can
import pytest
import structlog

from ecu.diagnostics import serve as serve_module
from ecu.diagnostics.serve import serve
from ecu.diagnostics.transport import Request
from ecu.errors import UserError
from ecu.runtime import place as place_module
from ecu.runtime.diagnostics import Settings

from .test_server import ABOUT

SETTINGS = Settings("virtual", "x", "7E0:7E8", "")


class Wire:
    """A `Link` that hears what the test says."""

    def __init__(self, *turns):
        self.turns, self.sent, self.closed, self.is_busy, self.requests = list(turns), [], False, False, []

    def turn(self, timeout_s):
        what = self.turns.pop(0) if self.turns else None
        if isinstance(what, Exception):
            raise what
        if what:
            self.requests.append(Request(what, False))

    def next(self):
        return self.requests.pop(0) if self.requests else None

    def send(self, data):
        self.sent.append(data)

    def close(self):
        self.closed = True


@pytest.fixture
def wires(monkeypatch):
    """What `Link` opens, in turn: wires, or errors."""
    opened = []

    def open_link(*_):
        found = opened.pop(0)
        if isinstance(found, Exception):
            raise found
        return found

    monkeypatch.setattr(serve_module, "Link", open_link)
    return opened


def test_it_answers_over_a_lost_bus_until_the_run_ends(wires, loop, tmp_path, monkeypatch):
    run = loop(**ABOUT)
    run.publish(5, mode=1)
    first, second = Wire(b"\x3e\x00", can.CanOperationError("gone")), Wire(b"\x14\xff\xff\xff", b"\x3e\x80")
    wires += [first, second]
    monkeypatch.setattr(place_module, "AGAIN_S", 0.0)
    turns = itertools.count()

    def goes_on():
        if next(turns) == 6:
            run.close(by="SIGTERM")
        return True

    with structlog.testing.capture_logs():
        serve(run.ring.path, tmp_path, SETTINGS, goes_on)
    assert first.sent == [b"\x7e\x00"]
    assert second.sent == [b"\x7f\x14\x78", b"\x54"]
    assert second.closed
    assert (tmp_path / "faults.sqlite").exists()


def test_a_process_whose_parent_has_gone_ends(wires, loop):
    wires += [Wire()]
    run = loop(**ABOUT)
    serve(run.ring.path, None, SETTINGS, lambda: False)


def test_a_key_file_that_has_become_none_is_an_error(loop, tmp_path):
    run = loop(**ABOUT)
    with pytest.raises(UserError, match="cannot be read"):
        serve(run.ring.path, None, SETTINGS._replace(key=str(tmp_path / "gone")), lambda: True)
