"""A recording replays to the bits that were recorded, as does an independent log of the same bus."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.replay.command import replay
from brakelab.replay.engine import new_ecu
from brakelab.replay.quality import Findings
from brakelab.replay.source import load_source
from brakelab.results.files import read_result
from brakelab.rig.play.play_log import contract_frames
from ecu.algorithm.step import INITIAL, initial_part, step
from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.receive import new_reception, receive
from ecu.bus.receive_plan import contract_receive_plan
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS, OUTPUT_COLUMNS
from ecu.errors import UserError
from ecu.recording.recorder import (
    ABOUT_FILE,
    CYCLES_FILE,
    candump_lines,
    layout,
    start_recording,
    write_batch,
)
from ecu.recording.ring import BESIDE, RECORDED, Batch
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

START_NS = 1_600_000_000_000_000_000
CYCLES = 300


def drive(tmp_path: Path) -> RecordArray:
    """Contract frames of 3.2 s on a bus, a braking from 1.5 s on."""
    path = tmp_path / "drive.csv"
    t = np.arange(320) * 0.01
    on = t > 1.5
    speed = (25.0 - 5.0 * np.clip(t - 1.5, 0, 9)) / 0.36
    names = [f"{name}_{c}" for name in ("wheel_speed", "calliper_pressure") for c in ("fl", "fr", "rl", "rr")]
    header = ",".join(["t", *names, "accel_x"])
    table = np.transpose([t, *[speed] * 4, *[45.0 * on] * 4, -5.0 * on])
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    frames = []
    for burst in contract_frames(path, load_source(None), Findings(path)):
        block = burst.copy()
        block["stamp_ns"] += START_NS + np.arange(len(block)) * 200_000
        frames.append(block)
    return np.concatenate(frames)


def record(tmp_path: Path, frames: RecordArray) -> tuple[Path, RecordArray]:
    """Run a live loop that joins the bus after 0.1 s and misses periods; return its recording and cycles."""
    plan = contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    params = new_params(load_config(resource("config/suv.toml")))
    params["mapped"] = plan.mapped
    ecu, reception = new_ecu(params, None), new_reception(plan)
    ecu.state["learned"]["mu_b"] = 0.5
    initial = initial_part(ecu.state).tobytes()
    records = np.zeros(CYCLES, RECORDED)
    first = begin = int(np.searchsorted(frames["stamp_ns"], START_NS + 10 * CYCLE_NS))
    t_ns = START_NS + 10 * CYCLE_NS
    for k in range(CYCLES):
        cycle = records["cycle"][k]
        cycle["missed"] = k % 50 == 49
        cycle["overruns"] = k // 50
        t_ns += int(cycle["missed"] + 1) * CYCLE_NS
        cycle["t_ns"] = t_ns
        begin_cycle(ecu.inputs[0], t_ns, int(cycle["missed"] + 1) * CYCLE_NS)
        ecu.inputs["overruns"] = cycle["overruns"]
        following = receive(plan, reception, frames, first, len(frames), ecu.inputs[0])
        cycle["frames"], first = following - first, following
        end_cycle(ecu.inputs[0], reception.freshness)
        step(*ecu[:4])
        records["outputs"][k] = ecu.outputs[0]
    about = {"start_ns": START_NS, "state": layout(INITIAL)}
    files = start_recording(tmp_path / "record", about, initial)
    write_batch(files, Batch(records, frames[begin:first], np.zeros(CYCLES, BESIDE)), "can0")
    return files.folder, records


def compare(out: Path, records: RecordArray) -> None:
    columns = read_result(out).columns
    live = records["outputs"].copy().view(np.float64).reshape(len(records), -1)
    for place, name in enumerate(OUTPUT_COLUMNS):
        np.testing.assert_array_equal(columns[name], live[:, place], name)
    t = (records["cycle"]["t_ns"] - records["cycle"]["t_ns"][0]) * 1e-9
    np.testing.assert_allclose(columns["t"], t, atol=1e-9)


def test_a_recording_replays_to_its_own_bits(tmp_path: Path) -> None:
    folder, records = record(tmp_path, drive(tmp_path))
    config = resource("config/suv.toml")
    replay([folder], config, None, None, None, tmp_path / "out.parquet")
    compare(tmp_path / "out.parquet", records)


def test_an_independent_log_replays_with_the_cycles_of_a_recording(tmp_path: Path) -> None:
    frames = drive(tmp_path)
    folder, records = record(tmp_path, frames)
    log = tmp_path / "witness.log"
    log.write_bytes(candump_lines(frames, "can0"))
    config = resource("config/suv.toml")
    replay([log], config, None, None, None, tmp_path / "out.parquet", folder)
    compare(tmp_path / "out.parquet", records)


def test_a_recording_of_another_layout_gives_one_line(tmp_path: Path) -> None:
    folder, _ = record(tmp_path, drive(tmp_path))
    about = folder / ABOUT_FILE
    about.write_text(about.read_text().replace('"brakings"', '"brakes"'))
    with pytest.raises(UserError, match="recorded by another version"):
        replay([folder], resource("config/suv.toml"), None, None, None, tmp_path / "out.parquet")


def test_a_recording_without_cycles_gives_one_line(tmp_path: Path) -> None:
    folder, _ = record(tmp_path, drive(tmp_path))
    (folder / CYCLES_FILE).write_bytes(b"")
    with pytest.raises(UserError, match="no cycle was recorded"):
        replay([folder], resource("config/suv.toml"), None, None, None, tmp_path / "out.parquet")


def test_one_that_begins_within_a_run_is_a_log_like_any_other(tmp_path: Path) -> None:
    """As `watch` keeps it: the state before its first cycle is not known."""
    folder, records = record(tmp_path, drive(tmp_path))
    about = folder / ABOUT_FILE
    about.write_text(about.read_text().replace('"start_ns"', '"first_cycle": 40, "start_ns"'))
    config, out = resource("config/suv.toml"), tmp_path / "out.parquet"
    replay([folder], config, None, None, None, out)
    columns = read_result(out).columns
    assert abs(len(columns["t"]) - len(records) - CYCLES // 50) <= 1  # periods missed are rows here
    np.testing.assert_array_less(
        abs(columns["mu_b_fl"][:100] - 0.45), 1e-6
    )  # configured, not the 0.5 learned
    with pytest.raises(UserError, match=r"begins within a run.*leave --cycles out"):
        replay([folder / "frames.log"], config, None, None, None, tmp_path / "other.parquet", folder)
