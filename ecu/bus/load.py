"""Bits on the wire at worst stuffing: how much of a bus the frames of a plan take.

Five equal bits are followed by a stuff bit, which counts too: at worst one for four. A classical frame of
n bytes has 34 + 8 n bits that are stuffed, 54 + 8 n with an identifier of 29 bits, and 13 that are not. A
CAN FD frame (ISO 11898-1) has 22 + 8 n, or 41 + 8 n; then its checksum with stuff count and fixed stuff
bits, 27 bits up to 16 bytes, 32 beyond, and 13 more. All count at the nominal rate: this ECU does not switch.
"""

from typing import Final

from ecu.bus.receive_plan import ReceivePlan
from ecu.bus.transmit import LONGEST_CLASSICAL, TransmitPlan
from ecu.contract.records import EXTENDED_ID, FRAME_FD
from ecu.contract.signals import CYCLE_NS

_END: Final = 13  # delimiters, acknowledgement, end of frame, intermission
_SHORT_CRC: Final = 16  # bytes


def worst_bits(length: int, *, extended: bool, fd: bool) -> int:
    """Return the bits of a frame of `length` bytes, with the pause after it."""
    if not fd:
        stuffed = 8 * length + (54 if extended else 34)
        return stuffed + (stuffed - 1) // 4 + _END
    stuffed = 8 * length + (41 if extended else 22)
    return stuffed + (stuffed - 1) // 4 + (27 if length <= _SHORT_CRC else 32) + _END


def sent_load(plan: TransmitPlan) -> float:
    """Return what the messages of a plan take of a bus [bit/s]."""
    return sum(
        worst_bits(
            int(one["length"]),
            extended=int(one["id"]) >= EXTENDED_ID,
            fd=bool(int(one["flags"]) & FRAME_FD),
        )
        / (int(one["period"]) * CYCLE_NS * 1e-9)
        for one in plan.messages
    )


def received_load(plan: ReceivePlan) -> float:
    """Return what the expected messages of a plan take of a bus [bit/s]."""
    return sum(
        worst_bits(
            int(one["length"]),
            extended=int(one["id"]) >= EXTENDED_ID,
            fd=int(one["length"]) > LONGEST_CLASSICAL,
        )
        / (int(one["period_ns"]) * 1e-9)
        for one in plan.messages
        if not one["foreign"]
    )
