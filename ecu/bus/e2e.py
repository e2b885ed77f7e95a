"""End-to-end protection: checks that a frame is intact and the next one of its sender.

Checksum rules, by the names that signal maps use:

autosar_p01      AUTOSAR E2E Profile 1 (PRS E2E Protocol, R4.x), Data ID mode BOTH: CRC-8 SAE J1850 in
                 byte 0 over the Data ID's low byte, its high byte and every byte behind the CRC;
                 counter 0–14 in the low nibble of byte 1. Start and XOR value are 0: the profile's 0xFF
                 cancel those of the CRC routine.
ford_brake_sn_4  0x07D: byte 2 = 0xFF − (b0 + b1 + counter), counter in the high nibble of byte 3
ford_accel_data  0x092: byte 6 = 0x16 − (b0 + … + b5 + b7)
toyota           last byte = identifier's bytes + length + all other bytes
hyundai_sum      last byte = sum of all other bytes (0x153)
hyundai_xor      high nibble of the last byte = XOR of all other nibbles (0x2B0)

Each maker's rule holds for every frame of the recorded drives that the tests read.

Counter: a sender keeps a grid, one count a period. While it lives (an accepted frame not older than `LIVING`
periods) a frame fits if it arrives at the grid position given by its counter: within half a period, or a
quarter while another stream claims the sequence. So a stream replayed beside its sender does not fit,
regardless of lost frames, unless it is in phase with the sender: then two frames claim one position, which is
reported (CROSSED), and the nearer one keeps the grid. Undisputed frames later than the grid belong to a
delayed sender: it gets a new grid, unless a frame of the former one still arrives. A lost sender is accepted
again as by AUTOSAR's P01 check, with any counter step that the elapsed time allows, or after three consistent
frames: so after a restart it is back within `LIVING` periods and two. `link.py` judges the stream.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ecu.jit import Record, kernel

NO_CHECKSUM, AUTOSAR_P01, FORD_BRAKE_SN_4, FORD_ACCEL_DATA, TOYOTA, HYUNDAI_SUM, HYUNDAI_XOR = range(7)
RULES: Final = {
    "autosar_p01": AUTOSAR_P01,
    "ford_brake_sn_4": FORD_BRAKE_SN_4,
    "ford_accel_data": FORD_ACCEL_DATA,
    "toyota": TOYOTA,
    "hyundai_sum": HYUNDAI_SUM,
    "hyundai_xor": HYUNDAI_XOR,
}
SHORTEST: Final = {"autosar_p01": 2, "ford_brake_sn_4": 4, "ford_accel_data": 8}
"""The payload that a rule needs at least [bytes], 2 where not listed."""

P01_MODULO: Final = 15  # counter 0–14
P01_COUNTER_START, P01_COUNTER_LENGTH = 8, 4

# Results of the counter check
IN_SEQUENCE, SOME_LOST, RESYNCHRONISED, REPEATED, WRONG_SEQUENCE, CROSSED = range(6)
LIVING: Final = 6.5
"""Periods without a frame that a sender may lose, five frames and their jitter, before it is gone."""
_FRAMES_TO_RESYNCHRONISE: Final = 3  # first frame out of sequence and two consistent with it
_GRID_GAIN: Final = 0.25  # of a frame's lateness in the grid: slower than jitter, faster than drift
_DOUBTED_GAIN: Final = 0.0625  # five frames of another sender do not shift it
DOUBT_NS: Final = 1_000_000_000  # duration of the doubt after one frame out of place


def _crc8_table() -> NDArray[np.uint8]:
    polynomial = 0x1D  # SAE J1850
    table = np.arange(256)
    for _ in range(8):
        table = np.where(table & 0x80, (table << 1) ^ polynomial, table << 1) & 0xFF
    return table.astype(np.uint8)


_CRC8: Final = _crc8_table()


@kernel
def p01_crc(data: NDArray[np.uint8], length: int, data_id: int) -> int:
    """Return the Profile 1 CRC of bytes 1 to `length` − 1 of `data`."""
    crc = _CRC8[data_id & 0xFF]
    crc = _CRC8[crc ^ np.uint8((data_id >> 8) & 0xFF)]
    for i in range(1, length):
        crc = _CRC8[crc ^ data[i]]
    return int(crc)


@kernel
def p01_protect(data: NDArray[np.uint8], length: int, data_id: int, counter: int) -> None:
    """Write counter and CRC into the payload."""
    data[1] = np.uint8((data[1] & 0xF0) | counter)
    data[0] = np.uint8(p01_crc(data, length, data_id))


@kernel
def checksum_holds(rule: int, data: NDArray[np.uint8], length: int, can_id: int, data_id: int) -> bool:
    """Return whether the payload of `length` bytes obeys the rule."""
    last = length - 1
    total = 0
    if rule == AUTOSAR_P01:
        return int(data[0]) == p01_crc(data, length, data_id)
    if rule == FORD_BRAKE_SN_4:
        total = 0xFF - (int(data[0]) + int(data[1]) + (int(data[3]) >> 4))
        return int(data[2]) == total & 0xFF
    if rule == FORD_ACCEL_DATA:
        total = 0x16 - int(data[7])
        for i in range(6):
            total -= int(data[i])
        return int(data[6]) == total & 0xFF
    if rule == TOYOTA:
        total = (can_id >> 8) + (can_id & 0xFF) + length
    if rule in (TOYOTA, HYUNDAI_SUM):
        for i in range(last):
            total += int(data[i])
        return int(data[last]) == total & 0xFF
    if rule == HYUNDAI_XOR:
        for i in range(last):
            total ^= int(data[i]) ^ (int(data[i]) >> 4)
        return int(data[last]) >> 4 == (total ^ int(data[last])) & 0xF
    return True


# Stored state of a sender's counter between frames; wide types, since kernels compute with them
SEQUENCE: Final = [
    ("accepted_ns", "i8"),  # stamp of the last frame accepted
    ("expected_ns", "i8"),  # its position on the grid
    ("grid_ns", "i8"),  # the same, with the grid's own correction
    ("disputed_ns", "i8"),  # stamp of the last frame that claimed the sequence without fitting
    ("doubted_ns", "i8"),  # stamp of the last reason to doubt the sender of accepted frames
    ("candidate_ns", "i8"),
    ("former_ns", "i8"),  # grid of a sender that seemed delayed, while it may be alive
    ("former_until_ns", "i8"),
    ("former", "i8"),  # its counter
    ("counter", "i8"),
    ("candidate", "i8"),
    ("consistent", "i8"),
    ("started", "u1"),
]


@kernel
def _lasts(told_ns: int, stamp_ns: int) -> bool:
    """Return whether a report is still in force; 0: never made."""
    return told_ns > 0 and stamp_ns - told_ns < DOUBT_NS


@kernel
def in_doubt(state: Record, stamp_ns: int) -> bool:
    """Return whether accepted frames may have more than one sender: reported within the last second."""
    return _lasts(state.doubted_ns, stamp_ns)


@kernel
def _accept(state: Record, counter: int, stamp_ns: int, expected_ns: int) -> None:
    gain = _DOUBTED_GAIN if in_doubt(state, stamp_ns) else _GRID_GAIN
    state.counter = counter
    state.accepted_ns = stamp_ns
    state.expected_ns = expected_ns
    state.grid_ns = expected_ns + int(gain * (stamp_ns - expected_ns))
    state.consistent = 0
    state.started = 1


@kernel
def _dispute(state: Record, stamp_ns: int) -> None:
    state.disputed_ns = state.doubted_ns = stamp_ns


@kernel
def _takes_back(state: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int) -> bool:
    """Accept a frame that fits the former grid: its sender was not delayed, another one had sent."""
    expected_ns = state.former_ns + (counter - state.former) % modulo * period_ns
    fits: bool = stamp_ns <= state.former_until_ns and abs(stamp_ns - expected_ns) <= period_ns // 2
    if fits:
        _dispute(state, stamp_ns)
        _accept(state, counter, stamp_ns, expected_ns)
        state.former_until_ns = 0
    return fits


@kernel
def _resynchronise(
    state: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int, gone: bool
) -> Any:
    """Take a frame that does not fit as a candidate; accept the third one of a lost sender."""
    cycles = (stamp_ns - state.candidate_ns + period_ns // 2) // period_ns
    consistent = 1 <= (counter - state.candidate) % modulo <= cycles
    state.consistent = min(state.consistent + 1, _FRAMES_TO_RESYNCHRONISE) if consistent else 1
    state.candidate = counter
    state.candidate_ns = stamp_ns
    if gone and state.consistent >= _FRAMES_TO_RESYNCHRONISE:
        _accept(state, counter, stamp_ns, stamp_ns)
        return RESYNCHRONISED
    _dispute(state, stamp_ns)
    return WRONG_SEQUENCE


@kernel
def check_counter(
    state: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int, slowest_ns: int
) -> Any:
    """Judge a frame's counter and store it in `state` (fields of `SEQUENCE`); the first frame is accepted.

    Args:
        state: fields of `SEQUENCE`, overwritten.
        counter: of the frame.
        modulo: of the counter.
        stamp_ns: of the frame.
        period_ns: between two frames.
        slowest_ns: the longest period of a sender with a variable one; with it there is no grid.

    Returns IN_SEQUENCE, SOME_LOST or RESYNCHRONISED (accepted), REPEATED, WRONG_SEQUENCE or CROSSED: a second
    frame at the sequence position of the last accepted one (rejected).
    """
    if counter >= modulo:
        return WRONG_SEQUENCE
    since_accepted = stamp_ns - state.accepted_ns
    if not state.started or since_accepted < -period_ns:  # the clock was set back
        _accept(state, counter, stamp_ns, stamp_ns)
        return IN_SEQUENCE
    elapsed = stamp_ns - state.grid_ns
    step = (counter - state.counter) % modulo
    if step == 0:
        _dispute(state, stamp_ns)
        if since_accepted > period_ns // 2:
            return REPEATED
        nearer = abs(stamp_ns - state.expected_ns) < abs(state.accepted_ns - state.expected_ns)
        if nearer:
            _accept(state, counter, stamp_ns, state.expected_ns)
        return CROSSED
    found = IN_SEQUENCE if step == 1 else SOME_LOST
    gone = since_accepted > LIVING * slowest_ns
    if gone:
        if step <= 1 + (elapsed + period_ns // 2) // period_ns:
            _accept(state, counter, stamp_ns, stamp_ns)
            return found
        return _resynchronise(state, counter, modulo, stamp_ns, period_ns, gone)
    disputed = _lasts(state.disputed_ns, stamp_ns)
    tolerance = period_ns // 4 if disputed else period_ns // 2
    if slowest_ns > period_ns:
        tolerance = period_ns  # without a grid the frame before may have been the late one
    early = step * period_ns - elapsed
    if early > tolerance or (disputed and elapsed - step * slowest_ns > tolerance):
        if _takes_back(state, counter, modulo, stamp_ns, period_ns):
            return SOME_LOST
        return _resynchronise(state, counter, modulo, stamp_ns, period_ns, gone)
    if elapsed - step * slowest_ns > tolerance:
        state.former_ns, state.former = state.grid_ns, state.counter
        state.former_until_ns = state.accepted_ns + int(LIVING * period_ns)
        state.doubted_ns = stamp_ns
        _accept(state, counter, stamp_ns, stamp_ns)
        return found
    if abs(early) > period_ns // 4 and slowest_ns == period_ns:
        state.doubted_ns = stamp_ns
    if slowest_ns > period_ns:
        _accept(state, counter, stamp_ns, stamp_ns)
    else:
        _accept(state, counter, stamp_ns, stamp_ns + early)
    return found
