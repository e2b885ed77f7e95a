"""The stored fault memory: durable, of one owner, and none the worse for a damaged file or a full disk."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import structlog
from hypothesis import given
from hypothesis import strategies as st

from ecu.contract.faults import WHEEL_SPEED_LOST
from ecu.diagnostics.fault_memory import CONFIRMED, Entry, FaultMemory
from ecu.diagnostics.memory_file import FILE, Kept, MemoryFile, Place, from_record, take_over, to_record
from ecu.diagnostics.trouble_codes import TROUBLE_CODES
from ecu.recording import revisions

KEY = "suv/12345678/8"
PLACE = Place(1_700_000_000_000_000_000, 4711)


def failed():
    """A memory with one confirmed code."""
    memory = FaultMemory()
    for _ in range(20):
        memory.add(WHEEL_SPEED_LOST, sum(code.fault.bit for code in TROUBLE_CODES), lambda: b"\x01\x02")
    return memory


@pytest.fixture
def file(tmp_path):
    """The file of a vehicle, loaded."""
    one = MemoryFile(tmp_path, KEY)
    assert one.load() is None
    yield one
    one.close(10)


def saved(file, memory=None):
    file.save(to_record(memory or failed(), PLACE))
    return file.is_saved(10)


def test_what_is_saved_is_loaded_by_the_next(tmp_path, file):
    assert saved(file)
    file.close(10)
    kept = MemoryFile(tmp_path, KEY).load()
    memory = FaultMemory()
    take_over(memory, kept.entries)
    assert memory.entries == failed().entries
    assert kept.place == PLACE


def test_another_vehicles_memory_is_its_own(tmp_path, file):
    assert saved(file)
    file.close(10)
    assert MemoryFile(tmp_path, "sedan/12345678/8").load() is None


def test_a_code_that_is_no_more_is_left_out():
    memory = FaultMemory()
    take_over(memory, {0x5FFF00: Entry(status=CONFIRMED)})
    assert memory.entries == FaultMemory().entries


SPOILT = {
    "no JSON": b"{",
    "no object": b"[]",
    "no place": b'{"entries": {}}',
    "no code": b'{"start_ns": 1, "cycle": 2, "entries": {"C1000": [0, 0, 0, "", ""], "x": []}}',
    "a row too short": b'{"start_ns": 1, "cycle": 2, "entries": {"500008": [0, 0]}}',
    "a number out of range": b'{"start_ns": 1, "cycle": 2, "entries": {"500008": [0, 256, 0, "", ""]}}',
    "a bit that there is not": b'{"start_ns": 1, "cycle": 2, "entries": {"500008": [128, 0, 0, "", ""]}}',
    "no bytes": b'{"start_ns": 1, "cycle": 2, "entries": {"500008": [0, 0, 0, "0", ""]}}',
    "deep": b"[" * 100000,
    "infinite": b'{"start_ns": 1e999, "cycle": 2, "entries": {}}',
}  # fmt: skip


@pytest.mark.parametrize("record", SPOILT.values(), ids=SPOILT)
def test_a_revision_that_makes_no_sense_is_skipped_for_the_one_before(record, tmp_path, file):
    with pytest.raises(ValueError):
        from_record(record)
    assert saved(file)
    file.save(record)
    assert file.is_saved(10)
    file.close(10)
    with structlog.testing.capture_logs() as lines:
        kept = MemoryFile(tmp_path, KEY).load()
    assert kept == Kept(
        PLACE, {number: entry for number, entry in failed().entries.items() if entry != Entry()}
    )
    assert [line["event"] for line in lines] == ["revision_refused"]


VALUE = st.recursive(
    st.one_of(st.none(), st.integers(-300, 300), st.floats(), st.text(max_size=4), st.just("00ff")),
    lambda inner: st.one_of(
        st.lists(inner, max_size=6), st.dictionaries(st.text(max_size=4), inner, max_size=3)
    ),
    max_leaves=8,
)
RECORD = st.one_of(
    VALUE,
    st.fixed_dictionaries(
        {
            "start_ns": st.one_of(st.just(1), VALUE),
            "cycle": st.one_of(st.just(2), VALUE),
            "entries": st.one_of(
                VALUE, st.dictionaries(st.just("500008"), st.lists(VALUE, min_size=5, max_size=5))
            ),
        }
    ),
)


@given(st.one_of(st.binary(max_size=40), RECORD.map(lambda value: json.dumps(value).encode())))
def test_any_record_is_a_memory_or_refused(record):
    try:
        kept = from_record(record)
    except ValueError:
        return
    take_over(FaultMemory(), kept.entries)
    assert all(0 <= entry.status < 128 and isinstance(entry.first, bytes) for entry in kept.entries.values())


def test_a_damaged_file_is_one_line_and_it_goes_on(tmp_path):
    (tmp_path / FILE).write_bytes(b"no database" * 1000)
    file = MemoryFile(tmp_path, KEY)
    with structlog.testing.capture_logs() as lines:
        assert file.load() is None
        assert saved(file)
    assert [line["event"] for line in lines] == ["store_damaged"]
    file.close(10)


def test_a_full_disk_is_one_line_until_there_is_room(tmp_path, file, monkeypatch):
    def full(path):
        error = sqlite3.OperationalError("database or disk is full")
        error.sqlite_errorcode = sqlite3.SQLITE_FULL
        raise error

    assert saved(file)
    file.close(10)
    second, connect = MemoryFile(tmp_path, KEY), revisions._connect
    with structlog.testing.capture_logs() as lines:
        with monkeypatch.context() as disk:
            disk.setattr(
                revisions, "_connect", lambda path: (full if path.parent == tmp_path else connect)(path)
            )
            assert second.load().place == PLACE  # it can be read all the same
            assert not saved(second, FaultMemory())
            assert not saved(second, FaultMemory())
        assert saved(second, FaultMemory())
    assert [line["event"] for line in lines] == ["faults_not_kept"]
    second.close(10)
    assert MemoryFile(tmp_path, KEY).load() == Kept(PLACE, {})


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    one = MemoryFile(tmp_path / "file", KEY)
    with structlog.testing.capture_logs() as lines:
        assert one.load() is None
        one.save(b"")
        assert not one.is_saved(0.1)
    assert [line["event"] for line in lines] == ["faults_not_kept"]


def test_it_has_one_owner_and_nobody_else_writes_over_it(tmp_path, file):
    assert saved(file)
    second = MemoryFile(tmp_path, KEY)
    with structlog.testing.capture_logs() as lines:
        assert second.load(patience_s=0.0) is None
    assert "another daemon keeps its fault memory there" in lines[0]["reason"]
    assert len(lines) == 1
    file.close(10)
    second.save(to_record(FaultMemory(), Place(2, 2)))
    assert not second.is_saved(0.2)
    assert MemoryFile(tmp_path, KEY).load().place == PLACE


def test_an_owner_that_is_about_to_end_is_waited_for(tmp_path, file):
    """A server that is started while the one before it stores its last cycles."""
    assert saved(file)
    ends = threading.Timer(0.3, lambda: file.close(10))
    ends.start()
    assert MemoryFile(tmp_path, KEY).load().place == PLACE
    ends.join()


def test_a_process_that_is_killed_has_lost_nothing_that_was_saved(tmp_path):
    script = (
        "import os, sys\nfrom pathlib import Path\n"
        "from ecu.diagnostics.fault_memory import FaultMemory\n"
        "from ecu.diagnostics.memory_file import MemoryFile, Place, to_record\n"
        f"file = MemoryFile(Path(sys.argv[1]), {KEY!r})\n"
        "file.load()\n"
        "for cycle in range(1000):\n"
        "    file.save(to_record(FaultMemory(), Place(1, cycle)))\n"
        "    if file.is_saved(10): print(cycle, flush=True)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, tmp_path],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])},
    ) as process:
        last = [int(process.stdout.readline()) for _ in range(5)][-1]
        process.send_signal(signal.SIGKILL)
    assert MemoryFile(tmp_path, KEY).load().place.cycle >= last
