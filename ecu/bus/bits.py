"""Integer bit fields of a CAN payload, for both byte orders, 1 to 64 bits, payloads up to 64 bytes.

`start` is the position of the field's first bit. Little endian: its least significant bit, counted from bit 0
of byte 0 upwards, as a DBC writes it. Big endian: its most significant bit, counted from bit 7 of byte 0
downwards, so that a field is `length` consecutive positions (a DBC's start s is 8 (s // 8) + 7 − s % 8). The
caller guarantees that the field lies within `data`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ecu.jit import kernel

UNSIGNED, SIGNED, FLOAT16, FLOAT32, FLOAT64 = range(5)
"""How the bits of a field are read as a number."""


def first_bit(dbc_start: int, big_endian: bool) -> int:
    """Return the position used by `extract` and `insert` for a start bit in DBC notation."""
    return 8 * (dbc_start // 8) + 7 - dbc_start % 8 if big_endian else dbc_start


@kernel
def extract(data: NDArray[np.uint8], start: int, length: int, big_endian: int) -> Any:
    """Return the field as uint64."""
    byte = start >> 3
    skipped = start & 7
    if skipped + length <= 64 and byte + 8 <= len(data):
        return _extract_at_once(data, np.uint64(byte), np.uint64(skipped), np.uint64(64 - length), big_endian)
    got = 8 - skipped
    if big_endian:
        value = np.uint64(data[byte] & (0xFF >> skipped))
        while got < length:
            byte += 1
            taken = min(8, length - got)
            value = (value << np.uint64(taken)) | np.uint64(data[byte] >> (8 - taken))
            got += taken
        return value >> np.uint64(got - length)
    value = np.uint64(data[byte] >> skipped)
    while got < length:
        byte += 1
        value |= np.uint64(data[byte]) << np.uint64(got)
        got += 8
    return value & (np.uint64(0xFFFFFFFFFFFFFFFF) >> np.uint64(64 - length))


@kernel
def _extract_at_once(data: NDArray[np.uint8], byte: Any, skipped: Any, unused: Any, big_endian: int) -> Any:
    """Return a field within eight bytes of `data`: as one load, so written that no index may be negative."""
    word = np.uint64(0)
    if big_endian:
        for i in range(8):
            word |= np.uint64(data[byte + np.uint64(i)]) << np.uint64(56 - 8 * i)
        return (word << skipped) >> unused
    for i in range(8):
        word |= np.uint64(data[byte + np.uint64(i)]) << np.uint64(8 * i)
    return (word >> skipped) & (np.uint64(0xFFFFFFFFFFFFFFFF) >> unused)


@kernel
def insert(data: NDArray[np.uint8], start: int, length: int, big_endian: int, value: Any) -> None:
    """Overwrite the field with the low `length` bits of `value` (uint64); other bits stay as they are."""
    byte = start >> 3
    skipped = start & 7
    left = length
    while left > 0:
        taken = min(8 - skipped, left)
        if big_endian:
            part = (value >> np.uint64(left - taken)) & np.uint64((1 << taken) - 1)
            shift = 8 - skipped - taken
        else:
            part = (value >> np.uint64(length - left)) & np.uint64((1 << taken) - 1)
            shift = skipped
        mask = ((1 << taken) - 1) << shift
        data[byte] = np.uint8((np.int64(data[byte]) & ~mask) | (np.int64(part) << shift))
        left -= taken
        skipped = 0
        byte += 1


@kernel
def sign_extended(raw: Any, length: int) -> Any:
    """Return the low `length` bits of `raw` (uint64), read as two's complement, as int64."""
    unused = np.int64(64 - length)
    return (np.int64(raw) << unused) >> unused


@kernel
def _float_from_half(raw: Any) -> float:
    fraction = float(raw & np.uint64(0x3FF))
    exponent = np.int64((raw >> np.uint64(10)) & np.uint64(0x1F))
    sign = -1.0 if raw & np.uint64(0x8000) else 1.0
    if exponent == 31:
        return sign * np.inf if fraction == 0.0 else np.nan
    if exponent == 0:
        return sign * fraction * 2.0**-24
    return float(sign * (1024.0 + fraction) * 2.0 ** float(exponent - 25))


@kernel
def number(raw: Any, length: int, kind: int) -> float:
    """Return the value of the field's bits (uint64) before scale and offset, as float64."""
    if kind == UNSIGNED:
        return float(raw)
    if kind == SIGNED:
        return float(sign_extended(raw, length))
    if kind == FLOAT32:
        return float(np.uint32(raw).view(np.float32))
    if kind == FLOAT64:
        return float(np.uint64(raw).view(np.float64))
    return _float_from_half(raw)
