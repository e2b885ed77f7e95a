"""Quality of a CAN log of any format: damage that its reader meets, stamps that do not fit.

Readers hand over `FrameBlock`s. `checked` counts stamps that repeat or step back and gaps, leaves out the
single frame whose stamp is far from its neighbours (a flipped bit), and lets time go on where the clock was
set, back by more than a second or on by more than an hour. Of frames that stand twice the second is left out.
A log that is stored from its end is in memory as a whole.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.frames_twice import FEW, KEPT, MEMORY, OUTLIER, TWICE, begins_anew, stands_before
from ecu.contract.records import FRAME, RecordArray, new_record
from ecu.errors import UserError
from ecu.jit import Record, kernel

BLOCK_FRAMES: Final = 1 << 14  # 1.3 MB: they stay in the processor's cache until they are decoded
# A step of the clock beyond this is no gap in the drive but a wrong stamp or two logs in one file.
MAX_JUMP_NS: Final = 3_600_000_000_000
# Assumption: no adapter holds a frame back for longer; an older stamp comes from a clock that was set.
STEP_NS: Final = 1_000_000_000
_FARTHEST_NS: Final = 1 << 61  # the year 2043: sums of two such stamps are still numbers
_AHEAD: Final = 4096  # frames among which the next of the same interface is looked for

_STAMPS: Final = np.dtype(
    [
        ("started", "i8"),
        ("latest_ns", "i8"),
        ("backwards", "i8"),
        ("repeated", "i8"),
        ("gaps", "i8"),
        ("longest_ns", "i8"),
        ("longest_at", "i8"),  # index of the frame behind the longest gap, if it is in this block
        ("set", "i8"),
        ("set_ns", "i8"),  # by how much the clock was set first …
        ("set_at", "i8"),  # … and the index, if it is in this block
        ("twice", "i8"),
        ("again", "i8"),  # whether the log stands here a second time, up to …
        ("until_ns", "i8"),
        ("jump", "i8"),  # index of the frame of an interface whose clock is another from the beginning
        ("known", "i8", (256,)),  # by interface, as the two that follow
        ("last_ns", "i8", (256,)),
        ("shift_ns", "i8", (256,)),  # since its clock was set
    ]
)


def known_date(stamp_ns: int) -> int | None:
    """Return a date [ns] as it is, None where it lies beyond every stamp that a log may have."""
    return stamp_ns if abs(stamp_ns) <= _FARTHEST_NS else None


def set_by(seconds: float) -> str:
    """Return by how much a clock was set, in words."""
    return f"{'back' if seconds < 0.0 else 'on'} by {abs(seconds):.1f} s"


@dataclass
class Damage:
    """Unreadable parts of a log."""

    damaged: int = 0
    """Lines, objects or cells that were skipped."""
    first_damaged: str = ""
    """Place of the first of them."""
    cut: str = ""
    """Place and cause, if the end of the log is missing."""
    stamps_repeated: int = 0
    """Against the frame before on the same interface, or the row before."""
    backwards: bool = False
    """Whether it is stored from its end, and was read from there."""
    clock_set: int = 0
    """How often a clock (of frames: that of an interface) was: back by more than 1 s, on by more than 1 h."""
    first_set: str = ""
    """Place of the first of them, and by how much."""

    def note_damage(self, count: int, place: str) -> None:
        """Count damage whose first piece is at `place`."""
        if count:
            self.damaged += count
            self.first_damaged = self.first_damaged or place

    def note_clock(self, place: str, seconds: float) -> None:
        """Count a clock that was set by `seconds` at `place`."""
        self.clock_set += 1
        self.first_set = self.first_set or f"{place}, {set_by(seconds)}"


@dataclass
class SignalQuality(Damage):
    """Findings in a signal file."""

    rows: int = 0
    samples: int = 0
    unknown_columns: list[str] = field(default_factory=list)
    columns_twice: list[str] = field(default_factory=list)
    """Of those that are read, by the name of the first."""
    zero_ns: int | None = None
    """Date of t = 0 as Unix time, if the file says so."""
    rows_twice: int = 0
    """Rows that stand in the file a second time, and were left out."""


@dataclass
class LogQuality(Damage):
    """Errors found in a CAN log."""

    frames: int = 0
    stamps_backwards: int = 0
    """Against the frame before on the same interface."""
    frames_twice: int = 0
    """Frames that stand in the log a second time, and were left out."""
    gaps: int = 0
    """Times of more than a second without any frame."""
    longest_gap_s: float = 0.0
    longest_gap: str = ""
    """Place of the frame behind it."""


class FrameBlock(NamedTuple):
    """Frames in the order of the log."""

    frames: RecordArray
    """FRAME, shape (n,)."""
    places: NDArray[np.int64]
    """Where each stands in its file, in the reader's own unit, shape (n,)."""
    unit: str
    """Of `places`: line, byte, record."""


@kernel
def _next_on(frames: RecordArray, i: int) -> int:
    """Return the index of the next frame of the interface of frame `i`; -1: none is near, -2: none here."""
    end = min(len(frames), i + 1 + _AHEAD)
    for j in range(i + 1, end):
        if frames[j].bus == frames[i].bus:
            return j
    return -1 if end == i + 1 + _AHEAD else -2


@kernel
def _stamp(frames: RecordArray, i: int, state: Record) -> int:
    """Return the stamp of frame `i` on the clock that its interface had first."""
    stamp = min(max(frames[i].stamp_ns, -_FARTHEST_NS), _FARTHEST_NS)
    return int(stamp + state.shift_ns[frames[i].bus])


@kernel
def _check(
    frames: RecordArray,
    verdict: NDArray[np.uint8],
    first: RecordArray,
    before: RecordArray,
    state: Record,
    mended: bool,
    last: bool,
) -> int:
    """Judge frames until one whose verdict takes those of the next block (`last`: there is none).

    `first` are those of the log, `before` the last before these.
    """
    state.longest_at = state.set_at = state.jump = -1
    for i in range(len(frames)):
        bus = frames[i].bus
        stamp = _stamp(frames, i, state)
        past = state.last_ns[bus] if state.known[bus] else state.latest_ns
        step = stamp - past
        if mended and step <= 0 and state.known[bus]:
            if step < -STEP_NS and not state.again:
                if i + FEW > len(frames) and not last:
                    return i
                if begins_anew(frames, i, first):
                    state.again, state.until_ns = 1, state.latest_ns
            again = state.again and stamp <= state.until_ns
            if again or stands_before(frames, i, stamp, verdict, before):
                state.twice += 1
                verdict[i] = TWICE
                continue
        if mended and state.started and abs(step) > STEP_NS:
            follower = _next_on(frames, i)
            if follower == -2 and not last:
                return i
            alone = follower < 0
            goes_on = stamp if alone else _stamp(frames, follower, state)
            if abs(goes_on - past) <= STEP_NS < abs(goes_on - stamp):
                verdict[i] = OUTLIER
                continue
            if abs(step) > MAX_JUMP_NS:
                if alone or abs(goes_on - stamp) > MAX_JUMP_NS:
                    verdict[i] = OUTLIER
                    continue
                if not state.known[bus]:
                    state.jump = i
                    return i
            if (step < 0 or step > MAX_JUMP_NS) and state.known[bus]:
                if state.set == 0:
                    state.set_at, state.set_ns = i, step
                state.set += 1
                state.shift_ns[bus] -= step
                stamp = past
        if state.known[bus]:
            state.backwards += step < 0 and stamp != past
            state.repeated += step == 0
        silent = stamp - state.latest_ns
        if state.started and silent > STEP_NS:
            state.gaps += 1
            if silent > state.longest_ns:
                state.longest_ns, state.longest_at = silent, i
        if stamp > state.until_ns:
            state.again = 0
        state.latest_ns = max(stamp, state.latest_ns) if state.started else stamp
        state.last_ns[bus] = stamp
        state.known[bus] = state.started = 1
        frames[i].stamp_ns = stamp
    return len(frames)


def checked(
    path: Path, blocks: Iterator[FrameBlock], quality: LogQuality, mended: bool = True
) -> Iterator[RecordArray]:
    """Yield the frames of `blocks` whose stamps are possible; `quality` is kept up to date.

    `mended` is False for what the daemon recorded: it met the stamps as they are.

    Raises:
        UserError: two interfaces have clocks more than an hour apart.
    """
    state = new_record(_STAMPS)
    stamps = state[0]
    rest: FrameBlock | None = None
    first = before = np.empty(0, FRAME)
    for following in chain(blocks, [None]):
        block = _joined(rest, following)
        if block is None:
            return
        verdict = np.zeros(len(block.frames), np.uint8)
        judged = _check(block.frames, verdict, first, before, stamps, mended, following is None)
        if stamps["jump"] >= 0:
            raise UserError(
                str(path),
                _place(block, stamps["jump"]),
                "this interface's clock is more than an hour off the others'; give each a log of its own",
            )
        if stamps["set_at"] >= 0:
            quality.first_set = f"{_place(block, stamps['set_at'])}, {set_by(1e-9 * int(stamps['set_ns']))}"
        if stamps["longest_at"] >= 0:
            quality.longest_gap = _place(block, stamps["longest_at"])
            quality.longest_gap_s = round(1e-9 * int(stamps["longest_ns"]), 6)
        rest = FrameBlock(block.frames[judged:], block.places[judged:], block.unit)
        frames, verdict = block.frames[:judged], verdict[:judged]
        outliers = np.flatnonzero(verdict == OUTLIER)
        if len(outliers):
            quality.note_damage(len(outliers), _place(block, outliers[0]))
        kept = verdict == KEPT
        if not kept.all():
            frames = frames[kept]
        quality.stamps_backwards = int(stamps["backwards"])
        quality.stamps_repeated = int(stamps["repeated"])
        quality.frames_twice = int(stamps["twice"])
        first = np.concatenate([first, frames[: FEW - len(first)]])
        before = np.concatenate([before, frames[-MEMORY:]])[-MEMORY:]
        quality.clock_set, quality.gaps = int(stamps["set"]), int(stamps["gaps"])
        quality.frames += len(frames)
        if _falls(frames, quality) and not quality.backwards:
            quality.backwards, quality.frames = True, 0
            quality.damaged, quality.first_damaged = quality.damaged - len(outliers), ""
            turned = [FrameBlock(one.frames[::-1], one.places[::-1], one.unit) for one in (block, *blocks)]
            yield from checked(path, reversed(turned), quality, mended)
            return
        if len(frames):
            yield frames


def _falls(frames: RecordArray, quality: LogQuality) -> bool:
    """Return whether time falls from frame to frame in the first ones of a log."""
    first = quality.frames == len(frames) > FEW
    falls = first and 2 * quality.stamps_backwards > quality.frames
    return falls and bool(frames["stamp_ns"][-1] < frames["stamp_ns"][0])


def _joined(rest: FrameBlock | None, following: FrameBlock | None) -> FrameBlock | None:
    if rest is None or not len(rest.frames):
        return following
    if following is None:
        return rest
    frames, places = zip(rest[:2], following[:2], strict=True)
    return FrameBlock(np.concatenate(frames), np.concatenate(places), following.unit)


def _place(block: FrameBlock, index: int) -> str:
    return f"{block.unit} {block.places[index]}"
