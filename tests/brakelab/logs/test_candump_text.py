"""Compiled candump lines against those of the recorder."""

import numpy as np

from brakelab.logs.candump_text import candump_text
from ecu.contract.records import FRAME, FRAME_EXTENDED, FRAME_FD, new_record
from ecu.recording.recorder import candump_lines


def test_lines_are_those_of_the_recorder():
    draw = np.random.default_rng(1)
    frames = new_record(FRAME, 2000)
    # From the first second on: as many digits as there are powers of ten
    frames["stamp_ns"] = np.sort(10.0 ** draw.uniform(0.0, 18.0, len(frames))).astype(np.int64)
    frames["stamp_ns"][:4] = 0, 999, 1_000_000_000, 9_999_999_999
    frames["flags"] = draw.choice([0, FRAME_EXTENDED, FRAME_FD, FRAME_EXTENDED | FRAME_FD], len(frames))
    frames["length"] = draw.choice([0, 1, 8, 64], len(frames))
    frames["data"] = draw.integers(0, 256, frames["data"].shape)
    extended = frames["flags"] & FRAME_EXTENDED > 0
    frames["can_id"] = np.where(
        extended, draw.integers(0, 1 << 29, len(frames)), draw.integers(0, 1 << 11, len(frames))
    )
    assert candump_text(frames, "vcan0") == candump_lines(frames, "vcan0")


def test_no_frames_are_no_lines():
    assert candump_text(new_record(FRAME, 0), "can0") == b""
