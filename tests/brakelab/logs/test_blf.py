"""BLF: python-can's writer and hand-made objects of every kind; damage costs what is damaged, no more."""

import struct
import zlib
from pathlib import Path

import can
import numpy as np
import pytest
from can.io import BLFReader, BLFWriter
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ecu.contract.records import FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE
from ecu.errors import UserError

from .conftest import assert_is, identifier, messages, read


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    st.lists(messages(), min_size=1, max_size=30, unique_by=identifier),
    st.sampled_from([100, 131072]),
    st.sampled_from([0, 6]),
)
def test_reads_what_python_can_reads(
    tmp_path: Path, sent: list[can.Message], container: int, level: int
) -> None:
    path = tmp_path / "drive.blf"
    with BLFWriter(path, max_container_size=container, compression_level=level) as writer:
        for message in sorted(sent, key=lambda message: message.timestamp):
            writer.on_message_received(message)
    interfaces: list[str] = []
    frames, quality = read(path, interfaces)
    expected = list(BLFReader(path))
    assert (quality.damaged, len(frames)) == (0, len(expected))
    for frame, message in zip(frames, expected, strict=True):
        assert frame["stamp_ns"] == round(message.timestamp * 1e6) * 1000
        assert_is(frame, message)
        assert interfaces[frame["bus"]] == f"can{message.channel}"


def blf(*objects: bytes, method: int = 2) -> bytes:
    """A file that began on 2 April 2022, 15:04:05.250, with one container."""
    header = struct.pack("<4sL", b"LOGG", 144) + bytes(32)
    header += struct.pack("<8H", 2022, 4, 6, 2, 15, 4, 5, 250)
    content = b"".join(objects)
    packed = zlib.compress(content) if method == 2 else content
    body = struct.pack("<H6xL4x", method, len(content)) + packed
    container = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body
    return header.ljust(144, b"\0") + container + bytes(len(container) % 4)


def blf_object(
    kind: int, content: bytes, stamp: int = 1_500_000_000, unit: int = 2, version: int = 1
) -> bytes:
    header = 32 if version == 1 else 40
    start = struct.pack("<4sHHLL", b"LOBJ", header, version, header + len(content), kind)
    start += struct.pack("<LHHQ", unit, 0, 0, stamp) + bytes(header - 32)
    return start + content + bytes(len(content) % 4)


def classical(channel: int, flags: int, length: int, can_id: int, data: bytes) -> bytes:
    return struct.pack("<HBBL8s", channel, flags, length, can_id, data)


def fd(flags: int, code: int, fd_flags: int, length: int, data: bytes) -> bytes:
    return struct.pack("<HBBLLBBB5x64s", 1, flags, code, 0x123, 0, 0, fd_flags, length, data)


def fd_64(code: int, length: int, flags: int, data: bytes) -> bytes:
    return struct.pack("<BBBxL4xL24x", 3, code, length, 0x123, flags) + data


EIGHT, TWELVE = bytes(range(1, 9)), bytes(range(12))
MESSAGE = classical(1, 0, 8, 0x123, EIGHT)
ERROR = struct.pack("<H46x", 2)
OBJECTS = {
    "CAN_MESSAGE": (1, MESSAGE, 0x123, 0, "can0", EIGHT),
    "29 bits": (1, classical(2, 1, 2, 0x98FEF100, EIGHT), 0x18FEF100, FRAME_EXTENDED, "can1", EIGHT[:2]),
    "remote": (1, classical(1, 0x80, 4, 0x123, b""), 0x123, FRAME_REMOTE, "can0", bytes(4)),
    "CAN_MESSAGE2": (86, MESSAGE + bytes(8), 0x123, 0, "can0", EIGHT),
    "CAN_FD_MESSAGE": (100, fd(0, 9, 1, 12, TWELVE), 0x123, FRAME_FD, "can0", TWELVE),
    "classical frame in one": (100, fd(0, 8, 0, 8, EIGHT), 0x123, 0, "can0", EIGHT),
    "CAN_FD_MESSAGE_64": (101, fd_64(9, 12, 0x1000, TWELVE), 0x123, FRAME_FD, "can2", TWELVE),
    "bytes left out": (101, fd_64(9, 12, 0x1000, TWELVE[:4]), 0x123, FRAME_FD, "can2", TWELVE[:4] + bytes(8)),
    "CAN_ERROR": (2, ERROR[:4], 0, FRAME_ERROR, "can1", b""),
    "CAN_ERROR_EXT": (73, ERROR[:32], 0, FRAME_ERROR, "can1", b""),
    "CAN_FD_ERROR_64": (104, ERROR, 0, FRAME_ERROR, "can1", b""),
}


@pytest.mark.usefixtures("berlin")
@pytest.mark.parametrize("case", OBJECTS)
@pytest.mark.parametrize("version", [1, 2])
def test_kinds_of_objects(tmp_path: Path, case: str, version: int) -> None:
    kind, content, can_id, flags, bus, data = OBJECTS[case]
    path = tmp_path / "drive.blf"
    path.write_bytes(blf(blf_object(kind, content, version=version), method=0))
    interfaces: list[str] = []
    (frame,), quality = read(path, interfaces)
    assert quality.damaged == 0
    # 15:04:05.25 in Berlin's summer is 13:04:05.25 UTC.
    assert frame["stamp_ns"] == 1_648_904_645_250_000_000 + 1_500_000_000
    assert (frame["can_id"], frame["flags"], interfaces[frame["bus"]]) == (can_id, flags, bus)
    assert bytes(frame["data"][: frame["length"]]) == data


def test_stamps_in_units_of_ten_microseconds(tmp_path: Path) -> None:
    path = tmp_path / "drive.blf"
    path.write_bytes(blf(blf_object(1, MESSAGE, 0, 1), blf_object(1, MESSAGE, 150_000, 1)))
    assert np.diff(read(path)[0]["stamp_ns"]) == [1_500_000_000]


def test_other_objects_and_requests_to_send_are_skipped(tmp_path: Path) -> None:
    path = tmp_path / "drive.blf"
    request = classical(1, 2, 8, 0x123, EIGHT)
    others = [blf_object(65, b"some text"), blf_object(1, request), blf_object(96, bytes(45))]
    path.write_bytes(blf(*others, blf_object(1, MESSAGE)))
    frames, quality = read(path)
    assert (len(frames), quality.damaged) == (1, 0)


@pytest.mark.parametrize(
    ("damaged", "count"),
    [
        (b"LOBJ" + struct.pack("<HHLL", 32, 1, 0xFFFFFF, 1) + bytes(32), "a length beyond all measure"),
        (b"LOBJ" + struct.pack("<HHLL", 32, 1, 3, 1) + bytes(32), "a length below its header's"),
        (bytes(48), "no signature"),
        (blf_object(1, classical(1, 0, 8, 0x923, EIGHT)), "identifier beyond 11 bits"),
        (blf_object(1, b"\1\0"), "too short"),
        (blf_object(100, fd(0, 9, 1, 13, bytes(64))), "13 bytes"),
    ],
)
def test_a_damaged_object_is_skipped_and_counted(tmp_path: Path, damaged: bytes, count: str) -> None:
    path = tmp_path / "drive.blf"
    good = [blf_object(1, MESSAGE, 1_500_000_000 + 1000 * k) for k in range(3)]
    path.write_bytes(blf(good[0], damaged, *good[1:]))
    frames, quality = read(path)
    assert len(frames) == 3, count
    assert quality.damaged >= 1
    assert quality.first_damaged == "byte 144"
    assert set(frames["can_id"]) == {0x123}


def test_objects_outside_of_containers(tmp_path: Path) -> None:
    path = tmp_path / "drive.blf"
    first, *others = (blf_object(1, MESSAGE, 1_500_000_000 + 1000 * k) for k in range(3))
    path.write_bytes(blf(first) + b"".join(others))
    frames, quality = read(path)
    assert (len(frames), quality.damaged, quality.cut) == (3, 0, "")


def test_a_file_of_damage_alone_gives_one_line(tmp_path: Path) -> None:
    path = tmp_path / "drive.blf"
    content = bytearray(blf(blf_object(1, MESSAGE)))
    content[180] ^= 0x40
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"damaged from byte 144 \(.*\) on: no frame in this BLF file; "):
        read(path)
