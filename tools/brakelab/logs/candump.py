"""Reads `candump -l` text into `FRAME` records, block by block, so that a log of any length fits in memory.

A line is `(seconds.fraction) interface ID#BYTES`: three hexadecimal digits for an 11-bit identifier, eight
for a 29-bit one (or, with 0x20000000 set, an error frame), `##F` and up to 64 bytes for a CAN FD frame with
flags F, `#R` for a remote frame, optionally followed by ` R` or ` T` for its direction.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.log_quality import FrameBlock, LogQuality
from brakelab.logs.text_log import DAMAGED, DATA, HEX, IS_FD_LENGTH, SKIPPED, line_end, note_line, read_text
from ecu.contract.records import FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE, RecordArray
from ecu.jit import Record, batch_kernel, kernel

EXAMPLE: Final = "(1600000820.298000) can0 085#7C33800047E07C7F"
MAX_INTERFACES: Final = 16
MAX_NAME: Final = 16  # IFNAMSIZ
_USUAL: Final = 20 + MAX_NAME + 1 + 9 + 16 + 2  # bytes of a line as a logger writes it, at most


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
def _name_of(text: NDArray[np.uint8], at: int) -> int:
    """Return where the interface of a line that is good begins."""
    while text[at] != 0x29:
        at += 1
    at += 1
    while text[at] == 0x20:
        at += 1
    return at


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
    while at < end and HEX[text[at]] < 16 and at - first < 9:
        can_id = 16 * can_id + np.int64(HEX[text[at]])
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
            if at + 1 >= end or HEX[text[at + 1]] > 15:
                return False
            at += 2
        while at + 1 < end and length < limit:
            high, low = HEX[text[at]], HEX[text[at + 1]]
            if high > 15 or low > 15:
                break
            data[length] = 16 * high + low
            length += 1
            at += 2
        if limit == 64 and not IS_FD_LENGTH[length]:
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
def _parse_usual(
    text: NDArray[np.uint8], at: int, name: int, frame: Record, data: NDArray[np.uint8]
) -> tuple[int, int]:
    """Parse a line as a logger writes it: ten digits, six digits, the interface of the line before (which
    begins at `name`), a data frame of at most eight bytes.

    `text` has `_USUAL` bytes from `at` on. Returns where the line ends (-1: it has another form) and where
    its interface begins.
    """
    if text[at] != 0x28 or text[at + 11] != 0x2E or text[at + 18] != 0x29 or text[at + 19] != 0x20:
        return -1, 0
    seconds, fraction, wrong = np.int64(0), np.int64(0), np.int64(0)
    for i in range(at + 1, at + 11):
        digit = np.int64(text[i]) - 48
        wrong |= digit | digit + 6
        seconds = 10 * seconds + digit
    for i in range(at + 12, at + 18):
        digit = np.int64(text[i]) - 48
        wrong |= digit | digit + 6
        fraction = 10 * fraction + digit
    if wrong & ~15:
        return -1, 0
    at += 20
    own = at
    while text[at] == text[name] and text[at] != 0x20 and at - own < MAX_NAME:
        at += 1
        name += 1
    if text[at] != 0x20 or text[name] != 0x20:
        return -1, 0
    at += 1
    can_id, wrong = np.int64(0), np.int64(0)
    first = at
    while text[at] != 0x23 and at - first < 8:
        digit = np.int64(HEX[text[at]])
        wrong |= digit
        can_id = 16 * can_id + digit
        at += 1
    standard = at - first == 3
    if text[at] != 0x23 or wrong & ~15 or not (standard or at - first == 8):
        return -1, 0
    if can_id > (0x7FF if standard else 0x1FFFFFFF):
        return -1, 0
    at += 1
    length = 0
    while text[at] != 0x0A and length < 8:
        high, low = np.int64(HEX[text[at]]), np.int64(HEX[text[at + 1]])
        if (high | low) & ~15:
            return -1, 0
        data[length] = 16 * high + low
        length += 1
        at += 2
    if text[at] != 0x0A:
        return -1, 0
    frame.stamp_ns = seconds * 1_000_000_000 + fraction * 1000
    frame.can_id = can_id
    frame.flags = 0 if standard else FRAME_EXTENDED
    frame.length = length
    return at, own


@batch_kernel
def _parse_candump(
    text: NDArray[np.uint8],
    names: NDArray[np.uint8],
    frames: RecordArray,
    payloads: NDArray[np.uint8],
    lines: NDArray[np.int64],
    counts: Record,
) -> tuple[int, int, bool]:
    size, room = len(text), len(frames)
    used = count = bus = 0
    name = -1
    while count < room:
        if name >= 0 and used + _USUAL <= size:
            end, own = _parse_usual(text, used, name, frames[count], payloads[count])
            if end >= 0:
                frames[count].bus = bus
                counts.line += 1
                lines[count] = counts.line
                name = own
                count += 1
                used = end + 1
                continue
            payloads[count] = 0
        end = line_end(text, used)
        if end < 0:
            break
        counts.line += 1
        if end == used or (end == used + 1 and text[used] == 0x0D):
            found = SKIPPED
        elif _parse_line(text, used, end, frames[count], payloads[count], names):
            found = DATA
            name, bus = _name_of(text, used), frames[count].bus
        else:
            found = DAMAGED
        count = note_line(found, counts, lines, payloads, count)
        used = end + 1
    return used, count, False


def read_candump(
    path: Path, interfaces: list[str], quality: LogQuality, advance: Callable[[int], None] | None = None
) -> Iterator[FrameBlock]:
    """Yield the frames of a candump log in blocks; `bus` is the place of the interface in `interfaces`.

    New names are added to `interfaces`. `quality` and `advance`: see `read_text`. Raises UserError for what
    is no candump log.
    """
    names = np.zeros((MAX_INTERFACES, MAX_NAME), np.uint8)
    for place, name in enumerate(interfaces):
        names[place, : len(name)] = np.frombuffer(name.encode(), np.uint8)

    def parse(text: NDArray[np.uint8], *into: Any) -> tuple[int, int, bool]:
        return _parse_candump(text, names, *into)

    def no_header(line: str) -> bool:
        return False

    remedy = f"no candump log; its lines look like {EXAMPLE}"
    for block in read_text(path, parse, no_header, remedy, quality, advance):
        for name in names[len(interfaces) :]:
            if name[0]:
                interfaces.append(name.tobytes().rstrip(b"\0").decode("latin-1"))
        yield block
