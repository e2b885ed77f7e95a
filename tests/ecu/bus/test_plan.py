"""Compiled codecs against cantools: ours, the shipped cars', a multiplexed one and many real cars'."""

import math
import struct
from functools import cache
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from cantools.database import Message
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.bus.database import load_database
from ecu.bus.plan import (
    MessagePlan,
    SignalUse,
    compile_message,
    compile_signals,
    decode,
    encode,
    is_valid,
    raw_code,
)
from ecu.errors import UserError

ROOT = Path(__file__).parents[3]
SHIPPED = [ROOT / "dbc" / "brake_ecu.dbc", *sorted((ROOT / "dbc" / "cars").glob("*.dbc"))]
PAYLOADS = 40  # random ones per message

MULTIPLEXED = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 1 Simple: 8 A
 SG_ which M : 0|4@1+ (1,0) [0|0] "" A
 SG_ always : 8|8@1- (0.5,3) [0|0] "" A
 SG_ in_one m1 : 16|12@1+ (0.1,-5) [0|0] "" A
 SG_ in_two m2 : 23|12@0- (2,0) [0|0] "" A
BO_ 2 Extended: 8 A
 SG_ outer M : 0|4@1+ (1,0) [0|0] "" A
 SG_ inner m1M : 4|4@1+ (1,0) [0|0] "" A
 SG_ deep m2 : 8|16@1- (1,0) [0|0] "" A
 SG_ ranged m3 : 24|8@1+ (1,0) [0|0] "" A
BO_ 3 Numbers: 24 A
 SG_ half : 7|16@0- (1,0) [0|0] "" A
 SG_ single : 23|32@0- (2,1) [0|0] "" A
 SG_ double : 64|64@1- (1,0) [0|0] "" A
 SG_ wide : 128|64@1+ (1,0) [0|0] "" A
BO_ 4 Long: 64 A
 SG_ last : 511|7@0+ (1,0) [0|0] "" A
 SG_ across : 250|61@1- (0.001,0) [0|0] "" A
VAL_ 4 last 127 "not_available" ;
VAL_ 4 across -1152921504606846976 "not_available" ;
SIG_VALTYPE_ 3 single : 1;
SIG_VALTYPE_ 3 double : 2;
SG_MUL_VAL_ 2 inner outer 1-1;
SG_MUL_VAL_ 2 deep inner 2-2;
SG_MUL_VAL_ 2 ranged outer 3-5, 9-9;
"""


@cache
def multiplexed() -> dict[str, Message]:
    database = cantools.database.load_string(MULTIPLEXED, "dbc")
    return {message.name: message for message in database.messages}


def same(ours: float, theirs: float) -> bool:
    return (math.isnan(ours) and math.isnan(theirs)) or math.isclose(
        ours, theirs, rel_tol=1e-12, abs_tol=1e-9
    )


def decoded(plan: MessagePlan, data: bytes) -> dict[str, float]:
    values = np.zeros(len(plan.names))
    decode(plan.signals, plan.codes, np.frombuffer(data, np.uint8), values)
    return dict(zip(plan.names, values.tolist(), strict=True))


def check_decode(message: Message, plan: MessagePlan, data: bytes) -> None:
    ours = decoded(plan, data)
    try:
        theirs: dict[str, Any] = message.decode(data, decode_choices=False)  # type: ignore[assignment]
    except cantools.database.DecodeError:
        return  # a multiplexer value that the database does not know
    for name, value in ours.items():
        if name in theirs:
            assert same(value, float(theirs[name])), (message.name, name, data.hex())
        else:
            assert math.isnan(value), (message.name, name, data.hex())


def check_encode(message: Message, plan: MessagePlan, data: bytes) -> None:
    """What cantools encodes from its own decoded values, we encode from ours."""
    try:
        theirs = message.decode(data, decode_choices=False)
        expected = message.encode(theirs, strict=False)  # type: ignore[arg-type]
    except (cantools.database.DecodeError, cantools.database.EncodeError, OverflowError, ValueError):
        return
    if any(math.isnan(float(value)) for value in theirs.values()):  # type: ignore[union-attr,arg-type]
        return
    values = np.array([float(theirs.get(name, math.nan)) for name in plan.names])  # type: ignore[union-attr,arg-type]
    written = np.zeros(message.length, np.uint8)
    encode(plan.signals, plan.codes, values, written)
    assert written.tobytes() == expected, (message.name, data.hex())


def payloads(message: Message, seed: int) -> list[bytes]:
    random = np.random.default_rng(seed)
    ends = [bytes(message.length), b"\xff" * message.length]
    return ends + [random.bytes(message.length) for _ in range(PAYLOADS)]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_databases_decode_as_cantools(path: Path) -> None:
    for message in load_database(path).messages:
        plan = compile_message(message)
        for data in payloads(message, message.frame_id):
            check_decode(message, plan, data)


@given(data=st.binary(min_size=8, max_size=8))
@settings(max_examples=300)
def test_multiplexers_decode_as_cantools(data: bytes) -> None:
    for name in ("Simple", "Extended"):
        message = multiplexed()[name]
        check_decode(message, compile_message(message), data)


@given(data=st.binary(min_size=64, max_size=64))
def test_long_payloads_and_ieee_numbers_decode_as_cantools(data: bytes) -> None:
    for name in ("Numbers", "Long"):
        message = multiplexed()[name]
        check_decode(message, compile_message(message), data[: message.length])


def test_nested_multiplexers_select() -> None:
    plan = compile_message(multiplexed()["Extended"])
    assert decoded(plan, bytes([0x21, 7, 0, 9, 0, 0, 0, 0]))["deep"] == 7.0
    assert math.isnan(decoded(plan, bytes([0x22, 7, 0, 9, 0, 0, 0, 0]))["deep"])
    assert decoded(plan, bytes([0x09, 7, 0, 9, 0, 0, 0, 0]))["ranged"] == 9.0


def test_encode_as_cantools() -> None:
    unlimited = [multiplexed()["Simple"], multiplexed()["Extended"]]
    for path in SHIPPED[1:]:  # values beyond the range that a database states are limited: next test
        unlimited += [m for m in load_database(path).messages if not any(s.minimum for s in m.signals)]
    for message in unlimited:
        plan = compile_message(message)
        whole = plan.signals.copy()
        for row in range(len(whole)):
            length, signed = int(whole[row]["length"]), int(whole[row]["kind"]) == 1
            whole[row]["raw_low"] = -(1 << (length - 1)) if signed else 0
            whole[row]["raw_high"] = (1 << (length - 1)) - 1 if signed else min((1 << length) - 1, 2**63 - 1)
        for data in payloads(message, 1):
            check_encode(message, plan._replace(signals=whole), data)


@pytest.mark.parametrize(
    ("value", "code"),
    [
        (12.5, 4500),
        (-10.0, 0),
        (-11.0, 0),  # never wraps
        (250.0, 52000),
        (1e300, 52000),
        (-math.inf, 0),
        (math.nan, 65535),  # not available
        (12.5024, 4500),  # rounds to the nearest code
        (12.5026, 4501),
    ],
)
def test_pressure_codes(contract: Path, value: float, code: int) -> None:
    message = load_database(contract).get_message_by_name("CalliperPressureFront")
    plan = compile_message(message)
    values = np.zeros(len(plan.names))
    values[plan.names.index("calliper_pressure_fl")] = value
    data = np.zeros(8, np.uint8)
    encode(plan.signals, plan.codes, values, data)
    assert int.from_bytes(data[2:4].tobytes(), "little") == code


@pytest.mark.parametrize(("value", "last", "across"), [(1e300, 126, 2**60 - 1), (-1e300, 0, -(2**60) + 1)])
def test_no_value_is_sent_as_not_available(value: float, last: int, across: int) -> None:
    message = multiplexed()["Long"]
    plan = compile_message(message)
    data = np.zeros(64, np.uint8)
    encode(plan.signals, plan.codes, np.full(2, value), data)
    codes = [int(raw_code(plan.signals[plan.names.index(name)], data)) for name in ("last", "across")]
    assert codes == [last, across]


def test_sentinels_and_validity() -> None:
    message = multiplexed()["Simple"]
    use = SignalUse("always", 0, refused=(-61.0,), validity="which", valid=(1, 2))
    rows = compile_signals(message, [use])
    codes = np.array(rows.codes, np.int64)
    for which, raw, valid in [(1, 4, True), (2, 4, True), (3, 4, False), (1, 0x80, False)]:
        data = np.array([which, raw, 0, 0, 0, 0, 0, 0], np.uint8)
        assert is_valid(rows.rows, codes, 0, raw_code(rows.rows[0], data), data) == valid, (which, raw)
    assert raw_code(rows.rows[0], np.array([1, 0x80, 0, 0, 0, 0, 0, 0], np.uint8)) == -128


@pytest.mark.drives
def test_databases_of_real_cars_decode_as_cantools(drives: Path) -> None:
    messages = 0
    for path in sorted((drives / "dbc").glob("*.dbc")):
        try:
            database = load_database(path, strict=False)
        except UserError:
            continue  # three with syntax errors, see test_database
        for message in database.messages:
            if message.length == 0 or not message.signals or message.length > 64:
                continue
            plan = compile_message(message)
            for data in payloads(message, message.frame_id)[:12]:
                check_decode(message, plan, data)
            messages += 1
    assert messages > 900


@pytest.mark.parametrize("value", [0.0, -2.5, 1 / 3, 1e300, 5e-324, -math.inf])
def test_a_double_is_sent_bit_by_bit(value: float) -> None:
    plan = compile_message(multiplexed()["Numbers"])
    values, data = np.zeros(len(plan.names)), np.zeros(24, np.uint8)
    values[plan.names.index("double")] = value
    encode(plan.signals, plan.codes, values, data)
    assert data[8:16].tobytes() == struct.pack("<d", value)
