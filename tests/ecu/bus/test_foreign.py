"""Whether somebody else already sends what we would."""

from contextlib import nullcontext

import pytest

from ecu.bus import foreign
from ecu.bus.foreign import another_ecu_speaks, discard, listen_before_send
from ecu.bus.transmit import contract_transmit_plan, frame_buffer
from ecu.contract.records import FRAME_EXTENDED
from ecu.errors import UserError
from ecu.settings.resources import resource

from .conftest import p01_protect

PLAN = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "BrakeEcu")
DEMAND = int(PLAN.ids[0])
UNPROTECTED = [int(place) for place in (PLAN.messages["data_id"] == 0).nonzero()[0]]
STATUS = int(PLAN.ids[UNPROTECTED[0]])


class Bus:
    """Frames (identifier, flags) by the time [s] at which they come; a sleep lasts `late_s` at least."""

    def __init__(self, monkeypatch, frames, late_s=0.0):
        self.now_s, self.frames, self.late_s = 0.0, sorted(frames), late_s
        monkeypatch.setattr(foreign.time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(foreign.time, "sleep", self.sleep)

    def sleep(self, seconds):
        self.now_s += max(seconds, self.late_s)

    def drain(self, frames, start):
        count = 0
        while self.frames and self.frames[0][0] <= self.now_s and start + count < len(frames):
            frame, (at_s, identifier, flags) = frames[start + count], self.frames.pop(0)
            frame["stamp_ns"], frame["can_id"], frame["flags"] = round(1e9 * at_s), identifier, flags
            count += 1
        return count


def each(period_s, identifier=DEMAND, flags=0, begin_s=0.001):
    return [(begin_s + k * period_s, identifier, flags) for k in range(round((1.0 - begin_s) / period_s))]


# frames (time, identifier, flags) -> how many are stray, None: they keep us from sending
HEARD = {
    "silence": ([], 0),
    "the vehicle": (each(0.01, 0x123), 0),
    "one frame": ([(0.5, DEMAND, 0)], 1),
    "a frame in the last moment": ([(0.98, DEMAND, 0)], 1),
    "four frames": (each(0.25), 4),
    "five frames": (each(0.2), None),
    "a demand each 10 ms": (each(0.01), None),
    "one that began late": (each(0.01, begin_s=0.94), None),
    "a status each 100 ms": (each(0.1, STATUS), None),
    "a hundred at once": ([(0.5, DEMAND, 0)] * 100, 100),
    "one of each of ours": ([(0.1 * k, int(PLAN.ids[k]), 0) for k in range(5)], 4),
    "the same number with 29 bits": (each(0.01, DEMAND, FRAME_EXTENDED), 0),
    "demands before we listen": ([(0.0, DEMAND, 0)] * 3000, 0),
    "before and after": ([(0.0, DEMAND, 0), *each(0.01, begin_s=0.3)], None),
}


@pytest.mark.parametrize(("frames", "stray"), HEARD.values(), ids=HEARD)
def test_only_who_sends_again_and_again_while_we_listen_keeps_us_away(monkeypatch, frames, stray):
    bus = Bus(monkeypatch, frames)
    discard(bus)
    with pytest.raises(UserError, match="someone else already sends it") if stray is None else nullcontext():
        assert listen_before_send(bus, "x", PLAN, 1.0) == stray
    assert stray is None or bus.now_s >= 1.0


def test_a_machine_that_sleeps_for_a_second_hears_as_much(monkeypatch):
    with pytest.raises(UserError, match="someone else already sends it"):
        listen_before_send(Bus(monkeypatch, each(0.05), late_s=2.0), "x", PLAN, 1.0)


def burst(*places, counter=0, spoil=None):
    """Frames of the messages at `places`, protected as ours; `spoil` changes them."""
    frames = frame_buffer(PLAN)
    for frame, place in zip(frames, places, strict=False):
        message = PLAN.messages[place]
        frame["can_id"], frame["length"] = message["id"], message["length"]
        frame["data"][2:8] = range(6)
        if message["data_id"]:
            p01_protect(frame["data"], int(message["length"]), int(message["data_id"]), counter)
    if spoil is not None:
        spoil(frames)
    return frames, len(places)


def spoil_crc(frames):
    frames["data"][:, 0] ^= 1


def shorten(frames):
    frames["length"] = 7


def extend(frames):
    frames["flags"] = FRAME_EXTENDED


# messages that come, and what is wrong with them -> whether another ECU speaks
SPEAKS = {
    "all four demands": (burst(0, 1, 2, 3), True),
    "two of them, others between": (burst(0, 0, 0, 1), True),
    "one demand, even often": (burst(0, 0, 0, 0), False),
    "wrong checksums": (burst(0, 1, 2, 3, spoil=spoil_crc), False),
    "wrong lengths": (burst(0, 1, 2, 3, spoil=shorten), False),
    "29 bits": (burst(0, 1, 2, 3, spoil=extend), False),
    "unprotected ones": (burst(*UNPROTECTED), False),
    "one intact among garbage": (burst(0, 1, 2, 3, spoil=lambda frames: spoil_crc(frames[1:])), False),
    "nothing": (burst(), False),
}


@pytest.mark.parametrize(("heard", "speaks"), SPEAKS.values(), ids=SPEAKS)
@pytest.mark.requirement("REQ-TWO-6")
def test_another_ecu_is_known_by_intact_frames_of_two_messages(heard, speaks):
    assert another_ecu_speaks(PLAN, *heard) is speaks
