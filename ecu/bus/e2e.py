"""End-to-end protection: writes and checks what says that a frame is intact.

Whether a frame is its sender's next: `sequence.py`.

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
j1939            SAE J1939-71, SPN 3188 of XBR: high nibble of the last byte = (s >> 4) + s, s the sum of
                 all other bytes, of the counter in its low nibble and of the identifier's four bytes

Each maker's rule holds for every frame of the recorded drives that the tests read.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ecu.jit import kernel

NO_CHECKSUM, AUTOSAR_P01, FORD_BRAKE_SN_4, FORD_ACCEL_DATA, TOYOTA, HYUNDAI_SUM, HYUNDAI_XOR, J1939 = range(8)
RULES: Final = {
    "autosar_p01": AUTOSAR_P01,
    "ford_brake_sn_4": FORD_BRAKE_SN_4,
    "ford_accel_data": FORD_ACCEL_DATA,
    "toyota": TOYOTA,
    "hyundai_sum": HYUNDAI_SUM,
    "hyundai_xor": HYUNDAI_XOR,
    "j1939": J1939,
}
SHORTEST_PAYLOAD: Final = {"autosar_p01": 2, "ford_brake_sn_4": 4, "ford_accel_data": 8}
"""The payload that a rule needs at least [bytes], 2 where not listed."""

P01_MODULO: Final = 15  # counter 0–14


def _crc8_tables() -> NDArray[np.uint8]:
    """Return what a byte adds to the CRC, by how many bytes of payload and Data ID it is from the end.

    The CRC starts at 0 and is linear: it is the XOR of what its bytes add, none of which waits for another.
    """
    polynomial = 0x1D  # SAE J1850
    table = np.arange(256)
    for _ in range(8):
        table = np.where(table & 0x80, (table << 1) ^ polynomial, table << 1) & 0xFF
    tables = [np.arange(256)]
    for _ in range(_LONGEST_PAYLOAD + 1):
        tables.append(table[tables[-1]])
    return np.array(tables, np.uint8)


_LONGEST_PAYLOAD: Final = 64  # bytes of a CAN FD payload
_CRC8: Final = _crc8_tables()


@kernel
def p01_crc(data: NDArray[np.uint8], length: int, data_id: int) -> int:
    """Return the Profile 1 CRC of bytes 1 to `length` − 1 of `data`, at most 63 bytes."""
    crc = _CRC8[length + 1, data_id & 0xFF] ^ _CRC8[length, (data_id >> 8) & 0xFF]
    for i in range(1, length):
        crc ^= _CRC8[length - i, data[i]]
    return int(crc)


@kernel
def checksum_place(rule: int, length: int) -> int:
    """Return the byte of a payload of `length` bytes that holds the rule's checksum, 0 without a rule."""
    if rule == FORD_BRAKE_SN_4:
        return 2
    if rule == FORD_ACCEL_DATA:
        return 6
    if rule in (TOYOTA, HYUNDAI_SUM, HYUNDAI_XOR, J1939):
        return length - 1
    return 0


@kernel
def _checked_byte(rule: int, data: NDArray[np.uint8], length: int, can_id: int, data_id: int) -> int:
    """Return the byte at `checksum_place` as the rest of the payload wants it."""
    place = checksum_place(rule, length)
    total = 0
    if rule == AUTOSAR_P01:
        return p01_crc(data, length, data_id)
    if rule == FORD_BRAKE_SN_4:
        return (0xFF - (int(data[0]) + int(data[1]) + (int(data[3]) >> 4))) & 0xFF
    if rule == FORD_ACCEL_DATA:
        total = 0x16 - int(data[7])
        for i in range(place):
            total -= int(data[i])
        return total & 0xFF
    if rule == TOYOTA:
        total = (can_id >> 8) + (can_id & 0xFF) + length
    if rule in (TOYOTA, HYUNDAI_SUM):
        for i in range(place):
            total += int(data[i])
        return total & 0xFF
    if rule == HYUNDAI_XOR:
        low = int(data[place]) & 0xF
        for i in range(place):
            total ^= int(data[i]) ^ (int(data[i]) >> 4)
        return (((total ^ low) & 0xF) << 4) | low
    if rule == J1939:
        low = int(data[place]) & 0xF
        total = low + (can_id >> 24) + ((can_id >> 16) & 0xFF) + ((can_id >> 8) & 0xFF) + (can_id & 0xFF)
        for i in range(place):
            total += int(data[i])
        return ((((total >> 4) + total) & 0xF) << 4) | low
    return int(data[place])


@kernel
def checksum_holds(rule: int, data: NDArray[np.uint8], length: int, can_id: int, data_id: int) -> bool:
    """Return whether the payload of `length` bytes obeys the rule."""
    return int(data[checksum_place(rule, length)]) == _checked_byte(rule, data, length, can_id, data_id)


@kernel
def protect(rule: int, data: NDArray[np.uint8], length: int, can_id: int, data_id: int) -> None:
    """Write the rule's checksum into the payload of `length` bytes, whose other bits are final."""
    data[checksum_place(rule, length)] = np.uint8(_checked_byte(rule, data, length, can_id, data_id))
