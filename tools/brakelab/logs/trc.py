"""Reads PEAK TRC text, versions 1.0 to 2.1: comments behind semicolons, then one line per message.

    ;$FILEVERSION=2.1
    ;$STARTTIME=43008.920986006946
    ;$COLUMNS=N,O,T,B,I,d,R,L,D
          1      1059.900 DT  1     0300 Rx -  7    00 00 00 00 04 00 00

The columns are fixed for each version before 2.0:

    1.0  N) O       ID   L D…            1.2  N) O  B  Rx  ID   L D…
    1.1  N) O  Rx   ID   L D…            1.3  N) O  B  Rx  ID - L D…

O: ms since the start, B: bus, T or Rx: type, L: data length code, l: bytes. `STARTTIME` counts days from
30 December 1899 in local time; version 1.0 has a comment `Start time: 11.09.2002 16:00:20.682` instead.
Bus n becomes interface number n, without such a column 1.
"""

import re
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta
from decimal import Decimal
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
from ecu.errors import UserError
from ecu.jit import Record, kernel

EXAMPLE: Final = "1  1059.900 DT  1  0300 Rx -  7  00 00 00 00 04 00 00"
_COLUMNS: Final = {"1.0": "NOIlD", "1.1": "NOTIlD", "1.2": "NOBTIlD", "1.3": "NOBTIRlD"}
_KINDS: Final = "NOTBIdRLlD"
_MOST_COLUMNS: Final = 12
_STATE: Final = np.dtype(
    [("start_ns", "i8"), ("columns", "i8", (_MOST_COLUMNS,)), ("count", "i8"), ("old", "i8")]
)
_DATE: Final = re.compile(
    r"(?:(?P<d>\d+)\.(?P<m>\d+)\.(?P<y>\d{4})|(?P<iso>\d{4}-\d\d-\d\d))\s+(?P<t>\d+:\d\d:\d\d)(?P<f>\.\d+)?"
)
_N, _O, _T, _B, _I, _D, _R, _L, _BYTES, _DATA = range(len(_KINDS))


def days_ns(days: str) -> int | None:
    """Return days since 30 December 1899, local time, as Unix time [ns]; None: no number."""
    try:
        whole, rest = divmod(Decimal(days) * 86_400, 1)
        start = datetime(1899, 12, 30) + timedelta(seconds=int(whole))
        # A date of this size has 16 digits at most, the last of them about a microsecond.
        return known_date(int(start.timestamp()) * 1_000_000_000 + round(rest * 1_000_000) * 1000)
    except (ArithmeticError, ValueError, OSError):
        return None


def date_ns(text: str) -> int | None:
    """Return the date of a comment such as `11.09.2002 16:00:20.682`, local time, as Unix time [ns]."""
    found = _DATE.search(text)
    if not found:
        return None
    day = found["iso"] or f"{found['y']}-{int(found['m']):02d}-{int(found['d']):02d}"
    try:
        seconds = int(datetime.strptime(f"{day} {found['t']}", "%Y-%m-%d %H:%M:%S").timestamp())
    except (ValueError, OverflowError):
        return None
    return known_date(seconds * 1_000_000_000 + int((found["f"] or ".0")[1:].ljust(9, "0")[:9]))


def _set_columns(state: RecordArray, names: str) -> None:
    row = state[0]
    row["count"] = len(names)
    row["columns"][: len(names)] = [_KINDS.find(name) for name in names]


def _read_header(path: Path, state: RecordArray) -> Callable[[str], bool]:
    def header(line: str) -> bool:
        key, _, value = line.partition("=")
        row = state[0]
        if key == ";$FILEVERSION":
            version = value.strip()
            row["old"] = version in _COLUMNS
            if row["old"]:
                _set_columns(state, _COLUMNS[version])
            elif version not in ("2.0", "2.1"):
                raise UserError(str(path), "FILEVERSION", f"{version} is not known; save it as 2.1 or older")
        elif key == ";$STARTTIME":
            row["start_ns"] = days_ns(value.strip()) or 0
        elif key == ";$COLUMNS":
            names = value.replace(" ", "").replace(",", "")
            missing = [name for name in "OTID" if name not in names]
            if missing or len(names) > _MOST_COLUMNS or not {"l", "L"} & set(names):
                raise UserError(str(path), "COLUMNS", f"{value.strip()}: O, T, I, D and l or L are needed")
            _set_columns(state, names)
        elif "Start time:" in line and not row["start_ns"]:
            row["start_ns"] = date_ns(line) or 0
        return line.startswith(";")

    return header


@kernel
def _payload(
    text: NDArray[np.uint8], at: int, end: int, length: int, frame: Record, data: NDArray[np.uint8]
) -> int:
    """Parse the bytes of a message, or the word that stands in their place."""
    last = word_end(text, at, end)
    if is_word(text, at, last, b"rtr"):
        frame.flags |= FRAME_REMOTE
        return DATA
    if is_word(text, at, last, b"error"):
        frame.flags = FRAME_ERROR
        return DATA
    for i in range(length):
        value = number(text, at, last, 16) if last - at == 2 else -1
        if value < 0:
            return DAMAGED
        data[i] = value
        at = skip_blanks(text, last, end)
        last = word_end(text, at, end)
    return DATA


@kernel
def _type(text: NDArray[np.uint8], at: int, end: int, old: bool, frame: Record) -> int:
    """Note the type of message."""
    if old:
        if is_word(text, at, end, b"rx") or is_word(text, at, end, b"tx"):
            return DATA
        if is_word(text, at, end, b"error"):
            frame.flags |= FRAME_ERROR
            return DATA
        return SKIPPED if is_word(text, at, end, b"warng") else DAMAGED
    if end - at != 2:
        return DAMAGED
    if is_word(text, at, end, b"dt"):
        return DATA
    first, second = text[at] | 0x20, text[at + 1] | 0x20
    if (first == 0x66 and (second == 0x64 or second == 0x62 or second == 0x65)) or (
        first == 0x62 and second == 0x69
    ):  # FD, FB (bit rate switched), FE (and error passive), BI (error passive)
        frame.flags |= FRAME_FD
        return DATA
    if is_word(text, at, end, b"rr"):
        frame.flags |= FRAME_REMOTE
        return DATA
    if is_word(text, at, end, b"er"):
        frame.flags |= FRAME_ERROR
        return DATA
    # States of the controller, its error counters, events
    return SKIPPED if first == 0x65 or is_word(text, at, end, b"st") else DAMAGED


@kernel
def _parse_line(
    text: NDArray[np.uint8], at: int, end: int, state: Record, frame: Record, data: NDArray[np.uint8]
) -> int:
    at = skip_blanks(text, at, end)
    if at == end:
        return SKIPPED
    if text[at] == 0x3B:
        return HEADER
    frame.flags, frame.bus, frame.length, frame.can_id = 0, 1, 0, 0
    length: Any = np.int64(-1)
    for column in range(state.count):
        kind = state.columns[column]
        at = skip_blanks(text, at, end)
        last = word_end(text, at, end)
        if kind == _DATA:
            if frame.flags & FRAME_ERROR:
                return DATA  # what follows is about the error
            if frame.flags & FRAME_REMOTE:
                frame.length = max(length, 0)
                return DATA
            if length < 0 or length > (64 if frame.flags & FRAME_FD else 8) or not IS_FD_LENGTH[length]:
                return DAMAGED
            frame.length = length
            return _payload(text, at, end, length, frame, data)
        if at == end:
            return DAMAGED
        if kind == _O:
            stamp = decimal(text, at, last, 6)
            if stamp < 0:
                return DAMAGED
            frame.stamp_ns = state.start_ns + stamp
        elif kind == _T:
            found = _type(text, at, last, state.old != 0, frame)
            if found != DATA:
                return found
        elif kind == _B:
            bus = number(text, at, last, 10)
            if not 0 <= bus <= 255:
                return DAMAGED
            frame.bus = bus
        elif kind == _I:
            if last - at == 8 and is_word(text, at, last, b"ffffffff"):
                return SKIPPED  # version 1.0: a warning
            value = number(text, at, last, 16)
            extended = last - at > 4
            if not frame.flags & FRAME_ERROR:
                if value < 0 or value > (0x1FFFFFFF if extended else 0x7FF):
                    return DAMAGED
                frame.can_id = value
                frame.flags |= FRAME_EXTENDED if extended else 0
        elif kind == _L:
            code = number(text, at, last, 10)
            if not 0 <= code <= 15:
                return DAMAGED
            length = FD_LENGTHS[code] if frame.flags & FRAME_FD else min(code, 8)
        elif kind == _BYTES:
            length = number(text, at, last, 10)
        at = last
    return DAMAGED


@kernel
def _parse_trc(
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


def read_trc(
    path: Path, quality: LogQuality, advance: Callable[[int], None] | None = None
) -> Iterator[FrameBlock]:
    """Yield the frames of a PEAK TRC log in blocks; `bus` is the number of its bus.

    `quality` and `advance`: see `read_text`. Raises UserError if the file is no TRC log.
    """
    state = new_record(_STATE)
    state["old"] = 1
    _set_columns(state, _COLUMNS["1.0"])  # which has no line that says so

    def parse(text: NDArray[np.uint8], *into: Any) -> tuple[int, int, bool]:
        return _parse_trc(text, state[0], *into)

    remedy = f"no message in this TRC log; its lines look like {EXAMPLE}"
    return read_text(path, parse, _read_header(path, state), remedy, quality, advance)
