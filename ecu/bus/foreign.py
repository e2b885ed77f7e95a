"""Detection of a foreign sender of our frames, before the first frame is sent."""

import time
from typing import Final

from ecu.bus.protocol import Channel
from ecu.bus.transmit import TransmitPlan
from ecu.contract.records import EXTENDED_ID, FRAME, FRAME_EXTENDED, new_record
from ecu.errors import UserError

_AT_ONCE: Final = 1024
_DISCARD_S: Final = 0.5  # a bus too busy to be emptied in that time is listened to at once


def discard(channel: Channel) -> None:
    """Discard the frames waiting in the channel, which are outdated."""
    frames = new_record(FRAME, _AT_ONCE)
    end = time.monotonic() + _DISCARD_S
    while channel.drain(frames, 0) and time.monotonic() < end:
        pass


def listen_before_send(channel: Channel, where: str, plan: TransmitPlan, seconds: float) -> None:
    """Listen for a while and refuse to start if another node already sends one of our frames.

    Raises:
        UserError: a foreign sender was heard.
    """
    names = dict(zip(plan.ids.tolist(), plan.messages["name"].tolist(), strict=True))
    frames = new_record(FRAME, _AT_ONCE)
    end = time.monotonic() + seconds
    while True:
        count = channel.drain(frames, 0)
        for frame in frames[:count]:
            number = int(frame["can_id"]) | (EXTENDED_ID if frame["flags"] & FRAME_EXTENDED else 0)
            if number in names:
                raise UserError(
                    where,
                    f"frame {int(frame['can_id']):03X} ({names[number]})",
                    "someone else already sends it; stop the other sender first",
                )
        if time.monotonic() >= end and count < len(frames):
            return
        time.sleep(0.01)
