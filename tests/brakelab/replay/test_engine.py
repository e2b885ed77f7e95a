"""Replay against an explicit live loop, cycle by cycle: the same bits, never a sample from the future."""

from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.logs.sample_block import SampleBlock
from brakelab.logs.signal_file import freshness_at_any_rate
from brakelab.replay import engine
from brakelab.replay.engine import Change, Rows, new_ecu, run_frames, run_samples
from brakelab.replay.quality import Findings
from brakelab.replay.source import load_source
from brakelab.rig.play.play_log import contract_frames
from ecu.algorithm.step import step
from ecu.bus.freshness import accept, begin_cycle, end_cycle
from ecu.bus.receive import new_reception, receive
from ecu.bus.receive_plan import contract_receive_plan
from ecu.contract.records import CYCLE, FRAME, RecordArray
from ecu.contract.signals import ACCEL_X, CALLIPER_PRESSURE, CYCLE_NS, MOTOR_TORQUE, N_OUTPUTS, WHEEL_SPEED
from ecu.recording.recorder import candump_lines
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

START_NS = 1_600_000_000_000_000_000


@pytest.fixture
def params() -> RecordArray:
    return new_params(load_config(resource("config/suv.toml")))


def braking(rates_hz: dict[int, float], seconds: float, seed: int) -> SampleBlock:
    """A stop from 30 m/s at 4 m/s² whose signals come at their own rates and phases, 20 % of samples lost."""
    random = np.random.default_rng(seed)
    stamps = {
        place: (np.arange(int(seconds * rate)) / rate + random.uniform(0, 1 / rate)) * 1e6
        for place, rate in rates_hz.items()
    }
    t_us = np.unique(np.concatenate([np.rint(at) for at in stamps.values()]).astype(np.int64))
    values = np.full((len(t_us), len(rates_hz)), np.nan)
    for column, (place, at) in enumerate(stamps.items()):
        kept = np.rint(at).astype(np.int64)[random.random(len(at)) > 0.2]
        t = kept * 1e-6
        brakes = (t > 1.0) & (t < 6.0)
        speed = 30.0 - 4.0 * np.clip(t - 1.0, 0.0, 5.0)
        level = {ACCEL_X: -4.0 * brakes, MOTOR_TORQUE: 0.0 * t}.get(place)
        if level is None:
            level = speed / 0.34 * (1 - 0.02 * brakes) if place < ACCEL_X else 35.0 * brakes
        values[np.searchsorted(t_us, kept), column] = level + random.normal(0, 0.01, len(kept))
    t_ns = t_us * 1000
    return SampleBlock(t_ns * 1e-9, t_ns, np.array(list(rates_hz), np.int64), values)


MIXED = {WHEEL_SPEED + i: 66.0 for i in range(4)} | {CALLIPER_PRESSURE + i: 36.0 for i in range(4)}
MIXED |= {ACCEL_X: 250.0, MOTOR_TORQUE: 10.0}


def in_blocks(block: SampleBlock, size: int) -> list[SampleBlock]:
    return [
        SampleBlock(
            block.t[i : i + size], block.t_ns[i : i + size], block.places, block.values[i : i + size].copy()
        )
        for i in range(0, len(block.t), size)
    ]


def joined(rows: list[Rows]) -> np.ndarray:
    return np.concatenate([block.values for block in rows])


def live_samples(params: RecordArray, block: SampleBlock, cycles: int) -> np.ndarray:
    ecu, freshness = new_ecu(params, None), freshness_at_any_rate()
    lines, row = [], 0
    for k in range(cycles):
        t_ns = int(block.t_ns[0]) + k * CYCLE_NS
        begin_cycle(ecu.inputs[0], t_ns, CYCLE_NS)
        while row < len(block.t_ns) and block.t_ns[row] <= t_ns:
            for column, place in enumerate(block.places):
                if np.isfinite(block.values[row, column]):
                    accept(
                        ecu.inputs[0],
                        freshness,
                        int(place),
                        block.values[row, column],
                        int(block.t_ns[row]),
                        True,
                    )
            row += 1
        end_cycle(ecu.inputs[0], freshness)
        step(*ecu[:4])
        lines.append(ecu.outputs.view(np.float64).copy())
    return np.array(lines)


@pytest.mark.parametrize("size", [10**9, 7, 1])
def test_mixed_rates_give_the_bits_of_a_live_loop(
    params: RecordArray, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "BATCH", 13 if size == 7 else 4096)
    block = braking(MIXED, 7.0, seed=1)
    rows = list(run_samples(new_ecu(params, None), freshness_at_any_rate(), in_blocks(block, size)))
    values = joined(rows)
    assert len(values) == (block.t_ns[-1] - block.t_ns[0]) // CYCLE_NS + 1
    assert values[:, :N_OUTPUTS].tobytes() == live_samples(params, block, len(values)).tobytes()
    t_ns = np.concatenate([r.t_ns for r in rows])
    np.testing.assert_array_equal(t_ns, block.t_ns[0] + np.arange(len(values)) * CYCLE_NS)


def test_no_row_knows_the_future(params: RecordArray) -> None:
    block = braking(MIXED, 4.0, seed=2)
    values = joined(list(run_samples(new_ecu(params, None), freshness_at_any_rate(), [block])))
    for k in (0, 57, 211):
        changed = block.values.copy()
        changed[block.t_ns > block.t_ns[0] + k * CYCLE_NS] *= 1.3
        other = joined(
            list(
                run_samples(new_ecu(params, None), freshness_at_any_rate(), [block._replace(values=changed)])
            )
        )
        assert other[: k + 1].tobytes() == values[: k + 1].tobytes()
        assert other[k + 30 :].tobytes() != values[k + 30 :].tobytes()


def drive_frames(tmp_path: Path, seconds: float = 3.0) -> RecordArray:
    """Contract frames of a stop, each within the 10 ms before its cycle, 5 % of them lost."""
    path = tmp_path / "drive.csv"
    t = np.arange(int(seconds * 100)) * 0.01
    speed = 30.0 - 4.0 * np.clip(t - 1.0, 0, 9)
    names = [f"{name}_{c}" for name in ("wheel_speed", "calliper_pressure") for c in ("fl", "fr", "rl", "rr")]
    table = [t, *[speed / 0.34] * 4, *[30.0 * (t > 1.0)] * 4, -4.0 * (t > 1.0)]
    np.savetxt(
        path, np.transpose(table), delimiter=",", header=",".join(["t", *names, "accel_x"]), comments=""
    )
    random = np.random.default_rng(3)
    frames = []
    for burst in contract_frames(path, load_source(None), Findings(path)):
        block = burst[random.random(len(burst)) > 0.05].copy()
        block["stamp_ns"] += START_NS + np.sort(random.integers(-9_000, 0, len(block))) * 1000
        frames.append(block)
    return np.concatenate(frames)


def live_frames(
    params: RecordArray,
    frames: RecordArray,
    cycles: RecordArray,
    counted: bool,
    changes: Sequence[Change] = (),
) -> np.ndarray:
    plan = contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    ecu, reception = new_ecu(params.copy(), None), new_reception(plan)
    lines, first = [], 0
    for cycle in cycles:
        for change in changes:
            if change.cycle == cycle["number"]:
                ecu.params[0] = change.params[0]
        begin_cycle(ecu.inputs[0], int(cycle["t_ns"]), int(cycle["missed"] + 1) * CYCLE_NS)
        for name in ("bus_faults", "overruns", "worst_lateness_us"):
            ecu.inputs[name] = cycle[name]
        until = first + int(cycle["frames"]) if counted else len(frames)
        first = receive(plan, reception, frames, first, until, ecu.inputs[0])
        end_cycle(ecu.inputs[0], reception.freshness)
        step(*ecu[:4])
        lines.append(ecu.outputs.view(np.float64).copy())
    return np.array(lines)


@pytest.mark.parametrize("size", [10**9, 5])
def test_frames_with_missed_periods_give_the_bits_of_a_live_loop(
    params: RecordArray, tmp_path: Path, size: int
) -> None:
    frames = drive_frames(tmp_path)
    random = np.random.default_rng(4)
    cycles = np.zeros(250, CYCLE)
    cycles["missed"] = random.choice([0, 0, 0, 0, 0, 1, 2], len(cycles))
    cycles["t_ns"] = START_NS + 3_000 + np.cumsum(cycles["missed"] + 1) * CYCLE_NS
    cycles["overruns"] = np.cumsum(cycles["missed"])
    cycles["worst_lateness_us"] = np.maximum.accumulate(random.uniform(0, 90, len(cycles)))
    cycles["bus_faults"] = (cycles["missed"] > 0) * np.uint32(1 << 21)
    plan = contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    blocks = [frames[i : i + size] for i in range(0, len(frames), size)]
    rows = run_frames(new_ecu(params, None), plan, new_reception(plan), blocks, cycles)
    assert joined(list(rows))[:, :N_OUTPUTS].tobytes() == live_frames(params, frames, cycles, False).tobytes()


def test_a_recording_repeats_which_frames_a_cycle_took(params: RecordArray, tmp_path: Path) -> None:
    """Frames that the socket gave late were consumed a cycle later than their stamps say."""
    frames = drive_frames(tmp_path)
    cycles = np.zeros(200, CYCLE)
    cycles["t_ns"] = START_NS + np.arange(1, 201) * CYCLE_NS
    due = np.searchsorted(frames["stamp_ns"], cycles["t_ns"], side="right")
    taken = due - np.tile([0, 6], 100)
    cycles["frames"] = np.diff(np.maximum.accumulate(taken), prepend=0)
    plan = contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    live = live_frames(params, frames, cycles, True)
    for counted in (True, False):
        rows = run_frames(new_ecu(params, None), plan, new_reception(plan), [frames], cycles, counted)
        assert (joined(list(rows))[:, :N_OUTPUTS].tobytes() == live.tobytes()) == counted


@pytest.mark.parametrize("batch", [2048, 64, 1])
def test_a_calibration_is_repeated_before_its_cycle(
    params: RecordArray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int
) -> None:
    """Also two before one cycle, one before the first and one after the last."""
    monkeypatch.setattr(engine, "BATCH", batch)
    frames = drive_frames(tmp_path)
    cycles = np.zeros(200, CYCLE)
    cycles["number"], cycles["t_ns"] = np.arange(200), START_NS + np.arange(1, 201) * CYCLE_NS
    plan = contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    changes = []
    for cycle, scale in ((0, 1.0), (64, 0.3), (129, 0.9), (129, 0.5), (199, 0.8), (200, 0.1)):
        other = params.copy()
        for name in ("mass", "unloaded_radius", "wheel_radius"):
            other[name] *= scale
        changes.append(Change(cycle, other))
    before = params.tobytes()
    live = live_frames(params, frames, cycles, False, changes)
    rows = run_frames(new_ecu(params, None), plan, new_reception(plan), [frames], cycles, False, changes)
    assert joined(list(rows))[:, :N_OUTPUTS].tobytes() == live.tobytes()
    assert live.tobytes() != live_frames(params, frames, cycles, False).tobytes()
    assert params.tobytes() == before  # the next log begins with CONFIG


def test_candump_text_keeps_every_bit_of_a_frame(tmp_path: Path) -> None:
    frames = drive_frames(tmp_path, 0.5)
    path = tmp_path / "drive.log"
    path.write_bytes(candump_lines(frames, "can0"))
    read = np.concatenate(list(read_frames(path, [], LogQuality())))
    assert read.tobytes() == frames.tobytes()


def test_a_log_without_frames_has_no_rows(params: RecordArray) -> None:
    plan = contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    assert list(run_frames(new_ecu(params, None), plan, new_reception(plan), [])) == []
    one = np.zeros(1, FRAME)
    one["stamp_ns"] = START_NS
    (rows,) = islice(run_frames(new_ecu(params, None), plan, new_reception(plan), [one]), 2)
    assert list(rows.t_ns) == [START_NS]
