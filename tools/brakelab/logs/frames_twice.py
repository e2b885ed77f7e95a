"""Frames that stand in a log twice: of two loggers that wrote one file, or of a log put behind itself.

Two loggers on one machine stamp a frame alike, and write by blocks. A frame whose stamp is not new is looked
for among those before it, back to an older stamp. A log that begins anew stands twice up to its last stamp.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ecu.contract.records import RecordArray
from ecu.jit import Record, kernel

MEMORY: Final = 4096  # frames among which one is looked for
FEW: Final = 10  # frames by which the begin of a log is known
KEPT, OUTLIER, TWICE = range(3)  # what becomes of a frame


@kernel
def _alike(one: Record, other: Record) -> bool:
    if one.can_id != other.can_id or one.flags != other.flags or one.bus != other.bus:
        return False
    alike = one.length == other.length
    for k in range(one.length):
        alike = alike and one.data[k] == other.data[k]
    return alike


@kernel
def stands_before(
    frames: RecordArray, i: int, stamp: int, verdict: NDArray[np.uint8], before: RecordArray
) -> bool:
    """Return whether frame `i`, of `stamp`, is among those of this block that are kept, or in `before`."""
    for back in range(min(MEMORY, i + len(before))):
        j = i - 1 - back
        if j >= 0 and verdict[j] != KEPT:
            continue
        other = frames[j] if j >= 0 else before[len(before) + j]
        if other.bus != frames[i].bus:
            continue
        if other.stamp_ns < stamp:
            return False
        if other.stamp_ns == stamp and _alike(frames[i], other):
            return True
    return False


@kernel
def begins_anew(frames: RecordArray, i: int, first: RecordArray) -> bool:
    """Return whether the first frames of the log stand again from frame `i` on."""
    if len(first) < FEW or len(frames) < i + FEW:
        return False
    for k in range(FEW):
        if frames[i + k].stamp_ns != first[k].stamp_ns or not _alike(frames[i + k], first[k]):
            return False
    return True
