"""An end of a connection that cannot be opened, goes, and comes back."""

import structlog

from ecu.errors import UserError
from ecu.runtime.place import AGAIN_S, Place


class Wire:
    """An end."""

    closed = False

    def close(self):
        self.closed = True


def place_of(*opened):
    """Return a place with what its opening finds in turn (wires, or errors), and its clock."""
    clock, found = [100.0], list(opened)

    def open_end():
        one = found.pop(0)
        if isinstance(one, Exception):
            raise one
        return one

    return Place("diagnostics", open_end, now_s=lambda: clock[0]), clock


def test_an_end_that_is_not_there_is_one_line_and_tried_again():
    wire = Wire()
    place, clock = place_of(*[UserError("virtual x", "", "is down")] * 2, wire)
    with structlog.testing.capture_logs() as lines:
        for _ in range(3):
            assert place.end() is None
        clock[0] += AGAIN_S
        assert place.end() is None
        clock[0] += AGAIN_S
        assert place.end() is wire
    assert [line["event"] for line in lines] == ["no_diagnostics"]
    assert "is down" in lines[0]["reason"]


def test_an_end_that_goes_is_reported_each_time():
    wires = [Wire(), Wire()]
    place, clock = place_of(*wires)
    with structlog.testing.capture_logs() as lines:
        for wire in wires:
            assert place.end() is wire
            place.lose(OSError("gone"))
            assert wire.closed
            assert place.end() is None
            clock[0] += AGAIN_S
    assert len(lines) == 2
