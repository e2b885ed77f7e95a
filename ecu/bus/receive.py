"""Reception of frames into inputs: identifier, length, checksum, counter, bits, validity, freshness.

A `Reception` holds its state. A rejected frame changes the counters alone, none of its signals.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.bus import e2e, link, sequence
from ecu.bus.freshness import NEVER, accept
from ecu.bus.plan import is_present, is_valid, raw_code, signed_value
from ecu.bus.protection import frame_count
from ecu.bus.receive_plan import PRIORITIES, PRIORITY_BIT, ReceivePlan
from ecu.bus.request import (
    FIRST,
    LAST,
    REQUEST,
    begin_request,
    hold_request,
    note_request,
    note_rival,
    settle_request,
)
from ecu.contract.faults import E2E_REJECTIONS
from ecu.contract.records import (
    E2E_COUNTS,
    EXTENDED_ID,
    FRAME_ERROR,
    FRAME_EXTENDED,
    FRAME_REMOTE,
    RecordArray,
)
from ecu.contract.signals import N_INPUTS
from ecu.jit import Record, kernel

# Per message of the plan
MESSAGE_COUNTERS: Final = np.dtype(
    [
        ("received", "u4"),
        ("accepted", "u4"),
        ("checksum_errors", "u4"),
        ("sequence_errors", "u4"),
        ("repeated", "u4"),
        ("length_errors", "u4"),
        ("lost", "u4"),  # accepted frames after a counter step above one
        ("resynchronised", "u4"),
        ("stamp_ns", "i8"),  # of the last frame received
        ("content", "u1", (8,)),  # of the last frame accepted
        *sequence.SEQUENCE,
        *link.LINK,
    ],
    align=True,
)
LATE, LOST, REPEATED, WRONG = range(len(E2E_COUNTS))
TOTALS: Final = np.dtype(
    [
        ("frames", "u8"),
        ("unknown", "u8"),
        ("foreign", "u8"),
        ("bus_errors", "u8"),
        ("rejected", "u8"),
        ("e2e", "u8", (len(E2E_COUNTS),)),
        ("loud_ns", "i8"),  # stamp of the last frame that made its stream loud
        ("unsure_ns", "i8"),  # stamp of the last frame by which a stream's content is unsure
    ]
)


class Reception(NamedTuple):
    """State of reception. Kernels write to it."""

    messages: RecordArray
    """`MESSAGE_COUNTERS` in the order of the plan's messages."""
    totals: RecordArray
    """`TOTALS`, length 1."""
    freshness: RecordArray
    """`FRESHNESS` per target place."""
    request: RecordArray
    """`REQUEST`, length 1."""


def new_reception(plan: ReceivePlan) -> Reception:
    """Return the state before the first frame."""
    messages = np.zeros(len(plan.messages), MESSAGE_COUNTERS)
    messages["stamp_ns"] = NEVER
    return Reception(messages, np.zeros(1, TOTALS), plan.expected.copy(), np.zeros(1, REQUEST))


@kernel
def _find(ids: NDArray[np.uint32], messages: Any, identifier: int) -> int:
    """Return the message of an identifier of 29 bits, -1: none; where any priority counts, of the rest."""
    place = _search(ids, identifier)
    if place >= 0:
        return place
    place = _search(ids, identifier & ~(PRIORITIES - 1 << PRIORITY_BIT))
    return place if place >= 0 and messages[place].any_priority else -1


@kernel
def _search(ids: NDArray[np.uint32], identifier: int) -> int:
    low, high = 0, len(ids)
    while low < high:
        middle = (low + high) // 2
        if ids[middle] < identifier:
            low = middle + 1
        else:
            high = middle
    return low if low < len(ids) and ids[low] == identifier else -1


@kernel
def _is_copy(counters: Record, counter: int, frame: Record, period_ns: int) -> bool:
    """Return whether a frame is the last accepted one once more, as a gateway or a bridge doubles it."""
    if (
        counter != counters.sender.counter
        or not 0 <= frame.stamp_ns - counters.sender.heard_ns <= period_ns // 2
    ):
        return False
    same = True
    for i in range(len(counters.content)):
        same = same and frame.data[i] == counters.content[i]
    return same


@kernel
def check_frame(message: Record, counters: Record, frame: Record) -> Any:
    """Return a frame's check result, P_OK if it is complete, intact and the next of its sender.

    Failed checks are counted.
    """
    if frame.length < message.length or (message.rule != e2e.NO_CHECKSUM and frame.length != message.length):
        counters.length_errors += 1
        return link.P_ERROR
    can_id: Any = np.int64(frame.can_id)
    if not e2e.checksum_holds(message.rule, frame.data, message.length, can_id, message.data_id):
        counters.checksum_errors += 1
        return link.P_ERROR
    if message.modulo > 0:
        counter: Any = frame_count(message, frame.data)
        if counters.started and _is_copy(counters, counter, frame, message.period_ns):
            counters.repeated += 1
            return link.P_REPEATED
        found = sequence.check_counter(
            counters, counter, message.modulo, frame.stamp_ns, message.period_ns, message.slowest_ns
        )
        if found == sequence.REPEATED or found == sequence.CROSSED:
            counters.repeated += 1
            return link.P_REPEATED
        if found == sequence.WRONG_SEQUENCE:
            counters.sequence_errors += 1
            return link.P_WRONG_SEQUENCE
        if found == sequence.SOME_LOST:
            counters.lost += 1
        elif found == sequence.RESYNCHRONISED:
            counters.resynchronised += 1
        for i in range(len(counters.content)):
            counters.content[i] = frame.data[i]
    counters.accepted += 1
    return link.P_OK


@kernel
def _is_unsure(counters: Record, status: int, stamp_ns: int) -> bool:
    """Return whether the frames that a stream has accepted may be another sender's.

    Two frames with one count and different contents, a sender that is not established beside a rival, or so
    many wrong checksums that some are right by chance. A stream that is only loud is its sender's.
    """
    crossed = status == link.P_REPEATED and counters.disputed_ns == stamp_ns
    contested = counters.established == 0 and counters.contested_ns > 0
    return crossed or contested or counters.error_count >= link.MANY_REJECTED


@kernel
def _write_link_faults(totals: Record, inputs: Record) -> None:
    """Write the fault bit of streams that are loud, and whether a stream's content is unsure."""
    loud = totals.loud_ns > 0 and inputs.t_ns - totals.loud_ns < link.REPORTED_NS
    inputs.e2e_faults = E2E_REJECTIONS if loud else 0
    unsure = totals.unsure_ns > 0 and inputs.t_ns - totals.unsure_ns < link.REPORTED_NS
    inputs.e2e_unsure = 1 if unsure else 0


@kernel
def receive(
    plan: ReceivePlan, reception: Reception, frames: Any, first: int, count: int, inputs: Record
) -> int:
    """Consume `frames[first:count]` in order up to the first one stamped after `inputs.t_ns`.

    Returns the index of the first frame left. `inputs` is `INPUTS` or a `target_dtype` record.
    """
    # Tuple fields are taken out once: in the loop each would cost an atomic reference count.
    ids, places, messages, signals, codes = plan.ids, plan.places, plan.messages, plan.signals, plan.codes
    counted, freshness, totals = reception.messages, reception.freshness, reception.totals[0]
    request = reception.request[0]
    index = first
    while index < count and frames[index].stamp_ns <= inputs.t_ns:
        frame = frames[index]
        index += 1
        totals.frames += 1
        if frame.flags & (FRAME_ERROR | FRAME_REMOTE):
            totals.bus_errors += 1
            continue
        identifier: Any = np.int64(frame.can_id)
        if frame.flags & FRAME_EXTENDED:
            identifier |= EXTENDED_ID
        place = np.int64(places[identifier]) if identifier < len(places) else _find(ids, messages, identifier)
        if place < 0:
            totals.unknown += 1
            continue
        message = messages[place]
        counters = counted[place]
        counters.received += 1
        counters.stamp_ns = frame.stamp_ns
        if message.foreign:
            totals.foreign += 1
            continue
        late, lost = counters.late, counters.lost
        status = check_frame(message, counters, frame)
        totals.e2e[LATE] += counters.late - late
        totals.e2e[LOST] += counters.lost - lost
        if message.modulo > 0 and link.judge_link(
            counters, status, frame.stamp_ns, message.period_ns, message.slowest_ns
        ):
            totals.loud_ns = frame.stamp_ns
        accepted = counts = status == link.P_OK
        asks = message.request != 0
        if not asks and message.modulo > 0 and _is_unsure(counters, status, frame.stamp_ns):
            totals.unsure_ns = frame.stamp_ns
        garbage = counters.error_count > link.MAX_ERROR_AGAIN
        doubt = asks and (garbage or sequence.in_doubt(counters, frame.stamp_ns))
        rival, standing = False, sequence.ESTABLISHED
        if not accepted:
            totals.rejected += 1
            totals.e2e[REPEATED if status == link.P_REPEATED else WRONG] += 1
            if not asks or status == link.P_ERROR:
                continue
            crossed = counters.disputed_ns == frame.stamp_ns
            rival = not crossed and sequence.rival_spoke(counters, frame.stamp_ns)
            standing = sequence.standing(counters, frame.stamp_ns)
            counts = crossed or (rival and standing == sequence.EQUAL)
            if not (counts or rival):
                continue
        if asks:
            begin_request(request)
        for row in range(message.first, message.first + message.count):
            if is_present(signals, codes, row, frame.data):
                signal = signals[row]
                code = raw_code(signal, frame.data)
                valid = is_valid(signals, codes, row, code, frame.data)
                value = signed_value(signals, codes, row, code, frame.data)
                asked = asks and FIRST <= signal.place <= LAST
                if asked and valid:
                    request.sample[signal.place - FIRST] = value
                if (doubt and asked and not valid) or not (accepted or (asked and counts)):
                    continue
                accept(inputs, freshness, signal.place, value, frame.stamp_ns, valid)
        if rival:
            note_rival(request, frame.stamp_ns, standing)
        if asks and counts:
            note_request(request, frame.stamp_ns, garbage)
            if doubt:
                hold_request(request, inputs)
    if len(inputs.new) == N_INPUTS:
        settle_request(request, freshness, inputs.t_ns)
    _write_link_faults(totals, inputs)
    return index
