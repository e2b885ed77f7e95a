"""Transport layers of XCP: UDP/IP, TCP/IP, CAN (ASAM MCD-1 XCP 1.5, part transport layers).

On Ethernet a packet has a header of four bytes, its length and a counter, both little-endian; on CAN it is a
frame's data. One master at a time. On UDP another one is heard once the first has been silent for
`TAKE_OVER_S`, on TCP once the first has hung up, or has connected to the port alone.
"""

import select
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from time import monotonic
from typing import Final, Protocol

import can

from ecu.bus.addresses import STANDARD, can_filters
from ecu.bus.channel import open_bus, read_frames
from ecu.errors import UserError
from ecu.xcp.protocol import Command
from ecu.xcp.slave import Size

HEADER: Final = struct.Struct("<HH")
ETHERNET: Final = Size(command=248, data=1400)
"""A packet with its headers is less than a frame of Ethernet."""
CAN: Final = Size(command=8, data=8)
TAKE_OVER_S: Final = 5.0
MOST_AT_ONCE: Final = 64
"""Commands that are answered before measured data have their turn."""
MOST_WAITING: Final = 1 << 16
"""Bytes that wait for a master on TCP; what else is measured stays in the ring."""
SEND_S: Final = 0.1


class End(Protocol):
    """The slave's end of a connection."""

    def commands(self, timeout_s: float) -> Iterator[bytes]:
        """Yield the commands that come within a time, at most `MOST_AT_ONCE`.

        Raises:
            can.CanError, OSError: the connection cannot be used any more.
        """

    def send(self, packet: bytes) -> bool:
        """Send a packet to the master; return False where there is no room for it now."""

    def close(self) -> None:
        """Close it."""


def _is_readable(timeout_s: float, *sockets: socket.socket) -> bool:
    return bool(select.select(sockets, [], [], timeout_s)[0])


def _open(kind: socket.SocketKind, address: str, port: int) -> socket.socket:
    """Return a socket at a port. Raises UserError: it is taken, or the machine does not let us."""
    try:
        opened = socket.socket(socket.AF_INET, kind)
    except OSError as error:
        remedy = "in a unit of systemd add AF_INET to RestrictAddressFamilies"
        raise UserError(f"{address}:{port}", "", f"{error.strerror}; {remedy}") from None
    try:
        if kind == socket.SOCK_STREAM:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.bind((address, port))
        opened.setblocking(False)
    except OSError as error:
        opened.close()
        raise UserError(
            f"{address}:{port}", "", f"{error.strerror}; choose another address or port"
        ) from None
    return opened


class Udp:
    """A port of UDP."""

    def __init__(
        self,
        address: str,
        port: int,
        is_connected: Callable[[], bool],
        now_s: Callable[[], float] = monotonic,
    ) -> None:
        """Open it; `is_connected` says whether there is a session. Raises UserError: the port is taken."""
        self._socket = _open(socket.SOCK_DGRAM, address, port)
        self._is_connected, self._now_s = is_connected, now_s
        self._master: tuple[str, int] = ("", 0)
        self._heard_s, self._counter = 0.0, 0

    @property
    def port(self) -> int:
        """Return the port that it has."""
        return int(self._socket.getsockname()[1])

    def commands(self, timeout_s: float) -> Iterator[bytes]:
        """See `End`."""
        if not _is_readable(timeout_s, self._socket):
            return
        for _ in range(MOST_AT_ONCE):
            try:
                datagram, sender = self._socket.recvfrom(65536)
            except OSError:  # no more, or an earlier packet found nobody
                return
            for command in _split(datagram):
                if self._is_masters(sender, command):
                    yield command

    def _is_masters(self, sender: tuple[str, int], command: bytes) -> bool:
        if sender != self._master:
            silent = self._now_s() - self._heard_s > TAKE_OVER_S
            if command[0] != Command.CONNECT or (self._is_connected() and not silent):
                return False
            self._master = sender
        self._heard_s = self._now_s()
        return True

    def send(self, packet: bytes) -> bool:
        """See `End`."""
        try:
            self._socket.sendto(HEADER.pack(len(packet), self._counter) + packet, self._master)
        except BlockingIOError:
            return False
        except OSError:  # nobody is there: it is lost, as on any network
            pass
        self._counter = self._counter + 1 & 0xFFFF
        return True

    def close(self) -> None:
        """See `End`."""
        self._socket.close()


def _split(datagram: bytes) -> Iterator[bytes]:
    """Yield the packets of a datagram, as far as it is made of them."""
    at = 0
    while at + HEADER.size < len(datagram):
        end = at + HEADER.size + HEADER.unpack_from(datagram, at)[0]
        if not at + HEADER.size < end <= len(datagram):
            return
        yield datagram[at + HEADER.size : end]
        at = end


class Tcp:
    """A port of TCP."""

    def __init__(
        self, address: str, port: int, is_connected: Callable[[], bool], has_left: Callable[[], object]
    ) -> None:
        """Open it; `has_left` is called when the master has hung up. Raises UserError: the port is taken."""
        self._listening = _open(socket.SOCK_STREAM, address, port)
        self._listening.listen()
        self._is_connected, self._has_left = is_connected, has_left
        self._master: socket.socket | None = None
        self._received, self._waiting, self._counter = b"", b"", 0

    @property
    def port(self) -> int:
        """Return the port that it has."""
        return int(self._listening.getsockname()[1])

    def commands(self, timeout_s: float) -> Iterator[bytes]:
        """See `End`."""
        self._flush()
        sockets = [self._listening, *([self._master] if self._master else [])]
        if _is_readable(0.0 if self._end_of_next() else timeout_s, *sockets):
            self._accept()
            self._receive()
        for _ in range(MOST_AT_ONCE):
            end = self._end_of_next()
            if end is None:
                return
            command, self._received = self._received[HEADER.size : end], self._received[end:]
            yield command

    def _end_of_next(self) -> int | None:
        """Return where the next packet ends in what was received, None: it is not whole."""
        if len(self._received) < HEADER.size:
            return None
        length = HEADER.unpack_from(self._received)[0]
        if not 0 < length <= ETHERNET.command:  # no XCP: where the next packet begins is not known
            self._hang_up()
            return None
        end: int = HEADER.size + length
        return end if end <= len(self._received) else None

    def _accept(self) -> None:
        try:
            found, _ = self._listening.accept()
        except OSError:  # nobody, or somebody who has gone again
            return
        if self._is_connected():
            found.close()
            return
        self._hang_up()
        found.setblocking(False)
        for option, value in (
            (socket.TCP_NODELAY, 1),
            (socket.TCP_KEEPIDLE, 5),
            (socket.TCP_KEEPINTVL, 1),
            (socket.TCP_KEEPCNT, 3),
            (socket.TCP_USER_TIMEOUT, 5000),
        ):
            found.setsockopt(socket.IPPROTO_TCP, option, value)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._master = found

    def _receive(self) -> None:
        if self._master is None:
            return
        try:
            found = self._master.recv(MOST_AT_ONCE * ETHERNET.command)
        except BlockingIOError:
            return
        except OSError:
            found = b""
        self._received += found
        if not found:
            self._hang_up()

    def _hang_up(self) -> None:
        if self._master is not None:
            self._master.close()
            self._master = None
            self._has_left()
        self._received, self._waiting, self._counter = b"", b"", 0

    def send(self, packet: bytes) -> bool:
        """See `End`."""
        if self._master is None:
            return True
        if len(self._waiting) < MOST_WAITING:
            self._waiting += HEADER.pack(len(packet), self._counter) + packet
            self._counter = self._counter + 1 & 0xFFFF
            self._flush()
            return True
        return False

    def _flush(self) -> None:
        if self._master is None or not self._waiting:
            return
        try:
            self._waiting = self._waiting[self._master.send(self._waiting) :]
        except BlockingIOError:
            pass
        except OSError:
            self._hang_up()

    def close(self) -> None:
        """See `End`."""
        self._hang_up()
        self._listening.close()


class Can:
    """A pair of identifiers on the bus of the run."""

    def __init__(self, interface: str, channel: str, hears: int, sends: int) -> None:
        """Open the bus. Raises UserError: it cannot be opened."""
        self._hears, self._sends = hears, sends
        self._bus = open_bus(interface, channel, can_filters=can_filters([hears]))

    def commands(self, timeout_s: float) -> Iterator[bytes]:
        """See `End`."""
        for frame in read_frames(self._bus, timeout_s, MOST_AT_ONCE):
            if (frame.arbitration_id, frame.is_extended_id) == (self._hears, self._hears > STANDARD):
                yield bytes(frame.data)

    def send(self, packet: bytes) -> bool:
        """See `End`."""
        frame = can.Message(arbitration_id=self._sends, is_extended_id=self._sends > STANDARD, data=packet)
        try:
            self._bus.send(frame, timeout=SEND_S)
        except can.CanError:
            return False
        return True

    def close(self) -> None:
        """See `End`."""
        with suppress(can.CanError, OSError):
            self._bus.shutdown()
