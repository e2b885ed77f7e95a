"""Time of decoding and encoding a message with its E2E protection, beside cantools on the same messages."""

from typing import Any, Final

import cantools
import numpy as np

from brakelab.bench.braking import ALL_DUE, MESSAGES_IN, Stop, simulated_stop
from brakelab.studies.measure import Row, alternate, installed, timed
from ecu.bus.receive import new_reception, receive
from ecu.bus.receive_plan import ReceivePlan, contract_receive_plan
from ecu.bus.transmit import (
    Transmission,
    TransmitPlan,
    contract_transmit_plan,
    frame_buffer,
    new_transmission,
    transmit,
)
from ecu.contract.records import FRAME, INPUTS, RecordArray, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.jit import kernel
from ecu.settings.resources import resource

ROUNDS: Final = 15
CYCLES: Final = 300
PER_CALL: Final = 39
"""Frames that a cycle on a full 500 kbit/s bus brings."""


@kernel
def _transmit_all(
    plan: TransmitPlan, transmission: Transmission, values: Any, cycle: int, sent: Any, frames: Any
) -> int:
    count = 0
    for k in range(len(values)):
        due = transmit(plan, transmission, values[k], cycle, sent)
        for i in range(due):
            frames[count] = sent[i]
            frames[count].stamp_ns = CYCLE_NS * (k + 1)
            count += 1
    return count


def protected_frames(stop: Stop, cycles: int) -> RecordArray:
    """Return the 13 protected input messages of each of `cycles` of braking, 10 ms apart."""
    plan = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "Vehicle")
    values = stop.values[stop.braking : stop.braking + cycles]
    frames = new_record(FRAME, MESSAGES_IN * len(values))
    _transmit_all(plan, new_transmission(plan), values, ALL_DUE, frame_buffer(plan), frames)
    return frames


def plan_of_the_bench() -> ReceivePlan:
    """Return the receive plan of the ECU, every message once in 10 ms, as in `protected_frames`."""
    plan = contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    plan.messages["period_ns"] = plan.messages["slowest_ns"] = CYCLE_NS
    return plan


def codec_rows(rounds: int = ROUNDS, cycles: int = CYCLES) -> list[Row]:
    """Return the rows; times per message."""
    stop, dbc = simulated_stop(), resource("dbc/brake_ecu.dbc")
    frames = protected_frames(stop, cycles)
    count = len(frames)
    plan = plan_of_the_bench()
    clean, reception = new_reception(plan), new_reception(plan)
    now = new_record(INPUTS)
    now["t_ns"] = frames["stamp_ns"][-1]
    inputs = now[0]

    def forget() -> None:
        for ours, fresh in zip(reception, clean, strict=True):
            ours[:] = fresh

    def in_calls_of_a_cycle() -> None:
        for first in range(0, count, PER_CALL):
            receive(plan, reception, frames, first, min(first + PER_CALL, count), inputs)

    database: Any = cantools.database.load_file(dbc)
    pairs = [(int(f["can_id"]), f["data"][: f["length"]].tobytes()) for f in frames]
    decoded = [(n, database.decode_message(n, data, decode_choices=False)) for n, data in pairs]

    def cantools_decode() -> None:
        for number, data in pairs:
            database.decode_message(number, data, decode_choices=False)

    def cantools_encode() -> None:
        for number, values in decoded:
            database.encode_message(number, values)

    sending = contract_transmit_plan(dbc, "Vehicle")
    transmission, sent, out = new_transmission(sending), frame_buffer(sending), new_record(FRAME, count)
    table = np.ascontiguousarray(stop.values[stop.braking : stop.braking + cycles])
    rows_of = list(table)

    def encode_from_python() -> None:
        for values in rows_of:
            transmit(sending, transmission, values, ALL_DUE, sent)

    tasks = [
        timed(lambda: receive(plan, reception, frames, 0, count, inputs), count, forget),
        timed(in_calls_of_a_cycle, count, forget),
        timed(cantools_decode, count),
        timed(lambda: _transmit_all(sending, transmission, table, ALL_DUE, sent, out), count),
        timed(encode_from_python, count),
        timed(cantools_encode, count),
    ]
    bulk_in, cycle_in, peer_in, bulk_out, cycle_out, peer_out = alternate(rounds, tasks)
    name = installed("cantools")
    decode, encode = f"{name} decode_message", f"{name} encode_message"
    return [
        Row("decode, one compiled loop (replay)", bulk_in, peer_in, "µs", decode),
        Row(f"decode, calls with {PER_CALL} frames", cycle_in, peer_in, "µs", decode),
        Row("encode, one compiled loop (simulation)", bulk_out, peer_out, "µs", encode),
        Row(f"encode, calls for {MESSAGES_IN} frames", cycle_out, peer_out, "µs", encode),
    ]
