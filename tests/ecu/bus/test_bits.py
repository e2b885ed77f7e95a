"""Bit fields against the same arithmetic on Python integers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.bus import bits

BIG_ENDIAN = [False, True]


@st.composite
def fields(draw: st.DrawFn) -> tuple[bytes, int, int]:
    data = draw(st.binary(min_size=1, max_size=64))
    length = draw(st.integers(1, min(64, 8 * len(data))))
    return data, draw(st.integers(0, 8 * len(data) - length)), length


def expected(data: bytes, start: int, length: int, big_endian: bool) -> int:
    if big_endian:
        return (int.from_bytes(data, "big") >> (8 * len(data) - start - length)) & ((1 << length) - 1)
    return (int.from_bytes(data, "little") >> start) & ((1 << length) - 1)


@pytest.mark.parametrize("big_endian", BIG_ENDIAN)
@given(field=fields())
def test_extract(big_endian: bool, field: tuple[bytes, int, int]) -> None:
    data, start, length = field
    assert bits.extract(np.frombuffer(data, np.uint8), start, length, big_endian) == expected(
        *field, big_endian
    )


@pytest.mark.parametrize("big_endian", BIG_ENDIAN)
@given(field=fields(), value=st.integers(0, 2**64 - 1))
def test_insert_changes_the_field_and_nothing_else(
    big_endian: bool, field: tuple[bytes, int, int], value: int
) -> None:
    data, start, length = field
    written = np.frombuffer(data, np.uint8).copy()
    bits.insert(written, start, length, big_endian, np.uint64(value))
    assert expected(written.tobytes(), start, length, big_endian) == value & ((1 << length) - 1)
    bits.insert(written, start, length, big_endian, np.uint64(expected(*field, big_endian)))
    assert written.tobytes() == data


@given(length=st.integers(1, 64), value=st.integers(0, 2**64 - 1))
def test_sign(length: int, value: int) -> None:
    value &= (1 << length) - 1
    signed = value - (1 << length) if value >> (length - 1) else value
    assert bits.sign_extended(np.uint64(value), length) == signed


@pytest.mark.parametrize(
    ("kind", "dtype", "length"),
    [(bits.FLOAT16, "f2", 16), (bits.FLOAT32, "f4", 32), (bits.FLOAT64, "f8", 64)],
)
@given(data=st.binary(min_size=8, max_size=8))
def test_ieee_numbers(kind: int, dtype: str, length: int, data: bytes) -> None:
    raw = int.from_bytes(data[: length // 8], "little")
    value = float(np.frombuffer(data[: length // 8], f"<{dtype}")[0])
    assert bits.number(np.uint64(raw), length, kind) == pytest.approx(value, rel=0, abs=0, nan_ok=True)


@pytest.mark.parametrize(
    ("dbc_start", "big_endian", "place"), [(7, True, 0), (0, True, 7), (15, True, 8), (12, False, 12)]
)
def test_start_as_a_database_writes_it(dbc_start: int, big_endian: bool, place: int) -> None:
    assert bits.first_bit(dbc_start, big_endian) == place
