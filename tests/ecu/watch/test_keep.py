import json

import pytest

from ecu.errors import UserError
from ecu.recording.recorder import read_recording
from ecu.recording.ring import RingReader
from ecu.watch.keep import keep


def batches(reader):
    found = []
    while len((batch := reader.read()).records):
        found.append(batch)
    return found


def test_what_was_watched_reads_back_as_a_recording(loop, tmp_path):
    one = loop()
    one.publish(300, frames=2, vehicle_speed=20.0)
    reader = RingReader(one.ring.path)
    recording = read_recording(keep(batches(reader), reader, tmp_path / "kept"))
    assert recording.cycles["number"].tolist() == list(range(300))
    assert set(recording.outputs["vehicle_speed"]) == {20.0}
    lines = recording.frames.read_text().splitlines()
    assert len(lines) == 600
    assert lines[0] == "(1800000000.000000) can0 123#0001020304050607"
    assert recording.about["first_cycle"] == 0


def test_one_that_begins_later_says_so(loop, tmp_path):
    one = loop()
    one.publish(3000, frames=1)
    reader = RingReader(one.ring.path)
    recording = read_recording(keep(batches(reader), reader, tmp_path))
    assert recording.about["first_cycle"] == recording.cycles["number"][0] == 600
    assert recording.about["start_ns"] == recording.cycles["t_ns"][0]


@pytest.mark.parametrize(
    ("before", "calibrated", "after", "first", "notes", "rate"),
    [
        (100, 1, 100, 0, [(1, 100)], 1.0),  # all of the run, and how it was calibrated: it can be repeated
        (100, 2, 100, 101, [], 2.0),  # what held before the last one is gone, and its cycles with it
        (100, 1, 2900, 600, [], 1.0),  # calibrated before the first cycle that is kept
        (100, 0, 10, 0, [], None),
    ],
)
def test_a_calibrated_run_says_which_parameters_held(
    loop, tmp_path, before, calibrated, after, first, notes, rate
):
    one = loop(configuration={"control": {}})
    for number in range(1, calibrated + 1):
        one.publish(before if number == 1 else 1)
        page = one.ring.pages[number % 2 : number % 2 + 1]
        page["number"], page["tables"] = number, json.dumps({"control": {"rate": float(number)}}).encode()
        one.ring.header["page"], one.ring.header["calibrated_from"] = number % 2, one.number
        one.ring.header["calibration"] = number
    for _ in range(after):
        one.publish(1)
    reader = RingReader(one.ring.path)
    found = [reader.read(1) for _ in range(2400)]
    recording = read_recording(keep([each for each in found if len(each.records)], reader, tmp_path / "kept"))
    assert recording.about["first_cycle"] == recording.cycles["number"][0] == first
    assert [note[:2] for note in recording.calibrations] == notes
    last = recording.calibrations[-1].tables if notes else recording.about["configuration"]
    assert last["control"].get("rate") == rate


def test_what_cannot_be_kept(loop, tmp_path):
    one = loop()
    reader = RingReader(one.ring.path)
    with pytest.raises(UserError, match="nothing to keep yet"):
        keep([], reader, tmp_path)
    one.publish(4)
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot record here"):
        keep(batches(reader), reader, tmp_path / "file")
