"""Frames as `candump -l` text by the million.

The same lines as `recorder.candump_lines` writes, of which an ECU needs some thousand a second; compiled,
because a simulated drive of ten minutes has a million.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ecu.contract.records import FRAME_EXTENDED, FRAME_FD, RecordArray
from ecu.jit import kernel

_FIXED: Final = 40
"""Bytes of a line at most without its interface's name and its payload."""
_HEX: Final = np.frombuffer(b"0123456789ABCDEF", np.uint8)


@kernel
def _decimal(text: NDArray[np.uint8], at: int, value: int, digits: int) -> int:
    for place in range(at + digits - 1, at - 1, -1):
        text[place] = 48 + value % 10
        value //= 10
    return at + digits


@kernel
def _write_line(text: NDArray[np.uint8], at: int, frame: Any, name: NDArray[np.uint8]) -> int:
    """Write a frame's line; return the place behind it."""
    seconds, rest = divmod(frame.stamp_ns, 1_000_000_000)
    digits, power = 1, 10
    while power <= seconds:
        digits, power = digits + 1, 10 * power
    text[at] = 0x28  # (
    at = _decimal(text, at + 1, seconds, digits)
    text[at] = 0x2E  # full stop
    at = _decimal(text, at + 1, rest // 1000, 6)
    text[at], text[at + 1] = 0x29, 0x20  # ) and a blank
    at += 2
    for i in range(len(name)):
        text[at + i] = name[i]
    at += len(name)
    text[at] = 0x20
    at += 1
    for shift in range(28 if frame.flags & FRAME_EXTENDED else 8, -1, -4):
        text[at] = _HEX[(np.int64(frame.can_id) >> shift) & 15]
        at += 1
    text[at] = 0x23  # #
    at += 1
    if frame.flags & FRAME_FD:
        text[at], text[at + 1] = 0x23, 0x30  # #0
        at += 2
    for i in range(frame.length):
        byte = np.int64(frame.data[i])
        text[at], text[at + 1] = _HEX[byte >> 4], _HEX[byte & 15]
        at += 2
    text[at] = 0x0A
    return at + 1


@kernel
def _write_lines(frames: Any, name: NDArray[np.uint8], text: NDArray[np.uint8]) -> int:
    at = 0
    for i in range(len(frames)):
        at = _write_line(text, at, frames[i], name)
    return at


def candump_text(frames: RecordArray, channel: str) -> bytes:
    """Return the lines of `frames` (FRAME, shape (n,)), stamps in µs."""
    name = np.frombuffer(channel.encode(), np.uint8)
    room = len(frames) * (_FIXED + len(name)) + 2 * int(frames["length"].sum(dtype=np.int64))
    text = np.empty(room, np.uint8)
    return text[: _write_lines(frames, name, text)].tobytes()
