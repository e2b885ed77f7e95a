"""Decode and encode plans: a database's description of signals, as rows that kernels read."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from cantools.database import Message
from numpy.typing import NDArray

from ecu.bus import bits
from ecu.bus.database import fits
from ecu.contract.records import EXTENDED_ID, RecordArray
from ecu.jit import Record, kernel

# One signal. Lists of raw codes lie in the plan's `codes`, as (first, count).
SIGNAL: Final = np.dtype(
    [
        ("scale", "f8"),
        ("offset", "f8"),
        ("raw_low", "i8"),  # codes that a value may be sent as
        ("raw_high", "i8"),
        ("not_available", "u8"),  # bits that mark it
        ("start", "i2"),
        ("length", "u1"),
        ("big_endian", "u1"),
        ("kind", "u1"),
        ("place", "i2"),  # index in the vector of values, −1: none
        ("selector", "i2"),  # row of the multiplexer that selects this signal, −1: always there
        ("selected", "i4", (2,)),  # codes: selector's values
        ("refused", "i4", (2,)),  # codes: not available, sentinels
        ("validity", "i2"),  # row of the signal, sent: place of the value, that declares this one valid
        ("valid", "i4", (2,)),  # codes: validity's values
        ("sign", "i2"),  # row of the signal that turns this magnitude negative, −1: none
        ("negative", "i4", (2,)),  # codes: sign's values
    ],
    align=True,
)


def identifier(message: Message) -> int:
    """Return a message's identifier, one of 29 bits with `EXTENDED_ID`."""
    return int(message.frame_id) | (EXTENDED_ID if message.is_extended_frame else 0)


class SignalUse(NamedTuple):
    """Use of one signal of a message."""

    signal: str
    place: int
    factor: float = 1.0
    offset: float = 0.0
    refused: tuple[float, ...] = ()
    """Sentinels: values, in the database's unit, that are no measurement."""
    validity: str = ""
    valid: tuple[int, ...] = ()
    sign: str = ""
    """Signal that says on which side of zero a magnitude is."""
    negative: tuple[int, ...] = ()


def uses_in(message: Message, places: dict[str, int]) -> list[SignalUse]:
    """Return the signals of a message of the contract that have a place."""
    return [
        SignalUse(signal.name, places[signal.name]) for signal in message.signals if signal.name in places
    ]


class SignalRows(NamedTuple):
    """Rows of one message: wanted signals first, in the order given, then the helpers they refer to."""

    rows: RecordArray
    wanted: int
    codes: list[int]


def _kind(signal: Any) -> int:
    if signal.is_float:
        return {16: bits.FLOAT16, 32: bits.FLOAT32, 64: bits.FLOAT64}[int(signal.length)]
    return bits.SIGNED if signal.is_signed else bits.UNSIGNED


def not_available_code(signal: Any) -> int | None:
    """Return the raw code named "not_available" in the database, None without one."""
    for code, name in (signal.choices or {}).items():
        if str(name) == "not_available":
            return int(code)
    return None


def _raw_range(signal: Any) -> tuple[int, int]:
    if signal.is_float:
        return 0, 0
    if signal.is_signed:
        low, high = -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    else:
        low, high = 0, min((1 << signal.length) - 1, 2**63 - 1)
    if (
        signal.minimum is not None
        and signal.maximum is not None
        and signal.minimum < signal.maximum
        and signal.scale
    ):
        ends = sorted((float(end) - signal.offset) / signal.scale for end in (signal.minimum, signal.maximum))
        low, high = max(low, int(np.ceil(ends[0] - 1e-6))), min(high, int(np.floor(ends[1] + 1e-6)))
    code = not_available_code(signal)
    if code == high:
        high -= 1
    if code == low:
        low += 1
    return low, high


def signal_row(signal: Any) -> RecordArray:
    """Return the layout of a cantools signal as one unassigned `SIGNAL` row, shape (1,)."""
    row = np.zeros(1, SIGNAL)
    big_endian = signal.byte_order == "big_endian"
    row["start"] = bits.first_bit(signal.start, big_endian)
    row["length"] = signal.length
    row["big_endian"] = big_endian
    row["kind"] = _kind(signal)
    row["scale"], row["offset"] = signal.scale, signal.offset
    row["raw_low"], row["raw_high"] = _raw_range(signal)
    row["place"] = row["selector"] = row["validity"] = row["sign"] = -1
    code = not_available_code(signal)
    if signal.is_float:
        row["not_available"] = {16: 0x7E00, 32: 0x7FC00000, 64: 0x7FF8000000000000}[signal.length]
    else:
        row["not_available"] = (code if code is not None else 0) % (1 << signal.length)
    return row


def compile_signals(
    message: Message, uses: Sequence[SignalUse], first_row: int = 0, first_code: int = 0
) -> SignalRows:
    """Return the rows that decode or encode `uses`, numbered from row `first_row` of a larger plan.

    Every name in `uses` must exist in the message (see `database.find_signal`).
    """
    known = {signal.name: signal for signal in message.signals}
    names: list[str] = [use.signal for use in uses]
    rows: list[RecordArray] = [signal_row(known[name]) for name in names]
    helpers: dict[str, int] = {}
    codes: list[int] = []

    def listed(values: Sequence[int]) -> tuple[int, int]:
        codes.extend(values)
        return first_code + len(codes) - len(values), len(values)

    def helper(name: str) -> int:
        if name not in helpers:
            helpers[name] = len(rows)
            names.append(name)
            rows.append(signal_row(known[name]))
        return first_row + helpers[name]

    for i, use in enumerate(uses):
        signal, row = known[use.signal], rows[i]
        row["place"] = use.place
        row["scale"] = signal.scale * use.factor
        row["offset"] = signal.offset * use.factor + use.offset
        refused = [round((value - signal.offset) / signal.scale) for value in use.refused]
        code = not_available_code(signal)
        row["refused"] = listed([*refused, *([] if code is None else [code])])
        if use.validity:
            row["validity"] = helper(use.validity)
            row["valid"] = listed(use.valid)
        if use.sign:
            row["sign"] = helper(use.sign)
            row["negative"] = listed(use.negative)
    place = 0
    while place < len(rows):  # a selector can itself be multiplexed
        signal = known[names[place]]
        if signal.multiplexer_signal is not None:
            rows[place]["selected"] = listed(signal.multiplexer_ids or [])
            rows[place]["selector"] = helper(signal.multiplexer_signal)
        place += 1
    return SignalRows(np.concatenate(rows) if rows else np.zeros(0, SIGNAL), len(uses), codes)


class MessagePlan(NamedTuple):
    """Codec of all signals of one message, each at the index of its name in `names`."""

    signals: RecordArray
    codes: NDArray[np.int64]
    names: tuple[str, ...]
    length: int


def compile_message(message: Message) -> MessagePlan:
    """Return the codec of every signal that lies within the message's length."""
    inside = [signal for signal in message.signals if fits(signal, message.length)]
    names = tuple(signal.name for signal in inside)
    rows = compile_signals(message, [SignalUse(name, place) for place, name in enumerate(names)])
    signals = rows.rows[: rows.wanted].copy()
    for place, name in enumerate(names):  # every helper is itself wanted: refer to that row
        selector = next(signal.multiplexer_signal for signal in inside if signal.name == name)
        if selector is not None:
            signals[place]["selector"] = names.index(selector)
    return MessagePlan(signals, np.array(rows.codes, np.int64), names, message.length)


@kernel
def raw_code(row: Record, data: NDArray[np.uint8]) -> Any:
    """Return the signal's bits as int64, sign-extended where it is signed."""
    raw = bits.extract(data, row.start, row.length, row.big_endian)
    if row.kind == bits.SIGNED:
        return bits.sign_extended(raw, row.length)
    return np.int64(raw)


@kernel
def _listed(codes: NDArray[np.int64], which: NDArray[np.int32], code: int) -> bool:
    for i in range(which[0], which[0] + which[1]):  # noqa: SIM110 (kernels have no generators)
        if codes[i] == code:
            return True
    return False


@kernel
def is_present(signals: Any, codes: NDArray[np.int64], row: int, data: NDArray[np.uint8]) -> bool:
    """Return whether the multiplexers of this payload select the signal."""
    return signals[row].selector < 0 or _is_selected(signals, codes, row, data)


@kernel
def _is_selected(signals: Any, codes: NDArray[np.int64], row: int, data: NDArray[np.uint8]) -> bool:
    while signals[row].selector >= 0:
        selector = signals[row].selector
        if not _listed(codes, signals[row].selected, raw_code(signals[selector], data)):
            return False
        row = selector
    return True


@kernel
def is_valid(signals: Any, codes: NDArray[np.int64], row: int, code: int, data: NDArray[np.uint8]) -> bool:
    """Return whether the signal, whose `raw_code` is `code`, is available and its validity signal agrees."""
    signal = signals[row]
    if signal.refused[1] > 0 and _listed(codes, signal.refused, code):
        return False
    if signal.validity < 0:
        return True
    return bool(_listed(codes, signal.valid, raw_code(signals[signal.validity], data)))


@kernel
def physical(row: Record, code: int) -> float:
    """Return the physical value of a `raw_code` in the target's unit; a float signal may give NaN or ±inf."""
    return float(bits.number(np.uint64(code), row.length, row.kind) * row.scale + row.offset)


@kernel
def signed_value(
    signals: Any, codes: NDArray[np.int64], row: int, code: int, data: NDArray[np.uint8]
) -> float:
    """Return the physical value of a signal's `raw_code`, negative where another signal says so."""
    signal = signals[row]
    value = physical(signal, code)
    if signal.sign >= 0 and _listed(codes, signal.negative, raw_code(signals[signal.sign], data)):
        return float(2.0 * signal.offset - value)  # the offset belongs to the value, not to its magnitude
    return value


@kernel
def decode(
    signals: Any, codes: NDArray[np.int64], data: NDArray[np.uint8], values: NDArray[np.float64]
) -> None:
    """Write every signal's value to its place; NaN for signals that the multiplexers deselect."""
    for row in range(len(signals)):
        present = is_present(signals, codes, row, data)
        values[signals[row].place] = (
            physical(signals[row], raw_code(signals[row], data)) if present else np.nan
        )


@kernel
def encode_signal(row: Record, data: NDArray[np.uint8], value: float) -> None:
    """Write one value: NaN as "not available", an out-of-range value as the nearest that can be sent."""
    code = np.uint64(row.not_available)
    if not np.isnan(value):
        scaled = (value - row.offset) / row.scale
        if row.kind == bits.FLOAT32:
            code = np.uint64(np.float32(scaled).view(np.uint32))
        elif row.kind == bits.FLOAT64:
            code = np.float64(scaled).view(np.uint64)
        elif scaled >= row.raw_high:
            code = np.uint64(row.raw_high)
        elif scaled <= row.raw_low:
            code = np.uint64(row.raw_low)
        else:
            code = np.uint64(np.int64(np.floor(scaled + 0.5)))
    bits.insert(data, row.start, row.length, row.big_endian, code)


@kernel
def encode(
    signals: Any, codes: NDArray[np.int64], values: NDArray[np.float64], data: NDArray[np.uint8]
) -> None:
    """Write the value of every selected signal; selectors are written first."""
    for row in range(len(signals)):
        if signals[row].selector < 0:
            encode_signal(signals[row], data, values[signals[row].place])
    for row in range(len(signals)):
        if signals[row].selector >= 0 and is_present(signals, codes, row, data):
            encode_signal(signals[row], data, values[signals[row].place])
