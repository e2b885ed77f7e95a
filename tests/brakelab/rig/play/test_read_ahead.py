"""A second process reads ahead: every frame in order, findings at the end, errors where they were met."""

import os
import signal
import time
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from brakelab.replay.quality import Findings
from brakelab.rig.play.read_ahead import SLOT_FRAMES, SLOTS, ReadAhead
from ecu.contract.records import FRAME, RecordArray
from ecu.errors import RunFault, UserError

LOG = Path("drive.log")


def numbered(count: int, size: int, end: str, findings: Findings) -> Iterator[RecordArray]:
    """`count` frames in blocks of `size`, then `end`."""
    for first in range(0, count, size):
        frames = np.zeros(min(size, count - first), FRAME)
        frames["stamp_ns"] = np.arange(first, first + len(frames))
        yield frames
    findings.other_interfaces = count
    if end == "jumps":
        raise UserError("drive.log", "line 9", "time jumps")
    if end == "dies":
        os.kill(os.getpid(), signal.SIGKILL)


ALL = SLOTS * SLOT_FRAMES


@pytest.mark.parametrize(
    ("count", "size"), [(0, 1), (1, 1), (SLOT_FRAMES, 13), (SLOT_FRAMES + 1, 5000), (ALL + 3000, 16384)]
)
def test_every_frame_comes_once_and_in_order(count: int, size: int) -> None:
    with ReadAhead(partial(numbered, count, size, ""), Findings(LOG)) as ahead:
        stamps = [block["stamp_ns"].copy() for block in ahead]
    assert np.concatenate([[], *stamps]).tolist() == list(range(count))
    assert all(len(block) == SLOT_FRAMES for block in stamps[:-1])
    assert ahead.findings.other_interfaces == count


@pytest.mark.parametrize(("end", "error"), [("jumps", UserError), ("dies", RunFault)])
def test_what_was_read_before_an_error_is_played(end: str, error: type[Exception]) -> None:
    count = 2 * SLOT_FRAMES
    with ReadAhead(partial(numbered, count, 100, end), Findings(LOG)) as ahead:
        blocks = iter(ahead)
        assert [len(block) for block in islice(blocks, 2)] == [SLOT_FRAMES, SLOT_FRAMES]
        with pytest.raises(error, match=r"^drive\.log: (line 9: time jumps|the process that read it)"):
            next(blocks)


def test_a_reader_whom_nobody_wants_to_hear_is_gone_at_once() -> None:
    with ReadAhead(partial(numbered, 10 * ALL, 16384, ""), Findings(LOG)) as ahead:
        next(iter(ahead))
        begin = time.monotonic()
    assert not ahead._reader.is_alive()
    assert time.monotonic() - begin < 30.0
