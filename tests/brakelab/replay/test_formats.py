"""One drive in every format: the same frames, the same results; damage is told in a line."""

import gzip
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF

from brakelab.bench.log_formats import FORMATS, convert, messages, write, write_mdf
from brakelab.replay.command import replay
from brakelab.replay.formats import format_of, kind_of, read_frames
from brakelab.replay.log_quality import LogQuality
from brakelab.replay.quality import Findings
from brakelab.replay.source import only_interface
from brakelab.results import read_result
from ecu.errors import UserError
from ecu.records import RecordArray
from ecu.resources import resource

DATA = Path(__file__).parents[2] / "data"
TEXT = (".log", ".asc", ".trc")


def read(path: Path, interfaces: list[str] | None = None) -> tuple[RecordArray, LogQuality]:
    quality = LogQuality()
    blocks = list(read_frames(path, interfaces if interfaces is not None else [], quality))
    return np.concatenate(blocks), quality


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
        ("drive.log", gzip.compress(b"(1.000000) can0 123#01\n"), "line 1: this is a candump log in gzip"),
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
        ("drive.blf.gz", gzip.compress(b"LOGG" + bytes(200)), "this is a Vector BLF file in gzip; unpack it"),
        ("drive.asc.gz", gzip.compress(b"date Mon\n")[:-9], "line 1: cannot be unpacked ("),
        ("drive.asc", b"\xff" * 3_000_000, "line 1: no frame in this ASC log"),
    ],
)
def test_what_cannot_be_read_gives_one_line(tmp_path: Path, name: str, content: bytes, line: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(UserError) as error:
        read(path) if kind_of(path) == "frames" else None
    assert str(error.value).startswith(f"{path}: {line}")
    assert "\n" not in str(error.value)


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
    for _ in range(12):
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
    assert read_on >= (0 if end in (".mf4", ".blf") else 12)


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
    with pytest.raises(UserError, match=r"MDF4 needs asammdf: pip install 'brake-ecu\[mdf\]'"):
        kind_of(path)


def test_the_bus_is_imported_without_asammdf() -> None:
    program = (
        "import sys, ecu.bus.channel; assert 'asammdf' not in sys.modules; "
        "import asammdf; print('can' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"
