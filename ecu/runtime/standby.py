"""Standby: a second daemon that follows the bus in silence and takes over when the first one falls silent.

It runs the whole cycle on the same frames, so its estimates, limiter and mode are warm at any time; only
sending is left out. It takes over when no other ECU (`ecu/bus/foreign.py`) was heard for `SILENCE_NS` on the
monotonic clock, and falls silent again in the cycle in which it hears one: two never send side by side. It
must have heard a first daemon, so two started together do not race; without one it stays silent. One standby
per bus: two of them would take over together.

When a sending daemon hears another sender of its frames, precedence decides (`Claim`): a newcomer yields and
continues as a standby, an established one stays. One that stood still while another spoke yields before it
sends. Reasons: docs/safety.md.

The alive counters continue from those of the first one, so that receivers see one sequence. Learned values
are read from the first one's ring at the start, if it runs on this machine; afterwards the own estimate
counts, not the ring's final content. It comes from the same frames and the same code, exists where the first
one's memory is lost or wrong, and needs no reading in the cycle of the take-over.
"""

import random
from typing import Any, Final

import numpy as np
import structlog
from numpy.typing import NDArray

from ecu.bus.foreign import another_ecu_speaks, is_intact, place_of_ours
from ecu.bus.protection import frame_count
from ecu.bus.transmit import Transmission, TransmitPlan
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS
from ecu.errors import UserError
from ecu.jit import kernel
from ecu.recording.learned_range import out_of_range
from ecu.recording.ring import RingReader, living_rings

SILENCE_NS: Final = 50_000_000
"""Five cycles without a frame of the first one."""
SPREAD_CYCLES: Final = 16
"""Upper bound of the random extra cycles of two that yielded to each other: one becomes first."""
NEWCOMER_CYCLES: Final = 200
"""After two seconds of sending a daemon is established: a new one has heard it, and refused."""
BESIDE_CYCLES: Final = 10
"""Least duration of another sender, missed periods among them: a standby falls silent after one cycle,
delayed frames come in one."""


class Claim:
    """Rule by which a sending daemon yields to another sender of its frames."""

    def __init__(self) -> None:
        self._spoken = self._beside = 0

    def is_lost(self, beside: int, missed: int) -> bool:
        """Add a cycle after `missed` periods; in `beside` of all these another ECU was heard."""
        if missed * CYCLE_NS >= SILENCE_NS:  # receivers missed us: a take-over was legitimate
            self._spoken = 0
        self._spoken += 1
        before = self._beside
        self._beside = before + min(beside, missed + 1) if beside else max(0, before - 1)
        newcomer = self._spoken <= NEWCOMER_CYCLES + BESIDE_CYCLES
        return newcomer and before < BESIDE_CYCLES <= self._beside


class Standby:
    """State of the second daemon. `yielded`: to another that may do the same."""

    def __init__(self, *, yielded: bool = False) -> None:
        self.speaks = False
        self._heard_ns: int | None = None
        self._yielded = yielded
        self._silence_ns = self._draw()

    def _draw(self) -> int:
        return SILENCE_NS + (random.randrange(SPREAD_CYCLES) * CYCLE_NS if self._yielded else 0)

    def listen(
        self, plan: TransmitPlan, sent: Transmission, frames: RecordArray, count: int, now_ns: int
    ) -> None:
        """Check the first `count` waiting frames; `now_ns` is T_k on the monotonic clock."""
        if _adopt_counters(plan, sent, frames, count):
            self._heard_ns = now_ns
            if self.speaks:
                self._silence_ns = self._draw()
        self.speaks = self._heard_ns is not None and now_ns - self._heard_ns >= self._silence_ns


@kernel
def _adopt_counters(plan: TransmitPlan, sent: Transmission, frames: Any, count: int) -> bool:
    """Return whether another ECU's frames are among `frames[:count]`; continue their counters."""
    if not another_ecu_speaks(plan, frames, count):
        return False
    for i in range(count):
        place = place_of_ours(plan, frames[i])
        if place >= 0 and is_intact(plan, place, frames[i]) and plan.messages[place].modulo > 0:
            message = plan.messages[place]
            sent.counter[place] = (frame_count(message, frames[i].data) + 1) % message.modulo
    return True


def learned_by_first(description: dict[str, Any], mu_nominal: NDArray[np.float64]) -> RecordArray | None:
    """Return the values learned by a living daemon on the same bus (`LEARNED`, shape (1,)), None without one.

    `description` is that of one's own ring: bus, vehicle and layout must be the same. `mu_nominal` has
    shape (4,).
    """
    same = ("interface", "channel", "store_key", "state")
    for path in living_rings():
        try:
            reader = RingReader(path)
        except UserError:  # another user's, or another version's
            continue
        if any(reader.description.get(name) != description[name] for name in same):
            continue
        learned = reader.latest("learned")
        if learned is None:
            continue
        wrong = out_of_range(learned, mu_nominal)
        if not wrong:
            structlog.get_logger("ecu").info("learned_from_ring", ring=str(path))
            return learned
        structlog.get_logger("ecu").warning("ring_refused", ring=str(path), reason=wrong)
    return None
