"""Reads Vector ASC text: a header with date and number base, then one line per event.

    date Wed Apr 20 08:15:30.123 am 2022
    base hex  timestamps absolute
    Begin Triggerblock Wed Apr 20 08:15:30.123 am 2022
       0.012345 1  18FEF100x       Rx   d 8 01 02 03 04 05 06 07 08
       0.012400 CANFD   1 Rx        123  a_name  1 0 9 12 01 02 03 … 0C   130000  130 303000 …

Dates are local time. Time stamps are seconds since the begin of the measurement, or (`timestamps relative`)
since the line before. Where they start again in a later trigger block, they count from its own date.
Channel n becomes interface number n. Events that are no frames are skipped, and requests to send (TxRq):
the frame itself follows.
"""

import re
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.log_quality import FrameBlock, LogQuality, known_date
from brakelab.logs.text_log import (
    DAMAGED,
    DATA,
    FD_LENGTHS,
    HEADER,
    IS_FD_LENGTH,
    SKIPPED,
    decimal,
    is_word,
    line_end,
    note_line,
    number,
    read_text,
    skip_blanks,
    word_end,
)
from ecu.contract.records import FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE, RecordArray, new_record
from ecu.jit import Record, kernel

EXAMPLE: Final = "0.012345 1  123  Rx   d 8 01 02 03 04 05 06 07 08"
_STATE: Final = np.dtype(
    [
        ("base", "i8"),
        ("relative", "i8"),
        ("origin_ns", "i8"),  # date of stamp 0
        ("block_ns", "i8"),  # date of the trigger block that has just begun
        ("begun", "i8"),  # a trigger block has
        ("blocks", "i8"),  # how many before
        ("clock_ns", "i8"),  # stamp of the last line
    ]
)
_MONTHS: Final = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_GERMAN: Final = {"mai": "may", "mrz": "mar", "mär": "mar", "m\ufffdr": "mar", "okt": "oct", "dez": "dec"}
_DATE: Final = re.compile(
    r"\S+\s+(?P<month>\S+)\s+(?P<day>\d+)\s+(?P<h>\d+):(?P<min>\d+):(?P<s>\d+)(?:\.(?P<f>\d+))?"
    r"(?:\s+(?P<half>am|pm))?\s+(?P<year>\d{4})",
    re.IGNORECASE,
)
_KNOWN: Final = re.compile(r"//|no\s|internal\s|end\s|begin\s|previous\s|#|$", re.IGNORECASE)


def date_ns(text: str) -> int | None:
    """Return a date such as `Wed Apr 20 08:15:30.123 am 2022`, local time, as Unix time [ns]; None: no date.

    Names of months may be English or German.
    """
    found = _DATE.match(text)
    if not found:
        return None
    name = found["month"].lower()[:3]
    hour = int(found["h"])
    if found["half"]:
        hour = hour % 12 + (12 if found["half"].lower() == "pm" else 0)
    try:
        date = datetime(
            int(found["year"]),
            _MONTHS.index(_GERMAN.get(name, name)) + 1,
            int(found["day"]),
            hour,
            int(found["min"]),
            int(found["s"]),
        )
        seconds = int(date.timestamp())
    except (ValueError, OverflowError):
        return None
    return known_date(seconds * 1_000_000_000 + int((found["f"] or "0").ljust(9, "0")[:9]))


def _read_header(state: RecordArray) -> Callable[[str], bool]:
    def header(line: str) -> bool:
        words = line.lower().split()
        row = state[0]
        if words[:1] == ["date"]:
            row["origin_ns"] = date_ns(line[4:].strip()) or 0
        elif words[:1] == ["base"] and len(words) > 1:
            row["base"] = 10 if words[1] == "dec" else 16
            row["relative"] = "relative" in words
        elif words[:2] == ["begin", "triggerblock"]:
            begin_ns = date_ns(line.split(None, 2)[2]) if len(words) > 2 else None
            if begin_ns is not None:
                row["block_ns"], row["begun"] = begin_ns, 1
        else:
            return bool(_KNOWN.match(line))
        return True

    return header


@kernel
def _identifier(text: NDArray[np.uint8], at: int, end: int, base: int, frame: Record) -> bool:
    """Write identifier and flags of `123` or `18FEF100x`; False: it is none."""
    extended = at < end and (text[end - 1] | 0x20) == 0x78
    value = number(text, at, end - 1 if extended else end, base)
    if value < 0 or value > (0x1FFFFFFF if extended else 0x7FF):
        return False
    frame.can_id = value
    frame.flags = FRAME_EXTENDED if extended else 0
    return True


@kernel
def _bytes(text: NDArray[np.uint8], at: int, end: int, base: int, count: int, data: NDArray[np.uint8]) -> int:
    """Read `count` numbers into `data`; return the place behind them, -1: one is missing."""
    for i in range(count):
        at = skip_blanks(text, at, end)
        last = word_end(text, at, end)
        value = number(text, at, last, base) if last - at <= 3 else -1
        if value < 0 or value > 255:
            return -1
        data[i] = value
        at = last
    return at


@kernel
def _classical(
    text: NDArray[np.uint8], at: int, end: int, base: int, frame: Record, data: NDArray[np.uint8]
) -> int:
    """Parse the fields after the channel."""
    last = word_end(text, at, end)
    if is_word(text, at, last, b"errorframe"):
        frame.can_id, frame.flags, frame.length = 0, FRAME_ERROR, 0
        return DATA
    known = _identifier(text, at, last, base, frame)
    direction = skip_blanks(text, last, end)
    last = word_end(text, direction, end)
    if not (is_word(text, direction, last, b"rx") or is_word(text, direction, last, b"tx")):
        # Statistics, states of the chip and the like have no direction; a line that ends here is cut.
        return DAMAGED if direction >= end else SKIPPED
    if not known:
        return DAMAGED
    if last - direction > 2:
        return SKIPPED  # TxRq
    at = skip_blanks(text, last, end)
    last = word_end(text, at, end)
    if last - at != 1:
        return DAMAGED
    kind = text[at] | 0x20
    at = skip_blanks(text, last, end)
    last = word_end(text, at, end)
    code = number(text, at, last, base)
    if kind == 0x72:  # r: remote, the length may be missing
        frame.flags |= FRAME_REMOTE
        frame.length = min(max(code, 0), 8)
        return DATA
    if kind != 0x64 or not 0 <= code <= 15:
        return DAMAGED
    length = min(code, 8)
    if _bytes(text, last, end, base, length, data) < 0:
        return DAMAGED
    frame.length = length
    return DATA


@kernel
def _fd(text: NDArray[np.uint8], at: int, end: int, base: int, frame: Record, data: NDArray[np.uint8]) -> int:
    """Parse CANFD fields: channel, direction, identifier, name, BRS, ESI, DLC, length, data, flags."""
    last = word_end(text, at, end)
    channel = number(text, at, last, 10)
    if not 0 <= channel <= 255:
        return DAMAGED
    frame.bus = channel
    at = skip_blanks(text, last, end)
    last = word_end(text, at, end)
    if not (is_word(text, at, last, b"rx") or is_word(text, at, last, b"tx")):
        return DAMAGED
    requested = last - at > 2
    at = skip_blanks(text, last, end)
    last = word_end(text, at, end)
    if is_word(text, at, last, b"errorframe"):
        frame.can_id, frame.flags, frame.length = 0, FRAME_ERROR, 0
        return DATA
    if not _identifier(text, at, last, base, frame):
        return DAMAGED
    if requested:
        return SKIPPED
    at = skip_blanks(text, last, end)
    last = word_end(text, at, end)
    if last - at != 1 or text[at] < 48 or text[at] > 49:  # the symbolic name, then BRS
        at = skip_blanks(text, last, end)
        last = word_end(text, at, end)
    if last - at != 1:
        return DAMAGED
    at = skip_blanks(text, last, end)
    last = word_end(text, at, end)  # ESI
    at = skip_blanks(text, last, end)
    last = word_end(text, at, end)
    code = number(text, at, last, 16)
    at = skip_blanks(text, last, end)
    last = word_end(text, at, end)
    length = number(text, at, last, 10)
    if not 0 <= code <= 15 or not 0 <= length <= 64 or not IS_FD_LENGTH[length]:
        return DAMAGED
    at = _bytes(text, last, end, base, length, data)
    if at < 0:
        return DAMAGED
    flags = 0x1000
    for i in range(3):  # duration and number of bits, then the flags
        at = skip_blanks(text, at, end)
        last = word_end(text, at, end)
        if i == 2 and last > at:
            flags = number(text, at, last, 16)
        at = last
    if flags & 0x1000 or length > 8:
        frame.flags |= FRAME_FD
    if flags & 0x10 or (length == 0 and code > 0):
        frame.flags |= FRAME_REMOTE
        length = int(FD_LENGTHS[code])
    frame.length = length
    return DATA


@kernel
def _parse_line(
    text: NDArray[np.uint8], at: int, end: int, state: Record, frame: Record, data: NDArray[np.uint8]
) -> int:
    at = skip_blanks(text, at, end)
    if at == end:
        return SKIPPED
    first = text[at]
    if first < 48 or first > 57:
        return HEADER
    last = word_end(text, at, end)
    stamp = decimal(text, at, last, 9)
    if stamp < 0:
        return DAMAGED
    if state.relative:
        stamp += state.clock_ns
    at = skip_blanks(text, last, end)
    last = word_end(text, at, end)
    if at == end:
        return DAMAGED
    if state.begun:
        if state.blocks == 0 or stamp < state.clock_ns:
            state.origin_ns = state.block_ns
        state.begun = 0
        state.blocks += 1
    channel = number(text, at, last, 10)
    found = SKIPPED
    if 0 <= channel <= 255:
        frame.bus = channel
        found = _classical(text, skip_blanks(text, last, end), end, state.base, frame, data)
    elif is_word(text, at, last, b"canfd"):
        found = _fd(text, skip_blanks(text, last, end), end, state.base, frame, data)
    if found != DAMAGED:
        state.clock_ns = stamp
    frame.stamp_ns = state.origin_ns + stamp
    return found


@kernel
def _parse_asc(
    text: NDArray[np.uint8],
    state: Record,
    frames: RecordArray,
    payloads: NDArray[np.uint8],
    lines: NDArray[np.int64],
    counts: Record,
) -> tuple[int, int, bool]:
    used = count = 0
    while count < len(frames):
        end = line_end(text, used)
        if end < 0:
            break
        found = _parse_line(text, used, end, state, frames[count], payloads[count])
        if found == HEADER:
            return used, count, True
        counts.line += 1
        count = note_line(found, counts, lines, payloads, count)
        used = end + 1
    return used, count, False


def read_asc(
    path: Path, quality: LogQuality, advance: Callable[[int], None] | None = None
) -> Iterator[FrameBlock]:
    """Yield the frames of a Vector ASC log in blocks; `bus` is the channel's number.

    `quality` and `advance`: see `read_text`. Raises UserError if the file is no ASC log.
    """
    state = new_record(_STATE)
    state["base"] = 16

    def parse(text: NDArray[np.uint8], *into: Any) -> tuple[int, int, bool]:
        return _parse_asc(text, state[0], *into)

    remedy = f"no frame in this ASC log; its lines look like {EXAMPLE}"
    return read_text(path, parse, _read_header(state), remedy, quality, advance)
