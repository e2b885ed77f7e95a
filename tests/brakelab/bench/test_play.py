"""The bench of players: its traffic, its measure, its page."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.bench import command
from brakelab.bench import play as bench
from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.results.text_table import Table
from brakelab.rig.live import Bus
from brakelab.studies import output
from ecu.contract.records import RecordArray


def test_traffic_is_that_of_a_bus_with_40_percent_load() -> None:
    times = bench.bus_times(10.0)
    assert np.diff(times).min() >= bench.FRAME_US  # one frame after another
    assert len(times) * bench.FRAME_US / 10e6 == pytest.approx(0.4, abs=0.01)
    assert (times == bench.bus_times(10.0)).all()  # the same for every player


def test_every_frame_of_the_log_carries_its_number(tmp_path: Path) -> None:
    log, times = tmp_path / "play.log", bench.bus_times(1.0)
    bench.write_log(log, times / 20.0, "vcan0")
    frames: RecordArray = np.concatenate(list(read_frames(log, [], LogQuality())))
    numbers = [int.from_bytes(data[:8].tobytes(), "big") for data in frames["data"]]
    assert numbers == list(range(len(times)))
    stamps_us = (frames["stamp_ns"] - 1_600_000_000_000_000_000) / 1e3
    np.testing.assert_allclose(stamps_us, times / 20.0, atol=0.51)


# numbers of the frames that came, when [us] -> how late [us]; the log has one every 1000 us
ARRIVALS = {
    "on time": ([0, 1, 2], [50, 550, 1050], [0, 0, 0]),
    "a late one": ([0, 1, 2], [50, 640, 1050], [0, 90, 0]),
    "a late first one": ([0, 1, 2], [80, 550, 1050], [30, 0, 0]),
    "an early one": ([0, 1, 2], [50, 540, 1050], [10, 0, 10]),
    "a lost one": ([0, 2], [50, 1050], [0, 0]),
}


@pytest.mark.parametrize(("numbers", "came", "late"), ARRIVALS.values(), ids=ARRIVALS)
def test_late_is_against_the_earliest_frame(numbers: list[int], came: list[int], late: list[int]) -> None:
    stamps = 1_700_000_000_000_000_000 + 1000 * np.array(came)
    found = bench.errors_us(np.array([0, 1000, 2000]), 2.0, np.array(numbers), stamps)
    np.testing.assert_allclose(found, late, atol=1e-6)


@pytest.mark.multicast
@pytest.mark.study
def test_play_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "SPEEDS", (20.0,))
    monkeypatch.setattr(bench, "choose_bus", lambda: Bus("udp_multicast", "239.76.1.2", "a bus"))
    players = 1 + len(bench.PLAYERS)
    [table] = bench.play_tables(0.01 * players)  # 324 frames each
    assert [row[1] for row in table.rows] == ["nothing sent", *(player.name for player in bench.PLAYERS)]
    for _, name, frames, p50, p99, _, worst, note in table.rows:
        if name == "canplayer":
            assert (frames, note) == ("–", "needs SocketCAN")
        else:
            assert frames in ("–", f"{len(bench.bus_times(0.2))} of {len(bench.bus_times(0.2))}")
            assert 0 <= float(p50) <= float(p99) <= float(worst)


def test_the_page_keeps_the_tables_of_other_buses(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(output, "resource", lambda name: tmp_path / name)
    (tmp_path / "docs" / "results").mkdir(parents=True)
    for title, value in [("one bus", "1"), ("another", "2"), ("one bus", "3")]:
        table = Table(title, ("what", "us"), [("a", value)], "Below.")
        monkeypatch.setattr("brakelab.bench.play.play_tables", lambda seconds, table=table: [table])
        assert command.bench("play", write=True) == 0
    text = (tmp_path / "docs" / "results" / "play.md").read_text(encoding="utf-8")
    assert text.count("Below.") == text.count("## ") == 2
    assert (
        text.index("## one bus")
        < text.index("| a | 3 |")
        < text.index("## another")
        < text.index("| a | 2 |")
    )
    assert "| a | 1 |" not in text
