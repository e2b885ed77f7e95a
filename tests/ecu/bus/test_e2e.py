"""End-to-end protection: checksums against published values."""

from collections.abc import Callable
from pathlib import Path

import e2e.crc
import e2e.p01
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import ecu.bus.e2e as protection
from ecu.bus.e2e import (
    FORD_ACCEL_DATA,
    FORD_BRAKE_SN_4,
    HYUNDAI_SUM,
    HYUNDAI_XOR,
    TOYOTA,
    checksum_holds,
    checksum_place,
    p01_crc,
    protect,
)
from ecu.contract.records import RecordArray

from .conftest import p01_protect


@pytest.mark.parametrize(
    ("counter", "crc"),
    [
        (0, 0xCC),  # the contract's check value
        (1, 0x91),  # AUTOSAR PRS E2E Protocol, Profile 1 examples
    ],
)
@pytest.mark.requirement("REQ-E2E-1")
def test_profile_1_of_eight_zero_bytes(counter: int, crc: int) -> None:
    data = np.zeros(8, np.uint8)
    p01_protect(data, 8, 0x123, counter)
    assert data.tolist() == [crc, counter, 0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize(
    ("text", "crc"),
    [
        ("00000000", 0x59),
        ("F20183", 0x37),
        ("0FAA0055", 0x79),
        ("00FF5511", 0xB8),
        ("332255AABBCCDDEEFF", 0xCB),
        ("926B55", 0x8C),
        ("FFFFFFFF", 0x74),
    ],
)
def test_crc_vectors_of_the_autosar_crc_routines(text: str, crc: int) -> None:
    """The routine starts at 0xFF, which equals inverting the first byte and starting at 0."""
    vector = bytes.fromhex(text)
    assert e2e.crc.calculate_crc8(vector, 0, True) == crc
    data = np.frombuffer(b"\0" + vector[2:], np.uint8)
    assert p01_crc(data, len(data), (vector[0] ^ 0xFF) | vector[1] << 8) ^ 0xFF == crc


@given(data=st.binary(min_size=8, max_size=64), data_id=st.integers(0, 0xFFFF), counter=st.integers(0, 14))
@example(bytes(range(64)), 0x1234, 3)
@pytest.mark.requirement("REQ-E2E-1")
def test_profile_1_as_the_e2e_package(data: bytes, data_id: int, counter: int) -> None:
    ours = np.frombuffer(data, np.uint8).copy()
    p01_protect(ours, len(data), data_id, counter)
    theirs = bytearray(data)
    theirs[1] = theirs[1] & 0xF0 | counter
    e2e.p01.e2e_p01_protect(theirs, data_id, length=len(data), increment_counter=False)
    assert ours.tobytes() == bytes(theirs)


@given(
    data=st.binary(min_size=8, max_size=8),
    first=st.integers(0, 56),
    flips=st.integers(1, 255),
)
@pytest.mark.requirement("REQ-E2E-1")
def test_no_burst_of_up_to_eight_bits_passes(data: bytes, first: int, flips: int) -> None:
    sent = np.frombuffer(data, np.uint8).copy()
    p01_protect(sent, 8, 0x5A01, 3)
    assert checksum_holds(1, sent, 8, 0x50, 0x5A01)
    number = int.from_bytes(sent.tobytes(), "big") ^ (flips << first)
    broken = np.frombuffer(number.to_bytes(8, "big"), np.uint8)
    assert not checksum_holds(1, broken, 8, 0x50, 0x5A01)


@pytest.mark.parametrize(
    ("rule", "highest"),
    [
        ("autosar_p01", 1),  # the counter
        ("ford_brake_sn_4", 3),  # the counter
        ("ford_accel_data", 7),
    ],
)
def test_the_shortest_payload_ends_with_the_highest_byte_of_the_rule(rule: str, highest: int) -> None:
    assert protection.SHORTEST_PAYLOAD[rule] == highest + 1


@given(data=st.binary(min_size=8, max_size=8))
def test_without_a_rule_every_payload_holds(data: bytes) -> None:
    assert checksum_holds(protection.NO_CHECKSUM, np.frombuffer(data, np.uint8), 8, 0x50, 0)


def test_profile_1_counts_to_14_in_the_low_nibble_of_byte_1() -> None:
    assert protection.P01_MODULO == 14 + 1
    data = np.full(8, 0xFF, np.uint8)
    p01_protect(data, 8, 0x123, 9)
    assert data[1:].tolist() == [0xF9, *[0xFF] * 6]


@pytest.mark.parametrize(
    ("car", "can_id", "rule", "byte"),
    [
        ("mustang", 0x07D, FORD_BRAKE_SN_4, 2),
        ("mustang", 0x092, FORD_ACCEL_DATA, 6),
        ("rav4", 0x024, TOYOTA, 7),
        ("rav4", 0x025, TOYOTA, 7),
        ("rav4", 0x2C1, TOYOTA, 7),
        ("kona", 0x153, HYUNDAI_SUM, 7),
        ("kona", 0x2B0, HYUNDAI_XOR, 4),
    ],
)
def test_makers_rules_on_recorded_frames(
    root: Path,
    read_log: Callable[[Path, str], RecordArray],
    car: str,
    can_id: int,
    rule: int,
    byte: int,
) -> None:
    log = read_log(root / "tests" / "data" / f"{car}.log", "can0")
    frames = log[log["can_id"] == can_id]
    assert len(frames) > 10
    for one in frames:
        assert checksum_holds(rule, one["data"], one["length"], can_id, 0)
        one["data"][byte] ^= 0x10
        assert not checksum_holds(rule, one["data"], one["length"], can_id, 0)


@pytest.mark.drives
@pytest.mark.parametrize(
    ("log", "bus", "can_id", "rule", "count"),
    [
        ("mustang/mustang_s550.candump.log", "can0", 0x07D, FORD_BRAKE_SN_4, 2524),
        ("mustang/mustang_s550.candump.log", "can0", 0x092, FORD_ACCEL_DATA, 603),
        ("rav4/rav4_bus0_bus1.candump.log", "can0", 0x024, TOYOTA, 4974),
        ("rav4/rav4_bus0_bus1.candump.log", "can0", 0x025, TOYOTA, 4974),
        ("kona/kona.candump.log", "can0", 0x153, HYUNDAI_SUM, 1085),
        ("kona/kona.candump.log", "can1", 0x2B0, HYUNDAI_XOR, 863),
    ],
)
def test_makers_rules_on_whole_drives(
    drives: Path,
    read_log: Callable[[Path, str], RecordArray],
    log: str,
    bus: str,
    can_id: int,
    rule: int,
    count: int,
) -> None:
    frames = read_log(drives / log, bus)
    frames = frames[frames["can_id"] == can_id]
    assert sum(checksum_holds(rule, one["data"], one["length"], can_id, 0) for one in frames) == count


@pytest.mark.parametrize(
    ("car", "can_id", "rule", "byte", "bits"),
    [
        ("mustang", 0x07D, FORD_BRAKE_SN_4, 2, 0xFF),
        ("mustang", 0x092, FORD_ACCEL_DATA, 6, 0xFF),
        ("rav4", 0x024, TOYOTA, 7, 0xFF),
        ("rav4", 0x025, TOYOTA, 7, 0xFF),
        ("kona", 0x153, HYUNDAI_SUM, 7, 0xFF),
        ("kona", 0x2B0, HYUNDAI_XOR, 4, 0xF0),
    ],
)
def test_what_is_protected_is_the_recorded_frame(
    root: Path,
    read_log: Callable[[Path, str], RecordArray],
    car: str,
    can_id: int,
    rule: int,
    byte: int,
    bits: int,
) -> None:
    log = read_log(root / "tests" / "data" / f"{car}.log", "can0")
    for one in log[log["can_id"] == can_id]:
        assert checksum_place(rule, int(one["length"])) == byte
        recorded = one["data"].copy()
        one["data"][byte] ^= bits
        protect(rule, one["data"], one["length"], can_id, 0)
        assert one["data"].tolist() == recorded.tolist()


@given(data=st.binary(min_size=8, max_size=8))
def test_without_a_rule_nothing_is_protected(data: bytes) -> None:
    payload = np.frombuffer(data, np.uint8).copy()
    protect(protection.NO_CHECKSUM, payload, 8, 0x50, 0)
    assert payload.tobytes() == data


BRAKE_REQUEST = 0x0C040B2A
# Sum of 7F 65 E4 and four FF: 1476; of the identifier's bytes: 69; counter. Example: 1476 + 69 + 5 = 1550,
# 1550 >> 4 = 96, 96 + 1550 = 1646, whose last four bits are E.
REQUESTS = [(0, 0x90), (5, 0xE5), (6, 0xF6), (7, 0x17), (15, 0x9F)]


@pytest.mark.parametrize(("counter", "last"), REQUESTS)
def test_the_checksum_of_j1939_s_brake_request_by_hand(counter: int, last: int) -> None:
    data = np.frombuffer(bytes.fromhex("7F65E4FFFFFFFF") + bytes([0xF0 | counter]), np.uint8).copy()
    protection.protect(protection.J1939, data, 8, BRAKE_REQUEST, 0)
    assert data[7] == last
    assert data[:7].tobytes() == bytes.fromhex("7F65E4FFFFFFFF")


def test_no_flipped_bit_and_no_other_sender_passes_the_checksum_of_j1939() -> None:
    data = np.frombuffer(bytes.fromhex("7F65E4FFFFFFFFE5"), np.uint8).copy()
    assert protection.checksum_holds(protection.J1939, data, 8, BRAKE_REQUEST, 0)
    for bit in range(64):
        data[bit // 8] ^= 1 << bit % 8
        assert not protection.checksum_holds(protection.J1939, data, 8, BRAKE_REQUEST, 0), bit
        data[bit // 8] ^= 1 << bit % 8
    for bit in range(29):
        assert not protection.checksum_holds(protection.J1939, data, 8, BRAKE_REQUEST ^ 1 << bit, 0), bit
