"""Reception of frames into inputs: identifier, length, checksum, counter, bits, validity, freshness.

A `ReceivePlan` is compiled from a database (and a signal map), a `Reception` holds the state of reception. A
rejected frame changes the counters alone, none of its signals.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from cantools.database import Message
from numpy.typing import NDArray

from ecu.bus import bits, e2e, link, sequence
from ecu.bus.database import attribute, load_database
from ecu.bus.freshness import NEVER, accept, input_freshness, new_freshness
from ecu.bus.plan import SIGNAL, SignalUse, compile_signals, is_present, is_valid, raw_code, signed_value
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
from ecu.contract.records import EXTENDED_ID, FRAME_ERROR, FRAME_EXTENDED, FRAME_REMOTE, RecordArray
from ecu.contract.signals import INPUT, INPUT_SIGNALS, N_INPUTS, N_OUTPUTS, OUTPUT
from ecu.jit import Record, kernel

MESSAGE: Final = np.dtype(
    [
        ("name", "U48"),
        ("id", "u4"),  # with EXTENDED_ID
        ("data_id", "u4"),
        ("period_ns", "i8"),
        ("slowest_ns", "i8"),
        ("first", "i4"),  # rows of `signals`
        ("count", "i4"),
        ("rule", "u1"),
        ("length", "u1"),
        ("foreign", "u1"),  # own identifier, never expected from another sender
        ("request", "u1"),  # carries the driver's request
        ("modulo", "i2"),  # of the counter, 0: none
        ("counter_start", "i2"),
        ("counter_length", "u1"),
        ("counter_big_endian", "u1"),
    ],
    align=True,
)

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
        *sequence.SEQUENCE,
        *link.LINK,
    ],
    align=True,
)
TOTALS: Final = np.dtype(
    [
        ("frames", "u8"),
        ("unknown", "u8"),
        ("foreign", "u8"),
        ("bus_errors", "u8"),
        ("rejected", "u8"),
        ("loud_ns", "i8"),  # stamp of the last frame that made its stream loud
    ]
)


class ReceivePlan(NamedTuple):
    """Signals to take from frames; `messages` in ascending order of identifiers. Read only."""

    ids: NDArray[np.uint32]
    """Identifiers, those of 29 bits with EXTENDED_ID: what kernel filters must let through."""
    messages: RecordArray
    signals: RecordArray
    codes: NDArray[np.int64]
    expected: RecordArray
    """`FRESHNESS` before the first sample, one per target place."""
    mapped: NDArray[np.bool_]
    """Per target place: whether any message feeds it."""


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


class MessageUse(NamedTuple):
    """Use of one message; `period_s` to `slowest_s` is the range of its admissible intervals."""

    message: Message
    signals: Sequence[SignalUse]
    period_s: float
    slowest_s: float
    rule: int = e2e.NO_CHECKSUM
    data_id: int = 0
    counter: Any = None
    """The cantools signal that counts frames, None: there is none."""
    modulo: int = 0
    foreign: bool = False


def compile_receive(uses: Sequence[MessageUse], expected: RecordArray) -> ReceivePlan:
    """Return the plan that receives `uses` into as many target places as `expected` has."""
    uses = sorted(uses, key=_identifier)
    messages = np.zeros(len(uses), MESSAGE)
    rows: list[RecordArray] = [np.zeros(0, SIGNAL)]
    codes: list[int] = []
    mapped = np.zeros(len(expected), np.bool_)
    for message, use in zip(messages, uses, strict=True):
        first = sum(map(len, rows))
        compiled = compile_signals(use.message, use.signals, first, len(codes))
        rows.append(compiled.rows)
        codes += compiled.codes
        mapped[[signal.place for signal in use.signals]] = True
        message["name"], message["id"] = use.message.name, _identifier(use)
        message["length"] = use.message.length
        message["period_ns"] = round(use.period_s * 1e9)
        message["slowest_ns"] = round(use.slowest_s * 1e9)
        message["first"], message["count"] = first, compiled.wanted
        message["rule"], message["data_id"], message["foreign"] = use.rule, use.data_id, use.foreign
        asks = [FIRST <= signal.place <= LAST for signal in use.signals]
        message["request"] = len(expected) == N_INPUTS and any(asks)
        if use.counter is not None:
            big_endian = use.counter.byte_order == "big_endian"
            message["modulo"] = use.modulo
            message["counter_start"] = bits.first_bit(use.counter.start, big_endian)
            message["counter_length"], message["counter_big_endian"] = use.counter.length, big_endian
    return ReceivePlan(
        np.ascontiguousarray(messages["id"]),
        messages,
        np.concatenate(rows),
        np.array([*codes, 0], np.int64),
        expected,
        mapped,
    )


def _identifier(use: MessageUse) -> int:
    return int(use.message.frame_id) | (EXTENDED_ID if use.message.is_extended_frame else 0)


def new_reception(plan: ReceivePlan) -> Reception:
    """Return the state before the first frame."""
    messages = np.zeros(len(plan.messages), MESSAGE_COUNTERS)
    messages["stamp_ns"] = NEVER
    return Reception(messages, np.zeros(1, TOTALS), plan.expected.copy(), np.zeros(1, REQUEST))


@kernel
def _find(ids: NDArray[np.uint32], identifier: int) -> int:
    low, high = 0, len(ids)
    while low < high:
        middle = (low + high) // 2
        if ids[middle] < identifier:
            low = middle + 1
        else:
            high = middle
    return low if low < len(ids) and ids[low] == identifier else -1


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
        start, length, big_endian = message.counter_start, message.counter_length, message.counter_big_endian
        counter: Any = np.int64(bits.extract(frame.data, start, length, big_endian))
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
    counters.accepted += 1
    return link.P_OK


@kernel
def _tell_links(totals: Record, inputs: Record) -> None:
    """Write the fault bit of streams that are loud."""
    loud = totals.loud_ns > 0 and inputs.t_ns - totals.loud_ns < link.TOLD_NS
    inputs.e2e_faults = E2E_REJECTIONS if loud else 0


@kernel
def receive(
    plan: ReceivePlan, reception: Reception, frames: Any, first: int, count: int, inputs: Record
) -> int:
    """Consume `frames[first:count]` in order up to the first one stamped after `inputs.t_ns`.

    Returns the index of the first frame left. `inputs` is `INPUTS` or a `target_dtype` record.
    """
    # Tuple fields are taken out once: in the loop each would cost an atomic reference count.
    ids, messages, signals, codes = plan.ids, plan.messages, plan.signals, plan.codes
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
        place = _find(ids, identifier)
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
        status = check_frame(message, counters, frame)
        if message.modulo > 0 and link.judge_link(
            counters, status, frame.stamp_ns, message.period_ns, message.slowest_ns
        ):
            totals.loud_ns = frame.stamp_ns
        accepted = counts = status == link.P_OK
        asks = message.request != 0
        doubt = asks and sequence.in_doubt(counters, frame.stamp_ns)
        rival, standing = False, sequence.ESTABLISHED
        if not accepted:
            totals.rejected += 1
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
            note_request(request, frame.stamp_ns)
            if doubt:
                hold_request(request, inputs)
    if len(inputs.new) == N_INPUTS:
        settle_request(request, freshness, inputs.t_ns)
    _tell_links(totals, inputs)
    return index


def _protected(message: Message, places: dict[str, int]) -> MessageUse:
    """Return the wanted signals of a contract message: every signal that has a place."""
    names = [signal.name for signal in message.signals]
    period_s = attribute(message, "GenMsgCycleTime") * 1e-3
    slowest_s = attribute(message, "CycleTimeSlowest") * 1e-3 or period_s
    protected = attribute(message, "E2EDataId") != 0
    return MessageUse(
        message,
        [SignalUse(name, places[name]) for name in names if name in places],
        period_s,
        slowest_s,
        e2e.AUTOSAR_P01 if protected else e2e.NO_CHECKSUM,
        attribute(message, "E2EDataId"),
        message.get_signal_by_name("alive_counter") if protected else None,
        e2e.P01_MODULO,
    )


def contract_receive_plan(dbc_path: Path) -> ReceivePlan:
    """Return the ECU's own plan: input frames into `INPUTS`; frames like the ECU's own are foreign."""
    messages = load_database(dbc_path).messages
    uses = [_protected(message, INPUT) for message in messages if "BrakeEcu" not in message.senders]
    watched = [MessageUse(m, [], 0.0, 0.0, foreign=True) for m in messages if "BrakeEcu" in m.senders]
    periods = {signal.place: (use.period_s, use.slowest_s) for use in uses for signal in use.signals}
    return compile_receive(uses + watched, input_freshness(periods, {}))


def contract_listen_plan(dbc_path: Path) -> ReceivePlan:
    """Return the plan of a listener to the ECU: its output frames into a vector of `OUTPUT_COLUMNS`.

    The target is a `target_dtype(N_OUTPUTS)` record. A value sent in two messages (`pressure_demand_valid`)
    arrives at twice the rate.
    """
    messages = load_database(dbc_path).messages
    uses = [_protected(message, OUTPUT) for message in messages if "BrakeEcu" in message.senders]
    rate = np.zeros(N_OUTPUTS)
    for use in uses:
        for signal in use.signals:
            rate[signal.place] += 1.0 / use.period_s
    period_s = np.divide(1.0, rate, out=np.zeros(N_OUTPUTS), where=rate > 0.0)
    everything = np.full(N_OUTPUTS, np.inf)
    timeout_s = np.maximum(0.1, 3.0 * period_s)
    return compile_receive(uses, new_freshness(timeout_s, period_s, period_s, -everything, everything))


def input_names(plan: ReceivePlan) -> tuple[str, ...]:
    """Return the names of the inputs that the plan feeds."""
    return tuple(signal.name for signal, mapped in zip(INPUT_SIGNALS, plan.mapped, strict=True) if mapped)
