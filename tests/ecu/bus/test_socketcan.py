"""The SocketCAN channel on a socket pair: one datagram a frame, as Linux hands frames over."""

import errno
import socket

import numpy as np
import pytest

from brakelab.bench.socket_pair import daemon_channel, put, socket_pair, wire_format
from ecu.bus import socketcan
from ecu.bus.protocol import BusStatus
from ecu.contract.records import EXTENDED_ID, FRAME, FRAME_EXTENDED, FRAME_FD, new_record
from ecu.system_calls import errno_location, memcpy


@pytest.fixture
def pair():
    """A channel, and the socket at its other end."""
    ends = socket_pair()
    channel = daemon_channel(ends.ecu, np.array([0x10], np.uint32))
    yield channel, ends.vehicle
    channel.close()
    ends.vehicle.close()


def frames_of(count, flags=0, length=8):
    frames = new_record(FRAME, count)
    frames["can_id"], frames["flags"], frames["length"] = 0x10 + np.arange(count), flags, length
    frames["data"][:, :length] = np.arange(length)
    return frames


# frames that wait, free places -> returned by each of three drains
WAITING = {
    "none": (0, 8, [0, 0, 0]),
    "a cycle's": (39, 64, [39, 0, 0]),
    "as many as a system call takes": (socketcan.BURST, 400, [128, 0, 0]),
    "more": (300, 400, [300, 0, 0]),
    "more than there is room for": (300, 140, [140, 140, 20]),
}


@pytest.mark.parametrize(("waiting", "room", "expected"), WAITING.values(), ids=WAITING)
def test_all_that_waits_is_drained_in_its_order(pair, waiting, room, expected):
    channel, vehicle = pair
    put(vehicle, wire_format(frames_of(waiting)))
    frames, found = new_record(FRAME, room), []
    for count in expected:
        assert channel.drain(frames, 0) == count
        found += frames["can_id"][:count].tolist()
        assert (frames["stamp_ns"][:count] > 1_700_000_000_000_000_000).all()
    assert found == list(range(0x10, 0x10 + waiting))
    assert channel.status() == BusStatus(False, False, 0, 0)


# flags, length -> bytes on the wire, their identifier
WIRES = {
    "classical": (0, 8, 16, 0x10),
    "29 bits": (FRAME_EXTENDED, 3, 16, 0x10 | EXTENDED_ID),
    "FD": (FRAME_FD, 64, 72, 0x10),
    "FD, 29 bits": (FRAME_FD | FRAME_EXTENDED, 12, 72, 0x10 | EXTENDED_ID),
}


@pytest.mark.parametrize(("flags", "length", "size", "can_id"), WIRES.values(), ids=WIRES)
def test_a_frame_that_is_sent_comes_back_as_it_was(pair, flags, length, size, can_id):
    channel, vehicle = pair
    sent, found = frames_of(1, flags, length), new_record(FRAME)
    assert channel.send(sent, 1) == 1
    wire = vehicle.recv(100)
    assert (len(wire), int.from_bytes(wire[:4], "little"), wire[4]) == (size, can_id, length)
    vehicle.send(wire)
    assert channel.drain(found, 0) == 1
    found["stamp_ns"] = 0
    assert found.tobytes() == sent.tobytes()


def test_frames_that_are_not_taken_count_as_failed(pair):
    channel, vehicle = pair
    sent = frames_of(5000)
    taken = channel.send(sent, 5000)  # more than a Unix socket holds
    assert 0 < taken < 5000
    assert channel.status() == BusStatus(False, False, 5000 - taken, 0)
    vehicle.close()
    assert channel.send(sent, 2) == 0
    assert channel.status().send_failures == 5000 - taken + 2


ERRORS = {
    errno.EAGAIN: (False, False),
    errno.ENOBUFS: (False, False),
    errno.EBADF: (False, False),
    errno.ENETDOWN: (True, False),
    errno.ENODEV: (True, True),
    errno.ENXIO: (True, True),
}


@pytest.mark.parametrize(("number", "expected"), ERRORS.items(), ids=errno.errorcode.get)
def test_an_error_tells_whether_the_interface_is_down_or_gone(number, expected):
    memory, status = socketcan.new_socket(), new_record(socketcan.STATUS)
    code = np.array([number], np.int32)
    socketcan._note_error(memory.line)  # of whatever: afterwards it compiles nothing
    memory.line[:] = 0
    memcpy(errno_location(), code.ctypes.data, 4)
    socketcan._note_error(memory.line)
    socketcan.read_status(memory, status[0])
    assert (bool(status["bus_off"][0]), bool(memory.line[socketcan._GONE])) == expected


def test_an_interface_that_was_down_is_on_again_with_the_next_frame(pair):
    channel, vehicle = pair
    channel.memory.line[socketcan._DOWN] = 1
    assert channel.status().bus_off
    channel.drain(new_record(FRAME, 8), 0)
    assert channel.status().bus_off
    put(vehicle, wire_format(frames_of(1)))
    channel.drain(new_record(FRAME, 8), 0)
    assert not channel.status().bus_off
    channel.memory.line[socketcan._DOWN] = 1
    channel.send(frames_of(1), 1)
    assert not channel.status().bus_off


class RemovedInterface:
    """A socket whose interface is removed until it `is_back`."""

    def __init__(self, end: socket.socket) -> None:
        self.end, self.is_back, self.bound = end, False, []

    def setsockopt(self, *_: object) -> None:
        if not self.is_back:
            raise OSError(errno.ENODEV, "No such device")

    def bind(self, address: tuple[str]) -> None:
        self.bound.append(address)


def test_a_removed_interface_is_bound_again_when_it_is_back(pair):
    channel, _ = pair
    interface = channel._socket = RemovedInterface(channel._socket)
    frames = new_record(FRAME, 8)
    channel.drain(frames, 0)
    assert interface.bound == []
    channel.memory.line[[socketcan._DOWN, socketcan._GONE]] = 1
    channel.drain(frames, 0)
    assert channel.memory.line[socketcan._GONE]
    interface.is_back = True
    channel.drain(frames, 0)
    assert interface.bound == [("socket pair",)]
    assert not channel.memory.line[socketcan._GONE]
    channel.drain(frames, 0)
    assert len(interface.bound) == 1
