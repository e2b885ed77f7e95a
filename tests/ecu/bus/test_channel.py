import gc
import logging
import select
import threading
import time

import can
import numpy as np
import pytest

from ecu.bus import socketcan
from ecu.bus.channel import GenericChannel, open_channel, read_frames
from ecu.contract.records import EXTENDED_ID, FRAME, FRAME_EXTENDED, FRAME_FD, new_record
from ecu.errors import UserError


class ScriptedBus:
    """A python-can bus that hears what a test says."""

    state = can.BusState.ACTIVE

    def __init__(self):
        self.heard, self.said, self.refuses, self.gone = [], [], False, False

    def recv(self, timeout):
        if self.gone:
            raise can.CanOperationError("gone")
        heard = self.heard.pop(0) if self.heard else None
        if isinstance(heard, Exception):
            raise can.CanOperationError("could not unpack received message") from heard
        return heard

    def send(self, message, timeout):
        if self.refuses:
            raise can.CanOperationError("full")
        self.said.append(message)

    def shutdown(self):
        pass


def message(can_id, data=b"\x01", **more):
    return can.Message(
        arbitration_id=can_id, data=data, **{"is_extended_id": False, "timestamp": time.time(), **more}
    )


def frame(can_id, data=b"\x01", flags=0):
    one = new_record(FRAME)
    one["can_id"], one["flags"], one["length"] = can_id, flags, len(data)
    one["data"][0, : len(data)] = list(data)
    return one


def channel(bus, ids, *, fd=False, hears_itself=False):
    return GenericChannel(bus, "x", frozenset(ids), fd=fd, hears_itself=hears_itself)


# what is heard -> identifiers handed on by a channel for 0x10 and 29-bit 0x20
HEARD = {
    "wanted": ([message(0x10), message(0x20, is_extended_id=True)], [0x10, 0x20]),
    "not wanted": ([message(0x11)], []),
    "the same number with 29 bits": ([message(0x10, is_extended_id=True), message(0x20)], []),
    "remote": ([message(0x10, b"", is_remote_frame=True)], []),
    "error frame": ([message(0x10, is_error_frame=True)], []),
    "FD, not configured": ([message(0x10, bytes(12), is_fd=True), message(0x10)], [0x10]),
}


@pytest.mark.parametrize(("heard", "expected"), HEARD.values(), ids=HEARD)
def test_only_wanted_frames_are_handed_on(heard, expected):
    bus, frames = ScriptedBus(), new_record(FRAME, 8)
    bus.heard = list(heard)
    count = channel(bus, [0x10, 0x20 | EXTENDED_ID]).drain(frames, 0)
    assert frames["can_id"][:count].tolist() == expected


def test_fd_frames_are_handed_on_where_configured():
    bus, frames = ScriptedBus(), new_record(FRAME, 8)
    bus.heard = [message(0x10, bytes(range(64)), is_fd=True)]
    assert channel(bus, [0x10], fd=True).drain(frames, 3) == 1
    assert (frames["flags"][3], frames["length"][3], frames["data"][3].tolist()) == (
        FRAME_FD,
        64,
        list(range(64)),
    )


def test_stamps_are_whole_microseconds_and_one_of_another_origin_is_replaced():
    bus, frames = ScriptedBus(), new_record(FRAME, 8)
    now = time.time()
    bus.heard = [message(0x10, timestamp=now), message(0x10, timestamp=12.5)]
    channel(bus, [0x10]).drain(frames, 0)
    assert (frames["stamp_ns"][:2] % 1000 == 0).all()
    assert abs(frames["stamp_ns"][0] - now * 1e9) < 2000
    assert frames["stamp_ns"][1] > (now - 1) * 1e9


@pytest.mark.parametrize("age_s", [0.0, 4.0, 6.0, 3600.0, -3600.0])
def test_a_frame_that_waited_keeps_its_stamp(age_s):
    bus, frames = ScriptedBus(), new_record(FRAME, 8)
    stamp = time.time() - age_s
    bus.heard = [message(0x10, timestamp=stamp)]
    channel(bus, [0x10]).drain(frames, 0)
    assert abs(frames["stamp_ns"][0] - stamp * 1e9) < 2000


def test_what_does_not_fit_waits():
    bus, frames = ScriptedBus(), new_record(FRAME, 4)
    bus.heard = [message(0x10, bytes([i])) for i in range(6)]
    unit = channel(bus, [0x10])
    assert unit.drain(frames, 1) == 3
    assert unit.drain(frames, 0) == 3
    assert frames["data"][:3, 0].tolist() == [3, 4, 5]


def test_own_frames_that_come_back_are_no_foreign_sender_but_every_other_is():
    bus, frames = ScriptedBus(), new_record(FRAME, 8)
    unit = channel(bus, [0x10], hears_itself=True)
    for data in (b"\x01", b"\x02"):
        unit.send(frame(0x10, data), 1)
    bus.heard = [message(0x10, data) for data in (b"\x01", b"\x02", b"\x02", b"\x03")]
    count = unit.drain(frames, 0)
    assert frames["data"][:count, 0].tolist() == [2, 3]


def test_a_frame_that_is_refused_is_counted_and_the_next_is_tried():
    bus = ScriptedBus()
    unit = channel(bus, [])
    bus.refuses = True
    assert unit.send(np.concatenate([frame(1), frame(2)]), 2) == 0
    bus.refuses = False
    assert unit.send(frame(3, bytes(4), FRAME_EXTENDED), 1) == 1
    assert unit.status().send_failures == 2
    assert (bus.said[0].arbitration_id, bus.said[0].is_extended_id, bus.said[0].dlc) == (3, True, 4)


def test_a_bus_that_is_gone_is_off_until_it_is_heard_again():
    bus, frames = ScriptedBus(), new_record(FRAME, 8)
    unit = channel(bus, [0x10])
    bus.gone = True
    assert unit.drain(frames, 0) == 0
    assert unit.status().bus_off
    bus.gone, bus.heard = False, [message(0x10)]
    unit.drain(frames, 0)
    assert not unit.status().bus_off


@pytest.mark.parametrize(
    ("state", "expected"), [(can.BusState.PASSIVE, (False, True)), (can.BusState.ERROR, (True, False))]
)
def test_the_drivers_state_is_reported(state, expected):
    bus = ScriptedBus()
    bus.state = state
    status = channel(bus, []).status()
    assert (status.bus_off, status.error_passive) == expected


def test_two_channels_talk_over_python_cans_virtual_bus():
    a = open_channel("virtual", "test_channel", receive_ids=[0x10])
    b = open_channel("virtual", "test_channel", receive_ids=[0x20])
    frames = new_record(FRAME, 8)
    assert a.send(frame(0x20, b"\x07\x08"), 1) == 1
    assert (a.drain(frames, 0), b.drain(frames, 0)) == (0, 1)
    assert frames["data"][0, :3].tolist() == [7, 8, 0]
    a.close()
    b.close()


@pytest.mark.parametrize("interface", ["nonsense", "socketcan"])
def test_a_bus_that_cannot_be_opened_is_one_line(interface):
    with pytest.raises(UserError, match=f"{interface} nosuch0: cannot be opened"):
        open_channel(interface, "nosuch0", receive_ids=[])


# class and second data byte of error frames, in order -> (bus off, error passive, not acknowledged)
LINE = {
    "bus off": ([(0x40, 0)], (1, 0, 0)),
    "restarted": ([(0x04, 0x20), (0x40, 0), (0x100, 0)], (0, 0, 0)),
    "active again": ([(0x40, 0), (0x04, 0x40)], (0, 0, 0)),
    "transmitter passive": ([(0x04, 0x20)], (0, 1, 0)),
    "receiver passive": ([(0x04, 0x10)], (0, 1, 0)),
    "down to warning": ([(0x04, 0x20), (0x04, 0x08)], (0, 0, 0)),
    "buffer overflow only": ([(0x04, 0x20), (0x04, 0x01)], (0, 1, 0)),
    "nobody acknowledges": ([(0x20, 0), (0x20, 0)], (0, 0, 2)),
}


@pytest.mark.parametrize(("errors", "expected"), LINE.values(), ids=LINE)
def test_error_frames_tell_the_state_of_the_line(errors, expected):
    line = np.zeros(4, np.int64)
    for error_class, controller in errors:
        socketcan._note_line(error_class, controller, line)
    assert tuple(line[:3]) == expected


def _control(words):
    control = np.zeros((1, 8), np.int64)
    control[0, : len(words)] = words
    return control


STAMP = [32, 1 | 35 << 32, 1_700_000_000, 123_456_789]
DROPPED = [20, 1 | 40 << 32, 77]
# control words -> (stamp [ns], dropped)
CONTROL = {
    "stamp": (STAMP, (1_700_000_000_123_456_000, 0)),
    "drops, then stamp": ([*DROPPED, *STAMP], (1_700_000_000_123_456_000, 77)),
    "stamp, then drops": ([*STAMP, *DROPPED], (1_700_000_000_123_456_000, 77)),
    "nothing": ([], (0, 0)),
    "nonsense": ([3, 1 | 35 << 32], (0, 0)),
}


@pytest.mark.parametrize(("words", "expected"), CONTROL.values(), ids=CONTROL)
def test_stamp_and_drop_counter_are_read_from_any_order(words, expected):
    burst, frames, line = socketcan.new_socket().incoming, new_record(FRAME), np.zeros(4, np.int64)
    burst.messages["header"]["control_length"][0] = 8 * len(words)
    burst.messages["length"][0] = 16
    burst.wire["can_id"][0], burst.wire["length"][0], burst.wire["data"][0] = 0x123, 8, 0xAA
    assert socketcan._parse(burst.messages, burst.wire, _control(words), 1, frames, 0, line) == 1
    assert (frames["stamp_ns"][0], line[socketcan._DROPPED]) == expected
    assert (frames["can_id"][0], frames["length"][0]) == (0x123, 8)
    assert frames["data"][0].tolist() == [0xAA] * 8 + [0] * 56
    assert burst.messages["header"]["control_length"][0] == 64


def test_virtual_channels_do_not_need_a_thread():
    before = set(threading.enumerate())
    unit = open_channel("virtual", "threads", receive_ids=[])
    assert set(threading.enumerate()) <= before
    unit.close()


@pytest.mark.multicast
def test_another_group_of_the_same_machine_is_another_bus():
    groups = ("239.74.163.5", "239.74.163.6", "239.74.163.6")
    other, sender, hearer = (open_channel("udp_multicast", group, receive_ids=[0x10]) for group in groups)
    try:
        sender.send(frame(0x10), 1)
        frames, deadline = new_record(FRAME, 8), time.monotonic() + 60
        while not hearer.drain(frames, 0):
            assert time.monotonic() < deadline
        assert other.drain(frames, 0) == 0
    finally:
        for one in (other, sender, hearer):
            one.close()


@pytest.mark.multicast
def test_what_another_group_sends_while_a_channel_is_opened_is_not_heard(monkeypatch):
    other = open_channel("udp_multicast", "239.74.163.5", receive_ids=[])
    begin = can.Bus

    def begin_slowly(**arguments):
        bus = begin(**arguments)
        other.send(frame(0x10), 1)
        assert select.select([bus.fileno()], [], [], 60)[
            0
        ]  # Linux hands it over until the socket option forbids it
        return bus

    monkeypatch.setattr(can, "Bus", begin_slowly)
    hearer = open_channel("udp_multicast", "239.74.163.6", receive_ids=[0x10])
    assert hearer.drain(new_record(FRAME, 8), 0) == 0
    for one in (other, hearer):
        one.close()


@pytest.mark.parametrize("error", [NameError("no canlib"), AttributeError("windll"), OSError("no device")])
def test_whatever_a_driver_raises_is_one_line(monkeypatch, error):
    def refuse(**_):
        raise error

    monkeypatch.setattr(can, "Bus", refuse)
    with pytest.raises(UserError, match=f"kvaser 0: cannot be opened: {error}"):
        open_channel("kvaser", "0", receive_ids=[])


def test_a_bus_that_was_begun_ends_without_a_word(caplog):
    gc.collect()  # what other tests left
    caplog.clear()
    with pytest.raises(UserError, match=r"udp_multicast 1\.2\.3\.4: cannot be opened"):
        open_channel("udp_multicast", "1.2.3.4", receive_ids=[])
    gc.collect()
    assert not caplog.records
    assert not logging.getLogger("can.bus").disabled


def test_an_unknown_interface_is_answered_with_those_known():
    with pytest.raises(UserError, match=r"no such interface; did you mean socketcan\?; .*virtual"):
        open_channel("socketcam", "can0", receive_ids=[])


@pytest.mark.parametrize(
    ("reason", "off"), [(ValueError("no msgpack"), False), (OSError(100, "Network is down"), True)]
)
def test_a_message_that_cannot_be_read_is_no_bus_off_and_holds_up_nothing(reason, off):
    bus, frames = ScriptedBus(), new_record(FRAME, 8)
    bus.heard = [reason, message(0x10), reason, reason, message(0x10)]
    opened = channel(bus, [0x10])
    assert opened.drain(frames, 0) == (0 if off else 2)
    assert opened.status().bus_off is off


def test_junk_without_end_does_not_hold_the_cycle_up():
    bus, frames = ScriptedBus(), new_record(FRAME, 8)
    bus.heard = [ValueError()] * 1000
    opened = channel(bus, [0x10])
    opened.drain(frames, 0)
    assert len(bus.heard) == 800


@pytest.mark.parametrize(
    ("interface", "platform", "drains_itself"),
    [("socketcan", "linux", True), ("socketcan", "darwin", False), ("udp_multicast", "darwin", False)],
)
def test_only_socketcan_on_linux_is_drained_past_python_can(monkeypatch, interface, platform, drains_itself):
    opened = []
    monkeypatch.setattr(can, "Bus", lambda **_: ScriptedBus())
    monkeypatch.setattr(socketcan, "SocketcanChannel", lambda bus, name, wanted: opened.append(name))
    monkeypatch.setattr("sys.platform", platform)
    found = open_channel(interface, "can7", receive_ids=[0x10])
    assert opened == (["can7"] if drains_itself else [])
    assert isinstance(found, GenericChannel) is not drains_itself


def test_classical_data_frames_are_read_until_none_comes_and_a_bus_that_is_gone_is_reported():
    bus = ScriptedBus()
    other = [{"is_error_frame": True}, {"is_remote_frame": True, "data": None}, {"is_fd": True}]
    bus.heard = [
        message(0x10),
        ValueError("no frame"),
        *(message(0x11, **one) for one in other),
        message(0x12),
    ]
    assert [one.arbitration_id for one in read_frames(bus, 0.1, 64)] == [0x10, 0x12]
    bus.heard = [message(number) for number in range(5)]
    assert [one.arbitration_id for one in read_frames(bus, 0.1, 3)] == [0, 1, 2]
    bus.gone = True
    with pytest.raises(can.CanOperationError):
        list(read_frames(bus, 0.1, 64))
