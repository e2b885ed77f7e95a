"""Reads `candump -l` text into `FRAME` records, block by block, so that a log of any length fits in memory.

A line is `(seconds.fraction) interface ID#BYTES`: three hexadecimal digits for an 11-bit identifier, eight
for a 29-bit one (or, with 0x20000000 set, an error frame), `##F` and up to 64 bytes for a CAN FD frame with
flags F, `#R` for a remote frame, optionally followed by ` R` or ` T` for its direction.
A damaged line is skipped and counted; a last line without its end is never used: its bytes may be missing.
"""

import gzip
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final, cast

import numpy as np
from numpy.typing import NDArray

from ecu.errors import UserError
from ecu.jit import Record, kernel
from ecu.records import FRAME, FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE, RecordArray

EXAMPLE: Final = "(1600000820.298000) can0 085#7C33800047E07C7F"
BLOCK_BYTES: Final = 1 << 22
BLOCK_FRAMES: Final = 1 << 16
MAX_INTERFACES: Final = 16
MAX_NAME: Final = 16  # IFNAMSIZ
# A step of the clock beyond this is no gap in the drive but a wrong stamp or two logs in one file.
MAX_JUMP_NS: Final = 3_600_000_000_000

_HEX = np.full(256, 255, np.uint8)
for _place, _digit in enumerate(b"0123456789ABCDEF"):
    _HEX[_digit] = _HEX[ord(chr(_digit).lower())] = _place
# Payload lengths that CAN FD knows.
_FD_LENGTH = np.zeros(65, np.bool_)
_FD_LENGTH[[0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]] = True

_COUNTS: Final = np.dtype(
    [
        (name, "i8")
        for name in ("line", "frames", "damaged", "first", "backwards", "repeated", "jump", "last_ns")
    ]
    + [("last_on_ns", "i8", (MAX_INTERFACES,))]
)


@dataclass
class LogQuality:
    """What was found wrong in a CAN log; line numbers count from 1, 0: none."""

    frames: int = 0
    damaged_lines: int = 0
    first_damaged_line: int = 0
    cut_line: int = 0
    """The last line, if its end is missing."""
    stamps_backwards: int = 0
    """Against the frame before on the same interface, as `stamps_repeated`."""
    stamps_repeated: int = 0


@kernel
def _interface(text: NDArray[np.uint8], start: int, end: int, names: NDArray[np.uint8]) -> int:
    """Return the place of a name in `names`, which it joins if it is new; -1: too long or too many."""
    if not 0 < end - start <= MAX_NAME:
        return -1
    for place in range(MAX_INTERFACES):
        name = names[place]
        if name[0] == 0:
            for i in range(end - start):
                name[i] = text[start + i]
            return place
        same = end - start == MAX_NAME or name[end - start] == 0
        for i in range(end - start):
            same = same and name[i] == text[start + i]
        if same:
            return place
    return -1


@kernel
def _parse_line(
    text: NDArray[np.uint8],
    at: int,
    end: int,
    frame: Record,
    data: NDArray[np.uint8],
    names: NDArray[np.uint8],
) -> bool:
    """Parse `text[at:end]` into `frame`, whose payload is `data`, shape (64,); False: damaged."""
    # 0x28 0x29: brackets; 0x2E: full stop; 0x20: space; 0x23: #; 0x0D: carriage return
    if end - at < 12 or text[at] != 0x28:
        return False
    at += 1
    first = at
    seconds = np.int64(0)
    while at < end and text[at] - 48 < 10 and text[at] >= 48:
        seconds = 10 * seconds + np.int64(text[at] - 48)
        at += 1
    if not 0 < at - first <= 10 or at >= end or text[at] != 0x2E:
        return False
    at += 1
    first = at
    fraction = np.int64(0)
    while at < end and text[at] - 48 < 10 and text[at] >= 48:
        fraction = 10 * fraction + np.int64(text[at] - 48)
        at += 1
    if not 0 < at - first <= 9 or end - at < 2 or text[at] != 0x29 or text[at + 1] != 0x20:
        return False
    for _ in range(9 - (at - first)):
        fraction *= 10
    at += 2
    while at < end and text[at] == 0x20:
        at += 1
    first = at
    while at < end and text[at] != 0x20:
        at += 1
    name_first, name_end = first, at
    while at < end and text[at] == 0x20:
        at += 1
    first = at
    can_id = np.int64(0)
    while at < end and _HEX[text[at]] < 16 and at - first < 9:
        can_id = 16 * can_id + np.int64(_HEX[text[at]])
        at += 1
    digits = at - first
    if at >= end or text[at] != 0x23 or (digits != 3 and digits != 8):
        return False
    at += 1
    flags = 0
    if digits == 8:
        flags = FRAME_ERROR if can_id & 0x20000000 else FRAME_EXTENDED
        if can_id > 0x3FFFFFFF:
            return False
        can_id &= 0x1FFFFFFF
    elif can_id > 0x7FF:
        return False
    limit = 8
    length = np.int64(0)
    if at < end and (text[at] == 0x52 or text[at] == 0x72):  # R: remote, the length may follow
        flags |= FRAME_REMOTE
        at += 1
        if at < end and text[at] >= 48 and text[at] <= 56:
            length = np.int64(text[at] - 48)
            at += 1
    else:
        if at < end and text[at] == 0x23:
            flags |= FRAME_FD
            limit = 64
            if at + 1 >= end or _HEX[text[at + 1]] > 15:
                return False
            at += 2
        while at + 1 < end and length < limit:
            high, low = _HEX[text[at]], _HEX[text[at + 1]]
            if high > 15 or low > 15:
                break
            data[length] = 16 * high + low
            length += 1
            at += 2
        if limit == 64 and not _FD_LENGTH[length]:
            return False
    while at < end and (text[at] == 0x20 or text[at] == 0x0D):
        at += 1
    if at < end and text[at - 1] == 0x20 and (text[at] == 0x52 or text[at] == 0x54):  # direction
        at += 1
        while at < end and (text[at] == 0x20 or text[at] == 0x0D):
            at += 1
    if at != end:
        return False
    bus = _interface(text, name_first, name_end, names)
    if bus < 0:
        return False
    frame.stamp_ns = seconds * 1_000_000_000 + fraction
    frame.can_id = can_id
    frame.flags = flags
    frame.bus = bus
    frame.length = length
    return True


@kernel
def parse_candump(
    text: NDArray[np.uint8],
    frames: RecordArray,
    data: NDArray[np.uint8],
    names: NDArray[np.uint8],
    counts: Record,
) -> tuple[int, int]:
    """Parse whole lines until the text or the room in `frames` (zeroed; `data` its payloads) ends.

    Returns how many bytes were used and how many frames written.
    """
    size, room = len(text), len(frames)
    used = count = 0
    while count < room and counts.jump == 0:
        end = used
        while end < size and text[end] != 0x0A:
            end += 1
        if end == size:
            break
        counts.line += 1
        blank = end == used or (end == used + 1 and text[used] == 0x0D)
        if _parse_line(text, used, end, frames[count], data[count], names):
            stamp = frames[count].stamp_ns
            if counts.frames and abs(stamp - counts.last_ns) > MAX_JUMP_NS:
                counts.jump = counts.line
            counts.last_ns = stamp
            bus = frames[count].bus
            counts.backwards += stamp < counts.last_on_ns[bus]
            counts.repeated += stamp == counts.last_on_ns[bus]
            counts.last_on_ns[bus] = stamp
            counts.frames += 1
            count += 1
        elif not blank:
            data[count] = 0
            counts.damaged += 1
            if counts.first == 0:
                counts.first = counts.line
        used = end + 1
    return used, count


def _open(path: Path) -> IO[bytes]:
    try:
        return cast(IO[bytes], gzip.open(path, "rb")) if path.suffix == ".gz" else path.open("rb")
    except OSError as error:
        raise UserError(
            str(path), "", f"cannot be read ({error.strerror}); give an existing candump log"
        ) from None


def read_candump(
    path: Path, interfaces: list[str], quality: LogQuality, advance: Callable[[int], None] | None = None
) -> Iterator[RecordArray]:
    """Yield the frames of a candump log (`.log`, also with `.gz`) in blocks of at most `BLOCK_FRAMES`.

    A frame's `bus` is the place of its interface in `interfaces`, to which new names are added. `quality` is
    kept up to date; `advance(bytes)` hears of progress in bytes of text. Raises UserError for what is no
    candump log and for a clock that jumps.
    """
    names = np.zeros((MAX_INTERFACES, MAX_NAME), np.uint8)
    for place, name in enumerate(interfaces):
        names[place, : len(name)] = np.frombuffer(name.encode(), np.uint8)
    counts = np.zeros(1, _COUNTS)
    rest = b""
    with _open(path) as stream:
        while True:
            try:
                chunk = stream.read(BLOCK_BYTES)
            except (OSError, EOFError) as error:
                if not counts[0]["frames"]:
                    raise UserError(
                        str(path), "line 1", f"cannot be unpacked ({error}); give a candump log"
                    ) from None
                chunk = b""  # a gzip file cut off: its text ends here
                rest = rest or b"?"
            if not chunk:
                break
            text = np.frombuffer(rest + chunk, np.uint8)
            while True:
                frames = np.zeros(min(BLOCK_FRAMES, len(text) // 12 + 1), FRAME)
                used, count = parse_candump(text, frames, frames["data"], names, counts[0])
                text = text[used:]
                _note(path, counts[0], names, interfaces, quality)
                if count:
                    yield frames[:count]
                if count < len(frames):
                    break
            rest = text.tobytes()
            if not quality.frames and (quality.damaged_lines or len(rest) >= BLOCK_BYTES):
                raise _wrong_format(path)
            if advance:
                advance(len(chunk))
    if not quality.frames:
        raise _wrong_format(path)
    if rest.strip():
        quality.cut_line = int(counts[0]["line"]) + 1


def _note(
    path: Path, counts: Record, names: NDArray[np.uint8], interfaces: list[str], quality: LogQuality
) -> None:
    if counts["jump"]:
        raise UserError(
            str(path),
            f"line {counts['jump']}",
            "time jumps by more than an hour; mend the line or split the log here",
        )
    quality.frames = int(counts["frames"])
    quality.damaged_lines = int(counts["damaged"])
    quality.first_damaged_line = int(counts["first"])
    quality.stamps_backwards = int(counts["backwards"])
    quality.stamps_repeated = int(counts["repeated"])
    for name in names[len(interfaces) :]:
        if name[0]:
            interfaces.append(name.tobytes().rstrip(b"\0").decode("latin-1"))


def _wrong_format(path: Path) -> UserError:
    if path.stat().st_size == 0:
        return UserError(str(path), "line 1", f"the file is empty; a candump log has lines like {EXAMPLE}")
    with path.open("rb") as stream:
        start = stream.read(4)
    if start == b"PAR1":
        return UserError(str(path), "line 1", "this is a Parquet file; let its name end in .parquet")
    return UserError(str(path), "line 1", f"no candump log; its lines look like {EXAMPLE}")
