"""Whether somebody else already sends what we would."""

from contextlib import nullcontext

import pytest

from ecu.bus import foreign
from ecu.bus.foreign import discard, listen_before_send
from ecu.bus.transmit import contract_transmit_plan
from ecu.contract.records import FRAME_EXTENDED
from ecu.errors import UserError
from ecu.settings.resources import resource

PLAN = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "BrakeEcu")
DEMAND = int(PLAN.ids[0])


class Bus:
    """Frames (identifier, flags) by the time [s] at which they can be read; time passes in sleep."""

    def __init__(self, monkeypatch, frames):
        self.now_s, self.frames = 0.0, sorted(frames)
        monkeypatch.setattr(foreign.time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(foreign.time, "sleep", self.sleep)

    def sleep(self, seconds):
        self.now_s += seconds

    def drain(self, frames, start):
        count = 0
        while self.frames and self.frames[0][0] <= self.now_s and start + count < len(frames):
            _, frames["can_id"][start + count], frames["flags"][start + count] = self.frames.pop(0)
            count += 1
        return count


# frames (time, identifier, flags) -> whether they keep us from sending
HEARD = {
    "silence": ([], False),
    "the vehicle": ([(0.5, 0x123, 0)], False),
    "a demand in the last moment": ([(0.98, DEMAND, 0)], True),
    "the same number with 29 bits": ([(0.5, DEMAND, FRAME_EXTENDED)], False),
    "a demand before we listen": ([(0.0, DEMAND, 0)] * 3000, False),
    "before and after": ([(0.0, DEMAND, 0), (0.3, DEMAND, 0)], True),
}


@pytest.mark.parametrize(("frames", "refused"), HEARD.values(), ids=HEARD)
def test_only_who_sends_while_we_listen_keeps_us_away(monkeypatch, frames, refused):
    bus = Bus(monkeypatch, frames)
    discard(bus)
    with pytest.raises(UserError, match="someone else already sends it") if refused else nullcontext():
        listen_before_send(bus, "x", PLAN, 1.0)
    assert refused or bus.now_s >= 1.0
