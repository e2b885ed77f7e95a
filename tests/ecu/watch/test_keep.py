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


def test_what_cannot_be_kept(loop, tmp_path):
    one = loop()
    reader = RingReader(one.ring.path)
    with pytest.raises(UserError, match="nothing to keep yet"):
        keep([], reader, tmp_path)
    one.publish(4)
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot record here"):
        keep(batches(reader), reader, tmp_path / "file")
