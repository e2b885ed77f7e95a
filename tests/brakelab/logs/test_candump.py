"""Candump text: python-can's reader is the oracle; damaged lines are skipped, counted and named."""

import gzip
from pathlib import Path

import can
import numpy as np
import pytest
from can.io import CanutilsLogReader, CanutilsLogWriter
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from brakelab.logs import text_log
from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from ecu.contract.records import FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE
from ecu.errors import UserError

from .conftest import assert_is, identifier, messages, read

STAMPS = st.integers(1, 2_000_000).map(lambda ms: ms / 1e3)
CHANNELS = st.sampled_from(["can0", "vcan1", "a", "slcan0_very_long"])
GOOD = "(1600000000.000100) can0 123#0102\n"


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(messages(stamps=STAMPS, channels=CHANNELS), min_size=1, max_size=30, unique_by=identifier))
def test_reads_what_python_can_reads(tmp_path: Path, sent: list[can.Message]) -> None:
    path = tmp_path / "drive.log"
    with CanutilsLogWriter(path) as writer:
        for message in sent:
            writer.on_message_received(message)
    interfaces: list[str] = []
    quality = LogQuality()  # stamps in any order are not mended here
    frames = np.concatenate(list(read_frames(path, interfaces, quality, mended=False)))
    expected = list(CanutilsLogReader(path))
    assert quality.damaged == 0
    assert len(frames) == len(expected) == quality.frames
    for frame, message in zip(frames, expected, strict=True):
        assert frame["stamp_ns"] == round(message.timestamp * 1e6) * 1000
        assert_is(frame, message)
        assert interfaces[frame["bus"]] == message.channel


@pytest.mark.parametrize(
    ("line", "damage"),
    [
        ("(1600000000.000200) can0 123#010", "half a byte"),
        ("(1600000000.000200) can0 123#0102030405060708FF", "nine bytes without CAN FD"),
        ("(1600000000.000200) can0 123#01G2", "a letter that is no digit"),
        ("(1600000000.000200) can0 12#0102", "identifier of two digits"),
        ("(1600000000.000200) can0 823#0102", "identifier beyond 11 bits"),
        ("(1600000000.000200) can0 4AAAAAAAA#01", "identifier of nine digits"),
        ("(1600000000.000200) can0 123##0" + "00" * 9, "nine bytes are no CAN FD length"),
        ("(1600000000.000200) can0 123##", "CAN FD without flags"),
        ("(1600000000) can0 123#0102", "no fraction"),
        ("(1600000000.000200 can0 123#0102", "bracket missing"),
        ("1600000000.000200) can0 123#0102", "bracket missing"),
        ("(1600000000.000200) can0", "nothing behind the interface"),
        ("(1600000000.000200) can0 123", "no payload sign"),
        ("(1600000000.000200) an_interface_too_long 123#01", "name beyond 16 letters"),
        ("(1600000000.000200) can0 123#0102 (1600000000.000300) can0", "two lines in one"),
        ("\0\0\0\0\0\0\0\0", "zeros of a disk that lost power"),
    ],
)
def test_a_damaged_line_is_skipped_counted_and_named(tmp_path: Path, line: str, damage: str) -> None:
    path = tmp_path / "drive.log"
    path.write_text(GOOD + line + "\n" + GOOD.replace("123", "124") + line + "\n")
    frames, quality = read(path)
    assert [hex(i) for i in frames["can_id"]] == ["0x123", "0x124"], damage
    assert (quality.damaged, quality.first_damaged) == (2, "line 2")
    assert not frames["data"][:, 2:].any()


@pytest.mark.parametrize(
    ("line", "can_id", "flags", "data"),
    [
        ("(1.000000) can0 123#", 0x123, 0, ""),
        ("(1.000000) can0 00000123#AA", 0x123, FRAME_EXTENDED, "aa"),
        ("(1.000000) can0 1FFFFFFF#aAbB", 0x1FFFFFFF, FRAME_EXTENDED, "aabb"),
        ("(1.000000) can0 20000080#0000000000000000", 0x80, FRAME_ERROR, "00" * 8),
        ("(1.000000) can0 123#R", 0x123, FRAME_REMOTE, ""),
        ("(1.000000) can0 123##3" + "5A" * 64, 0x123, FRAME_FD, "5a" * 64),
        ("(1.000000)  can0  123#01 R", 0x123, 0, "01"),
        ("(1.000000) can0 123#01 T\r", 0x123, 0, "01"),
    ],
)
def test_forms_of_a_line(tmp_path: Path, line: str, can_id: int, flags: int, data: str) -> None:
    path = tmp_path / "drive.log"
    path.write_text(line + "\n")
    (frame,), quality = read(path)
    assert quality.damaged == 0
    assert frame["stamp_ns"] == 1_000_000_000
    assert (frame["can_id"], frame["flags"]) == (can_id, flags)
    assert bytes(frame["data"][: frame["length"]]).hex() == data


def test_stamps_keep_their_nanoseconds_and_disorder_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "drive.log"
    path.write_text(
        "(1600000000.1) c 001#\n(1600000000.123456789) c 002#\n"
        "(1600000000.123456789) c 003#\n(1600000000.000001) c 004#\n"
    )
    frames, quality = read(path)
    assert list(frames["stamp_ns"] - 1_600_000_000_000_000_000) == [
        100_000_000,
        123_456_789,
        123_456_789,
        1_000,
    ]
    assert (quality.stamps_repeated, quality.stamps_backwards) == (1, 1)


def test_a_last_line_without_its_end_is_not_used(tmp_path: Path) -> None:
    path = tmp_path / "drive.log"
    path.write_text("".join(GOOD.replace("0102", f"{k:04X}") for k in range(3)) + GOOD.rstrip())
    frames, quality = read(path)
    assert len(frames) == 3
    assert quality.cut.startswith("line 4: the last line is cut off")


def test_blocks_join_without_a_seam(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "drive.log"
    lines = [f"(1600000000.{k:06d}) can{k % 2} {k:03X}#{'5A' * (k % 9)}\n" for k in range(1000)]
    path.write_text("".join(lines))
    whole, _ = read(path)
    monkeypatch.setattr(text_log, "BLOCK_BYTES", 97)
    monkeypatch.setattr(text_log, "BLOCK_FRAMES", 2)
    pieces, quality = read(path)
    assert pieces.tobytes() == whole.tobytes()
    assert quality.frames == 1000


def test_interfaces_keep_the_order_they_are_given(tmp_path: Path) -> None:
    path = tmp_path / "drive.log"
    path.write_text(GOOD.replace("can0", "can7") + GOOD)
    interfaces = ["can0"]
    frames, _ = read(path, interfaces)
    assert interfaces == ["can0", "can7"]
    assert list(frames["bus"]) == [1, 0]


def test_a_packed_log_reads_like_a_plain_one(tmp_path: Path) -> None:
    plain, packed = tmp_path / "drive.log", tmp_path / "drive.log.gz"
    plain.write_text(GOOD * 50)
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert read(packed)[0].tobytes() == read(plain)[0].tobytes()


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"", "line 1: the file is empty"),
        (b"PAR1" + bytes(200), "line 1: this is a Parquet file; let its name end in .parquet"),
        (b"date Mon Jan 1\nbase hex timestamps absolute\n", "line 1: this is a Vector ASC log"),
        (bytes(range(256)) * 9, "line 1: no candump log"),
        (b"(1600000000.000100) can0 123#0102", "line 1: no candump log"),
        (
            GOOD.encode() + b"(1700000000.000100) can9 123#0102\n" * 2,
            "line 2: this interface's clock is more than an hour off the others'",
        ),
    ],
)
def test_what_is_no_candump_log_gives_one_line(tmp_path: Path, content: bytes, line: str) -> None:
    path = tmp_path / "drive.log"
    path.write_bytes(content)
    with pytest.raises(UserError) as error:
        read(path)
    assert str(error.value).startswith(f"{path}: {line}")
