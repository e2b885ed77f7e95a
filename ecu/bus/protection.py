"""Checksum rule and frame counter of a message, as fields of its record in a plan."""

from typing import Any, Final, NamedTuple

import numpy as np
from cantools.database import Message
from numpy.typing import NDArray

from ecu.bus import bits, e2e
from ecu.bus.database import attribute
from ecu.jit import Record, kernel

PROTECTION: Final = [
    ("data_id", "u4"),
    ("rule", "u1"),
    ("modulo", "i2"),  # of the counter, 0: none
    ("counter_start", "i2"),
    ("counter_length", "u1"),
    ("counter_big_endian", "u1"),
]


class Protection(NamedTuple):
    """How a message is protected."""

    rule: int = e2e.NO_CHECKSUM
    data_id: int = 0
    counter: Any = None
    """The cantools signal that counts frames, None: there is none."""
    modulo: int = 0


UNPROTECTED: Final = Protection()


def contract_protection(message: Message) -> Protection:
    """Return the protection of a message of the contract."""
    data_id = attribute(message, "E2EDataId")
    if not data_id:
        return UNPROTECTED
    counter = message.get_signal_by_name("alive_counter")
    return Protection(e2e.AUTOSAR_P01, data_id, counter, e2e.P01_MODULO)


def set_protection(row: np.void, protection: Protection) -> None:
    """Write the fields of `PROTECTION` of a message's row."""
    row["rule"], row["data_id"], row["modulo"] = protection.rule, protection.data_id, protection.modulo
    counter = protection.counter
    if counter is not None:
        row["counter_big_endian"] = counter.byte_order == "big_endian"
        row["counter_start"] = bits.first_bit(counter.start, counter.byte_order == "big_endian")
        row["counter_length"] = counter.length


@kernel
def frame_count(message: Record, data: NDArray[np.uint8]) -> Any:
    """Return the frame counter of a payload as int64; `message` has the fields of `PROTECTION`."""
    start, length, big_endian = message.counter_start, message.counter_length, message.counter_big_endian
    return np.int64(bits.extract(data, start, length, big_endian))


@kernel
def write_count(message: Record, data: NDArray[np.uint8], count: int) -> None:
    """Write the frame counter of a payload; `message` has the fields of `PROTECTION`."""
    start, length, big_endian = message.counter_start, message.counter_length, message.counter_big_endian
    bits.insert(data, start, length, big_endian, np.uint64(count))
