"""Plan of reception: which signals of which messages feed which places, compiled from a database.

A signal map compiles the messages of a foreign database to the same plan.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from cantools.database import Message
from numpy.typing import NDArray

from ecu.bus.database import attribute, load_database
from ecu.bus.freshness import input_freshness, new_freshness
from ecu.bus.plan import SIGNAL, SignalUse, compile_signals, identifier, uses_in
from ecu.bus.protection import PROTECTION, UNPROTECTED, Protection, contract_protection, set_protection
from ecu.bus.request import FIRST, LAST
from ecu.contract.records import RecordArray
from ecu.contract.signals import INPUT, INPUT_SIGNALS, N_INPUTS, N_OUTPUTS, OUTPUT

MESSAGE: Final = np.dtype(
    [
        ("name", "U48"),
        ("id", "u4"),  # with EXTENDED_ID
        ("period_ns", "i8"),
        ("slowest_ns", "i8"),
        ("first", "i4"),  # rows of `signals`
        ("count", "i4"),
        ("length", "u1"),
        ("foreign", "u1"),  # own identifier, never expected from another sender
        ("request", "u1"),  # carries the driver's request
        ("any_priority", "u1"),  # J1939: the three bits in `id` are 0, and count for nothing
        *PROTECTION,
    ],
    align=True,
)

STANDARD_IDS: Final = 1 << 11
PRIORITY_BIT, PRIORITIES = 26, 8
"""Of an identifier of J1939 (SAE J1939-21): its three highest bits."""


class ReceivePlan(NamedTuple):
    """Signals to take from frames; `messages` in ascending order of identifiers. Read only."""

    ids: NDArray[np.uint32]
    """Identifiers, those of 29 bits with EXTENDED_ID."""
    places: NDArray[np.int16]
    """Message of each identifier of 11 bits, −1: none, shape (2048,)."""
    messages: RecordArray
    signals: RecordArray
    codes: NDArray[np.int64]
    expected: RecordArray
    """`FRESHNESS` before the first sample, one per target place."""
    mapped: NDArray[np.bool_]
    """Per target place: whether any message feeds it."""


class MessageUse(NamedTuple):
    """Use of one message; `period_s` to `slowest_s` is the range of its admissible intervals."""

    message: Message
    signals: Sequence[SignalUse]
    period_s: float
    slowest_s: float
    protection: Protection = UNPROTECTED
    foreign: bool = False
    any_priority: bool = False


def accepted_ids(messages: RecordArray) -> dict[int, str]:
    """Return every identifier that is one of `messages` (MESSAGE), with its name; 29 bits with EXTENDED_ID.

    They are what kernel filters must let through.
    """
    return {
        int(one["id"]) | priority << PRIORITY_BIT: str(one["name"])
        for one in messages
        for priority in (range(PRIORITIES) if one["any_priority"] else (0,))
    }


def places_of(ids: NDArray[np.uint32]) -> NDArray[np.int16]:
    """Return `ReceivePlan.places` of messages with these identifiers."""
    places = np.full(STANDARD_IDS, -1, np.int16)
    standard = np.flatnonzero(ids < STANDARD_IDS)
    places[ids[standard]] = standard
    return places


def compile_receive(uses: Sequence[MessageUse], expected: RecordArray) -> ReceivePlan:
    """Return the plan that receives `uses` into as many target places as `expected` has."""
    uses = sorted(uses, key=lambda use: identifier(use.message))
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
        message["name"], message["id"] = use.message.name, identifier(use.message)
        message["length"] = use.message.length
        message["period_ns"] = round(use.period_s * 1e9)
        message["slowest_ns"] = round(use.slowest_s * 1e9)
        message["first"], message["count"] = first, compiled.wanted
        message["foreign"], message["any_priority"] = use.foreign, use.any_priority
        set_protection(message, use.protection)
        asks = [FIRST <= signal.place <= LAST for signal in use.signals]
        message["request"] = len(expected) == N_INPUTS and any(asks)
    return ReceivePlan(
        np.ascontiguousarray(messages["id"]),
        places_of(messages["id"]),
        messages,
        np.concatenate(rows),
        np.array([*codes, 0], np.int64),
        expected,
        mapped,
    )


def messages_by_contract(plan: ReceivePlan) -> dict[str, list[str]]:
    """Return the messages of `plan` by those of the contract whose inputs they feed, without the axle."""
    found: dict[str, list[str]] = {}
    for message in plan.messages:
        rows = plan.signals["place"][int(message["first"]) :][: int(message["count"])]
        for place in () if message["foreign"] else rows.tolist():
            names = found.setdefault(re.sub("(Front|Rear)$", "", INPUT_SIGNALS[place].message), [])
            if str(message["name"]) not in names:
                names.append(str(message["name"]))
    return found


def _protected(message: Message, places: dict[str, int]) -> MessageUse:
    """Return the wanted signals of a contract message: every signal that has a place."""
    period_s = attribute(message, "GenMsgCycleTime") * 1e-3
    slowest_s = attribute(message, "CycleTimeSlowest") * 1e-3 or period_s
    return MessageUse(
        message,
        uses_in(message, places),
        period_s,
        slowest_s,
        contract_protection(message),
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
