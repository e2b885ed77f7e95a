"""ASC and TRC text: python-can's readers are the oracle; dates, number bases and every version's columns."""

from pathlib import Path

import can
import numpy as np
import pytest
from can.io import ASCReader, ASCWriter, TRCReader, TRCWriter
from can.io.trc import TRCFileVersion
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from brakelab.logs.asc import date_ns
from brakelab.logs.trc import days_ns
from ecu.contract.records import FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE, RecordArray

from .conftest import FD_LENGTHS, assert_is, identifier, messages, read


def assert_same(frames: RecordArray, interfaces: list[str], expected: list[can.Message], first: int) -> None:
    """`first`: the channel of can0 in python-can's reader."""
    assert len(frames) == len(expected)
    for frame, message in zip(frames, expected, strict=True):
        assert abs(frame["stamp_ns"] - round(message.timestamp * 1e6) * 1000) <= 1000
        assert_is(frame, message)
        assert interfaces[frame["bus"]] == f"can{message.channel - first}"


# A CAN FD frame without data cannot be distinguished from a remote frame in ASC.
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(messages(fd_lengths=FD_LENGTHS[1:]), min_size=1, max_size=30, unique_by=identifier))
def test_asc_is_what_python_can_reads(tmp_path: Path, sent: list[can.Message]) -> None:
    path = tmp_path / "drive.asc"
    with ASCWriter(path) as writer:
        for message in sorted(sent, key=lambda message: message.timestamp):
            writer.on_message_received(message)
    interfaces: list[str] = []
    frames, quality = read(path, interfaces)
    assert quality.damaged == 0
    assert_same(frames, interfaces, list(ASCReader(path, relative_timestamp=False)), 0)


# python-can's TRC writer gives a small 29-bit identifier fewer than the format's eight digits.
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    st.lists(
        messages(fd_too=False, least_extended=0x10000000), min_size=1, max_size=30, unique_by=identifier
    ),
    st.booleans(),
)
def test_trc_is_what_python_can_reads(tmp_path: Path, sent: list[can.Message], old: bool) -> None:
    path = tmp_path / "drive.trc"
    with TRCWriter(path) as writer:
        writer.file_version = TRCFileVersion.V1_0 if old else TRCFileVersion.V2_1
        for message in sorted(sent, key=lambda message: message.timestamp):
            writer.on_message_received(message)
    interfaces: list[str] = []
    frames, quality = read(path, interfaces)
    expected = list(TRCReader(path))
    assert quality.damaged == 0
    if old:  # python-can leaves out the start, which stands in a comment
        frames["stamp_ns"] -= frames["stamp_ns"][0] - round(expected[0].timestamp * 1e9)
    assert_same(frames, interfaces, expected, 1)


ASC = """date Sat Apr 2 03:04:05.250 pm 2022
base {base}  timestamps {stamps}
internal events logged
// version 9.0.0
Begin Triggerblock Sat Apr 2 03:04:05.250 pm 2022
   0.000000 Start of measurement
"""


@pytest.mark.usefixtures("berlin")
@pytest.mark.parametrize(
    ("line", "can_id", "flags", "bus", "data"),
    [
        ("1.5 1  123             Rx   d 2 01 ff  Length = 1 BitCount = 2 ID = 291", 0x123, 0, "can0", "01ff"),
        ("1.5 2  18FEF100x       Tx   d 1 A0", 0x18FEF100, FRAME_EXTENDED, "can1", "a0"),
        ("1.5 1  123             Rx   r", 0x123, FRAME_REMOTE, "can0", ""),
        ("1.5 1  123             Rx   r 4", 0x123, FRAME_REMOTE, "can0", "00000000"),
        ("1.5 3  ErrorFrame", 0, FRAME_ERROR, "can2", ""),
        ("1.5 1  123 Rx d F 01 02 03 04 05 06 07 08", 0x123, 0, "can0", "0102030405060708"),
        (
            f"1.5 CANFD   4 Rx 123  a_name  1 0 9 12 {'5a ' * 12} 130 130 303000 0 0 0 0 0",
            0x123,
            FRAME_FD,
            "can3",
            "5a" * 12,
        ),
        ("1.5 CANFD   4 Rx 123x  1 0 2 2 01 02 130 130 0 0", 0x123, FRAME_EXTENDED, "can3", "0102"),
        ("1.5 CANFD   1 Tx ErrorFrame Not Acknowledge error", 0, FRAME_ERROR, "can0", ""),
    ],
)
def test_forms_of_an_asc_line(
    tmp_path: Path, line: str, can_id: int, flags: int, bus: str, data: str
) -> None:
    path = tmp_path / "drive.asc"
    path.write_text(ASC.format(base="hex", stamps="absolute") + line + "\nEnd TriggerBlock\n")
    interfaces: list[str] = []
    (frame,), quality = read(path, interfaces)
    assert quality.damaged == 0
    # 15:04:05.25 in Berlin's summer is 13:04:05.25 UTC.
    assert frame["stamp_ns"] == 1_648_904_645_250_000_000 + 1_500_000_000
    assert (frame["can_id"], frame["flags"], interfaces[frame["bus"]]) == (can_id, flags, bus)
    assert bytes(frame["data"][: frame["length"]]).hex() == data


@pytest.mark.parametrize(
    ("line", "damaged"),
    [
        ("1.5 1  123 Rx d 2 01", 1),
        ("1.5 1  123 Rx d 2 01 0x2", 1),
        ("1.5 1  123 Rx d 2 01 123", 1),
        ("1.5 1  823 Rx d 0", 1),
        ("1.5 1  123 Rx q 0", 1),
        ("1.5 1  123", 1),
        ("1.5.5 1  123 Rx d 0", 1),
        ("1.5 CANFD 1 Rx 123 1 0 9 13 01", 1),
        ("\0\0\0\0\0\0\0\0\0\0\0\0", 1),
        ("1.5 1  Statistic: D 2 R 0 XD 0 XR 0 E 0 O 0 B 0.04%", 0),
        ("1.5 CAN 1 Status:chip status error active", 0),
        ("1.5 2  J1939TP FEE3p  6 0 0 - Rx d 23 A0 0F", 0),
        ("1.5 1  123 TxRq d 0", 0),
        ("1.5 Start of measurement", 0),
        ("", 0),
    ],
)
def test_other_asc_lines_are_skipped_and_damage_is_counted(tmp_path: Path, line: str, damaged: int) -> None:
    path = tmp_path / "drive.asc"
    good = "1.0 1  123 Rx d 1 07\n"
    path.write_text(ASC.format(base="hex", stamps="absolute") + good + line + "\n" + good.replace("07", "08"))
    frames, quality = read(path)
    assert list(frames["data"][:, 0]) == [7, 8]
    assert not frames["data"][:, 1:].any()
    assert (quality.damaged, quality.first_damaged) == (damaged, "line 8" if damaged else "")


def test_asc_stamps_since_the_line_before_and_decimal_numbers(tmp_path: Path) -> None:
    path = tmp_path / "drive.asc"
    lines = "0.5 1  291 Rx d 2 10 255\n0.25 1  Statistic: D 2\n0.25 1  292 Rx d 1 7\n"
    path.write_text(ASC.format(base="dec", stamps="relative") + lines)
    frames, quality = read(path)
    assert quality.damaged == 0
    assert list(frames["can_id"]) == [291, 292]
    assert bytes(frames["data"][0][:2]) == b"\x0a\xff"
    assert np.diff(frames["stamp_ns"]) == [500_000_000]


@pytest.mark.parametrize(("again", "seconds"), [("0.5", 10.0), ("20.5", 20.0)])
def test_a_later_trigger_block_that_starts_again_has_its_own_date(
    tmp_path: Path, again: str, seconds: float
) -> None:
    path = tmp_path / "drive.asc"
    first = "0.5 1  123 Rx d 1 07\n1.0 1  123 Rx d 1 07\nEnd TriggerBlock\n"
    block = f"Begin Triggerblock Sat Apr 2 03:04:15.250 pm 2022\n{again} 1  123 Rx d 1 08\n"
    path.write_text(ASC.format(base="hex", stamps="absolute") + first + block)
    frames, _ = read(path)
    assert frames["stamp_ns"][2] - frames["stamp_ns"][0] == round(seconds * 1e9)


@pytest.mark.usefixtures("berlin")
@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("Wed Apr 20 08:15:30.123 am 2022", 1_650_435_330.123),
        ("Wed Apr 20 12:15:30 am 2022", 1_650_406_530.0),
        ("Wed Apr 20 12:15:30 pm 2022", 1_650_449_730.0),
        ("Mit Dez 7 20:15:30.5 2022", 1_670_440_530.5),
        ("Mit M\ufffdr 9 20:15:30 2022", 1_646_853_330.0),
        ("Wed Foo 20 08:15:30.123 am 2022", None),
        ("Wed Apr 20 08:15:30 am 9022", None),
        ("yesterday", None),
    ],
)
def test_dates_of_asc(text: str, seconds: float | None) -> None:
    found = date_ns(text)
    assert (found is None) if seconds is None else (found == round(seconds * 1e3) * 1_000_000)


@pytest.mark.parametrize("days", ["yesterday", "1e308", "nan", "2000000", "-1e9"])
def test_days_that_are_no_date_of_a_trc(days: str) -> None:
    assert days_ns(days) is None


TRC = {
    "1.0": (";   Start time: 11.09.2002 16:00:20.682\n", "     1)      1841 0300 2 01 02", 1_031_752_822.523),
    "1.1": (";$STARTTIME=37510.66690604\n", "     1)  1841.0  Rx  0300  2  01 02", 1_031_752_822.523),
    "1.2": (";$STARTTIME=37510.66690604\n", "     1)  1841.000 1  Rx  0300  2  01 02", 1_031_752_822.523),
    "1.3": (";$STARTTIME=37510.66690604\n", "  1)  1841.000 1  Rx  0300 -  2  01 02", 1_031_752_822.523),
    "2.0": (
        ";$STARTTIME=37510.66690604\n;$COLUMNS=N,O,T,I,d,l,D\n",
        "  1  1841.000 DT 0300 Rx  2  01 02",
        1_031_752_822.523,
    ),
    "2.1": (
        ";$STARTTIME=37510.66690604\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n",
        "  1  1841.000 DT 1  0300 Rx -  2  01 02",
        1_031_752_822.523,
    ),
}


@pytest.mark.usefixtures("berlin")
@pytest.mark.parametrize("version", TRC)
def test_versions_of_trc(tmp_path: Path, version: str) -> None:
    start, line, seconds = TRC[version]
    path = tmp_path / "drive.trc"
    path.write_text(f";$FILEVERSION={version}\n{start};\n; a comment\n{line}\n")
    interfaces: list[str] = []
    frames, quality = read(path, interfaces)
    assert (quality.damaged, len(frames), interfaces) == (0, 1, ["can0"])
    assert abs(frames["stamp_ns"][0] * 1e-9 - seconds) < 1e-3
    assert (frames["can_id"][0], frames["length"][0]) == (0x300, 2)
    assert bytes(frames["data"][0][:3]) == b"\x01\x02\x00"


@pytest.mark.parametrize(
    ("line", "can_id", "flags", "length"),
    [
        ("1)  1841 0300 3 RTR", 0x300, FRAME_REMOTE, 3),
        ("1)  1841 0008 4 ERROR 00 19 08 08", 8, FRAME_ERROR, 4),
        ("1)  1841 00000300 1 01", 0x300, FRAME_EXTENDED, 1),
    ],
)
def test_words_of_trc_1_0(tmp_path: Path, line: str, can_id: int, flags: int, length: int) -> None:
    path = tmp_path / "drive.trc"
    path.write_text(f"; no version: 1.0\n{line}\n2) 1843 FFFFFFFF 4 00 00 00 04 BUSLIGHT\n")
    (frame,), quality = read(path)
    assert quality.damaged == 0
    assert (frame["can_id"], frame["flags"], frame["length"]) == (can_id, flags, length)


@pytest.mark.parametrize(
    ("line", "can_id", "flags", "length"),
    [
        ("1 5.000 FD 1 00000300 Rx - 9 " + "5A " * 12, 0x300, FRAME_FD | FRAME_EXTENDED, 12),
        ("1 5.000 FB 1 0300 Rx - 15 " + "5A " * 64, 0x300, FRAME_FD, 64),
        ("1 5.000 BI 1 0300 Rx - 1 5A", 0x300, FRAME_FD, 1),
        ("1 5.000 RR 1 0300 Rx - 8", 0x300, FRAME_REMOTE, 8),
        ("1 5.000 ER 1 - Rx - 5 04 00 02 00 00", 0, FRAME_ERROR, 0),
        ("1 5.000 DT 1 0300 Rx - 0", 0x300, 0, 0),
    ],
)
def test_types_of_trc_2_1(tmp_path: Path, line: str, can_id: int, flags: int, length: int) -> None:
    path = tmp_path / "drive.trc"
    path.write_text(f";$FILEVERSION=2.1\n;$STARTTIME=43008.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n{line}\n")
    (frame,), quality = read(path)
    assert quality.damaged == 0
    assert (frame["can_id"], frame["flags"], frame["length"]) == (can_id, flags, length)


@pytest.mark.parametrize(
    ("line", "damaged"),
    [
        ("1 5.000 DT 1 0300 Rx - 2 01", 1),
        ("1 5.000 DT 1 0300 Rx - 16 " + "01 " * 16, 1),
        ("1 5.000 DT 1 9300 Rx - 1 01", 1),
        ("1 5.000 XY 1 0300 Rx - 1 01", 1),
        ("1 x.000 DT 1 0300 Rx - 1 01", 1),
        ("1 5.000 DT 1", 1),
        ("garbage", 1),
        ("1 5.000 ST 1 - Rx - 4 00 00 00 00", 0),
        ("1 5.000 EC 1 - Rx - 2 02 02", 0),
        ("; a comment in the middle", 0),
        ("", 0),
    ],
)
def test_other_trc_lines_are_skipped_and_damage_is_counted(tmp_path: Path, line: str, damaged: int) -> None:
    path = tmp_path / "drive.trc"
    head = ";$FILEVERSION=2.1\n;$STARTTIME=43008.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
    path.write_text(f"{head}1 4.000 DT 1 0300 Rx - 1 07\n{line}\n3 6.000 DT 1 0300 Rx - 1 08\n")
    frames, quality = read(path)
    assert list(frames["data"][:, 0]) == [7, 8]
    assert not frames["data"][:, 1:].any()
    assert (quality.damaged, quality.first_damaged) == (damaged, "line 5" if damaged else "")


def test_an_asc_clock_that_is_set_goes_on_and_is_reported_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "drive.asc"
    lines = "1.0 1  123 Rx d 1 07\n9000.0 1  123 Rx d 1 07\n9000.1 1  123 Rx d 1 07\n"
    path.write_text(ASC.format(base="hex", stamps="absolute") + lines)
    frames, quality = read(path)
    assert frames["stamp_ns"][-1] - frames["stamp_ns"][0] == 100_000_000
    assert (quality.clock_set, quality.first_set) == (1, "line 8, on by 8999.0 s")
