"""Other senders of our frames: one that sends before we do, and frames by which another ECU is known.

A stray frame is no sender. Before the first frame is sent, one counts who sends an identifier of ours again
and again, whatever it holds: two such senders destroy each other's frames. Later, when braking depends on it,
only another ECU does: intact frames of two of our messages at a time, which garbage is not even by chance.
"""

import math
import time
from typing import Any, Final

import numpy as np

from ecu.bus.e2e import NO_CHECKSUM, checksum_holds
from ecu.bus.protocol import Channel
from ecu.bus.transmit import TransmitPlan
from ecu.contract.records import EXTENDED_ID, FRAME, FRAME_EXTENDED, new_record
from ecu.errors import UserError
from ecu.jit import Record, kernel

_AT_ONCE: Final = 1024
_DISCARD_S: Final = 0.5  # a bus too busy to be emptied in that time is listened to at once
_LOOK_S: Final = 0.01
SENDS: Final = 5
"""Frames of one identifier that make a sender; those stamped within `_APART_NS` are one."""
_APART_NS: Final = 5_000_000
KNOWN_BY: Final = 2
"""Messages of ours by which another ECU is known."""


@kernel
def place_of_ours(plan: TransmitPlan, frame: Record) -> int:
    """Return the message of `plan` that has the frame's identifier, -1: none."""
    identifier = np.int64(frame.can_id) | (EXTENDED_ID if frame.flags & FRAME_EXTENDED else 0)
    for place in range(len(plan.ids)):
        if plan.ids[place] == identifier:
            return place
    return -1


@kernel
def is_intact(plan: TransmitPlan, place: int, frame: Record) -> bool:
    """Return whether a frame of our message at `place` is protected as ours are."""
    message = plan.messages[place]
    if message.rule == NO_CHECKSUM or frame.length != message.length:
        return False
    can_id: Any = np.int64(frame.can_id)
    return checksum_holds(message.rule, frame.data, frame.length, can_id, message.data_id)


@kernel
def another_ecu_speaks(plan: TransmitPlan, frames: Any, count: int) -> bool:
    """Return whether intact frames of two of our messages are among `frames[:count]`."""
    first = -1
    for i in range(count):
        place = place_of_ours(plan, frames[i])
        if place < 0 or place == first or not is_intact(plan, place, frames[i]):
            continue
        if first >= 0:
            return True
        first = place
    return False


def discard(channel: Channel) -> None:
    """Discard the frames waiting in the channel, which are outdated."""
    frames = new_record(FRAME, _AT_ONCE)
    end = time.monotonic() + _DISCARD_S
    while channel.drain(frames, 0) and time.monotonic() < end:
        pass


def listen_before_send(channel: Channel, where: str, plan: TransmitPlan, seconds: float) -> int:
    """Listen for a while and refuse to start if another node already sends one of our frames.

    Returns the number of stray frames with an identifier of ours.

    Raises:
        UserError: a foreign sender was heard.
    """
    frames = new_record(FRAME, _AT_ONCE)
    sends, last_ns = np.zeros(len(plan.ids), np.int64), np.full(len(plan.ids), -math.inf)
    end, stray = time.monotonic() + seconds, 0
    while True:
        count = channel.drain(frames, 0)
        heard = frames["can_id"][:count] | np.where(frames["flags"][:count] & FRAME_EXTENDED, EXTENDED_ID, 0)
        ours = np.isin(heard, plan.ids)
        stray += int(ours.sum())
        for frame in frames[:count][ours]:
            place = place_of_ours(plan, frame)
            if frame["stamp_ns"] - last_ns[place] >= _APART_NS:
                sends[place], last_ns[place] = sends[place] + 1, frame["stamp_ns"]
        if sends.max() >= SENDS:
            sent = plan.messages[int(sends.argmax())]
            raise UserError(
                where,
                f"frame {int(sent['id']):03X} ({sent['name']})",
                "someone else already sends it; stop the other sender first",
            )
        if time.monotonic() >= end and count < len(frames):
            return stray
        time.sleep(_LOOK_S)
