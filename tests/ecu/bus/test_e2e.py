"""End-to-end protection: checksums against published values, counters as tables of what to accept."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import e2e.crc
import e2e.p01
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ecu.bus.e2e as protection
from ecu.bus.e2e import (
    CROSSED,
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
    in_doubt,
    p01_crc,
    p01_protect,
)
from ecu.contract.records import RecordArray

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
    ("rule", "highest"),
    [
        ("autosar_p01", 1),  # the counter
        ("ford_brake_sn_4", 3),  # the counter
        ("ford_accel_data", 7),
    ],
)
def test_the_shortest_payload_ends_with_the_highest_byte_of_the_rule(rule: str, highest: int) -> None:
    assert protection.SHORTEST[rule] == highest + 1


@given(data=st.binary(min_size=8, max_size=8))
def test_without_a_rule_every_payload_holds(data: bytes) -> None:
    assert checksum_holds(protection.NO_CHECKSUM, np.frombuffer(data, np.uint8), 8, 0x50, 0)


def test_profile_1_counts_to_14_in_the_low_nibble_of_byte_1() -> None:
    assert protection.P01_MODULO == 14 + 1
    data = np.full(8, 0xFF, np.uint8)
    p01_protect(data, 8, 0x123, 9)
    number = int.from_bytes(data.tobytes(), "little") >> protection.P01_COUNTER_START
    assert number & ((1 << protection.P01_COUNTER_LENGTH) - 1) == 9
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


# Counter: frames as (milliseconds, counter) after an accepted frame with counter 5 at 0 ms, and the verdicts.
NO_COUNTER = -1
OK, LOST, SYNC, REP, BAD, TWO = IN_SEQUENCE, SOME_LOST, RESYNCHRONISED, REPEATED, WRONG_SEQUENCE, CROSSED
SEQUENCES = {
    "regular": ([(10, 6), (20, 7), (30, 8)], [OK, OK, OK]),
    "early and late by half a cycle": ([(6, 6), (24, 7), (26, 8)], [OK, OK, OK]),
    "half a cycle late, just": ([(15, 6)], [OK]),
    "later than half a cycle, undisputed": ([(15.1, 6), (25.1, 7)], [OK, OK]),
    "later than half a cycle, disputed": ([(5, 1), (15.1, 6)], [BAD, BAD]),
    "half a cycle early, just": ([(5, 6)], [OK]),
    "earlier than half a cycle": ([(4.9, 6)], [BAD]),
    "early by more than a quarter while another claims the sequence": (
        [(5, 1), (7.4, 6), (17.5, 7)],
        [BAD, BAD, LOST],
    ),
    "a quarter early, just, while another claims it": ([(5, 1), (7.5, 6)], [BAD, OK]),
    "a quarter late, just, while another claims it": ([(5, 1), (12.5, 6)], [BAD, OK]),
    "later than a quarter while another claims it": ([(5, 1), (12.6, 6)], [BAD, BAD]),
    "half a cycle late, just, and the next early": ([(15, 6), (19, 7)], [OK, OK]),
    "somebody spoke for one that goes on": ([(25, 6), (60, 11), (70, 12)], [OK, LOST, OK]),
    "… and is half a cycle late at its last": ([(25, 6), (65, 11)], [OK, LOST]),
    "… off its grid": ([(25, 6), (60, 12)], [OK, BAD]),
    "… after its time": ([(25, 6), (66, 12)], [OK, BAD]),
    "the doubt is over": (
        [(5, 1)] + [(10 * k, 5 + k) for k in range(1, 101)] + [(1006, 106)],
        [BAD] + [OK] * 101,
    ),
    "one lost": ([(20, 7), (30, 8)], [LOST, OK]),
    "five lost": ([(60, 11), (70, 12)], [LOST, OK]),
    "one cycle behind after five lost, then the sender": ([(60, 10), (64, 12), (64, 11)], [LOST, BAD, LOST]),
    "… which lost a sixth": ([(60, 10), (66, 12)], [LOST, BAD]),
    "gone: any step that the time allows": ([(66, 13), (76, 14)], [LOST, OK]),
    "gone: a step larger than the time allows": ([(66, 14)], [BAD]),
    "alive for 65 ms: no step the time does not allow": ([(65, 13)], [BAD]),
    "gone: half a cycle early, just": ([(75, 14)], [LOST]),
    "gone: earlier than half a cycle": ([(74.9, 14)], [BAD]),
    "gone: back with the third frame whatever it counts": ([(66, 14), (76, 15), (86, 16)], [BAD, BAD, SYNC]),
    "… and one of them lost, half a cycle early": ([(66, 14), (81, 16), (91, 17)], [BAD, BAD, SYNC]),
    "… too early for a lost one": ([(66, 14), (80.9, 16), (90.9, 17), (100.9, 18)], [BAD, BAD, BAD, SYNC]),
    "… that repeat do not count": ([(66, 16), (76, 16), (86, 17), (96, 18)], [BAD, BAD, BAD, SYNC]),
    "… nor one from before the last accepted": (
        [(10, 6), (11, 1), *((10 * k, 5 + k) for k in range(2, 7)), (130, 20), (140, 21), (150, 22)],
        [OK, BAD, *[OK] * 5, BAD, BAD, SYNC],
    ),
    "stuck": ([(10, 5), (20, 5), (200, 5)], [REP, REP, REP]),
    "stuck, then going on": ([(10, 5), *((10 * k, 4 + k) for k in range(2, 8))], [REP, *[BAD] * 5, LOST]),
    "held up by three cycles": ([(40, 6), (50, 7), (60, 8)], [OK, OK, OK]),
    "sent twice": ([(10, 6), (11, 6), (20, 7)], [OK, TWO, OK]),
    "sent again half a cycle later": ([(10, 6), (15, 6), (15.1, 6)], [OK, TWO, REP]),
    "the nearer of two keeps the grid": ([(5.5, 6), (10, 6), (20, 7), (27.6, 8)], [OK, TWO, OK, OK]),
    "wraps behind 14": (
        [(60, 11), (70, 12), (80, 13), (90, 14), (100, 0), (110, 1)],
        [LOST, OK, OK, OK, OK, OK],
    ),
    "counter 15 does not exist": ([(10, NO_COUNTER), (20, 7)], [BAD, LOST]),
    "… nor where 0 is due": ([(60, 11), (90, 14), (100, NO_COUNTER)], [LOST, LOST, BAD]),
    "jumps ahead too far": ([(10, 9), (20, 7)], [BAD, LOST]),
    "sender restarts at 0": ([(10 * k, k - 1) for k in range(1, 9)], [BAD] * 5 + [REP, OK, OK]),
    "sender restarts far ahead": ([(10 * k, 12 + k) for k in range(1, 9)], [BAD] * 6 + [SYNC, OK]),
    "sender restarts after a pause": ([(100, 4), (110, 5), (120, 6), (130, 7)], [BAD, REP, OK, OK]),
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
    "held up for 50 ms, then all at once": (
        [(60, 6), (60, 7), (60, 8), (60, 9), (60, 10), (60, 11)],
        [OK, BAD, BAD, BAD, BAD, LOST],
    ),
    "the clock is set back": ([(-500, 6), (-490, 7)], [OK, OK]),
    "… by more than a cycle, just": ([(-10.1, 6)], [OK]),
    "a cycle early is no clock set back": ([(-10, 6)], [BAD]),
}


def judge(state: Any, counter: int, ms: float) -> int:
    counter = 15 if counter == NO_COUNTER else counter % 15
    return int(check_counter(state, counter, 15, 1_000 * MS + int(ms * MS), PERIOD, PERIOD))


@pytest.mark.parametrize("name", SEQUENCES)
def test_counter(name: str) -> None:
    frames, verdicts = SEQUENCES[name]
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    assert judge(state, 5, 0) == IN_SEQUENCE, "a log may start anywhere"
    assert [judge(state, counter, ms) for ms, counter in frames] == verdicts


@pytest.mark.parametrize(
    ("told_ns", "stamp_ns", "doubt"),
    [
        (0, 500 * MS, False),  # never told, early in a log that begins at 0
        (2_000 * MS, 2_000 * MS, True),
        (2_000 * MS, 2_999 * MS, True),
        (2_000 * MS, 3_000 * MS, False),
    ],
)
def test_doubt_lasts_for_a_second(told_ns: int, stamp_ns: int, doubt: bool) -> None:
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    state["doubted_ns"] = told_ns
    assert bool(in_doubt(state, stamp_ns)) == doubt


@pytest.mark.parametrize(
    ("late_ms", "doubt"),
    [(-2.6, True), (-2.5, False), (0.0, False), (2.5, False), (2.6, True), (5.0, True), (5.1, True)],
)
def test_a_frame_off_its_place_by_more_than_a_quarter_of_a_period_is_told(
    late_ms: float, doubt: bool
) -> None:
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    judge(state, 5, 0)
    assert judge(state, 6, 10 + late_ms) == IN_SEQUENCE
    assert bool(in_doubt(state, 1_010 * MS)) == doubt


@pytest.mark.parametrize(("late_ms", "moved_ms"), [(2.0, 0.5), (-2.0, -0.5), (0.0, 0.0)])
def test_a_late_frame_moves_the_grid_by_a_quarter_of_it_in_doubt_by_a_sixteenth(
    late_ms: float, moved_ms: float
) -> None:
    for doubted_ns, share in ((0, 1.0), (1_000 * MS, 0.25)):
        state = np.zeros(1, np.dtype(SEQUENCE))[0]
        judge(state, 5, 0)
        state["doubted_ns"] = doubted_ns
        assert judge(state, 6, 10 + late_ms) == IN_SEQUENCE
        assert state["expected_ns"] == 1_010 * MS
        assert state["grid_ns"] == 1_010 * MS + int(share * moved_ms * MS)


@given(lost=st.lists(st.booleans(), min_size=20, max_size=200))
def test_lost_frames_never_cost_another_one(lost: list[bool]) -> None:
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    accepted_at = None
    for k, gone in enumerate(lost):
        if gone:
            continue
        verdict = judge(state, k, 10 * k)
        repeats = accepted_at is not None and (k - accepted_at) % 15 == 0
        assert verdict == REPEATED if repeats else verdict in (IN_SEQUENCE, SOME_LOST)
        accepted_at = accepted_at if repeats else k


@given(
    restarted_at=st.integers(0, 14),
    silent=st.integers(0, 200),
    known=st.integers(0, 14),
    jitter=st.lists(st.floats(-1.0, 1.0), min_size=10, max_size=10),
)
def test_a_restarted_sender_is_back_within_100_ms(
    restarted_at: int, silent: int, known: int, jitter: list[float]
) -> None:
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    judge(state, known, 0)
    verdicts = [judge(state, restarted_at + k, 10 * (1 + silent + k) + jitter[k]) for k in range(9)]
    taken = [k for k, verdict in enumerate(verdicts) if verdict in (IN_SEQUENCE, SOME_LOST, RESYNCHRONISED)]
    assert taken, verdicts
    assert verdicts[-1] in (IN_SEQUENCE, SOME_LOST, RESYNCHRONISED)
    if silent >= 6:
        assert taken[0] <= 3, "who was silent for longer is back with the third frame"


@pytest.mark.parametrize("interval", [10, 25, 40, 70, 100])
def test_a_sender_that_may_choose_its_rate_has_no_grid(interval: int) -> None:
    """`VehicleSpeed` comes every 10 to 100 ms."""
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    for k in range(40):
        stamp_ns = 1_000 * MS + k * interval * MS
        assert check_counter(state, k % 15, 15, stamp_ns, PERIOD, 10 * PERIOD) == IN_SEQUENCE
        assert not in_doubt(state, stamp_ns)


@pytest.mark.parametrize(
    "late_ms",
    [[0, 0, 5.8, 0, 0, 0], [0, 9, 0, 0, 9, 0], [0, 40, 30, 20, 10, 0], [0, 15, 5.1, 0, 20, 10, 0]],
    ids=["one late", "twice by nearly a period", "four held up, sent at once", "again and again"],
)
def test_a_sender_without_a_grid_may_be_held_up(late_ms: list[float]) -> None:
    """A frame that is late makes the next one early: both are its sender's."""
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    for k, late in enumerate(late_ms * 5):
        stamp_ns = 1_000 * MS + k * PERIOD + int(late * MS)
        assert check_counter(state, k % 15, 15, stamp_ns, PERIOD, 10 * PERIOD) == IN_SEQUENCE, k


@pytest.mark.parametrize("off", [0.95, 0.98, 1.02, 1.05])
def test_a_senders_clock_may_be_off(off: float) -> None:
    state = np.zeros(1, np.dtype(SEQUENCE))[0]
    assert {judge(state, k, 10 * off * k) for k in range(1000)} == {IN_SEQUENCE}


LOST_FRAMES = range(6)
OFFSETS_MS = (0.5, 2.0, 3.5, 5.0, 6.5, 8.0, 9.5)


@pytest.mark.parametrize("lost", LOST_FRAMES)
@pytest.mark.parametrize("phase", range(15))
def test_a_replayed_stream_does_not_win_over_a_living_sender(phase: int, lost: int) -> None:
    """Frames of both every 10 ms with 1 ms of jitter; the living sender loses `lost` in a row each 0.3 s.

    A replayed stream is taken only where its counter and its instant are those of the sender, within a
    quarter of a period; then both claim each place, and who is meant is told (see `request.py`).
    """
    random = np.random.default_rng(100 * phase + lost)
    for offset in OFFSETS_MS:
        state = np.zeros(1, np.dtype(SEQUENCE))[0]
        taken = {"living": 0, "replayed": 0}
        frames = []
        for k in range(400):
            living_ms, replayed_ms = random.uniform(-1.0, 1.0, 2)
            if k < 60 or k % 30 >= lost:
                frames.append((10 * k + living_ms, "living", k))
            if k >= 50:
                frames.append((10 * k + offset + replayed_ms, "replayed", k + phase))
        sent = sum(who == "living" for ms, who, _ in frames if ms >= 500)
        crossed = 0
        for ms, who, counter in sorted(frames):
            verdict = judge(state, counter, ms)
            crossed += verdict == CROSSED
            if ms >= 500 and verdict in (IN_SEQUENCE, SOME_LOST):
                taken[who] += 1
        distance = offset - 10 * phase if phase < 2 else 75.0  # ms on the sender's own grid
        in_its_place = min(abs(distance), abs(distance - 150)) < 2.5 + 2.0
        if in_its_place:
            silent = 350 - sent
            assert taken["replayed"] <= crossed + silent + 1, (offset, taken, crossed)
        else:
            assert taken == {"living": sent, "replayed": 0}, (offset, taken)
