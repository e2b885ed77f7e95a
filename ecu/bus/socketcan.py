"""SocketCAN drained in one burst: kernels call `recvmmsg` and `sendmmsg` on preallocated memory.

The socket is the one that python-can opened. Linux filters by identifier, stamps every frame (cut to
whole microseconds, as in candump logs), counts the frames it dropped (SO_RXQ_OVFL) and reports the
controller's state in error frames: during bus-off it accepts frames to send without an error, so only error
frames reveal it.
"""

import errno
import select
import socket
import struct
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.bus.protocol import STATUS, BusStatus
from ecu.contract.records import EXTENDED_ID, FRAME, FRAME_EXTENDED, FRAME_FD, RecordArray, new_record
from ecu.errors import UserError
from ecu.jit import Record, kernel
from ecu.system_calls import errno_location, memcpy, recvmmsg, sendmmsg

BURST: Final = 128  # frames per system call: a 500 kbit/s bus carries 45 in a cycle
RECEIVE_BUFFER: Final = 4 << 20  # bytes: about 5000 frames, a second of a saturated bus
MAX_FILTERS: Final = 512  # CAN_RAW_FILTER_MAX

# linux/can.h, linux/can/error.h, linux/can/raw.h, asm-generic/socket.h
_RTR, _ERR, _EFF_MASK, _SFF_MASK = 1 << 30, 1 << 29, 0x1FFFFFFF, 0x7FF
_ERR_CRTL, _ERR_ACK, _ERR_BUSOFF, _ERR_RESTARTED = 0x04, 0x20, 0x40, 0x100
_CRTL_WARNING, _CRTL_PASSIVE, _CRTL_ACTIVE = 0x0C, 0x30, 0x40
_CAN_RAW_ERR_FILTER = 2
_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _SO_RXQ_OVFL = 33, 35, 40
_CAN_MTU, _CANFD_MTU = 16, 72
_MSG_DONTWAIT = 0x40  # linux/socket.h
_DOWN_ERRORS: Final = (errno.ENETDOWN, errno.ENODEV, errno.ENXIO)
_ENETDOWN: Final = errno.ENETDOWN

# struct msghdr and mmsghdr, struct iovec, struct canfd_frame (a can_frame is its first 16 bytes)
_MESSAGE: Final = np.dtype(
    [
        ("name", np.uintp),
        ("name_length", "u4"),
        ("iov", np.uintp),
        ("iov_length", np.uintp),
        ("control", np.uintp),
        ("control_length", np.uintp),
        ("flags", "i4"),
    ],
    align=True,
)
_MMESSAGE: Final = np.dtype([("header", _MESSAGE), ("length", "u4")], align=True)
_IOVEC: Final = np.dtype([("base", np.uintp), ("length", np.uintp)])
_WIRE: Final = np.dtype(
    [("can_id", "u4"), ("length", "u1"), ("flags", "u1"), ("spare", "u2"), ("data", "u1", (64,))]
)
_CONTROL_BYTES: Final = 64  # a timespec (32 with its header) and a counter (24)
# State of the line as found by kernels; indices in an array. Gone: the interface was removed.
_BUS_OFF, _PASSIVE, _NOT_ACKNOWLEDGED, _DROPPED, _DOWN, _GONE, _FAILURES, _ERRNO = range(8)


class Burst(NamedTuple):
    """Preallocated memory of one `recvmmsg` or `sendmmsg`."""

    messages: RecordArray
    vectors: RecordArray
    wire: RecordArray
    control: NDArray[np.int64]


class Socket(NamedTuple):
    """A socket as kernels have it."""

    handle: int
    """-1: none; nothing comes in, nothing is taken."""
    incoming: Burst
    outgoing: Burst
    line: NDArray[np.int64]
    """State of the line."""


def _new_burst(control_bytes: int) -> Burst:
    burst = Burst(
        np.zeros(BURST, _MMESSAGE),
        np.zeros(BURST, _IOVEC),
        np.zeros(BURST, _WIRE),
        np.zeros((BURST, control_bytes // 8), np.int64),
    )
    every = np.arange(BURST, dtype=np.uintp)
    burst.vectors["base"] = burst.wire.ctypes.data + every * _WIRE.itemsize
    burst.vectors["length"] = _CANFD_MTU
    header = burst.messages["header"]
    header["iov"] = burst.vectors.ctypes.data + every * _IOVEC.itemsize
    header["iov_length"] = 1
    if control_bytes:
        header["control"] = burst.control.ctypes.data + every * control_bytes
        header["control_length"] = control_bytes
    return burst


def new_socket(handle: int = -1) -> Socket:
    """Return the memory for a socket."""
    return Socket(handle, _new_burst(_CONTROL_BYTES), _new_burst(0), np.zeros(8, np.int64))


def prepare_kernels() -> None:
    """Load or compile the kernels of a channel, which afterwards compiles nothing."""
    none, frames = new_socket(), new_record(FRAME)
    receive_frames(none, frames, 0)
    send_frames(none, frames, 1)
    read_status(none, new_record(STATUS)[0])


class SocketcanChannel:
    """A CAN_RAW socket, see `ecu.bus.channel.Channel`."""

    def __init__(self, bus: Any, name: str, receive_ids: frozenset[int]) -> None:
        if np.dtype(np.uintp).itemsize != 8:
            raise UserError(name, "", "SocketCAN needs a 64-bit system")
        self.name = name
        self._bus = bus
        self._socket: socket.socket = bus.socket
        self._wanted = receive_ids
        _configure(self._socket, receive_ids)
        self.memory = new_socket(self._socket.fileno())
        self._status = new_record(STATUS)
        self._discard()
        prepare_kernels()

    def drain(self, frames: RecordArray, start: int) -> int:
        """See `Channel`. Error frames change the status and are not returned."""
        self.bind_again()
        return receive_frames(self.memory, frames, start)

    def send(self, frames: RecordArray, count: int) -> int:
        """See `Channel`. Frames that the kernel does not take at once are counted as failed and dropped."""
        return send_frames(self.memory, frames, count)

    def bind_again(self) -> None:
        """Bind to the interface of this name if it was removed (a USB adapter, say) and may be back.

        The socket's filters went with it.
        """
        if not self.memory.line[_GONE]:
            return
        try:
            _configure(self._socket, self._wanted)
            self._socket.bind((self.name,))
        except OSError:
            return
        self.memory.line[_GONE] = 0

    def status(self) -> BusStatus:
        """See `Channel`. An interface that is down counts as bus off."""
        read_status(self.memory, self._status[0])
        off, passive, failures, dropped = self._status[0].tolist()
        return BusStatus(bool(off), bool(passive), failures, dropped)

    def close(self) -> None:
        """See `Channel`."""
        self._bus.shutdown()

    def _discard(self) -> None:
        """Discard frames that arrived before the filters were set."""
        while select.select([self._socket], [], [], 0)[0]:
            try:
                self._socket.recv(_CANFD_MTU)
            except OSError:
                return


def _configure(handle: socket.socket, receive_ids: frozenset[int]) -> None:
    """Set filters, error frames, drop counter, stamps and a large receive buffer."""
    exact = EXTENDED_ID | _RTR  # these bits count too: 11 against 29 bits, data against remote
    filters = b"".join(
        struct.pack("=II", number, exact | (_EFF_MASK if number & EXTENDED_ID else _SFF_MASK))
        for number in sorted(receive_ids)
    )
    if len(receive_ids) <= MAX_FILTERS:
        handle.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, filters)
    errors = _ERR_CRTL | _ERR_ACK | _ERR_BUSOFF | _ERR_RESTARTED
    handle.setsockopt(socket.SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, errors)
    handle.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
    handle.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
    try:
        handle.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, RECEIVE_BUFFER)
    except PermissionError:
        handle.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)


@kernel
def receive_frames(line_socket: Socket, frames: RecordArray, start: int) -> int:
    """Write all frames that wait in the socket from `frames[start]` on; return their number."""
    handle, line = line_socket.handle, line_socket.line
    messages, _, wire, control = line_socket.incoming
    count = 0
    while start + count < len(frames):
        room = min(BURST, len(frames) - start - count)
        got = recvmmsg(handle, messages.ctypes.data, room, _MSG_DONTWAIT, 0)
        if got <= 0:
            _note_error(line)
            break
        line[_DOWN] = 0
        count += _parse(messages, wire, control, got, frames, start + count, line)
        if got < BURST:
            break
    return count


@kernel
def send_frames(line_socket: Socket, frames: RecordArray, count: int) -> int:
    """Hand over the first `count` frames; return how many were taken, the others count as failed."""
    handle, line = line_socket.handle, line_socket.line
    messages, vectors, wire, _ = line_socket.outgoing
    taken = 0
    while taken < count:
        part = min(BURST, count - taken)
        _format(frames, taken, part, wire, vectors)
        sent = sendmmsg(handle, messages.ctypes.data, part, _MSG_DONTWAIT)
        if sent < 0:
            _note_error(line)
        else:
            line[_DOWN] = 0
            taken += sent
        if sent < part:
            line[_FAILURES] += count - taken
            break
    return taken


@kernel
def _note_error(line: NDArray[np.int64]) -> None:
    """Update the line's state by the number of the system call's error."""
    line[_ERRNO] = 0
    memcpy(line.ctypes.data + 8 * _ERRNO, errno_location(), 4)
    number = line[_ERRNO]
    if number in _DOWN_ERRORS:
        line[_DOWN] = 1
        if number != _ENETDOWN:
            line[_GONE] = 1


@kernel
def read_status(line_socket: Socket, status: Record) -> None:
    """Write the line's status to a record `STATUS`."""
    line = line_socket.line
    status.bus_off = 1 if line[_BUS_OFF] or line[_DOWN] else 0
    status.error_passive = line[_PASSIVE]
    status.send_failures = line[_FAILURES] + line[_NOT_ACKNOWLEDGED]
    status.dropped = line[_DROPPED]


@kernel
def _parse(
    messages: RecordArray,
    wire: RecordArray,
    control: NDArray[np.int64],
    count: int,
    frames: RecordArray,
    start: int,
    line: NDArray[np.int64],
) -> int:
    """Turn `count` messages into frames from `frames[start]` on; return the number of frames."""
    written = 0
    for i in range(count):
        raw = wire[i]
        stamp = np.int64(0)
        words = control[i]
        used = np.int64(messages[i].header.control_length) // 8
        messages[i].header.control_length = words.size * 8
        at = 0
        while at + 2 < used + 1:
            size = words[at]  # cmsg_len; the next word holds cmsg_level (low) and cmsg_type (high)
            kind = words[at + 1] >> 32
            if kind == _SO_TIMESTAMPNS:
                stamp = words[at + 2] * 1_000_000_000 + words[at + 3]
            elif kind == _SO_RXQ_OVFL:
                line[_DROPPED] = words[at + 2] & 0xFFFFFFFF
            if size < 16:
                break
            at += (size + 7) // 8
        if raw.can_id & _ERR:
            _note_line(raw.can_id, raw.data[1], line)
            continue
        if line[_BUS_OFF]:  # after bus-off a controller restarts error active
            line[_BUS_OFF] = line[_PASSIVE] = 0
        frame = frames[start + written]
        fd = messages[i].length == _CANFD_MTU
        extended = raw.can_id & EXTENDED_ID != 0
        frame.stamp_ns = stamp // 1000 * 1000
        frame.can_id = raw.can_id & (_EFF_MASK if extended else _SFF_MASK)
        frame.flags = (FRAME_EXTENDED if extended else 0) | (FRAME_FD if fd else 0)
        frame.bus = 0
        frame.spare = 0
        length = min(raw.length, 64 if fd else 8)
        frame.length = length
        for j in range(64):
            frame.data[j] = raw.data[j] if j < length else 0
        written += 1
    return written


@kernel
def _note_line(error_class: int, controller: int, line: NDArray[np.int64]) -> None:
    """Update the controller's state by an error frame."""
    if error_class & _ERR_BUSOFF:
        line[_BUS_OFF] = 1
    if error_class & _ERR_RESTARTED:
        line[_BUS_OFF] = 0
        line[_PASSIVE] = 0
    if error_class & _ERR_ACK:
        line[_NOT_ACKNOWLEDGED] += 1
    if error_class & _ERR_CRTL:
        if controller & _CRTL_PASSIVE:
            line[_PASSIVE] = 1
        elif controller & (_CRTL_WARNING | _CRTL_ACTIVE):
            line[_PASSIVE] = 0
        if controller & _CRTL_ACTIVE:
            line[_BUS_OFF] = 0


@kernel
def _format(frames: RecordArray, first: int, count: int, wire: RecordArray, vectors: RecordArray) -> None:
    """Lay `count` frames out in the kernel's format."""
    for i in range(count):
        frame, raw = frames[first + i], wire[i]
        raw.can_id = frame.can_id | (EXTENDED_ID if frame.flags & FRAME_EXTENDED else 0)
        raw.length = frame.length
        vectors[i].length = _CANFD_MTU if frame.flags & FRAME_FD else _CAN_MTU
        for j in range(frame.length):
            raw.data[j] = frame.data[j]
