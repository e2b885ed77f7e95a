"""Format of a log, by its name and its content, and a reader of its frames."""

import gzip
import re
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import numpy as np

from brakelab.logs.asc import read_asc
from brakelab.logs.blf import read_blf
from brakelab.logs.candump import read_candump
from brakelab.logs.log_quality import FrameBlock, LogQuality, checked
from brakelab.logs.mdf import holds_frames, read_mdf
from brakelab.logs.text_log import is_packed
from brakelab.logs.trc import read_trc
from ecu.contract.records import RecordArray
from ecu.errors import UserError
from ecu.settings.resources import regular

FORMATS: Final = (
    "candump .log, Vector .asc and .blf, PEAK .trc (text also with .gz), MDF4 .mf4 of frames or channels, "
    ".parquet, .csv, or the folder of a recording"
)
_NAMES: Final = {
    ".log": "a candump log",
    ".asc": "a Vector ASC log",
    ".trc": "a PEAK TRC log",
    ".blf": "a Vector BLF file",
    ".mf4": "an MDF file",
    ".parquet": "a Parquet file",
    ".csv": "a CSV file",
}
_TEXT: Final = (".log", ".asc", ".trc")
_HEAD: Final = 4096
_BEGINS: Final = (
    (re.compile(rb"LOGG"), ".blf"),
    (re.compile(rb"MDF     |UnFinMF "), ".mf4"),
    (re.compile(rb"PAR1"), ".parquet"),
    (re.compile(rb'"?Interval"?\|"ms"\|'), ".csv"),  # RaceCapture
    (re.compile(rb"\s*\(\d+\.\d+\) +\S+ +[0-9A-Fa-f]+#"), ".log"),
    (re.compile(rb"\s*(date |base +(hex|dec)|\d+\.\d+ +(\d+|CANFD) +\S+ )", re.IGNORECASE), ".asc"),
    (re.compile(rb"\s*(;|\d+\) +\d)"), ".trc"),
    (re.compile(rb"(\xef\xbb\xbf)?([\w\". -]+[,;\t])*\"?t\"?([,;\t]|\r?\n)"), ".csv"),
)

Advance = Callable[[int], None]


def format_of(path: Path) -> str:
    """Return the format of a log as the end of its name: a key of `_NAMES`.

    Raises:
        UserError: nothing that is read, or the name says otherwise than the content.
    """
    suffixes = [suffix.lower() for suffix in path.suffixes]
    packed_name = suffixes[-1:] == [".gz"]
    named = "".join(suffixes[-2:-1] if packed_name else suffixes[-1:])
    regular(path, "a log, or write it to one first")
    try:
        packed = is_packed(path)
        with path.open("rb") as plain:
            head = _head_of_packed(path) if packed else plain.read(_HEAD)
    except OSError as error:
        raise UserError(str(path), "", f"cannot be read ({error.strerror}); give a log that can") from None
    found = next((end for begin, end in _BEGINS if begin.match(head)), None)
    if not head and not packed and named in _NAMES:
        raise UserError(str(path), "line 1", f"the file is empty; it should be {_NAMES[named]}")
    if found and found not in _TEXT and packed:
        raise UserError(str(path), "", f"this is {_NAMES[found]} in gzip; unpack it with gunzip")
    if found and (found != named or packed > packed_name):
        ends = f"{found}.gz" if packed else found
        what = f"{_NAMES[found]} in gzip" if packed else _NAMES[found]
        raise UserError(str(path), "line 1", f"this is {what}; let its name end in {ends}")
    if packed_name and not packed and not found and named in _TEXT:
        remedy = "its name says gzip, its content does not; give the log as it was recorded"
        raise UserError(str(path), "byte 0", remedy)
    if named not in _NAMES or (packed_name and named not in _TEXT):
        raise UserError(
            str(path), "", f"unknown kind of log {path.suffix or '(no suffix)'}; replay reads {FORMATS}"
        )
    return named


def _head_of_packed(path: Path) -> bytes:
    try:
        with gzip.open(path) as stream:
            return stream.read(_HEAD)
    except (OSError, EOFError, zlib.error):
        return b""  # its reader will say where


def kind_of(path: Path) -> str:
    """Return "recording", "signals" or "frames". Raises UserError for what is not read."""
    if path.is_dir():
        return "recording"
    end = format_of(path)
    if end == ".mf4":
        return "frames" if holds_frames(path) else "signals"
    return "signals" if end in (".parquet", ".csv") else "frames"


def interface_name(channel: int) -> str:
    """Return the interface of a channel in formats that number theirs from 1: channel 1 is can0."""
    return f"can{channel - 1}" if channel else "channel0"


def read_frames(
    path: Path,
    interfaces: list[str],
    quality: LogQuality,
    advance: Advance | None = None,
    mended: bool = True,
) -> Iterator[RecordArray]:
    """Yield the frames of a log of any format in blocks of FRAME.

    A frame's `bus` is the place of its interface in `interfaces`, to which new names are added. `quality` is
    kept up to date; `advance(bytes)` hears of progress; `mended`: see `checked`. Raises UserError for a log
    that has no frame, and for a clock that jumps.
    """
    end = format_of(path)
    if end == ".log":
        return checked(path, read_candump(path, interfaces, quality, advance), quality, mended)
    if end in (".parquet", ".csv"):
        raise UserError(str(path), "", "holds signals that are decoded already; give a log of frames")
    read = {".asc": read_asc, ".trc": read_trc, ".blf": read_blf, ".mf4": read_mdf}[end]
    return checked(path, _named(read(path, quality, advance), interfaces), quality, mended)


def _named(blocks: Iterator[FrameBlock], interfaces: list[str]) -> Iterator[FrameBlock]:
    """Replace the channel numbers of `blocks` by places in `interfaces`."""
    places = np.full(256, -1, np.int16)
    for block in blocks:
        bus = block.frames["bus"]
        for channel in np.flatnonzero(np.bincount(bus, minlength=256)):
            if places[channel] < 0:
                name = interface_name(int(channel))
                if name not in interfaces:
                    interfaces.append(name)
                places[channel] = interfaces.index(name)
        block.frames["bus"] = places[bus]
        yield block
