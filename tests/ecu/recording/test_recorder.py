import io
import json
import os
import re
import shutil
import sqlite3

import numpy as np
import pytest
from structlog.testing import capture_logs

from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from ecu.algorithm.estimate import ESTIMATE
from ecu.contract.faults import E2E_REJECTIONS
from ecu.contract.records import (
    CYCLE,
    FRAME,
    FRAME_EXTENDED,
    FRAME_FD,
    INPUT_WATCH,
    INPUTS,
    LEARNED,
    OUTPUTS,
    new_record,
)
from ecu.contract.work import Kind, Work, to_record
from ecu.errors import UserError
from ecu.recording import store as state_store
from ecu.recording.calibration import NOTES_FILE
from ecu.recording.publish import publish
from ecu.recording.recorder import (
    CYCLES_FILE,
    FRAMES_FILE,
    candump_lines,
    dtype_of,
    interface_name,
    layout,
    make_room,
    read_recording,
)
from ecu.recording.ring import RECORDED, RingReader, create_ring
from ecu.recording.store import open_store, restore
from ecu.runtime import side_process
from ecu.runtime.side_process import Recorder

STATE = np.dtype([("speed", "f8"), ("learned", LEARNED), ("flag", "u1")], align=True)
ABOUT = {
    "channel": "can0",
    "store_key": "suv/1/1",
    "start_ns": 1_700_000_000_000_000_000,
    "config_hash": "abcd",
    "state": layout(STATE),
}


class Run:
    """A ring with a recorder at its end."""

    def __init__(self, tmp_path, record=None, state=None, **more):
        initial = new_record(STATE)
        initial["speed"] = 12.5
        self.ring = create_ring(tmp_path / "ring", ABOUT, initial.tobytes(), slots=64, frames=1024)
        self.cycle, self.outputs, self.learned = new_record(CYCLE), new_record(OUTPUTS), new_record(LEARNED)
        self.learned["mu_b"], self.learned["sigma_mu_b"], self.learned["observed_s"] = 0.4, 0.03, 2.0
        self.learned["radius_sigma"] = 0.002
        self.frames = new_record(FRAME, 3)
        self.frames["length"], self.frames["can_id"] = 2, [0x10, 0x123, 0x7FF]
        self.recorder = Recorder(RingReader(self.ring.path), record, state, **more)

    def cycles(self, count, frames=0, brakings=0, **outputs):
        for _ in range(count):
            self.cycle["number"] = self.ring.header["written"]
            self.cycle["frames"], self.learned["brakings"] = frames, brakings
            for name, value in outputs.items():
                self.outputs[name] = value
            measured = (self.outputs, new_record(INPUTS), new_record(ESTIMATE))
            publish(self.ring, self.cycle, *measured, self.learned, new_record(INPUT_WATCH), self.frames)
        self.recorder.turn()


def test_a_recording_reads_back_as_it_was_written(tmp_path):
    run = Run(tmp_path, record=tmp_path / "record")
    run.cycles(3, frames=2, k_f=0.9)
    run.cycles(2, frames=1, k_f=1.1)
    run.recorder.finish()
    recording = read_recording(tmp_path / "record")
    assert recording.cycles["number"].tolist() == [0, 1, 2, 3, 4]
    assert recording.outputs["k_f"].tolist() == [0.9] * 3 + [1.1] * 2
    assert recording.initial["speed"].tolist() == [12.5]
    assert recording.about["config_hash"] == "abcd"
    assert len(recording.frames.read_text().splitlines()) == 3 * 2 + 2 * 1
    assert recording.cycles["frames"].sum() == 8


def calibrate(run, number, cycle):
    page = run.ring.pages[:1]
    page["number"], page["tables"] = number, json.dumps({"control": {"n": number}}).encode()
    run.ring.header["calibrated_from"], run.ring.header["calibration"] = cycle, number


def test_a_calibration_is_noted_once_also_by_the_recorder_that_takes_over(tmp_path):
    run = Run(tmp_path, record=tmp_path / "record")
    run.cycles(3)
    calibrate(run, 1, 3)
    run.cycles(2)
    run.cycles(2)
    assert read_recording(tmp_path / "record").calibrations == [(1, 3, {"control": {"n": 1}}, None)]
    calibrate(run, 2, 7)
    run.recorder = Recorder(RingReader(run.ring.path), tmp_path / "record", None, again=True)
    run.cycles(1)
    run.recorder.finish()
    notes = read_recording(tmp_path / "record").calibrations
    assert [note[:2] for note in notes] == [(1, 3), (2, 7)]


def test_work_is_stored_before_its_cycle_counts_as_handled_and_is_one_line(tmp_path):
    """A change alone would wait for a minute."""
    run = Run(tmp_path, record=tmp_path / "record", state=tmp_path / "state")
    run.cycles(3)
    run.learned["wear"]["odometer"] = 5.0
    calibrate(run, 1, 4)
    run.ring.pages["work"][0] = to_record(Work(Kind.NEW_PADS, {"fl": 0.0}))[0]
    with capture_logs() as lines:
        run.cycles(1)
        assert kept(run) is None  # of the cycle before
        run.cycles(1)
    assert kept(run)["wear"]["odometer"] == 5.0
    line = {"number": 1, "cycle": 4, "kind": "new_pads", "wear": {"fl": 0.0}}
    assert [one for one in lines if one["event"] == "serviced"] == [
        {**line, "event": "serviced", "log_level": "info"}
    ]
    run.recorder.finish()
    found = read_recording(tmp_path / "record").calibrations
    assert [note.work for note in found] == [Work(Kind.NEW_PADS, {"fl": 0.0})]


def kept(run):
    found = run.recorder.store.execute("SELECT record FROM learned WHERE key = ?", (run.recorder.key,))
    row = found.fetchone()
    return row and np.frombuffer(row[0], LEARNED)[0]


def test_notes_that_are_none_make_no_recording(tmp_path):
    run = Run(tmp_path, record=tmp_path / "record")
    run.cycles(1)
    for text in ("{", "[]", '{"number": 1}', '{"number": 1, "cycle": "x", "tables": {}}'):
        (run.recorder.files.folder / NOTES_FILE).write_text(text)
        with pytest.raises(UserError, match="not a complete recording"):
            read_recording(tmp_path / "record")


def test_each_start_has_a_folder_and_the_latest_is_read(tmp_path):
    for k_f in (1.0, 2.0, 3.0):
        run = Run(tmp_path, record=tmp_path / "record")
        run.cycles(1, k_f=k_f)
        run.recorder.finish()
    folders = sorted((tmp_path / "record").iterdir())
    assert len(folders) == 3
    assert read_recording(folders[0]).outputs["k_f"].tolist() == [1.0]
    assert read_recording(tmp_path / "record").outputs["k_f"].tolist() == [3.0]


@pytest.mark.parametrize("torn", [1, RECORDED.itemsize - 1])
def test_a_torn_last_cycle_is_left_out(tmp_path, torn):
    run = Run(tmp_path, record=tmp_path / "record")
    run.cycles(4)
    run.recorder.finish()
    file = next((tmp_path / "record").glob(f"*/{CYCLES_FILE}"))
    file.write_bytes(file.read_bytes()[:-torn])
    assert read_recording(tmp_path / "record").cycles["number"].tolist() == [0, 1, 2]


def test_no_recording_is_one_line(tmp_path):
    with pytest.raises(UserError, match="no recording"):
        read_recording(tmp_path)


@pytest.mark.parametrize("dtype", [RECORDED, FRAME, STATE])
def test_a_layout_survives_json(dtype):
    back = dtype_of(json.loads(json.dumps(layout(dtype))))
    assert back.itemsize == dtype.itemsize
    assert back.fields.keys() == dtype.fields.keys()
    content = np.arange(dtype.itemsize, dtype=np.uint8).tobytes()
    a, b = np.frombuffer(content, dtype), np.frombuffer(content, back)
    assert all(np.array_equal(_bytes(a[name]), _bytes(b[name])) for name in dtype.names)


def _bytes(values):
    return np.frombuffer(values.tobytes(), np.uint8)


# identifier, flags, stamp [ns], data -> the line of candump -l
LINES = {
    "standard": (0x10, 0, 1_436_509_052_249_713_000, "1122", "(1436509052.249713) can0 010#1122"),
    "no data": (0x7FF, 0, 1_000_001_000, "", "(1.000001) can0 7FF#"),
    "29 bits": (0x18DAF110, FRAME_EXTENDED, 2_000_000_000, "AB", "(2.000000) can0 18DAF110#AB"),
    "29 bits, small": (0x5, FRAME_EXTENDED, 2_000_000_000, "AB", "(2.000000) can0 00000005#AB"),
    "FD": (0x123, FRAME_FD, 3_000_000_000, "00" * 12, "(3.000000) can0 123##0" + "00" * 12),
}


@pytest.mark.parametrize(("can_id", "flags", "stamp_ns", "data", "line"), LINES.values(), ids=LINES)
def test_frames_are_written_as_candump_writes_them(can_id, flags, stamp_ns, data, line):
    frames = new_record(FRAME)
    payload = bytes.fromhex(data)
    frames["can_id"], frames["flags"], frames["stamp_ns"], frames["length"] = (
        can_id,
        flags,
        stamp_ns,
        len(payload),
    )
    frames["data"][0, : len(payload)] = list(payload)
    assert candump_lines(frames, "can0").decode() == line + "\n"


NAMES = {
    "can0": "can0",
    "239.74.163.77": "239.74.163.77",
    "/dev/ttyUSB0@115200": "_dev_ttyUSB0_11",
    "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173": "ff15_7079_7468_",
}


@pytest.mark.parametrize(("channel", "name"), NAMES.items(), ids=NAMES)
def test_a_recording_bears_a_name_that_a_candump_log_can_bear(channel, name, tmp_path):
    assert interface_name(channel) == name
    frames, interfaces = new_record(FRAME), []
    (tmp_path / "drive.log").write_bytes(candump_lines(frames, name))
    assert len(next(read_frames(tmp_path / "drive.log", interfaces, LogQuality()))) == 1
    assert interfaces == [name]


class FullDisk(io.BytesIO):
    """Takes a little, then there is no room."""

    def write(self, data):
        if self.tell() > 50:
            raise OSError(28, "No space left on device")
        return super().write(bytes(data)[:40])


def test_a_full_disk_ends_the_recording_with_one_line_and_nothing_else(tmp_path):
    run = Run(tmp_path, record=tmp_path / "record", state=tmp_path / "state")
    run.cycles(1)
    run.recorder.files = run.recorder.files._replace(frames=FullDisk())
    with capture_logs() as lines:
        run.cycles(2, frames=3)
        run.cycles(2, frames=3, brakings=1)
    assert [line["event"] for line in lines if line["log_level"] == "error"] == ["recording_stopped"]
    assert restore(open_store(tmp_path / "state"), "suv/1/1", np.full(4, 0.4)) is not None


# what a killed recorder left beside whole cycles: bytes more or less of frames.log, of cycles.bin
LEFT = {
    "nothing": (0, 0),
    "frames of a cycle that is not there": (70, 0),
    "a torn line": (5, 0),
    "a torn cycle": (0, 100),
    "both": (33, RECORDED.itemsize - 1),
    "cycles only in part": (0, -100),
}


@pytest.mark.parametrize(("frames", "cycles"), LEFT.values(), ids=LEFT)
@pytest.mark.requirement("REQ-PROC-1")
def test_one_that_was_killed_is_gone_on_with_in_the_same_recording(tmp_path, frames, cycles):
    run = Run(tmp_path, record=tmp_path / "record", state=tmp_path / "state")
    run.cycles(4, frames=2, mode=1)
    files = run.recorder.files
    assert os.write(files.frames.fileno(), b"(1700000000.000001) can0 010#0000\n"[:1] * frames) == frames
    if cycles < 0:
        os.truncate(files.cycles.fileno(), 4 * RECORDED.itemsize + cycles)
    else:
        os.write(files.cycles.fileno(), bytes(cycles))
    run.recorder = None
    run.ring.header["followed"] = 2
    with capture_logs() as lines:
        run.recorder = Recorder(
            RingReader(run.ring.path), tmp_path / "record", tmp_path / "state", again=True
        )
        run.cycles(3, frames=1, mode=1)
        run.recorder.finish()
    recording = read_recording(tmp_path / "record")
    assert recording.cycles["number"].tolist() == list(range(7))
    assert len(recording.frames.read_text().splitlines()) == 4 * 2 + 3
    assert saved_brakings(tmp_path / "state") == 0
    assert lines == []  # what the first one said is not said again


def test_a_store_that_cannot_be_written_is_tried_again(tmp_path):
    (tmp_path / "state").write_text("a file")
    with capture_logs() as lines:
        run = Run(tmp_path, state=tmp_path / "state")
        run.cycles(2)
        assert not run.recorder.kept
        run.cycles(1, brakings=1)
        run.cycles(1, brakings=2)
    assert [line["event"] for line in lines] == ["not_kept"]
    (tmp_path / "state").unlink()
    run.cycles(1, brakings=3)
    assert run.recorder.kept
    assert saved_brakings(tmp_path / "state") == 3


def test_a_disk_that_is_full_is_reported_once(tmp_path, monkeypatch):
    """The store opens, and every value that is written to it fails."""
    run = Run(tmp_path, state=tmp_path / "state")
    run.cycles(2)
    save = state_store.save

    def full(*_):
        raise sqlite3.OperationalError("database or disk is full")

    monkeypatch.setattr(state_store, "save", full)
    with capture_logs() as lines:
        for brakings in range(1, 5):
            run.cycles(1, brakings=brakings)
            assert not run.recorder.kept
    assert [line["event"] for line in lines] == ["not_kept"]
    monkeypatch.setattr(state_store, "save", save)
    run.cycles(1, brakings=5)
    assert run.recorder.kept
    assert saved_brakings(tmp_path / "state") == 5


@pytest.mark.parametrize("what", ["the folder", "the file", "the file, and another was put there"])
def test_a_store_that_is_removed_is_reported_and_made_anew(tmp_path, what):
    run = Run(tmp_path, state=tmp_path / "state")
    run.cycles(1, brakings=1)
    if what == "the folder":
        shutil.rmtree(tmp_path / "state")
    else:
        for file in (tmp_path / "state").glob("learned*"):
            file.unlink()
    if what == "the file, and another was put there":
        open_store(tmp_path / "state").close()
    with capture_logs() as lines:
        run.cycles(1, brakings=1)  # nothing learned since
        run.cycles(1, brakings=1)
    assert [line["event"] for line in lines] == ["store_removed"]
    assert run.recorder.kept
    assert saved_brakings(tmp_path / "state") == 1


def test_a_limit_removes_the_oldest_recordings_and_stops_one_that_is_larger_alone(tmp_path):
    for _ in range(3):
        run = Run(tmp_path, record=tmp_path / "record")
        run.cycles(10)
        run.recorder.finish()
    folders = sorted((tmp_path / "record").iterdir())
    size = sum(file.stat().st_size for file in folders[0].iterdir())
    assert make_room(folders[2], 3 * size)
    assert sorted((tmp_path / "record").iterdir()) == folders
    (folders[0] / "note.txt").write_text("of the user")
    assert make_room(folders[2], 2.5 * size)
    assert [len(list(folder.iterdir())) for folder in folders] == [1, 4, 4]
    with capture_logs() as lines:
        run = Run(tmp_path, record=tmp_path / "record", limit_bytes=2000)
        run.cycles(10)
    assert [line["event"] for line in lines] == ["recording_stopped"]


def saved_brakings(folder):
    found = restore(open_store(folder), "suv/1/1", np.full(4, 0.4))
    return None if found is None else int(found[1]["brakings"][0])


def test_learned_values_are_saved_after_a_braking_and_at_the_end(tmp_path, monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(side_process.time, "monotonic", lambda: clock[0])
    run = Run(tmp_path, state=tmp_path / "state")
    run.cycles(5)
    assert saved_brakings(tmp_path / "state") is None
    run.cycles(1, brakings=1)
    assert saved_brakings(tmp_path / "state") == 1
    run.learned["radius_error"] = 0.001
    run.cycles(1, brakings=1)
    revisions = "SELECT max(revision) FROM learned"
    assert open_store(tmp_path / "state").execute(revisions).fetchone() == (1,)
    clock[0] = 60.0
    run.cycles(1, brakings=1)
    assert open_store(tmp_path / "state").execute(revisions).fetchone() == (2,)
    run.learned["radius_error"] = 0.002
    run.cycles(1, brakings=1)
    run.recorder.finish()
    assert open_store(tmp_path / "state").execute(revisions).fetchone() == (3,)


def test_events_are_lines_on_change_only(tmp_path):
    run = Run(tmp_path)
    with capture_logs() as lines:
        run.cycles(20, mode=0, active_faults=1)
        run.cycles(20, mode=1, active_faults=0)
        run.cycles(20, mode=2, active_faults=1 << 16)
        run.cycles(20, mode=2, active_faults=0)
    assert [(line["event"], line.get("now") or line.get("fault")) for line in lines] == [
        ("mode", "ready"),
        ("mode", "active"),
        ("fault", "bus off"),
        ("fault_gone", "bus off"),
    ]


def test_rejections_are_reported_with_what_was_late_lost_repeated_and_wrong_so_far(tmp_path):
    run = Run(tmp_path)
    with capture_logs() as lines:
        run.cycle["e2e"] = 4, 3, 9, 0
        run.cycles(5, mode=3, active_faults=E2E_REJECTIONS)
        run.cycle["e2e"] = 4, 3, 20, 1
        run.cycles(5, mode=3, active_faults=0)
    assert [line["frames"] for line in lines if "fault" in line] == [
        {"late": 4, "lost": 3, "repeated": 9, "wrong": 0},
        {"late": 4, "lost": 3, "repeated": 20, "wrong": 1},
    ]


def test_a_clock_that_was_set_is_reported(tmp_path):
    run = Run(tmp_path)
    with capture_logs() as lines:
        for set_s in (0, 60, 60, -3600):
            run.cycle["clock_set_ns"] = set_s * 1_000_000_000
            run.cycles(1)
    assert [(line["by_s"], line["since_start_s"]) for line in lines if line["event"] == "clock_set"] == [
        (60.0, 60.0)
    ]  # the second one within a second


def test_stamps_of_a_recording_are_what_candump_keeps(tmp_path):
    run = Run(tmp_path, record=tmp_path / "record")
    run.frames["stamp_ns"] = 1_700_000_000_123_456_000
    run.cycles(1, frames=1)
    run.recorder.finish()
    line = next((tmp_path / "record").glob(f"*/{FRAMES_FILE}")).read_text()
    assert re.fullmatch(r"\(1700000000\.123456\) can0 010#0000\n", line)
