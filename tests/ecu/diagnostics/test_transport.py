"""ISO-TP between two ends, and against frames of anybody."""

import itertools
import sys

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.diagnostics import transport
from ecu.diagnostics.transport import Link, Request
from ecu.errors import UserError

CHANNELS = (f"uds-{number}" for number in itertools.count())


def test_without_can_isotp_it_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "isotp", None)
    with pytest.raises(UserError, match=r"needs can-isotp: .* -m pip install can-isotp"):
        transport.load_isotp()


@pytest.fixture
def ends():
    """Open the ECU's end and a tester's on a bus in memory, and a raw one."""
    opened = []

    def start(request=0x7E0, response=0x7E8):
        channel = next(CHANNELS)
        functional = 0x7DF if request < 0x800 else 0x18DB33F1
        opened.append(Link("virtual", channel, response, request, functional))
        opened.append(Link("virtual", channel, request, response))
        opened.append(can.Bus(interface="virtual", channel=channel))
        return opened[-3:]

    yield start
    for one in opened:
        (one.shutdown if isinstance(one, can.BusABC) else one.close)()


def turn(*links, turns=300):
    for _ in range(turns):
        for link in links:
            link.turn(0)


@pytest.mark.parametrize("length", [1, 7, 8, 62, 63, 500, 4095])
@pytest.mark.parametrize("request_id", [0x7E0, 0x18DA28F1])
def test_a_message_arrives_whole_in_both_directions(length, request_id, ends):
    ecu, tester, _ = ends(request_id, request_id + 8)
    text = bytes(number & 0xFF for number in range(length))
    for sender, receiver in ((tester, ecu), (ecu, tester)):
        sender.send(text)
        turn(ecu, tester)
        assert receiver.next() == Request(text, functional=False)
        assert not sender.is_busy
        assert not receiver.is_busy


def frame(can_id, data, **more):
    return can.Message(arbitration_id=can_id, data=data, **{"is_extended_id": can_id > 0x7FF, **more})


@pytest.mark.parametrize(
    ("message", "request_"),
    [
        (frame(0x7DF, b"\x02\x3e\x80"), Request(b"\x3e\x80", functional=True)),
        (frame(0x7DF, b"\x02\x3e\x80\xcc\xcc\xcc\xcc\xcc"), Request(b"\x3e\x80", functional=True)),
        (frame(0x7E0, b"\x02\x3e\x00"), Request(b"\x3e\x00", functional=False)),
        (frame(0x7DF, b"\x10\x09abcdef"), None),  # it has no flow control
        (frame(0x7DF, b"\x05\x3e\x80"), None),  # less than it says
        (frame(0x7DF, b"\x00"), None),
        (frame(0x7DF, b""), None),
        (frame(0x7E1, b"\x02\x3e\x00"), None),
        (frame(0x7E0, b"\x02\x3e\x00", is_extended_id=True), None),
        (frame(0x7E0, b"", is_remote_frame=True), None),
        (frame(0x7E0, b"\x02\x3e\x00", is_fd=True), None),
        (frame(0x7E0, b""), None),
    ],
)
def test_what_is_taken_for_a_request(message, request_, ends):
    ecu, _, bus = ends()
    bus.send(message)
    turn(ecu, turns=3)
    assert ecu.next() == request_


def test_frames_are_padded(ends):
    ecu, _, bus = ends()
    ecu.send(b"\x7e\x00")
    assert bytes(bus.recv(1).data) == b"\x02\x7e\x00\xcc\xcc\xcc\xcc\xcc"


def test_the_next_request_waits_for_the_end_of_the_response(ends):
    ecu, tester, bus = ends()
    ecu.send(bytes(100))
    for _ in range(3):
        bus.send(frame(0x7E0, b"\x02\x3e\x00"))
    ecu.turn(0)
    assert ecu.next() is None
    turn(ecu, tester)
    assert [ecu.next(), ecu.next(), ecu.next(), ecu.next()] == [Request(b"\x3e\x00", False)] * 3 + [None]


def test_a_tester_that_is_gone_in_the_middle_holds_nothing_up_for_longer_than_a_second(ends, monkeypatch):
    monkeypatch.setattr(transport, "TIMEOUT_MS", 50)
    ecu, _, bus = ends()
    bus.send(frame(0x7E0, b"\x10\x20abcdef"))  # the first frame of a request, and no more
    ecu.send(bytes(100))  # nobody sends a flow control
    while ecu.is_busy:
        ecu.turn(0.01)
    bus.send(frame(0x7E0, b"\x02\x3e\x00"))
    turn(ecu, turns=2)
    assert ecu.next() == Request(b"\x3e\x00", functional=False)


def test_of_a_flood_only_a_few_wait(ends):
    ecu, _, bus = ends()
    for _ in range(1000):
        bus.send(frame(0x7E0, b"\x02\x3e\x00"))
    turn(ecu, turns=20)
    waiting = 0
    while ecu.next():
        waiting += 1
    assert waiting == transport.WAITING


FRAMES = st.lists(
    st.tuples(st.sampled_from([0x7E0, 0x7DF]), st.binary(max_size=8), st.booleans()), max_size=30
)


@given(FRAMES)
def test_no_frames_of_anybody_stop_it(frames):
    channel = next(CHANNELS)
    ecu, bus = Link("virtual", channel, 0x7E8, 0x7E0, 0x7DF), can.Bus(interface="virtual", channel=channel)
    try:
        for can_id, data, answers in frames:
            bus.send(frame(can_id, data))
            ecu.turn(0)
            request = ecu.next()
            if request and answers:
                ecu.send(bytes(30))
    finally:
        ecu.close()
        bus.shutdown()
