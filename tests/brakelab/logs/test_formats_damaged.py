"""A damaged log in every format: what is whole is read, and the damage is reported in a line."""

import gzip
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.bench.log_formats import FORMATS, messages, write
from brakelab.logs import text_log
from brakelab.logs.log_quality import LogQuality
from ecu.contract.records import RecordArray
from ecu.errors import UserError

from .conftest import DATA, TEXT, read


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
    good = [b"(1600000000.000100) can0 123#01%02d\n" % k for k in range(20)]
    path.write_bytes(b"".join(good[:10]) + bytes(5_000_000) + b"\n" + b"".join(good[10:]))
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
        {"clock_set": 2, "first_set": "line 101, back by 10.0 s"},
    ),
    "set back twice": (
        lambda k: -5 * SECOND * ((k >= 50) + (k >= 150)),
        {"clock_set": 4, "first_set": "line 51, back by 5.0 s"},
    ),
    "set on by an hour": (
        lambda k: 3600 * SECOND * (k >= 100),
        {"clock_set": 2, "first_set": "line 101, on by 3600.0 s"},
    ),
    "set back by a day": (
        lambda k: -86_400 * SECOND * (k >= 100),
        {"clock_set": 2, "first_set": "line 101, back by 86400.0 s"},
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
    expected = np.array(true if "clock_set" in reported else stamps, object)[kept]
    # A clock that was set goes on from the last frame of the same interface, 20 ms before.
    assert np.abs(frames["stamp_ns"] - expected).max() <= 40_000_000 * ("clock_set" in reported)


TWICE: dict[str, Callable[[list[str]], list[str]]] = {
    "each line behind itself": lambda lines: [line for line in lines for _ in range(2)],
    "two loggers that write by blocks of 3 s": lambda lines: [
        line for k in range(0, 400, 60) for line in 2 * lines[k : k + 60]
    ],
    "blocks that are not alike": lambda lines: [
        *lines[:90], *lines[:130], *lines[90:200], *lines[130:400], *lines[200:400],
    ],
    "the log behind itself": lambda lines: 2 * lines,
    "thrice": lambda lines: 3 * lines,
}  # fmt: skip


@pytest.mark.parametrize("order", TWICE)
@pytest.mark.parametrize("block_frames", [1 << 14, 37])
def test_frames_that_stand_twice_count_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, order: str, block_frames: int
) -> None:
    monkeypatch.setattr(text_log, "BLOCK_FRAMES", block_frames)
    lines = [f"({1600000000 + k // 20}.{k % 20 * 5:02d}0000) can{k % 2} 123#{k:04X}\n" for k in range(400)]
    path = tmp_path / "drive.log"
    written = TWICE[order](lines)
    path.write_text("".join(written))
    frames, quality = read(path)
    assert [256 * one[0] + one[1] for one in frames["data"].tolist()] == list(range(400))
    unlike = {name: value for name, value in vars(quality).items() if value != vars(LogQuality())[name]}
    assert unlike == {"frames": 400, "frames_twice": len(written) - 400}


@pytest.mark.parametrize("block_frames", [1 << 14, 50])
def test_frames_stored_from_the_end_are_read_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block_frames: int
) -> None:
    monkeypatch.setattr(text_log, "BLOCK_FRAMES", block_frames)
    lines = [f"(1600000000.{k:03d}000) can{k % 2} 123#{k:02X}\n" for k in range(200)]
    lines.insert(150, "(1600000000.15")
    path = tmp_path / "drive.log"
    path.write_text("".join(f"{line.strip()}\n" for line in reversed(lines)))
    frames, quality = read(path)
    assert list(frames["data"][:, 0]) == list(range(200))
    assert (np.diff(frames["stamp_ns"]) == 1_000_000).all()
    assert (quality.backwards, quality.frames, quality.damaged) == (True, 200, 1)
    assert (quality.stamps_backwards, quality.clock_set) == (0, 0)
