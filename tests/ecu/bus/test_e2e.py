"""End-to-end protection: checksums against published values, counters as tables of what to accept."""

from collections.abc import Callable
from pathlib import Path

import e2e.crc
import e2e.p01
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.bus.e2e import (
    FORD_ACCEL_DATA,
    FORD_BRAKE_SN_4,
    HYUNDAI_SUM,
    HYUNDAI_XOR,
    IN_SEQUENCE,
    REPEATED,
    RESYNCHRONISED,
    SEQUENCE,
    SOME_LOST,
    TOYOTA,
    WRONG_SEQUENCE,
    check_counter,
    checksum_holds,
    p01_crc,
    p01_protect,
)
from ecu.records import RecordArray

MS = 1_000_000
PERIOD = 10 * MS


@pytest.mark.parametrize(
    ("counter", "crc"),
    [
        (0, 0xCC),  # the contract's check value
        (1, 0x91),  # AUTOSAR PRS E2E Protocol, Profile 1 examples
    ],
)
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


@given(data=st.binary(min_size=8, max_size=8), data_id=st.integers(0, 0xFFFF), counter=st.integers(0, 14))
def test_profile_1_as_the_e2e_package(data: bytes, data_id: int, counter: int) -> None:
    ours = np.frombuffer(data, np.uint8).copy()
    p01_protect(ours, 8, data_id, counter)
    theirs = bytearray(data)
    theirs[1] = theirs[1] & 0xF0 | counter
    e2e.p01.e2e_p01_protect(theirs, data_id, length=8, increment_counter=False)
    assert ours.tobytes() == bytes(theirs)


@given(
    data=st.binary(min_size=8, max_size=8),
    first=st.integers(0, 56),
    flips=st.integers(1, 255),
)
def test_no_burst_of_up_to_eight_bits_passes(data: bytes, first: int, flips: int) -> None:
    sent = np.frombuffer(data, np.uint8).copy()
    p01_protect(sent, 8, 0x5A01, 3)
    assert checksum_holds(1, sent, 8, 0x50, 0x5A01)
    number = int.from_bytes(sent.tobytes(), "big") ^ (flips << first)
    broken = np.frombuffer(number.to_bytes(8, "big"), np.uint8)
    assert not checksum_holds(1, broken, 8, 0x50, 0x5A01)


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


# Counter: frames as (milliseconds, counter) after an accepted frame with counter 5 at 0 ms, and the verdicts.
OK, LOST, SYNC, REP, BAD = IN_SEQUENCE, SOME_LOST, RESYNCHRONISED, REPEATED, WRONG_SEQUENCE
SEQUENCES = {
    "regular": ([(10, 6), (20, 7), (30, 8)], [OK, OK, OK]),
    "early and late by half a cycle": ([(6, 6), (24, 7), (26, 8)], [OK, OK, OK]),
    "one lost": ([(20, 7), (30, 8)], [LOST, OK]),
    "five lost": ([(60, 11), (70, 12)], [LOST, OK]),
    "stuck": ([(10, 5), (20, 5), (200, 5)], [REP, REP, REP]),
    "stuck, then going on": ([(10, 5), (20, 6), (30, 7)], [REP, OK, OK]),
    "sent twice": ([(10, 6), (11, 6), (20, 7)], [OK, REP, OK]),
    "wraps behind 14": ([(90, 14), (100, 0), (110, 1)], [LOST, OK, OK]),
    "counter 15 does not exist": ([(10, 15), (20, 7)], [BAD, LOST]),
    "jumps ahead too far": ([(10, 9), (20, 7)], [BAD, LOST]),
    "sender restarts at 0": ([(10, 0), (20, 1), (30, 2), (40, 3)], [BAD, BAD, SYNC, OK]),
    "sender restarts and loses a frame": ([(10, 0), (20, 1), (40, 3), (50, 4)], [BAD, BAD, SYNC, OK]),
    "1 s gap, going on": ([(1000, 0), (1010, 1)], [LOST, OK]),
    "1 s gap, same counter first": ([(1000, 5), (1010, 6)], [REP, OK]),
    "an old block beside the sender": (
        [(10, 6), (11, 0), (20, 7), (21, 1), (30, 8), (31, 2), (40, 9), (41, 3), (50, 10)],
        [OK, BAD, OK, BAD, OK, BAD, OK, BAD, OK],
    ),
    "an old block in a burst": (
        [(10, 6), (11, 0), (11, 1), (11, 2), (12, 3), (12, 4), (20, 7)],
        [OK, BAD, BAD, BAD, BAD, BAD, OK],
    ),
    "three in half a cycle": ([(10, 6), (11, 7), (12, 8), (20, 8)], [OK, OK, BAD, OK]),
    "the clock is set back": ([(-500, 6), (-490, 7)], [OK, OK]),
}


@pytest.mark.parametrize("name", SEQUENCES)
def test_counter(name: str) -> None:
    frames, verdicts = SEQUENCES[name]
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    assert check_counter(state, 5, 15, 0, PERIOD) == IN_SEQUENCE, "a log may start anywhere"
    assert [check_counter(state, counter, 15, ms * MS, PERIOD) for ms, counter in frames] == verdicts


@given(lost=st.lists(st.booleans(), min_size=20, max_size=200))
def test_lost_frames_never_cost_another_one(lost: list[bool]) -> None:
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    accepted_at = None
    for k, gone in enumerate(lost):
        if gone:
            continue
        verdict = check_counter(state, k % 15, 15, k * PERIOD, PERIOD)
        repeats = accepted_at is not None and (k - accepted_at) % 15 == 0
        assert verdict == REPEATED if repeats else verdict in (IN_SEQUENCE, SOME_LOST)
        accepted_at = accepted_at if repeats else k


@given(restarted_at=st.integers(0, 14), silent=st.integers(0, 200), known=st.integers(0, 14))
def test_a_restarted_sender_is_accepted_within_four_frames(
    restarted_at: int, silent: int, known: int
) -> None:
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    check_counter(state, known, 15, 0, PERIOD)
    verdicts = [
        check_counter(state, (restarted_at + k) % 15, 15, (1 + silent + k) * PERIOD, PERIOD) for k in range(4)
    ]
    assert verdicts[-1] in (IN_SEQUENCE, SOME_LOST, RESYNCHRONISED)
