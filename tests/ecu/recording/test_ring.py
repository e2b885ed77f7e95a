import multiprocessing
import os
import subprocess
import sys
from multiprocessing.synchronize import Event
from pathlib import Path

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.contract.records import CYCLE, FRAME, INPUT_WATCH, INPUTS, LEARNED, OUTPUTS, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.errors import UserError
from ecu.recording import ring as ring_module
from ecu.recording.publish import publish
from ecu.recording.ring import (
    FRAMES,
    SLOTS,
    RingReader,
    close_ring,
    create_ring,
    living_rings,
    ring_path,
)


class Writer:
    """Publishes numbered cycles; frame n of the run has the identifier n % 2048."""

    def __init__(self, path: Path, slots: int, frames: int) -> None:
        self.ring = create_ring(path, {"channel": "can0"}, b"initial", slots=slots, frames=frames)
        self.cycle, self.outputs, self.learned = new_record(CYCLE), new_record(OUTPUTS), new_record(LEARNED)
        self.inputs, self.estimate = new_record(INPUTS), new_record(ESTIMATE)
        self.watched, self.frames = new_record(INPUT_WATCH), new_record(FRAME, 100)
        self.sent = 0

    def publish(self, *frames_per_cycle: int) -> None:
        for count in frames_per_cycle:
            number = int(self.ring.header["written"][0])
            self.cycle["number"], self.cycle["frames"] = number, count
            self.outputs["k_f"], self.learned["mu_b"] = number + 0.5, number
            self.inputs["value"], self.estimate["speed"] = number + 0.125, number + 0.75
            self.watched["ratio"] = number + 0.25
            self.frames["can_id"] = (self.sent + np.arange(100)) % 2048
            measured = (self.outputs, self.inputs, self.estimate)
            publish(self.ring, self.cycle, *measured, self.learned, self.watched, self.frames)
            self.sent += count


@pytest.fixture
def path(tmp_path):
    return tmp_path / "test.ring"


def test_a_reader_gets_what_was_written_in_order(path):
    writer = Writer(path, slots=16, frames=64)
    reader = RingReader(path)
    writer.publish(3, 0, 7)
    batch = reader.read()
    assert batch.records["cycle"]["number"].tolist() == [0, 1, 2]
    assert batch.records["outputs"]["k_f"].tolist() == [0.5, 1.5, 2.5]
    assert set(batch.beside["inputs"]["value"][1]) == {1.125}
    assert batch.beside["estimate"]["speed"].tolist() == [0.75, 1.75, 2.75]
    assert reader.latest("learned")["mu_b"].tolist() == [[2.0] * 4]
    assert set(reader.latest("watched")["ratio"].flat) == {2.25}
    assert batch.frames["can_id"].tolist() == list(range(10))
    assert len(reader.read().records) == 0
    assert (reader.description, reader.initial) == ({"channel": "can0"}, b"initial")


def test_it_goes_on_over_the_end_of_the_memory(path):
    writer = Writer(path, slots=8, frames=16)
    reader = RingReader(path)
    for _ in range(20):
        writer.publish(2, 0, 5)
        batch = reader.read()
        assert len(batch.records) == 3
        assert np.diff(batch.frames["can_id"].astype(int)).tolist() == [1] * 6
    assert (reader.lost_cycles, reader.lost_frames) == (0, 0)


def test_an_overtaken_reader_counts_what_it_lost(path):
    writer = Writer(path, slots=8, frames=1000)
    reader = RingReader(path)
    writer.publish(*[1] * 30)
    batch = reader.read()
    assert batch.records["cycle"]["number"].tolist() == list(range(22, 30))
    assert batch.frames["can_id"].tolist() == list(range(22, 30))
    assert reader.lost_cycles == 22


def test_frames_that_were_overwritten_are_counted_and_left_out(path):
    writer = Writer(path, slots=8, frames=16)
    reader = RingReader(path)
    writer.publish(10, 10, 4)
    batch = reader.read()
    assert len(batch.records) == 3
    assert batch.frames["can_id"].tolist() == list(range(8, 24))
    assert reader.lost_frames == 8


def test_a_slot_that_is_being_written_is_not_read(path):
    writer = Writer(path, slots=8, frames=16)
    reader = RingReader(path)
    writer.publish(0, 0, 0)
    writer.ring.slots["number"][1] = -1
    assert reader.read().records["cycle"]["number"].tolist() == [0, 2]
    assert reader.lost_cycles == 1


def test_a_late_reader_starts_with_the_oldest_cycle_still_there(path):
    writer = Writer(path, slots=8, frames=16)
    writer.publish(*[0] * 11)
    reader = RingReader(path)
    assert reader.read(limit=2).records["cycle"]["number"].tolist() == [3, 4]
    assert reader.lost_cycles == 0


def test_the_reader_learns_that_the_writer_is_done(path):
    writer = Writer(path, slots=8, frames=16)
    reader = RingReader(path)
    assert not reader.closed
    close_ring(writer.ring)
    assert reader.closed


def test_it_holds_twenty_seconds_of_a_full_bus():
    assert SLOTS * CYCLE_NS >= 20e9
    assert FRAMES >= 20 * 100 * 45


def _flood(path: Path, cycles: int, reading: Event) -> None:
    writer = Writer(path, slots=32, frames=256)
    reading.wait()
    writer.publish(*[7] * cycles)
    close_ring(writer.ring)


def test_a_reader_beside_a_racing_writer_sees_whole_cycles_only(path):
    spawn = multiprocessing.get_context("spawn")
    reading = spawn.Event()
    process = spawn.Process(target=_flood, args=(path, 20_000, reading))
    process.start()
    while not path.exists() and process.is_alive():
        pass
    reader, read, done = RingReader(path), 0, False
    reading.set()
    while not done:
        done = reader.closed or not process.is_alive()
        batch = reader.read()
        numbers = batch.records["cycle"]["number"]
        assert (batch.records["outputs"]["k_f"] == numbers + 0.5).all()
        learned = reader.latest("learned")
        assert learned is None or len(set(learned["mu_b"][0])) == 1
        assert np.isin(batch.frames["can_id"], np.arange(2048)).all()
        read += len(numbers)
    process.join()
    assert read + reader.lost_cycles == 20_000


@pytest.mark.parametrize("content", [b"", b"x" * 10_000], ids=["empty", "something else"])
def test_another_file_is_one_line(path, content):
    path.write_bytes(content)
    with pytest.raises(UserError, match="ring"):
        RingReader(path)


@pytest.mark.requirement("REQ-SEC-1")
def test_it_is_its_owner_s_alone_and_follows_no_link(path, tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("mine")
    path.symlink_to(victim)
    Writer(path, slots=8, frames=16)
    assert victim.read_text() == "mine"
    assert path.stat(follow_symlinks=False).st_mode & 0o777 == 0o600
    assert not path.is_symlink()
    assert len(list(tmp_path.iterdir())) == 2


def _link(path):
    path.rename(path.with_name("elsewhere"))
    path.symlink_to(path.with_name("elsewhere"))


def _header(path, **values):
    content = bytearray(path.read_bytes())
    header = np.frombuffer(content, ring_module._HEADER, 1)
    for name, value in values.items():
        header[name] = value
    path.write_bytes(content)


# what somebody made of a ring; none of them is read
FORGED = {
    "a symbolic link": _link,
    "anyone may write it": lambda path: path.chmod(0o602),
    "another user's": lambda path: os.chown(path, 12345, -1),
    "cut": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "no description": lambda path: _header(path, description_bytes=0),
    "its description is a list": lambda path: path.write_bytes(
        path.read_bytes().replace(b'{"channel": "can0"}', b'["channel", "can0"]')
    ),
    "its description is 3000 deep": lambda path: (
        path.write_bytes(path.read_bytes().replace(b'{"channel": "can0"}initial' + bytes(2974), b"[" * 3000)),
        _header(path, description_bytes=3000),
    ),
    "no slots": lambda path: _header(path, slots=0),
    "more slots than it has": lambda path: _header(path, slots=10**12),
    "negative": lambda path: _header(path, frames=-5),
    "a pipe": lambda path: (path.unlink(), os.mkfifo(path)),
}


@pytest.mark.parametrize("forge", FORGED.values(), ids=FORGED)
def test_what_is_not_our_own_ring_is_one_line(path, forge):
    Writer(path, slots=8, frames=16)
    try:
        forge(path)
    except PermissionError:
        pytest.skip("only root gives files away")
    with pytest.raises(UserError, match="ring"):
        RingReader(path)


def test_rings_of_the_living_are_known_by_their_lock(tmp_path, monkeypatch):
    monkeypatch.setattr(ring_module, "ring_folder", lambda: tmp_path)
    kept = Writer(
        ring_path(1), slots=8, frames=16
    )  # a process id that is not the writer's, as in a container
    script = (
        "import sys, time; from pathlib import Path; from ecu.recording.ring import create_ring\n"
        "ring = create_ring(Path(sys.argv[1]), {}, b'', slots=2, frames=2); print(flush=True); time.sleep(60)"
    )
    command = [sys.executable, "-c", script, str(ring_path(2))]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as other:
        other.stdout.readline()
        assert living_rings() == sorted([kept.ring.path, ring_path(2)])
        other.kill()
    (tmp_path / "brake-ecu.0.3.ring.abcd.new").write_text("left by one that died while it made it")
    assert living_rings() == [kept.ring.path]
    assert [file.name for file in tmp_path.iterdir()] == [kept.ring.path.name]


@pytest.mark.parametrize("words", [b"", b"[" * 3000, b"3", b'"by"', b"{", b"\xff", b"9" * 3000 + b"]"])
def test_last_words_that_cannot_be_read_are_none(path, words):
    ring = Writer(path, slots=8, frames=16).ring
    ring.header["last_words"], ring.header["closed"] = words, 1
    assert (RingReader(path).closed, RingReader(path).last_words) == (True, {})


def test_last_words_and_where_to_go_on(path):
    writer = Writer(path, slots=8, frames=64)
    writer.publish(3, 0, 7, 1)
    reader = RingReader(path)
    assert reader.go_on_after(1)["cycle"]["number"].tolist() == [1]
    assert [reader.frames_before(number) for number in (0, 2, 4, 5)] == [0, 3, 11, None]
    assert reader.read().records["cycle"]["number"].tolist() == [2, 3]
    assert reader.last_read == 3
    close_ring(writer.ring, {"cycles": 4})
    assert reader.last_words == {"cycles": 4}
