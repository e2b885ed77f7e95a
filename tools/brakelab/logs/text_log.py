"""Text logs of every format: a stream of whole lines, packed or not, a block at a time.

A damaged line is skipped and counted; a last line without its end is never used: its bytes may be missing.
"""

import gzip
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.log_quality import BLOCK_FRAMES, FrameBlock, LogQuality
from ecu.contract.records import FRAME, RecordArray
from ecu.errors import UserError
from ecu.jit import Record, kernel

BLOCK_BYTES: Final = 1 << 20
SHORTEST_LINE: Final = 12  # bytes of a line that holds a frame

# What a line is.
DATA, SKIPPED, DAMAGED, HEADER = 0, 1, 2, 3
COUNTS: Final = np.dtype([("line", "i8"), ("damaged", "i8"), ("first", "i8")])

HEX: Final = np.full(256, 255, np.uint8)
for _place, _digit in enumerate(b"0123456789ABCDEF"):
    HEX[_digit] = HEX[ord(chr(_digit).lower())] = _place
FD_LENGTHS: Final = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64], np.int64)
"""Payload of each data length code."""
IS_FD_LENGTH: Final = np.isin(np.arange(65), FD_LENGTHS)

Parse = Callable[
    [NDArray[np.uint8], RecordArray, NDArray[np.uint8], NDArray[np.int64], Any], tuple[int, int, bool]
]
"""(text, frames, their payloads, their lines, counts) -> bytes used, frames written, whether the next whole
line is a header's."""


@kernel
def note_line(
    found: int, counts: Record, lines: NDArray[np.int64], data: NDArray[np.uint8], count: int
) -> int:
    """Count a line of the kind `found`; return the number of frames so far."""
    if found == DATA:
        lines[count] = counts.line
        return count + 1
    if found == DAMAGED:
        data[count] = 0
        counts.damaged += 1
        if counts.first == 0:
            counts.first = counts.line
    return count


@kernel
def line_end(text: NDArray[np.uint8], at: int) -> int:
    """Return the place of the end of the line that begins at `at`; -1: it is not whole."""
    while at < len(text) and text[at] != 0x0A:
        at += 1
    return at if at < len(text) else -1


@kernel
def skip_blanks(text: NDArray[np.uint8], at: int, end: int) -> int:
    """Return the place of the next word in `text[at:end]`, `end` if there is none."""
    while at < end and (text[at] == 0x20 or text[at] == 0x09 or text[at] == 0x0D):
        at += 1
    return at


@kernel
def word_end(text: NDArray[np.uint8], at: int, end: int) -> int:
    """Return the place behind the word that begins at `at`."""
    while at < end and text[at] != 0x20 and text[at] != 0x09 and text[at] != 0x0D:
        at += 1
    return at


@kernel
def number(text: NDArray[np.uint8], at: int, end: int, base: int) -> int:
    """Return the number that `text[at:end]` is; -1: it is none, or has more than nine digits."""
    if not 0 < end - at <= 9:
        return -1
    value: Any = np.int64(0)
    for i in range(at, end):
        digit = np.int64(HEX[text[i]])
        if digit >= base:
            return -1
        value = base * value + digit
    return int(value)


@kernel
def decimal(text: NDArray[np.uint8], at: int, end: int, places: int) -> int:
    """Return the decimal number that `text[at:end]` is, times 10^`places` (digits beyond are cut); -1: none.

    A number without a fraction is one too; nine digits stand before it at most.
    """
    value: Any = np.int64(0)
    first = at
    while at < end and text[at] >= 48 and text[at] <= 57:
        value = 10 * value + np.int64(text[at] - 48)
        at += 1
    if not 0 < at - first <= 9:
        return -1
    digits = 0
    if at < end and text[at] == 0x2E:
        at += 1
        first = at
        while at < end and text[at] >= 48 and text[at] <= 57:
            if digits < places:
                value = 10 * value + np.int64(text[at] - 48)
                digits += 1
            at += 1
        if at == first:
            return -1
    if at != end:
        return -1
    for _ in range(places - digits):
        value *= 10
    return int(value)


@kernel
def is_word(text: NDArray[np.uint8], at: int, end: int, word: bytes) -> bool:
    """Return whether `text[at:end]` begins with `word`, given in lower case."""
    if end - at < len(word):
        return False
    same = True
    for i in range(len(word)):
        same = same and (text[at + i] | 0x20) == word[i]
    return same


def is_packed(path: Path) -> bool:
    """Return whether the file is a gzip file, by its content."""
    with path.open("rb") as stream:
        return stream.read(2) == b"\x1f\x8b"


def open_log(path: Path) -> IO[bytes]:
    """Return the text of a log, packed or not. Raises UserError if it cannot be opened."""
    try:
        return cast(IO[bytes], gzip.open(path, "rb")) if is_packed(path) else path.open("rb")
    except OSError as error:
        raise UserError(str(path), "", f"cannot be read ({error.strerror}); give an existing log") from None


def _read(stream: IO[bytes], room: memoryview) -> tuple[int, Exception | None]:
    """Return how many of the next bytes of a log are in `room`, and why a packed one ends with them."""
    count = 0
    try:
        while count < len(room) and (read := stream.readinto1(room[count:])):  # type: ignore[attr-defined]
            count += read
    except (OSError, EOFError, zlib.error) as error:
        return count, error
    return count, None


def read_text(
    path: Path,
    parse: Parse,
    header: Callable[[str], bool],
    no_log: str,
    quality: LogQuality,
    advance: Callable[[int], None] | None,
) -> Iterator[FrameBlock]:
    """Yield the frames of a text log in blocks of at most `BLOCK_FRAMES`.

    `header` takes a line that is no frame's and returns whether it is known. `quality` is kept up to date;
    `advance(bytes)` hears of progress in bytes of text. Raises UserError with `no_log` where no line is good.
    """
    counts = np.zeros(1, COUNTS)
    room = np.empty(2 * BLOCK_BYTES, np.uint8)
    rest, read, too_long = 0, 0, False
    with open_log(path) as stream:
        torn: Exception | None = None
        while torn is None:
            came, torn = _read(stream, room[rest : rest + BLOCK_BYTES].data)
            if not came:
                break
            text = room[: rest + came]
            if too_long:  # its beginning was counted already
                ends = np.flatnonzero(text == 0x0A)
                text, too_long = text[ends[0] + 1 :] if len(ends) else text[:0], not len(ends)
            while True:
                frames = np.zeros(min(BLOCK_FRAMES, len(text) // SHORTEST_LINE + 1), FRAME)
                lines = np.empty(len(frames), np.int64)
                used, count, at_header = parse(text, frames, frames["data"], lines, counts[0])
                text = text[used:]
                read += count
                if at_header:
                    end = int(np.argmax(text == 0x0A))
                    counts["line"] += 1
                    if not header(text[:end].tobytes().decode("utf-8", "replace").strip()):
                        quality.note_damage(1, f"line {counts[0]['line']}")
                    text = text[end + 1 :]
                if counts[0]["damaged"]:
                    quality.note_damage(int(counts[0]["damaged"]), f"line {counts[0]['first']}")
                    counts["damaged"] = 0
                if count:
                    yield FrameBlock(frames[:count], lines[:count], "line")
                if count < len(frames) and not at_header:
                    break
            rest = len(text)
            room[:rest] = text
            if not read and quality.damaged:
                break
            if rest >= BLOCK_BYTES:
                counts["line"] += 1
                quality.note_damage(1, f"line {counts[0]['line']}")
                rest, too_long = 0, True
            if advance:
                advance(came)
    if not read:
        raise UserError(str(path), "line 1", f"cannot be unpacked ({torn}); {no_log}" if torn else no_log)
    if torn:
        place = f"line {counts[0]['line'] + 1}"
        quality.cut = f"{place}: the packed data is cut off or damaged here, the rest was not read"
    elif room[:rest].tobytes().strip():
        quality.cut = f"line {counts[0]['line'] + 1}: the last line is cut off and was not used"
