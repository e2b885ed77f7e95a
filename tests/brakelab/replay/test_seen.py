"""What is counted of each input: gaps, invalid samples, ends of the range, jumps no car can make."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.replay.command import replay
from brakelab.replay.quality import Findings
from brakelab.replay.seen import new_seen, set_raw_ends
from brakelab.replay.source import load_source
from brakelab.results.files import read_result
from brakelab.rig.play.play_log import contract_frames
from ecu.bus.receive_plan import contract_receive_plan
from ecu.contract.signals import INPUT
from ecu.recording.recorder import candump_lines
from ecu.settings.resources import resource

SECONDS = 4.0
ROWS = 400
ROLLING = {"wheel_speed_fl": 50.0, "accel_x": 0.1, "calliper_pressure_fl": 30.0, "pedal_position": 100.0}


def signals(path: Path, change: dict[str, dict[int, float]]) -> Path:
    """Four seconds at 10 ms with some samples changed: {name: {row: value}}."""
    columns = {"t": np.arange(ROWS) * 0.01} | {name: np.full(ROWS, value) for name, value in ROLLING.items()}
    for name, samples in change.items():
        for row, value in samples.items():
            columns[name][row] = value
    pq.write_table(pa.table(columns), path)
    return path


def counted(log: Path, out: Path) -> tuple[dict[str, dict], dict]:
    """Return the counts of each input by name, and the log's."""
    replay([log], resource("config/suv.toml"), None, None, None, out)
    (counts,) = json.loads(read_result(out).metadata["quality"])
    return {row["name"]: row for row in counts["inputs"]}, counts


NAN = float("nan")


@pytest.mark.parametrize(
    ("name", "samples", "expected"),
    [
        ("wheel_speed_fl", {}, {"samples": 400, "greatest_gap_s": 0.01, "jumps": 0, "clipped": 0}),
        ("wheel_speed_fl", dict.fromkeys(range(100, 130), NAN), {"samples": 370, "greatest_gap_s": 0.31}),
        ("wheel_speed_fl", dict.fromkeys(range(380, 400), NAN), {"samples": 380, "greatest_gap_s": 0.20}),
        ("wheel_speed_fl", {100: 500.0, 101: 401.0}, {"outside": 2, "greatest": 50.0, "jumps": 0}),
        ("wheel_speed_fl", {100: 10.0}, {"jumps": 2, "least": 10.0}),  # 3000 rad/s² and 3 rad/s: 33 rad/s
        ("wheel_speed_fl", {100: 20.0}, {"jumps": 0, "least": 20.0}),
        ("calliper_pressure_fl", {100: 250.0, 101: 249.9}, {"clipped": 1, "greatest": 250.0}),
        ("calliper_pressure_fl", {7: -10.0}, {"clipped": 1, "least": -10.0}),
        ("pedal_position", {}, {"clipped": 0, "greatest": 100.0}),  # pressed to the stop is no clipping
        ("pedal_position", {200: 0.0}, {"jumps": 2}),
    ],
)
def test_an_input_is_counted(tmp_path: Path, name: str, samples: dict[int, float], expected: dict) -> None:
    log = signals(tmp_path / "drive.parquet", {name: samples})
    inputs, counts = counted(log, tmp_path / "out.parquet")
    assert {key: inputs[name][key] for key in expected} == expected
    assert set(inputs) == set(ROLLING)
    assert counts["rows"] == ROWS
    assert counts["seconds"] > 0.0


def test_a_longer_gap_allows_a_larger_step(tmp_path: Path) -> None:
    samples = dict.fromkeys(range(100, 103), NAN) | dict.fromkeys(range(103, ROWS), 0.0)
    inputs, _ = counted(
        signals(tmp_path / "a.parquet", {"wheel_speed_fl": samples}), tmp_path / "out.parquet"
    )
    assert inputs["wheel_speed_fl"]["jumps"] == 0


def test_frames_have_a_rate_and_counters_of_their_own(tmp_path: Path) -> None:
    path, log = signals(tmp_path / "drive.parquet", {}), tmp_path / "drive.log"
    text = b""
    for frames in contract_frames(path, load_source(None), Findings(path)):
        frames["stamp_ns"] += 1_600_000_000_000_000_000
        text += candump_lines(frames, "can0")
    lines = text.splitlines(keepends=True)
    wheel = [place for place, line in enumerate(lines) if b" 070#" in line]
    for place in wheel[50:60]:
        lines[place] = lines[place].replace(b"070#", b"070#FF").replace(b"\n", b"")[:-2] + b"\n"
    log.write_bytes(b"".join(line for place, line in enumerate(lines) if place not in wheel[200:220]))
    inputs, counts = counted(log, tmp_path / "out.parquet")
    speed = inputs["wheel_speed_fl"]
    assert speed["expected_hz"] == [100.0, 100.0]
    assert speed["greatest_gap_s"] == pytest.approx(0.21, abs=0.011)
    (message,) = [row for row in counts["messages"] if row["name"] == "WheelSpeedFront"]
    assert message["id"] == "070"
    assert message["received"] == len(wheel) - 20
    assert message["checksum_errors"] == 10


def test_the_raw_range_of_the_database_sets_the_ends() -> None:
    seen = new_seen()
    set_raw_ends(seen, contract_receive_plan(resource("dbc/brake_ecu.dbc")).signals)
    pressure = seen[INPUT["calliper_pressure_fl"]]
    assert pressure["bottom"] == pytest.approx(-10.0, abs=0.01)
    assert pressure["top"] == pytest.approx(250.0, abs=0.01)
    assert seen[INPUT["wheel_speed_fl"]]["top"] < np.inf
    assert seen[INPUT["motor_limit_fl"]]["bottom"] == -np.inf  # no torque is no clipping
    assert np.isinf(seen[INPUT["pedal_position"]]["top"])
