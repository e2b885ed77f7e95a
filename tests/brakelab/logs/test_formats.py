"""One drive in every format: the same frames, the same results; what is no log is refused in a line."""

import gzip
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF

from brakelab.bench.log_formats import FORMATS, write_mdf
from brakelab.logs.formats import format_of, kind_of, read_frames
from brakelab.replay.command import replay
from brakelab.replay.quality import Findings
from brakelab.replay.source import only_interface
from brakelab.results.files import read_result
from ecu.errors import UserError
from ecu.settings.resources import resource

from .conftest import DATA, TEXT, read


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
        replay([log], config, map, None, None, out)
        results.append(read_result(out))
    for name, column in results[0].columns.items():
        np.testing.assert_array_equal(results[1].columns[name], column, err_msg=name)
    starts = [int(result.metadata["start_time_ns"]) for result in results]
    assert abs(starts[1] - starts[0]) <= 1_000_000_000


@pytest.mark.parametrize("end", [".asc", ".blf", ".trc"])
@pytest.mark.study
def test_logs_of_can_logconvert(tmp_path: Path, end: str) -> None:
    out = tmp_path / f"mustang{end}"
    head = tmp_path / "head.log"
    head.write_bytes(b"".join((DATA / "mustang.log").read_bytes().splitlines(keepends=True)[:2000]))
    subprocess.run([sys.executable, "-m", "can.logconvert", head, out], check=True)
    expected, frames = read(head)[0], read(out)[0]
    np.testing.assert_array_equal(frames["data"], expected["data"])
    np.testing.assert_array_equal(np.diff(frames["stamp_ns"]), np.diff(expected["stamp_ns"]))


@pytest.mark.parametrize("name", ["can0", "can1", "1", "2"])
@pytest.mark.study
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


@pytest.mark.parametrize("name", ["drive.log", "drive.csv"])
def test_a_pipe_is_not_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(UserError, match="is no regular file"):
        kind_of(tmp_path / name)


def test_decoded_signals_hold_no_frames(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_text("t,accel_x\n0,1\n")
    with pytest.raises(UserError, match="holds signals that are decoded already; give a log of frames"):
        read(path)


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


def test_the_bus_is_imported_without_asammdf() -> None:
    program = (
        "import sys, ecu.bus.channel, brakelab.mapping.command, brakelab.rig.live; "
        "assert 'asammdf' not in sys.modules; import asammdf; print('can' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"
