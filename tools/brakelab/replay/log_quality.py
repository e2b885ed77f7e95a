"""What is wrong in a CAN log, whatever its format: damage that its reader meets, stamps that do not fit.

Readers hand over `FrameBlock`s. `checked` counts stamps that repeat or step back, leaves out the single
frame whose stamp is far from its neighbours (a flipped bit), and refuses a log whose clock jumps for good.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.errors import UserError
from ecu.jit import Record, kernel
from ecu.records import RecordArray, new_record

BLOCK_FRAMES: Final = 1 << 14  # 1.3 MB: they stay in the processor's cache until they are decoded
# A step of the clock beyond this is no gap in the drive but a wrong stamp or two logs in one file.
MAX_JUMP_NS: Final = 3_600_000_000_000

_STAMPS: Final = np.dtype(
    [
        ("started", "i8"),
        ("backwards", "i8"),
        ("repeated", "i8"),
        ("last_ns", "i8"),
        ("suspects", "i8"),
        ("suspect_ns", "i8"),
        ("jump", "i8"),  # index of the frame from which on the clock is another
        ("last_on_ns", "i8", (256,)),
    ]
)


@dataclass
class LogQuality:
    """What was found wrong in a CAN log."""

    frames: int = 0
    damaged: int = 0
    """Lines or objects that were skipped."""
    first_damaged: str = ""
    """Place of the first of them."""
    cut: str = ""
    """Place and cause, if the end of the log is missing."""
    stamps_backwards: int = 0
    """Against the frame before on the same interface, as `stamps_repeated`."""
    stamps_repeated: int = 0

    def note_damage(self, count: int, place: str) -> None:
        """Count damage whose first piece is at `place`."""
        if count:
            self.damaged += count
            self.first_damaged = self.first_damaged or place


class FrameBlock(NamedTuple):
    """Frames in the order of the log."""

    frames: RecordArray
    """FRAME, shape (n,)."""
    places: NDArray[np.int64]
    """Where each stands in its file, in the reader's own unit, shape (n,)."""
    unit: str
    """Of `places`: line, byte, record."""


@kernel
def _check(frames: RecordArray, kept: NDArray[np.bool_], state: Record) -> None:
    for i in range(len(frames)):
        stamp = frames[i].stamp_ns
        if state.started and abs(stamp - state.last_ns) > MAX_JUMP_NS:
            if state.suspects and abs(stamp - state.suspect_ns) <= MAX_JUMP_NS:
                state.jump = i
                return
            state.suspects, state.suspect_ns = 1, stamp
            kept[i] = False
            continue
        bus = frames[i].bus
        state.backwards += stamp < state.last_on_ns[bus]
        state.repeated += stamp == state.last_on_ns[bus]
        state.last_on_ns[bus] = state.last_ns = stamp
        state.started, state.suspects = 1, 0


def checked(path: Path, blocks: Iterator[FrameBlock], quality: LogQuality) -> Iterator[RecordArray]:
    """Yield the frames of `blocks` whose stamps are possible; `quality` is kept up to date.

    Raises:
        UserError: the clock jumps by more than an hour and stays there.
    """
    state = new_record(_STAMPS)
    state["last_on_ns"] = np.iinfo(np.int64).min
    state["jump"] = -1
    for block in blocks:
        kept = np.ones(len(block.frames), np.bool_)
        _check(block.frames, kept, state[0])
        jump = int(state[0]["jump"])
        if jump >= 0:
            raise UserError(
                str(path),
                f"{block.unit} {block.places[jump]}",
                "time jumps by more than an hour; mend it here or split the log",
            )
        outliers = np.flatnonzero(~kept)
        if len(outliers):
            quality.note_damage(len(outliers), f"{block.unit} {block.places[outliers[0]]}")
        quality.stamps_backwards = int(state[0]["backwards"])
        quality.stamps_repeated = int(state[0]["repeated"])
        frames = block.frames[kept] if len(outliers) else block.frames
        quality.frames += len(frames)
        if len(frames):
            yield frames
