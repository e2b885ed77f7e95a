"""Reads MDF4 with asammdf: CAN bus logging into frames, channels with the contract's names into signals.

A file that has a group with a channel `CAN_DataFrame` (ASAM MDF bus logging) holds frames; `CAN_RemoteFrame`
and `CAN_ErrorFrame` may stand beside it, each in groups of its own. Records are taken in windows, so that a
file of any length fits in memory, and the groups are merged by time. Stamps are rounded to whole
microseconds, as the ECU has them. `BusChannel` n becomes channel n; a file that has a channel 0 counts from 0
(python-can's writer does), and its n becomes channel n + 1.

asammdf is in an extra: where it is installed, `import can` takes longer (see `ecu/bus/__init__.py`).
"""

import gc
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.log_quality import BLOCK_FRAMES, FrameBlock, LogQuality
from brakelab.logs.text_log import FD_LENGTHS
from ecu.contract.records import FRAME, FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE, RecordArray
from ecu.errors import UserError

WINDOW: Final = 1 << 18  # records
AT_ONCE: Final = 1 << 20
"""Records of a group that is read in one piece, for which asammdf takes half the time."""
_FEW: Final = 1 << 10  # records, among which a file that counts from 0 shows it
_KINDS: Final = {"CAN_DataFrame": 0, "CAN_RemoteFrame": FRAME_REMOTE, "CAN_ErrorFrame": FRAME_ERROR}
_PLACED: Final = np.dtype([("frame", FRAME), ("place", "i8")])


class Column(Protocol):
    """The part of `asammdf.Signal` that is used."""

    samples: NDArray[Any]
    timestamps: NDArray[np.float64]
    invalidation_bits: NDArray[np.bool_] | None


class Measurement:
    """The part of `asammdf.MDF` that is used; it has no useful types."""

    def __init__(self, path: Path) -> None:
        """Raises UserError if asammdf is not installed or cannot read the file."""
        try:
            from asammdf import MDF
        except ImportError:
            raise UserError(str(path), "", "MDF4 needs asammdf: pip install asammdf") from None
        self._read: Any = None
        self._wanted: tuple[int, int, int, int, bool] | None = None
        logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # the same, in one line, comes from here
        # Where its constructor fails its destructor does so too, and Python would print that.
        hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
        try:
            try:
                measurement: Any = MDF
                self._mdf: Any = measurement(path, process_bus_logging=False)
                return
            except Exception as error:  # a damaged file makes it raise anything
                reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            gc.collect()
        finally:
            sys.unraisablehook = hook
        raise UserError(
            str(path), "", f"no readable MDF4 file ({reason}); save it again where it was recorded"
        )

    def channels(self) -> Iterator[tuple[str, int, int]]:
        """Yield name, group and place in it of every channel."""
        for group, content in enumerate(self._mdf.groups):
            for index, channel in enumerate(content.channels):
                yield str(channel.name), group, index

    def unit(self, group: int, index: int) -> str:
        """Return the unit of a channel as the file spells it, empty: it has none."""
        channel = self._mdf.groups[group].channels[index]
        own = getattr(channel, "unit", "") or getattr(getattr(channel, "conversion", None), "unit", "")
        return str(own or "")

    def rows(self, group: int) -> int:
        """Return how many records a group has."""
        return int(self._mdf.groups[group].channel_group.cycles_nr)

    def is_plain(self, group: int, prefix: str) -> bool:
        """Return whether all channels with this prefix lie on whole bytes."""
        channels = [c for c in self._mdf.groups[group].channels if str(c.name).startswith(prefix)]
        return all(not c.bit_offset and c.bit_count % 8 == 0 for c in channels)

    def master(self, group: int) -> int | None:
        """Return the place of the time channel."""
        return cast("int | None", self._mdf.masters_db.get(group))

    def column(self, group: int, index: int, first: int, count: int, raw: bool) -> Column:
        """Return records `first` to `first + count` of a channel, `raw`: without its conversion.

        What was read last is not read again.
        """
        wanted = group, index, first, count, raw
        if wanted != self._wanted:
            self._read, self._wanted = (
                self._mdf.get(
                    group=group,
                    index=index,
                    raw=raw,
                    record_offset=first,
                    record_count=None if first == 0 and count >= self.rows(group) else count,
                    ignore_invalidation_bits=True,
                ),
                wanted,
            )
        return cast(Column, self._read)

    def start_ns(self) -> int:
        """Return the start of the measurement as Unix time [ns], whole microseconds."""
        start = self._mdf.start_time
        seconds = int(start.replace(microsecond=0).timestamp())
        return seconds * 1_000_000_000 + int(start.microsecond) * 1000

    def close(self) -> None:
        """Close the file."""
        self._mdf.close()


@cache
def _holds_frames(path: Path, changed_ns: int) -> bool:
    measurement = Measurement(path)
    try:
        return any(name in _KINDS for name, _, _ in measurement.channels())
    finally:
        measurement.close()


def holds_frames(path: Path) -> bool:
    """Return whether an MDF4 file holds frames, not channels. Raises UserError if it cannot be read."""
    return _holds_frames(path, path.stat().st_mtime_ns)


def in_step(
    sources: Sequence[Iterator[RecordArray]], stamps: Callable[[RecordArray], NDArray[Any]]
) -> Iterator[list[tuple[int, RecordArray]]]:
    """Yield the records of several sources up to common times, one after the other: (source, its records).

    `stamps` gives the times of records; where they fall within a source, its order is kept.
    """
    waiting = [next(source, None) for source in sources]
    while True:
        rising = [None if block is None else np.maximum.accumulate(stamps(block)) for block in waiting]
        latest = [times[-1] for times in rising if times is not None]
        if not latest:
            return
        horizon = min(latest)
        ready = []
        for place, (block, times) in enumerate(zip(waiting, rising, strict=True)):
            if block is None or times is None:
                continue
            count = int(np.searchsorted(times, horizon, "right"))
            if count:
                ready.append((place, block[:count]))
            waiting[place] = block[count:] if count < len(block) else next(sources[place], None)
        yield ready


def read_mdf(
    path: Path, quality: LogQuality, advance: Callable[[int], None] | None = None
) -> Iterator[FrameBlock]:
    """Yield the frames of an MDF4 bus logging file in blocks; `bus` is the channel's number.

    `quality` is kept up to date; `advance(bytes)` hears of progress. Raises UserError where there
    is no frame.
    """
    measurement = Measurement(path)
    groups = [
        (group, index, name)
        for name, group, index in measurement.channels()
        if name in _KINDS and measurement.rows(group)
    ]
    total = sum(measurement.rows(group) for group, _, _ in groups)
    shift = int(_counts_from_zero(measurement, groups))
    sources = [_frames(measurement, *group, shift, quality) for group in groups]
    read = 0
    try:
        for block in sources[0] if len(sources) == 1 else _merged(sources):
            read += len(block.frames)
            if advance:
                advance(path.stat().st_size * len(block.frames) // total)
            yield block
    finally:
        measurement.close()
    if not read:
        raise UserError(
            str(path), quality.cut or "CAN_DataFrame", "no frame in this MDF4 file; record it again"
        )


def _merged(sources: Sequence[Iterator[FrameBlock]]) -> Iterator[FrameBlock]:
    """Yield the frames of several groups by time."""

    def placed(block: FrameBlock) -> RecordArray:
        records = np.empty(len(block.frames), _PLACED)
        records["frame"], records["place"] = block.frames, block.places
        return records

    each = [map(placed, source) for source in sources]
    for ready in in_step(each, lambda block: block["frame"]["stamp_ns"]):
        merged = ready[0][1]
        if len(ready) > 1:
            merged = np.concatenate([block for _, block in ready])
            rising = [np.maximum.accumulate(block["frame"]["stamp_ns"]) for _, block in ready]
            merged = merged[np.argsort(np.concatenate(rising), kind="stable")]
        yield FrameBlock(np.ascontiguousarray(merged["frame"]), merged["place"], "record")


def _counts_from_zero(measurement: Measurement, groups: Sequence[tuple[int, int, str]]) -> bool:
    """Return whether any frame is on channel 0; looked for until the first one."""
    for group, index, kind in groups:
        bus = f"{kind}.BusChannel"
        places = [place for name, of, place in measurement.channels() if (of, name) == (group, bus)]
        rows = measurement.rows(group)
        windows = [(0, _FEW), *((first, WINDOW) for first in range(_FEW, rows, WINDOW))]
        at_once = rows <= AT_ONCE and measurement.is_plain(group, f"{kind}.")
        for first, count in ([(0, AT_ONCE)] if at_once else windows) if places else ():
            try:
                column = measurement.column(group, index if at_once else places[0], first, count, raw=True)
            except Exception:  # a damaged file makes asammdf raise anything; `_frames` tells where
                break
            if ((column.samples[bus] if at_once else column.samples) == 0).any():
                return True
    return False


def _frames(
    measurement: Measurement, group: int, index: int, kind: str, shift: int, quality: LogQuality
) -> Iterator[FrameBlock]:
    """Yield the frames of a group; `shift` is added to the number of a channel."""
    places = {
        name.partition(".")[2]: place
        for name, of, place in measurement.channels()
        if of == group and name.startswith(f"{kind}.")
    }
    plain = measurement.is_plain(group, f"{kind}.")
    start_ns = measurement.start_ns()
    rows = measurement.rows(group)
    window = AT_ONCE if rows <= AT_ONCE else WINDOW
    for first in range(0, rows, window):
        try:
            if plain:
                whole = measurement.column(group, index, first, window, raw=True)
                stamps = whole.timestamps
                columns = {
                    name: whole.samples[f"{kind}.{name}"]
                    for name in places
                    if f"{kind}.{name}" in (whole.samples.dtype.names or ())
                }
            else:
                parts = {
                    name: measurement.column(group, place, first, window, raw=True)
                    for name, place in places.items()
                }
                stamps = parts["ID"].timestamps
                columns = {name: part.samples for name, part in parts.items()}
        except Exception as error:  # a damaged file makes asammdf raise anything
            quality.cut = f"record {first} of group {group}: cannot be read ({error}), the rest is missing"
            return
        if len(stamps) < min(window, rows - first):
            end = first + len(stamps)
            quality.cut = f"record {end} of group {group}: {rows - end} records are missing"
        for begin in range(0, len(stamps), BLOCK_FRAMES):
            part = slice(begin, begin + BLOCK_FRAMES)
            frames = np.zeros(len(stamps[part]), FRAME)
            frames["stamp_ns"] = start_ns + np.rint(stamps[part] * 1e6).astype(np.int64) * 1000
            _fill(frames, {name: column[part] for name, column in columns.items()}, _KINDS[kind])
            frames["bus"] += shift if "BusChannel" in columns else 0
            records = np.arange(first + begin, first + begin + len(frames))
            yield FrameBlock(frames, records, "record")
        if quality.cut:
            return


def _fill(frames: RecordArray, columns: dict[str, NDArray[Any]], kind: int) -> None:
    """Write the fields that bus logging has of each frame; `kind`: type of all of them."""

    def flag(name: str) -> NDArray[np.bool_]:
        return columns[name].astype(np.int64) != 0 if name in columns else np.zeros(len(frames), np.bool_)

    number = columns["ID"].astype(np.int64) if "ID" in columns else np.zeros(len(frames), np.int64)
    frames["can_id"] = number & 0x1FFFFFFF
    extended = flag("IDE") | (number & 0x80000000 != 0)
    frames["flags"] = kind | FRAME_EXTENDED * extended | FRAME_FD * flag("EDL")
    frames["bus"] = columns["BusChannel"].astype(np.int64) & 0xFF if "BusChannel" in columns else 1
    data = columns.get("DataBytes", np.zeros((len(frames), 0), np.uint8))
    if data.ndim == 1:  # bytes of one length as a word each
        data = np.ascontiguousarray(data).view(np.uint8).reshape(len(frames), -1)
    width = data.shape[1]
    if "DataLength" in columns:
        length = columns["DataLength"].astype(np.int64)
    elif "DLC" in columns:
        length = FD_LENGTHS[columns["DLC"].astype(np.int64) & 0x0F]
    else:
        length = np.full(len(frames), width)
    frames["length"] = np.clip(length, 0, 64 if kind else min(width, 64))
    width = min(width, 64)
    payload = f"V{width}"  # copied as one piece, not byte by byte
    if width:
        frames["data"][:, :width].view(payload)[:] = data[:, :width].view(payload)
    if len(frames) and frames["length"].min() < width:
        beyond = np.arange(width) >= frames["length"][:, np.newaxis]
        frames["data"][:, :width][beyond] = 0
