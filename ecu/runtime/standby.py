"""Standby: a second daemon that follows the bus in silence and takes over when the first one falls silent.

It runs the whole cycle on the same frames, so its estimates, limiter and mode are warm at any time; only
sending is left out. It takes over when no other ECU (`ecu/bus/foreign.py`) was heard for `SILENCE_NS` on the
monotonic clock, and falls silent again in the cycle in which it hears one: two never send side by side. It
must have heard a first daemon, so two started together do not race; without one it stays silent. One standby
per bus: two of them would take over together.

When a sending daemon hears another sender of its frames, precedence decides (`CLAIM`): a newcomer yields and
continues as a standby, an established one stays. One that stood still while another spoke yields before it
sends. Reasons: docs/safety.md.

The alive counters continue from those of the first one, so that receivers see one sequence. Learned values
are read from the first one's ring at the start, if it runs on this machine; afterwards the own estimate
counts, not the ring's final content. It comes from the same frames and the same code, exists where the first
one's memory is lost or wrong, and needs no reading in the cycle of the take-over.
"""

import random
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import structlog
from numpy.typing import NDArray

from ecu.bus.foreign import another_ecu_speaks, is_intact, place_of_ours
from ecu.bus.protection import frame_count
from ecu.bus.transmit import Transmission, TransmitPlan
from ecu.contract.records import RecordArray, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.errors import UserError
from ecu.jit import Record, kernel
from ecu.recording.learned_range import out_of_range
from ecu.recording.ring import RingReader, living_rings

SILENCE_NS: Final = 50_000_000
"""Five cycles without a frame of the first one."""
SPREAD_CYCLES: Final = 16
"""Upper bound of the random extra cycles of two that yielded to each other: one becomes first."""
DRAWS: Final = 64
"""Drawn at the start: a kernel of the cycle has no source of chance."""
NEWCOMER_CYCLES: Final = 200
"""After two seconds of sending a daemon is established: a new one has heard it, and refused."""
BESIDE_CYCLES: Final = 10
"""Least duration of another sender, missed periods among them: a standby falls silent after one cycle,
delayed frames come in one."""


CLAIM: Final = np.dtype(
    [
        ("spoken", "i8"),  # cycles since the start, or since receivers missed us
        ("beside", "i8"),  # of these with another sender, those without taken off
    ]
)
STANDBY: Final = np.dtype(
    [
        ("waits", "i8"),  # 1: a standby, or one that yielded
        ("speaks", "i8"),
        ("heard", "i8"),  # 1: a first daemon, at `heard_ns`
        ("heard_ns", "i8"),  # T_k on the monotonic clock
        ("silence_ns", "i8"),  # after which it speaks
        ("yielded", "i8"),  # 1: to another that may do the same
        ("drawn", "i8"),  # how many `extra` were used
        ("extra", "i8", (DRAWS,)),  # random cycles beyond `SILENCE_NS`, in turn
    ],
    align=True,
)


def new_standby(*, waits: bool) -> RecordArray:
    """Return the state of a daemon that is a standby, or sends."""
    standby = new_record(STANDBY)
    standby["waits"], standby["speaks"], standby["silence_ns"] = waits, not waits, SILENCE_NS
    standby["extra"] = random.choices(range(SPREAD_CYCLES), k=DRAWS)
    return standby


@kernel
def claim_is_lost(claim: Record, beside: int, missed: int) -> bool:
    """Add a cycle after `missed` periods; return whether a sending daemon yields.

    In `beside` of all these periods another ECU was heard.
    """
    if missed * CYCLE_NS >= SILENCE_NS:  # receivers missed us: a take-over was legitimate
        claim.spoken = 0
    claim.spoken += 1
    before = claim.beside
    claim.beside = before + min(beside, missed + 1) if beside else max(0, before - 1)
    newcomer = claim.spoken <= NEWCOMER_CYCLES + BESIDE_CYCLES
    return newcomer and before < BESIDE_CYCLES <= claim.beside


@kernel
def yield_to_other(standby: Record) -> None:
    """Become the standby of another that may do the same."""
    standby.waits = standby.yielded = 1
    standby.speaks = 0
    _draw(standby)


@kernel
def _draw(standby: Record) -> None:
    standby.silence_ns = SILENCE_NS
    if standby.yielded:
        standby.silence_ns += standby.extra[standby.drawn % DRAWS] * CYCLE_NS
        standby.drawn += 1


@kernel
def listen(
    standby: Record, plan: TransmitPlan, sent: Transmission, frames: RecordArray, count: int, now_ns: int
) -> None:
    """Check the first `count` waiting frames; `now_ns` is T_k on the monotonic clock."""
    if _adopt_counters(plan, sent, frames, count):
        standby.heard, standby.heard_ns = 1, now_ns
        if standby.speaks:
            _draw(standby)
    silent = standby.heard != 0 and now_ns - standby.heard_ns >= standby.silence_ns
    standby.speaks = 1 if silent else 0


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


def rings_beside(description: dict[str, Any]) -> Iterator[RingReader]:
    """Yield the rings of living daemons whose bus, vehicle and layout are those of `description`."""
    same = ("interface", "channel", "store_key", "state")
    for path in living_rings():
        try:
            reader = RingReader(path)
        except UserError:  # another user's, or another version's
            continue
        if all(reader.description.get(name) == description[name] for name in same):
            yield reader


def learned_by_first(description: dict[str, Any], mu_nominal: NDArray[np.float64]) -> RecordArray | None:
    """Return the values learned by a living daemon on the same bus (`LEARNED`, shape (1,)), None without one.

    `description` is that of one's own ring: bus, vehicle and layout must be the same. `mu_nominal` has
    shape (4,).
    """
    for reader in rings_beside(description):
        path = reader.ring.path
        learned = reader.latest("learned")
        if learned is None:
            continue
        wrong = out_of_range(learned, mu_nominal)
        if not wrong:
            structlog.get_logger("ecu").info("learned_from_ring", ring=str(path))
            return learned
        structlog.get_logger("ecu").warning("ring_refused", ring=str(path), reason=wrong)
    return None
