"""A CAN bus without CAN: a socket pair that carries struct can_frame, stamped by the kernel like a CAN_RAW
socket. The daemon's `SocketcanChannel` and python-can's `SocketcanBus` work on it as they are."""

import socket
import struct
from typing import Any, Final, NamedTuple

import can
import numpy as np
from can.interfaces.socketcan.socketcan import SocketcanBus
from numpy.typing import NDArray

from ecu.bus.socketcan import SocketcanChannel
from ecu.contract.records import RecordArray

_CAN_FRAME: Final = struct.Struct("=IB3x8s")
_BUFFER: Final = 1 << 20  # bytes
_TIMESTAMPNS: Final = 35  # SO_TIMESTAMPNS, asm-generic/socket.h


class _CanSocket(socket.socket):
    """A Unix socket that accepts, without effect, options of CAN sockets: filters and error frames."""

    def setsockopt(self, level: int, *option: Any) -> None:
        if level != socket.SOL_CAN_RAW:
            super().setsockopt(level, *option)


class SocketPair(NamedTuple):
    """Both ends: the ECU's and that of the vehicle."""

    ecu: socket.socket
    vehicle: socket.socket


def socket_pair() -> SocketPair:
    """Return a new pair; neither end blocks."""
    ends = []
    for end in socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM):
        handle = _CanSocket(fileno=end.detach())
        handle.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
        handle.setblocking(False)
        ends.append(handle)
    return SocketPair(*ends)


class _OpenedBus(NamedTuple):
    """The part of a python-can bus that the daemon's channel uses."""

    socket: socket.socket

    def shutdown(self) -> None:
        self.socket.close()


def daemon_channel(end: socket.socket, receive_ids: NDArray[np.uint32]) -> SocketcanChannel:
    """Return the daemon's SocketCAN channel on one end."""
    return SocketcanChannel(_OpenedBus(end), "socket pair", frozenset(receive_ids.tolist()))


class PythonCanBus(SocketcanBus):
    """python-can's SocketCAN bus on one end, without the opening of its socket."""

    def __init__(self, end: socket.socket) -> None:
        self.socket, self.channel, self._bcm_sockets = end, "socket pair", {}
        self._is_filtered = False
        end.setsockopt(socket.SOL_SOCKET, _TIMESTAMPNS, 1)
        can.BusABC.__init__(self, channel="socket pair")


def wire_format(frames: RecordArray) -> list[bytes]:
    """Return every frame in the kernel's format."""
    return [
        _CAN_FRAME.pack(int(frame["can_id"]), int(frame["length"]), frame["data"][:8].tobytes())
        for frame in frames
    ]


def put(end: socket.socket, packets: list[bytes]) -> None:
    """Send frames."""
    for packet in packets:
        end.send(packet)


def take(end: socket.socket) -> int:
    """Discard waiting frames; return their number."""
    count = 0
    while True:
        try:
            end.recv(_CAN_FRAME.size)
        except BlockingIOError:
            return count
        count += 1
