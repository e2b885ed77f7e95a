"""Transmission: values due in this cycle are scaled, packed, counted and protected."""

from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.bus.database import attribute, load_database
from ecu.bus.e2e import P01_MODULO, p01_protect
from ecu.bus.plan import SIGNAL, SignalUse, compile_signals, encode_signal
from ecu.contract.records import FRAME, RecordArray
from ecu.contract.signals import CYCLE_NS, INPUT, OUTPUT
from ecu.jit import Record, kernel

SENT_MESSAGE: Final = np.dtype(
    [
        ("name", "U48"),
        ("id", "u4"),
        ("data_id", "u4"),  # 0: not protected
        ("first", "i4"),  # rows of `signals`
        ("count", "i4"),
        ("period", "i4"),  # cycles
        ("phase", "i4"),
        ("length", "u1"),
        ("optional", "u1"),  # not sent while all its values are NaN
    ],
    align=True,
)


class TransmitPlan(NamedTuple):
    """Schedule of frames to send, in ascending order of identifiers. Read only."""

    ids: NDArray[np.uint32]
    messages: RecordArray
    signals: RecordArray


class Transmission(NamedTuple):
    """State of transmission. Kernels write to it."""

    counter: NDArray[np.uint8]
    """Of the next frame, per message."""
    sent: NDArray[np.int64]
    """Frames so far, per message."""


def contract_transmit_plan(dbc_path: Path, sender: Literal["BrakeEcu", "Vehicle"]) -> TransmitPlan:
    """Return the transmit plan of `sender`, from a vector of `OUTPUT_COLUMNS` or of `INPUT_SIGNALS`.

    NaN is sent as "not available"; an out-of-range value as the nearest that can be sent.
    """
    places = OUTPUT if sender == "BrakeEcu" else INPUT
    chosen = [message for message in load_database(dbc_path).messages if sender in message.senders]
    chosen.sort(key=lambda message: int(message.frame_id))
    messages = np.zeros(len(chosen), SENT_MESSAGE)
    rows: list[RecordArray] = [np.zeros(0, SIGNAL)]
    for message, source in zip(messages, chosen, strict=True):
        names = [signal.name for signal in source.signals if signal.name in places]
        message["name"], message["id"], message["length"] = source.name, source.frame_id, source.length
        message["data_id"] = attribute(source, "E2EDataId")
        message["first"], message["count"] = sum(map(len, rows)), len(names)
        message["period"] = attribute(source, "GenMsgCycleTime") * 1_000_000 // CYCLE_NS
        message["phase"] = attribute(source, "CyclePhase") * 1_000_000 // CYCLE_NS
        message["optional"] = attribute(source, "Optional")
        rows.append(compile_signals(source, [SignalUse(name, places[name]) for name in names]).rows)
    return TransmitPlan(np.ascontiguousarray(messages["id"]), messages, np.concatenate(rows))


def new_transmission(plan: TransmitPlan) -> Transmission:
    """Return the state before the first cycle."""
    return Transmission(np.zeros(len(plan.messages), np.uint8), np.zeros(len(plan.messages), np.int64))


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
        frame.can_id = message.id
        frame.flags = 0
        frame.bus = 0
        frame.length = message.length
        for i in range(len(frame.data)):
            frame.data[i] = 0
        for row in range(message.first, message.first + message.count):
            signal = plan.signals[row]
            encode_signal(signal, frame.data, values[signal.place])
        if message.data_id != 0:
            counter = transmission.counter[place]
            p01_protect(frame.data, message.length, message.data_id, counter)
            transmission.counter[place] = (counter + 1) % P01_MODULO
        transmission.sent[place] += 1
        count += 1
    return count
