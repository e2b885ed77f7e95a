"""Transmission: values due in this cycle are scaled, packed, counted and protected."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from cantools.database import Message
from numpy.typing import NDArray

from ecu.bus.database import LONGEST_PAYLOAD, attribute, load_database
from ecu.bus.e2e import NO_CHECKSUM, protect
from ecu.bus.plan import SIGNAL, compile_signals, encode_signal, identifier, uses_in
from ecu.bus.protection import (
    PROTECTION,
    UNPROTECTED,
    Protection,
    contract_protection,
    set_protection,
    write_count,
)
from ecu.contract.records import EXTENDED_ID, FRAME, FRAME_EXTENDED, FRAME_FD, RecordArray
from ecu.contract.signals import CYCLE_NS, INPUT, OUTPUT
from ecu.jit import Record, kernel

LONGEST_CLASSICAL: Final = 8
"""Payload of a classical frame [bytes]; a longer one makes it a CAN FD frame."""

SENT_MESSAGE: Final = np.dtype(
    [
        ("name", "U48"),
        ("id", "u4"),  # with EXTENDED_ID
        ("first", "i4"),  # rows of `signals`
        ("count", "i4"),
        ("period", "i4"),  # cycles
        ("phase", "i4"),
        ("length", "u1"),
        ("flags", "u1"),  # of its frames
        ("optional", "u1"),  # not sent while all its values are NaN
        *PROTECTION,
        ("payload", "u1", (LONGEST_PAYLOAD,)),  # before its values are written
    ],
    align=True,
)


class TransmitPlan(NamedTuple):
    """Schedule of frames to send, in ascending order of identifiers. Read only."""

    ids: NDArray[np.uint32]
    """Identifiers, those of 29 bits with EXTENDED_ID."""
    messages: RecordArray
    signals: RecordArray


class Transmission(NamedTuple):
    """State of transmission. Kernels write to it."""

    counter: NDArray[np.uint16]
    """Of the next frame, per message."""
    sent: NDArray[np.int64]
    """Frames so far, per message."""


class SentMessage(NamedTuple):
    """A message to send; `period` and `phase` in cycles."""

    message: Message
    rows: RecordArray
    """`SIGNAL` of its values."""
    period: int
    phase: int
    protection: Protection = UNPROTECTED
    optional: bool = False
    payload: bytes = bytes(LONGEST_PAYLOAD)
    """Before its values are written."""
    moved: int = 0
    """Added to its identifier."""


def compile_transmit(sent: Sequence[SentMessage]) -> TransmitPlan:
    """Return the plan that sends these messages."""
    sent = sorted(sent, key=lambda one: identifier(one.message) + one.moved)
    messages = np.zeros(len(sent), SENT_MESSAGE)
    for row, one in zip(messages, sent, strict=True):
        message = one.message
        row["name"], row["id"], row["length"] = message.name, identifier(message) + one.moved, message.length
        fd = message.is_fd or message.length > LONGEST_CLASSICAL
        row["flags"] = FRAME_EXTENDED * message.is_extended_frame | FRAME_FD * fd
        row["count"], row["period"], row["phase"] = len(one.rows), one.period, one.phase
        row["optional"], row["payload"] = one.optional, np.frombuffer(one.payload, np.uint8)
        set_protection(row, one.protection)
    messages["first"] = np.cumsum(messages["count"]) - messages["count"]
    rows = np.concatenate([np.zeros(0, SIGNAL), *(one.rows for one in sent)])
    return TransmitPlan(np.ascontiguousarray(messages["id"]), messages, rows)


def contract_messages(
    dbc_path: Path, sender: Literal["BrakeEcu", "Vehicle"], moved: int = 0
) -> list[SentMessage]:
    """Return the contract's messages of `sender`, `moved` added to their identifiers."""
    places = OUTPUT if sender == "BrakeEcu" else INPUT
    return [
        SentMessage(
            message,
            compile_signals(message, uses_in(message, places)).rows,
            attribute(message, "GenMsgCycleTime") * 1_000_000 // CYCLE_NS,
            attribute(message, "CyclePhase") * 1_000_000 // CYCLE_NS,
            contract_protection(message),
            bool(attribute(message, "Optional")),
            moved=moved,
        )
        for message in load_database(dbc_path).messages
        if sender in message.senders
    ]


def contract_transmit_plan(dbc_path: Path, sender: Literal["BrakeEcu", "Vehicle"]) -> TransmitPlan:
    """Return the transmit plan of `sender`, from a vector of `OUTPUT_COLUMNS` or of `INPUT_SIGNALS`.

    NaN is sent as "not available"; an out-of-range value as the nearest that can be sent.
    """
    return compile_transmit(contract_messages(dbc_path, sender))


def slowest_demand(plan: TransmitPlan) -> int:
    """Return the longest period [cycles] of messages of a map with a demand, 0 without one."""
    of_message = np.repeat(plan.messages["period"], plan.messages["count"])
    return int(of_message[plan.signals["validity"] >= 0].max(initial=0))


def new_transmission(plan: TransmitPlan) -> Transmission:
    """Return the state before the first cycle."""
    return Transmission(np.zeros(len(plan.messages), np.uint16), np.zeros(len(plan.messages), np.int64))


def frame_buffer(plan: TransmitPlan) -> RecordArray:
    """Return a buffer for all frames of a cycle."""
    return np.zeros(len(plan.messages), FRAME)


@kernel
def _has_value(plan: TransmitPlan, message: Record, values: NDArray[np.float64]) -> bool:
    for row in range(message.first, message.first + message.count):
        if not np.isnan(values[plan.signals[row].place]):
            return True
    return False


@kernel
def transmit(
    plan: TransmitPlan, transmission: Transmission, values: NDArray[np.float64], cycle: int, frames: Any
) -> int:
    """Write the frames due in this cycle to `frames` from index 0, unstamped; return their number."""
    count = 0
    for place in range(len(plan.messages)):
        message = plan.messages[place]
        if (cycle - message.phase) % message.period != 0:
            continue
        if message.optional and not _has_value(plan, message, values):
            continue
        frame = frames[count]
        frame.stamp_ns = 0
        frame.can_id = message.id & ~np.uint32(EXTENDED_ID)
        frame.flags = message.flags
        frame.bus = 0
        frame.length = message.length
        for i in range(len(frame.data)):
            frame.data[i] = message.payload[i]
        for row in range(message.first, message.first + message.count):
            signal = plan.signals[row]
            valid = signal.validity < 0 or values[signal.validity] == 1.0
            encode_signal(signal, frame.data, values[signal.place] if valid else np.nan)
        if message.modulo > 0:
            write_count(message, frame.data, transmission.counter[place])
            transmission.counter[place] = (transmission.counter[place] + 1) % message.modulo
        if message.rule != NO_CHECKSUM:
            can_id: Any = np.int64(frame.can_id)
            protect(message.rule, frame.data, frame.length, can_id, message.data_id)
        transmission.sent[place] += 1
        count += 1
    return count
