"""Reads Vector BLF: a header, then containers of packed bytes, whose sum is a stream of objects.

    file        "LOGG", length of the header u4, …, date of the start (SYSTEMTIME, 8 u2) at byte 40
    object      "LOBJ", length of the header u2, version u2, length u4, type u4, then
                flags u4 (1: stamps in 10 µs, 2: in ns), …, stamp u8 at byte 24, the content
    container   type 10: method u2 (0: plain, 2: zlib), …, unpacked length u4 at byte 24, the bytes

Little endian; padded to multiples of four bytes. An object may begin in one container and end in the next.
Vector's programs write the start in local time. Stamps are rounded to whole microseconds, as the ECU has
them. Channel n becomes interface number n. Requests to send (TxRq) are skipped: the frame itself follows.
"""

import struct
import zlib
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.log_quality import BLOCK_FRAMES, FrameBlock, LogQuality, known_date
from brakelab.logs.text_log import FD_LENGTHS, IS_FD_LENGTH
from ecu.contract.records import (
    FRAME,
    FRAME_ERROR,
    FRAME_EXTENDED,
    FRAME_FD,
    FRAME_REMOTE,
    RecordArray,
    new_record,
)
from ecu.errors import UserError
from ecu.jit import Record, kernel

BLOCK_BYTES: Final = 1 << 20
LARGEST_OBJECT: Final = 1 << 26  # bytes of an object: a length beyond is damage
_HEADER: Final = 16
_CONTAINER: Final = 10
_SHORTEST_FRAME: Final = 48  # bytes of an object that holds a frame
_LONGEST_FRAME: Final = 512
# "LOBJ" as a little-endian number
_SIGNATURE: Final = 0x4A424F4C
_CAN_MESSAGE, _CAN_ERROR, _CAN_ERROR_EXT = 1, 2, 73
_CAN_MESSAGE2, _CAN_FD, _CAN_FD_64, _CAN_FD_ERROR_64 = 86, 100, 101, 104
_FRAMES: Final = (
    _CAN_MESSAGE,
    _CAN_MESSAGE2,
    _CAN_FD,
    _CAN_FD_64,
    _CAN_ERROR,
    _CAN_ERROR_EXT,
    _CAN_FD_ERROR_64,
)
_TX_REQUEST: Final = 2
_DAMAGE: Final = np.dtype([("count", "i8"), ("first", "i8")])
_REMEDY: Final = "record it again, or save it as .asc where it was recorded"


class _Piece(NamedTuple):
    """Bytes of the stream of objects."""

    content: bytes
    offset: int
    """Where its container stands in the file."""
    damage: str
    """Its damage, empty if none."""


@kernel
def _u2(stream: NDArray[np.uint8], at: int) -> int:
    return int(stream[at]) | int(stream[at + 1]) << 8


@kernel
def _u4(stream: NDArray[np.uint8], at: int) -> int:
    return _u2(stream, at) | _u2(stream, at + 2) << 16


@kernel
def _identify(number: int, frame: Record) -> bool:
    extended = number & 0x80000000 != 0
    frame.can_id = number & 0x1FFFFFFF
    frame.flags = FRAME_EXTENDED if extended else 0
    return extended or number <= 0x7FF


@kernel
def _parse_object(
    stream: NDArray[np.uint8], kind: int, at: int, end: int, frame: Record, data: NDArray[np.uint8]
) -> int:
    """Parse the content of an object, `stream[at:end]`; 1: a frame, 0: none, -1: damaged."""
    size = end - at
    if kind in (_CAN_MESSAGE, _CAN_MESSAGE2):
        if size < 16 or not _identify(_u4(stream, at + 4), frame):
            return -1
        if stream[at + 2] & 0x0F == _TX_REQUEST:
            return 0
        frame.bus = stream[at] if stream[at + 1] == 0 else 255
        frame.length = min(np.int64(stream[at + 3]), 8)
        if stream[at + 2] & 0x80:
            frame.flags |= FRAME_REMOTE
            return 1
        first = at + 8
    elif kind == _CAN_FD:
        if size < 20 or not _identify(_u4(stream, at + 4), frame):
            return -1
        if stream[at + 2] & 0x0F == _TX_REQUEST:
            return 0
        frame.bus = stream[at] if stream[at + 1] == 0 else 255
        frame.flags |= FRAME_FD if stream[at + 13] & 0x01 else 0
        frame.length = stream[at + 14]
        if stream[at + 2] & 0x80:
            frame.flags |= FRAME_REMOTE
            frame.length = FD_LENGTHS[stream[at + 3] & 0x0F]
            return 1
        first = at + 20
    elif kind == _CAN_FD_64:
        if size < 40 or not _identify(_u4(stream, at + 4), frame):
            return -1
        if stream[at + 34] == _TX_REQUEST:
            return 0
        flags = _u4(stream, at + 12)
        frame.bus = stream[at]
        frame.flags |= FRAME_FD if flags & 0x1000 else 0
        frame.length = stream[at + 2]
        if flags & 0x10:
            frame.flags |= FRAME_REMOTE
            frame.length = FD_LENGTHS[stream[at + 1] & 0x0F]
            return 1
        first = at + 40
    elif kind in (_CAN_ERROR, _CAN_ERROR_EXT, _CAN_FD_ERROR_64):
        if size < 4:
            return -1
        frame.can_id, frame.flags, frame.length, frame.bus = 0, FRAME_ERROR, 0, stream[at]
        return 1
    else:
        return 0
    length: Any = np.int64(frame.length)
    if length > 64 or not IS_FD_LENGTH[length]:
        return -1
    for i in range(min(length, end - first)):  # bytes that are not there are zero, as CANoe has them
        data[i] = stream[first + i]
    return 1


@kernel
def _parse_blf(
    stream: NDArray[np.uint8],
    start_ns: int,
    frames: RecordArray,
    payloads: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    damage: Record,
) -> tuple[int, int]:
    """Parse whole objects until the stream or the room ends; return bytes used and frames written."""
    size, room = len(stream), len(frames)
    used = count = 0
    while count < room and used + _HEADER <= size:
        at = used
        while at + _HEADER <= size and _u4(stream, at) != _SIGNATURE:
            at += 1
        if at - used > 8:  # more than padding
            damage.count += 1
            damage.first = used if damage.first < 0 else damage.first
        if at + _HEADER > size:
            used = at
            break
        used = at
        header, length, kind = _u2(stream, at + 4), _u4(stream, at + 8), _u4(stream, at + 12)
        longest = _LONGEST_FRAME if kind in _FRAMES else LARGEST_OBJECT
        if header < _HEADER or length < header or length > longest:
            damage.count += 1
            damage.first = used if damage.first < 0 else damage.first
            used += 4
            continue
        if at + length > size:
            break
        end = at + length
        if header >= 32:
            stamp = _u4(stream, at + 24) | _u4(stream, at + 28) << 32
            microseconds = 10 * stamp if _u4(stream, at + 16) == 1 else (stamp + 500) // 1000
            found = _parse_object(stream, kind, at + header, end, frames[count], payloads[count])
            if found > 0:
                frames[count].stamp_ns = start_ns + 1000 * microseconds
                offsets[count] = at
                count += 1
            elif found < 0:
                damage.count += 1
                damage.first = used if damage.first < 0 else damage.first
        used = end
    return used, count


def start_time_ns(header: bytes) -> int:
    """Return the date of the start, local time, as Unix time [ns]; 0: none."""
    year, month, _, day, hour, minute, second, millisecond = struct.unpack_from("<8H", header, 40)
    try:
        seconds = int(datetime(year, month, day, hour, minute, second).timestamp())
    except (ValueError, OverflowError):
        return 0
    return known_date(seconds * 1_000_000_000 + int(millisecond) * 1_000_000) or 0


def _unpack(packed: bytes, method: int) -> tuple[bytes, str]:
    """Return the contents of a container, and its damage."""
    if method == 0:
        return packed, ""
    if method != 2:
        return b"", f"packed by an unknown method ({method})"
    unpacker = zlib.decompressobj()
    try:
        content = unpacker.decompress(packed, LARGEST_OBJECT)
    except zlib.error as error:
        return b"", str(error)  # what came before may be wrong already
    if unpacker.unconsumed_tail:
        return b"", f"more than {LARGEST_OBJECT >> 20} MB in one container"
    return content, "" if unpacker.eof else "its end is missing"


def _pieces(stream: IO[bytes], advance: Callable[[int], None] | None) -> Iterator[_Piece]:
    """Yield the contents of containers, and objects outside of any."""
    while True:
        offset = stream.tell()
        header = stream.read(_HEADER)
        if not header:
            return
        if not header.strip(b"\0"):  # room that a recorder had reserved, or lost
            if not _seek_object(stream, offset):
                return
            yield _Piece(b"", offset, "zeros where an object should begin")
            continue
        if len(header) < _HEADER:
            yield _Piece(b"", offset, "the file is cut off here")
            return
        signature, _, _, length, kind = struct.unpack("<4sHHLL", header)
        if signature != b"LOBJ" or not _HEADER <= length <= LARGEST_OBJECT:
            yield _Piece(b"", offset, "no object begins here")
            if not _seek_object(stream, offset + 1):
                return
            continue
        body = stream.read(length - _HEADER)
        stream.read(length % 4)
        if advance:
            advance(length)
        damage = "" if len(body) == length - _HEADER else "the file is cut off here"
        if kind != _CONTAINER:
            yield _Piece(header + body, offset, damage)
        elif len(body) >= 16:
            content, reason = _unpack(body[16:], struct.unpack_from("<H", body)[0])
            # A container that is whole and still does not end was overwritten: what it gives may be wrong.
            yield _Piece(b"" if reason and not damage else content, offset, damage or reason)
        else:
            yield _Piece(b"", offset, damage or "an empty container")


def _seek_object(stream: IO[bytes], offset: int) -> bool:
    """Go to the next object from `offset` on; False: there is none."""
    stream.seek(offset)
    while True:
        chunk = stream.read(BLOCK_BYTES)
        found = chunk.find(b"LOBJ")
        if found >= 0:
            stream.seek(offset + found)
            return True
        if len(chunk) < 4:
            return False
        offset += len(chunk) - 3
        stream.seek(offset)


def read_blf(
    path: Path, quality: LogQuality, advance: Callable[[int], None] | None = None
) -> Iterator[FrameBlock]:
    """Yield the frames of a BLF log in blocks; `bus` is the channel's number.

    `quality` is kept up to date; `advance(bytes)` hears of progress. Raises UserError where there is
    no frame.
    """
    read = 0
    with path.open("rb") as stream:
        header = stream.read(144)
        start_ns = start_time_ns(header) if len(header) >= 56 else 0
        stated = struct.unpack_from("<L", header, 4)[0] if len(header) >= 8 else 0
        stream.seek(min(stated, len(header)))
        rest, rest_offset = b"", 0
        for batch in _batches(_pieces(stream, advance)):
            for piece in batch:
                if piece.damage.startswith("the file is cut"):
                    quality.cut = f"byte {piece.offset}: {piece.damage}, what follows is missing"
                elif piece.damage:
                    quality.note_damage(1, f"byte {piece.offset} ({piece.damage})")
            content = np.frombuffer(b"".join([rest, *(piece.content for piece in batch)]), np.uint8)
            ends = np.cumsum([len(rest), *(len(piece.content) for piece in batch)])
            origins = np.array([rest_offset, *(piece.offset for piece in batch)])
            used = 0
            while True:
                frames = np.zeros(min(BLOCK_FRAMES, len(content) // _SHORTEST_FRAME + 1), FRAME)
                offsets = np.empty(len(frames), np.int64)
                damage = new_record(_DAMAGE)
                damage["first"] = -1
                taken, count = _parse_blf(
                    content[used:], start_ns, frames, frames["data"], offsets, damage[0]
                )
                if damage["count"][0]:
                    place = origins[np.searchsorted(ends[:-1], used + damage["first"][0], "right")]
                    quality.note_damage(int(damage["count"][0]), f"byte {place}")
                places = origins[np.searchsorted(ends[:-1], used + offsets[:count], "right")]
                used += taken
                read += count
                if count:
                    yield FrameBlock(frames[:count], places, "byte")
                if count < len(frames):
                    break
            # An object that goes on in a lost container is lost with it.
            rest = b"" if batch and batch[-1].damage else content[used:].tobytes()
            rest_offset = int(origins[-1])
    if not read:
        damaged = quality.cut or (quality.first_damaged and f"damaged from {quality.first_damaged} on")
        raise UserError(str(path), damaged or "whole file", f"no frame in this BLF file; {_REMEDY}")
    if len(rest) > _HEADER and not quality.cut:
        quality.cut = f"byte {rest_offset}: the last object is cut off and was not used"


def _batches(pieces: Iterator[_Piece]) -> Iterator[list[_Piece]]:
    batch: list[_Piece] = []
    size = 0
    for piece in pieces:
        batch.append(piece)
        size += len(piece.content)
        if size >= BLOCK_BYTES or piece.damage:
            yield batch
            batch, size = [], 0
    yield batch
