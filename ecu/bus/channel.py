"""Channels on every interface of python-can.

On SocketCAN the bus's own socket is drained directly (`ecu/bus/socketcan.py`); every other interface goes
through python-can's messages.
"""

import logging
import os
import socket
import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import Any, Final

import can

from ecu.bus.protocol import BusStatus, Channel
from ecu.contract.records import EXTENDED_ID, FRAME_EXTENDED, FRAME_FD, RecordArray
from ecu.errors import UserError, closest

# Frames of one identifier that may be echoed back: 0.3 s of a 10 ms frame.
_ECHOES: Final = 32
_IP_MULTICAST_ALL: Final = 49  # linux/in.h
_MALFORMED_AT_ONCE: Final = 200  # unreadable messages per cycle; the rest waits
_KNOWN: Final = sorted(can.VALID_INTERFACES)

logging.getLogger("can").addHandler(logging.NullHandler())  # its exceptions repeat it, in one line


def open_channel(interface: str, channel: str, *, receive_ids: Iterable[int], fd: bool = False) -> Channel:
    """Open `channel` of python-can's `interface` for the identifiers `receive_ids`.

    A 29-bit identifier carries `EXTENDED_ID`. Include the own output identifiers to detect a foreign sender:
    own frames do not come back. With `fd`, CAN FD frames are received too.

    Raises:
        UserError: the bus cannot be opened.
    """
    wanted = frozenset(receive_ids)
    bus = open_bus(interface, channel, fd=fd)
    if interface == "socketcan" and sys.platform == "linux":
        from ecu.bus.socketcan import SocketcanChannel

        return SocketcanChannel(bus, channel, wanted)
    return GenericChannel(bus, channel, wanted, fd=fd, hears_itself=interface == "udp_multicast")


def open_bus(interface: str, channel: str, *, fd: bool = False, **special: Any) -> can.BusABC:
    """Open python-can's bus; `special` are arguments of its interface.

    Raises:
        UserError: it cannot be opened.
    """
    if interface == "udp_multicast":
        special["hop_limit"] = 0  # stay on this machine
    # python-can's udp_multicast ends a burst at the first FD frame if FD is off.
    if fd or interface == "udp_multicast":
        special["fd"] = True
    if interface not in can.VALID_INTERFACES:
        raise UserError(
            f"{interface} {channel}",
            "",
            f"cannot be opened: no such interface{closest(interface, _KNOWN)}; take "
            f"one of python-can's: {', '.join(_KNOWN)}",
        )
    bus = _open(interface, channel, special)
    if isinstance(bus, str):
        raise UserError(
            f"{interface} {channel}",
            "",
            f"cannot be opened: {bus}; is the interface there and up (ip link), and its driver installed?",
        )
    if interface == "udp_multicast":
        _hear_own_group_only(bus)
    return bus


def _open(interface: str, channel: str, special: dict[str, Any]) -> can.BusABC | str:
    """Return the bus, or the reason why it cannot be opened."""
    log = logging.getLogger("can.bus")
    log.disabled = True
    try:
        return can.Bus(interface=interface, channel=channel, **special)
    except Exception as error:  # python-can's drivers raise errors of many kinds
        # The partly opened bus is destroyed here; it would warn about a missing shutdown.
        error.__traceback__ = error.__context__ = None
        return str(error)
    finally:
        log.disabled = False


def _hear_own_group_only(bus: can.BusABC) -> None:
    """Ignore groups joined by other processes: Linux delivers them to every socket of the port.

    Messages received before the option was set are discarded.
    """
    if sys.platform == "linux":
        with socket.socket(fileno=os.dup(bus.fileno())) as own:
            own.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)
            with suppress(BlockingIOError):
                while True:
                    own.recv(1, socket.MSG_DONTWAIT)


def is_malformed(error: Exception) -> bool:
    """Return whether the driver could not read one message, which says nothing about the line.

    python-can has no error class for it; line failures carry a reason of the operating system.
    """
    reason = error.__cause__
    return isinstance(error, can.CanOperationError) and reason is not None and not isinstance(reason, OSError)


def read_frames(bus: can.BusABC, timeout_s: float, most: int) -> Iterator[can.Message]:
    """Yield the classical data frames among the next messages, at most `most`, waiting for the first alone.

    Raises:
        can.CanError, OSError: the bus is gone.
    """
    for number in range(most):
        try:
            frame = bus.recv(0.0 if number else timeout_s)
        except can.CanError as error:
            if not is_malformed(error):
                raise
            continue
        if frame is None:
            return
        if not (frame.is_error_frame or frame.is_remote_frame or frame.is_fd):
            yield frame


class GenericChannel:
    """Channel on any interface of python-can, message by message."""

    def __init__(
        self, bus: can.BusABC, name: str, receive_ids: frozenset[int], *, fd: bool, hears_itself: bool
    ) -> None:
        self.name = name
        self._bus, self._wanted, self._fd = bus, receive_ids, fd
        self._echoes: dict[int, deque[bytes]] | None = {} if hears_itself else None
        self._failures, self._off = 0, False

    def drain(self, frames: RecordArray, start: int) -> int:
        """See `Channel`."""
        count = malformed = 0
        while start + count < len(frames):
            try:
                message = self._bus.recv(timeout=0)
            except (can.CanError, OSError) as error:
                if not is_malformed(error):
                    self._off = True
                    break
                malformed += 1
                if malformed == _MALFORMED_AT_ONCE:
                    break
                continue
            if message is None:
                break
            if message.is_error_frame or message.is_remote_frame or (message.is_fd and not self._fd):
                continue
            identifier = message.arbitration_id | (EXTENDED_ID if message.is_extended_id else 0)
            if identifier not in self._wanted or self._is_echo(identifier, bytes(message.data)):
                continue
            self._off = False
            _store(message, frames[start + count])
            count += 1
        return count

    def _is_echo(self, identifier: int, data: bytes) -> bool:
        """Return whether a frame is an echo of ours: each sent frame explains one."""
        sent = self._echoes.get(identifier) if self._echoes is not None else None
        if sent is None or data not in sent:
            return False
        sent.remove(data)
        return True

    def send(self, frames: RecordArray, count: int) -> int:
        """See `Channel`."""
        taken = 0
        for frame in frames[:count]:
            flags, length = int(frame["flags"]), int(frame["length"])
            data = frame["data"][:length].tobytes()
            extended = bool(flags & FRAME_EXTENDED)
            message = can.Message(
                arbitration_id=int(frame["can_id"]),
                is_extended_id=extended,
                is_fd=bool(flags & FRAME_FD),
                data=data,
            )
            try:
                self._bus.send(message, timeout=0)
            except (can.CanError, OSError):
                self._failures += 1
                continue
            taken += 1
            if self._echoes is not None:
                identifier = message.arbitration_id | (EXTENDED_ID if extended else 0)
                self._echoes.setdefault(identifier, deque(maxlen=_ECHOES)).append(data)
        return taken

    def status(self) -> BusStatus:
        """See `Channel`."""
        state = self._bus.state
        off = self._off or state is can.BusState.ERROR
        return BusStatus(off, state is can.BusState.PASSIVE, self._failures, 0)

    def close(self) -> None:
        """See `Channel`."""
        self._bus.shutdown()


def _store(message: can.Message, frame: Any) -> None:
    # A driver counts from 1970, or from a start of its own that is never half as long ago.
    now = time.time_ns()
    stamp = round(message.timestamp * 1e6) * 1000
    frame["stamp_ns"] = stamp if stamp > now // 2 else now // 1000 * 1000
    frame["can_id"] = message.arbitration_id
    frame["flags"] = FRAME_EXTENDED * message.is_extended_id | FRAME_FD * message.is_fd
    length = len(message.data)
    frame["length"] = length
    frame["data"][:length] = message.data
    frame["data"][length:] = 0
