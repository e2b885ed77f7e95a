"""One drive in every format: the same frames, the same results; damage is reported in a line."""

import gzip
import shutil
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asammdf import MDF

from brakelab.bench.log_formats import FORMATS, convert, messages, write, write_mdf
from brakelab.logs import text_log
from brakelab.logs.formats import format_of, kind_of, read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.replay.command import replay
from brakelab.replay.quality import Findings
from brakelab.replay.source import only_interface
from brakelab.results.files import read_result
from ecu.contract.records import RecordArray
from ecu.errors import UserError
from ecu.settings.resources import resource

from .conftest import read

DATA = Path(__file__).parents[2] / "data"
TEXT = (".log", ".asc", ".trc")


@pytest.fixture(scope="module")
def kona(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The drive of the Kona (two buses) in every format; by time, as python-can's writers want it."""
    folder = tmp_path_factory.mktemp("kona")
    lines = (DATA / "kona.log").read_text().splitlines(keepends=True)
    (folder / "sorted.log").write_text("".join(sorted(lines, key=lambda line: line.split()[0])))
    logs = {end: convert(folder / "sorted.log", folder / f"kona{end}") for end in FORMATS}
    return logs | {"sorted": folder / "sorted.log"}


@pytest.mark.parametrize("end", FORMATS)
def test_frames_are_those_of_candump(kona: dict[str, Path], end: str) -> None:
    buses: list[str] = []
    expected, quality = read(kona["sorted"], buses)
    if end == ".mf4":  # a group for each bus, merged by time
        expected = expected[np.lexsort((expected["bus"], expected["stamp_ns"]))]
    interfaces: list[str] = []
    frames, found = read(kona[end], interfaces)
    assert kind_of(kona[end]) == "frames"
    assert sorted(interfaces) == ["can0", "can1"]
    assert (found.frames, found.damaged, found.cut) == (quality.frames, 0, "")
    for name in ("can_id", "flags", "length", "data"):
        np.testing.assert_array_equal(frames[name], expected[name], err_msg=name)
    names = np.array(interfaces)[frames["bus"]]
    np.testing.assert_array_equal(names, np.array(buses)[expected["bus"]])
    offset = frames["stamp_ns"] - expected["stamp_ns"]
    # Every format here keeps microseconds; ASC has its start in whole milliseconds, TRC as a float of days.
    assert offset.max() == offset.min()
    assert abs(offset[0]) <= {".asc": 1_000_000_000, ".trc": 1_000}.get(end, 0)


@pytest.mark.parametrize("end", FORMATS)
def test_results_are_those_of_candump(kona: dict[str, Path], tmp_path: Path, end: str) -> None:
    config, map = resource("config/suv.toml"), resource("config/maps/kona.toml")
    results = []
    for log in (kona["sorted"], kona[end]):
        out = tmp_path / f"{log.stem}.parquet"
        assert replay([log], config, map, None, None, out) == 0
        results.append(read_result(out))
    for name, column in results[0].columns.items():
        np.testing.assert_array_equal(results[1].columns[name], column, err_msg=name)
    starts = [int(result.metadata["start_time_ns"]) for result in results]
    assert abs(starts[1] - starts[0]) <= 1_000_000_000


@pytest.mark.parametrize("end", [".asc", ".blf", ".trc"])
def test_logs_of_can_logconvert(tmp_path: Path, end: str) -> None:
    out = tmp_path / f"mustang{end}"
    head = tmp_path / "head.log"
    head.write_bytes(b"".join((DATA / "mustang.log").read_bytes().splitlines(keepends=True)[:2000]))
    subprocess.run([sys.executable, "-m", "can.logconvert", head, out], check=True)
    expected, frames = read(head)[0], read(out)[0]
    np.testing.assert_array_equal(frames["data"], expected["data"])
    np.testing.assert_array_equal(np.diff(frames["stamp_ns"]), np.diff(expected["stamp_ns"]))


@pytest.mark.parametrize("name", ["can0", "can1", "1", "2"])
def test_a_bus_of_an_mdf_file_by_python_can_is_that_of_the_other_formats(
    kona: dict[str, Path], tmp_path: Path, name: str
) -> None:
    """Its writer counts channels from 0, all others from 1."""
    head = tmp_path / "head.log"
    head.write_bytes(b"".join(kona["sorted"].read_bytes().splitlines(keepends=True)[:400]))
    out = tmp_path / "head.mf4"
    subprocess.run([sys.executable, "-m", "can.logconvert", head, out], check=True)
    chosen = []
    for path in (head, out):
        findings = Findings(path)
        blocks = read_frames(path, findings.interfaces, findings.log)
        chosen.append(np.concatenate(list(only_interface(blocks, name, findings))))
        assert sorted(findings.interfaces) == ["can0", "can1"]
    assert 0 < len(chosen[0]) < 400
    for column in ("can_id", "length", "data"):
        np.testing.assert_array_equal(chosen[1][column], chosen[0][column])


@pytest.mark.parametrize("end", FORMATS)
@pytest.mark.parametrize("name", ["can1", "2"])
def test_a_bus_is_chosen_by_its_interface_or_channel(kona: dict[str, Path], end: str, name: str) -> None:
    findings = Findings(kona[end])
    blocks = read_frames(kona[end], findings.interfaces, findings.log)
    chosen = np.concatenate(list(only_interface(blocks, name, findings)))
    expected = [line for line in kona["sorted"].read_text().splitlines() if " can1 " in line]
    assert len(chosen) == len(expected) < findings.log.frames
    assert [f"{can_id:03X}" for can_id in chosen["can_id"]] == [line.split()[2][:3] for line in expected]
    assert findings.other_interfaces == findings.log.frames - len(expected)


@pytest.mark.parametrize("end", TEXT)
def test_a_packed_text_reads_like_a_plain_one(kona: dict[str, Path], tmp_path: Path, end: str) -> None:
    packed = tmp_path / f"kona{end}.gz"
    packed.write_bytes(gzip.compress(kona[end].read_bytes()))
    assert read(packed)[0].tobytes() == read(kona[end])[0].tobytes()


@pytest.mark.parametrize("end", FORMATS)
@pytest.mark.parametrize("named", FORMATS)
def test_a_wrong_name_says_what_it_really_is(
    kona: dict[str, Path], tmp_path: Path, end: str, named: str
) -> None:
    path = tmp_path / f"drive{named}"
    shutil.copy(kona[end], path)
    if end == named:
        assert format_of(path) == end
        return
    with pytest.raises(UserError, match=rf"line 1: this is an? .*; let its name end in \{end}$"):
        kind_of(path)


@pytest.mark.parametrize(
    ("name", "content", "line"),
    [
        ("drive.log", b"", "line 1: the file is empty"),
        ("drive.blf", b"", "line 1: the file is empty"),
        (
            "drive.log",
            gzip.compress(b"(1.000000) can0 123#01\n", mtime=0),
            "line 1: this is a candump log in gzip",
        ),
        ("drive.asc", b"date Mon Jan 1 00:00:00 2024\nbase hex\n", "line 1: no frame in this ASC log"),
        ("drive.trc", b";$FILEVERSION=9.9\n", "FILEVERSION: 9.9 is not known"),
        ("drive.trc", b";$FILEVERSION=2.1\n;$COLUMNS=N,O,T\n", "COLUMNS: N,O,T: O, T, I, D and l or L"),
        (
            "drive.blf",
            b"LOGG" + bytes(200),
            "damaged from byte 0 (no object begins here) on: no frame in this BLF file",
        ),
        ("drive.mf4", b"MDF     4.10" + bytes(200), "no readable MDF4 file ("),
        ("drive.txt", b"hello\n", "unknown kind of log .txt; replay reads candump .log"),
        ("drive", b"hello\n", "unknown kind of log (no suffix)"),
        (
            "drive.blf.gz",
            gzip.compress(b"LOGG" + bytes(200), mtime=0),
            "this is a Vector BLF file in gzip; unpack it",
        ),
        ("drive.asc.gz", gzip.compress(b"date Mon\n", mtime=0)[:-9], "line 1: cannot be unpacked ("),
        ("drive.asc", b"\xff" * 3_000_000, "line 1: no frame in this ASC log"),
        ("drive.blf", b"\x85" * 9000, "damaged from byte 144 (no object begins here) on: no frame"),
        ("drive.log.gz", b"\x85" * 9000, "byte 0: its name says gzip, its content does not"),
        ("drive.blf", b"t,accel_x\n0,1\n", "line 1: this is a CSV file; let its name end in .csv"),
        (
            "drive.parquet",
            b'"accel_x";"t"\r\n0;1\r\n',
            "line 1: this is a CSV file; let its name end in .csv",
        ),
        (
            "drive.csv.gz",
            gzip.compress(b"t,accel_x\n0,1\n", mtime=0),
            "this is a CSV file in gzip; unpack it",
        ),
    ],
)
def test_what_cannot_be_read_gives_one_line(tmp_path: Path, name: str, content: bytes, line: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(UserError) as error:
        read(path) if kind_of(path) == "frames" else None
    assert str(error.value).startswith(f"{path}: {line}")
    assert "\n" not in str(error.value)


def test_decoded_signals_hold_no_frames(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_text("t,accel_x\n0,1\n")
    with pytest.raises(UserError, match="holds signals that are decoded already; give a log of frames"):
        read(path)


@pytest.mark.parametrize("end", FORMATS)
def test_of_a_file_cut_in_the_middle_the_first_half_is_read(
    kona: dict[str, Path], tmp_path: Path, end: str
) -> None:
    path = tmp_path / f"cut{end}"
    path.write_bytes(kona[end].read_bytes()[: kona[end].stat().st_size // 2])
    if end == ".mf4":  # what says where the records are stands at its end
        with pytest.raises(UserError, match=r"no readable MDF4 file|no frame in this MDF4 file"):
            read(path)
        return
    expected = read(kona[end])[0]
    frames, quality = read(path)
    assert 0.3 * len(expected) < len(frames) < 0.7 * len(expected)
    assert frames.tobytes() == expected[: len(frames)].tobytes()
    last = path.read_bytes().count(b"\n") + 1
    assert quality.cut.startswith("byte " if end == ".blf" else f"line {last}:")


@pytest.mark.parametrize("end", FORMATS)
def test_flipped_bits_never_end_in_a_traceback(kona: dict[str, Path], tmp_path: Path, end: str) -> None:
    content = kona[end].read_bytes()
    random = np.random.default_rng(1)
    path = tmp_path / f"flipped{end}"
    whole = len(read(kona[end])[0])
    read_on = 0
    tries = 12 if end in TEXT else 5
    for _ in range(tries):
        damaged = np.frombuffer(content, np.uint8).copy()
        places = random.integers(1000, len(damaged), 30)
        damaged[places] ^= 1 << random.integers(0, 8, 30).astype(np.uint8)
        path.write_bytes(damaged)
        try:
            frames, quality = read(path)
        except UserError:
            continue
        if len(frames) > 0.5 * whole:
            read_on += 1
        if end in TEXT:
            assert len(frames) >= whole - 60
            assert quality.frames == len(frames)
    assert read_on >= (0 if end in (".mf4", ".blf") else tries)


def test_a_lost_blf_container_costs_its_own_frames_only(tmp_path: Path) -> None:
    expected, _ = read(DATA / "mustang.log")
    path = write(tmp_path / "drive.blf", messages(expected, ["can0"]), max_container_size=4096)
    content = bytearray(path.read_bytes())
    containers = [144]
    while (at := containers[-1]) < len(content):
        size = int.from_bytes(content[at + 8 : at + 12], "little")
        containers.append(at + size + size % 4)
    content[containers[3] + 200] ^= 0x10
    path.write_bytes(content)
    frames, quality = read(path)
    assert quality.first_damaged.startswith(f"byte {containers[3]} (")
    first, last = 3 * 4096 // 48, 4 * 4096 // 48 + 1  # objects of 48 bytes, also those across its borders
    kept = np.r_[expected["data"][:first], expected["data"][last:]]
    np.testing.assert_array_equal(frames["data"], kept)


def mustang_in_containers(path: Path) -> tuple[RecordArray, bytearray, list[int]]:
    """The Mustang's frames, their BLF file in containers of 4 kB, and where these begin and the last ends."""
    expected, _ = read(DATA / "mustang.log")
    content = bytearray(write(path, messages(expected, ["can0"]), max_container_size=4096).read_bytes())
    begins = [144]
    while begins[-1] < len(content):
        size = int.from_bytes(content[begins[-1] + 8 : begins[-1] + 12], "little")
        begins.append(begins[-1] + size + size % 4)
    return expected, content, begins


@pytest.mark.parametrize("damage", ["zeros over two containers", "a bomb", "an absurd header"])
def test_what_follows_a_damaged_place_of_a_blf_file_is_read(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "drive.blf"
    expected, content, begins = mustang_in_containers(path)
    if damage == "an absurd header":
        content[4:8] = b"\xff" * 4
        lost, place = 0, ""
    elif damage == "a bomb":  # 100 MB of zeros in 100 kB
        packed = zlib.compress(bytes(100_000_000), 9)
        head = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(packed), 10, 2, 100_000_000)
        content[begins[3] : begins[3]] = head + packed + bytes(len(packed) % 4)
        lost, place = 0, f"byte {begins[3]} (more than 64 MB in one container)"
    else:
        content[begins[3] : begins[5]] = bytes(begins[5] - begins[3])
        lost, place = 2 * 4096 // 48 + 1, f"byte {begins[3]} (zeros where an object should begin)"
    path.write_bytes(content)
    frames, quality = read(path)
    assert quality.first_damaged == place
    assert len(expected) - lost - 1 <= len(frames) <= len(expected) - lost + 1
    assert frames["data"][-1].tobytes() == expected["data"][-1].tobytes()


@pytest.mark.parametrize("tail", [b"", b"garbage behind the stream"])
def test_of_a_packed_text_all_is_read_up_to_the_damage(tmp_path: Path, tail: bytes) -> None:
    text = (DATA / "mustang.log").read_bytes()
    packed = gzip.compress(text)
    path = tmp_path / "drive.log.gz"
    path.write_bytes(packed + tail if tail else packed[:-9])
    frames, quality = read(path)
    assert len(frames) >= text.count(b"\n") - 20
    assert quality.cut.endswith("the packed data is cut off or damaged here, the rest was not read")


def test_a_line_of_many_megabytes_is_one_damaged_line(tmp_path: Path) -> None:
    path = tmp_path / "drive.log"
    good = b"(1600000000.000100) can0 123#0102\n"
    path.write_bytes(good * 10 + bytes(5_000_000) + b"\n" + good * 10)
    frames, quality = read(path)
    assert (len(frames), quality.damaged, quality.first_damaged) == (20, 1, "line 11")


def test_a_stamp_far_from_its_neighbours_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "drive.log"
    path.write_text(
        "(1600000000.000100) can0 123#01\n(1900000000.000200) can0 123#02\n(1600000000.000300) can0 123#03\n"
    )
    frames, quality = read(path)
    assert list(frames["data"][:, 0]) == [1, 3]
    assert (quality.damaged, quality.first_damaged, quality.stamps_backwards) == (1, "line 2", 0)


SECOND = 1_000_000_000
# Of 200 frames on two interfaces, 10 ms apart: stamps of some are off; what the reader reports.
CLOCKS: dict[str, tuple[Callable[[int], int], dict[str, Any]]] = {
    "as it was": (lambda k: 0, {}),
    "set back by 10 s": (
        lambda k: -10 * SECOND * (k >= 100),
        {"clock_set_back": 2, "first_set_back": "line 101, by 10.0 s"},
    ),
    "set back twice": (
        lambda k: -5 * SECOND * ((k >= 50) + (k >= 150)),
        {"clock_set_back": 4, "first_set_back": "line 51, by 5.0 s"},
    ),
    "one stamp 80 s ahead": (lambda k: 80 * SECOND * (k == 99), {"damaged": 1, "first_damaged": "line 100"}),
    "one stamp 2 s behind": (lambda k: -2 * SECOND * (k == 99), {"damaged": 1, "first_damaged": "line 100"}),
    "one stamp beyond all numbers": (
        lambda k: 8 * 10**9 * SECOND * (k == 99),
        {"damaged": 1, "first_damaged": "line 100"},
    ),
    "the last stamp 2 h ahead": (
        lambda k: 7200 * SECOND * (k == 199),
        {"damaged": 1, "first_damaged": "line 200"},
    ),
    "a gap of 50 min": (
        lambda k: 3000 * SECOND * (k >= 100),
        {"gaps": 1, "longest_gap": "line 101", "longest_gap_s": 3000.01},
    ),
    "half a second late": (lambda k: -SECOND // 2 * (k == 99), {"stamps_backwards": 1}),
    "a second clock 40 s behind": (lambda k: -40 * SECOND * (k % 2), {}),
}


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("block_frames", [1 << 14, 7])
def test_clocks_that_jump_are_mended_and_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clock: str, block_frames: int
) -> None:
    monkeypatch.setattr(text_log, "BLOCK_FRAMES", block_frames)
    off, reported = CLOCKS[clock]
    true = [1_600_000_000 * SECOND + k * SECOND // 100 for k in range(200)]
    stamps = [stamp + off(k) for k, stamp in enumerate(true)]
    path = tmp_path / "drive.log"
    path.write_text(
        "".join(f"({s // SECOND}.{s % SECOND:09d}) can{k % 2} 123#{k:02X}\n" for k, s in enumerate(stamps))
    )
    frames, quality = read(path)
    unlike = {name: value for name, value in vars(quality).items() if value != vars(LogQuality())[name]}
    assert unlike == reported | {"frames": 200 - reported.get("damaged", 0)}
    kept = [k for k in range(200) if k in frames["data"][:, 0]]
    expected = np.array(true if "clock_set_back" in reported else stamps, object)[kept]
    # A clock that was set back goes on from the last frame of the same interface, 20 ms before.
    assert np.abs(frames["stamp_ns"] - expected).max() <= 40_000_000 * ("clock_set_back" in reported)


@pytest.mark.parametrize("compression", [0, 2])
def test_mdf_groups_are_merged_by_time(tmp_path: Path, compression: int) -> None:
    interfaces: list[str] = []
    frames, _ = read(DATA / "kona.log", interfaces)
    path = write_mdf(tmp_path / "drive.mf4", frames, interfaces, compression)
    merged, _ = read(path)
    assert (np.diff(merged["stamp_ns"]) >= 0).all()
    assert len(MDF(path).groups) == 2


def test_without_asammdf_mdf_names_the_remedy(
    kona: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "drive.mf4"
    shutil.copy(kona[".mf4"], path)
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(UserError, match=r"MDF4 needs asammdf: pip install asammdf"):
        kind_of(path)


@pytest.mark.parametrize("module", ["ecu.bus.channel", "brakelab.mapping.command"])
def test_the_bus_is_imported_without_asammdf(module: str) -> None:
    program = (
        f"import sys, {module}; assert 'asammdf' not in sys.modules; "
        "import asammdf; print('can' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"
