"""MDF4: bus logging in every layout, and channels with the contract's names at rates of their own."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from asammdf import MDF, Signal

from brakelab.bench.log_formats import write_mdf
from brakelab.logs import mdf as mdf_reader
from brakelab.logs.formats import kind_of, read_frames
from brakelab.logs.log_quality import Damage, LogQuality, SignalQuality
from brakelab.logs.mdf_channels import open_channels, read_channels
from brakelab.logs.signal_file import read_signals
from ecu.contract.records import FRAME, FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, RecordArray
from ecu.contract.signals import ACCEL_X, INPUT_SIGNALS, WHEEL_SPEED
from ecu.errors import UserError

START = datetime(2024, 5, 6, 7, 8, 9, 250_000, UTC)
START_NS = 1_714_979_289_250_000_000


def frames_of_all_kinds(count: int = 500) -> RecordArray:
    random = np.random.default_rng(4)
    frames = np.zeros(count, FRAME)
    frames["stamp_ns"] = START_NS + np.sort(random.integers(0, 10_000_000, count)) * 1000
    frames["bus"] = random.integers(0, 3, count)
    frames["flags"] = random.choice([0, FRAME_EXTENDED, FRAME_FD, FRAME_FD | FRAME_EXTENDED], count)
    extended = frames["flags"] & FRAME_EXTENDED != 0
    frames["can_id"] = np.where(
        extended, random.integers(0, 1 << 29, count), random.integers(0, 1 << 11, count)
    )
    fd = frames["flags"] & FRAME_FD != 0
    frames["length"] = np.where(fd, random.choice([12, 48, 64], count), random.integers(0, 9, count))
    frames["data"] = random.integers(0, 256, (count, 64))
    frames["data"][np.arange(64) >= frames["length"][:, np.newaxis]] = 0
    return frames


@pytest.mark.parametrize("window", [1 << 18, 7])
@pytest.mark.parametrize("compression", [0, 1, 2])
@pytest.mark.parametrize("groups", ["one", "several"])
def test_bus_logging_gives_the_frames_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, window: int, compression: int, groups: str
) -> None:
    for name in ("WINDOW", "AT_ONCE", "_FEW"):
        monkeypatch.setattr(mdf_reader, name, window)
    frames = frames_of_all_kinds()
    if groups == "one":
        frames["bus"] = 0
    else:
        frames["flags"][::50] = FRAME_ERROR
        frames["length"][::50], frames["data"][::50], frames["can_id"][::50] = 0, 0, 0
    path = write_mdf(tmp_path / "drive.mf4", frames, ["can0", "can1", "can2"], compression)
    interfaces = ["can0", "can1", "can2"]
    found = np.concatenate(list(read_frames(path, interfaces, quality := LogQuality())))
    group = np.where(frames["flags"] & FRAME_ERROR, -1, frames["bus"].astype(int))
    expected = frames[np.lexsort((group, frames["stamp_ns"]))]
    assert found.tobytes() == expected.tobytes()
    assert (quality.frames, quality.damaged, quality.cut) == (500, 0, "")


def drive(path: Path) -> Path:
    """Wheel speeds at 100 Hz, accel_x at 250 Hz (its last second invalid), a foreign channel at 10 Hz."""
    with MDF(version="4.10") as mdf:
        mdf.start_time = START
        t = np.arange(300) * 0.01
        corners = ("fl", "fr", "rl", "rr")
        mdf.append([Signal(80.0 - t + i, t, name=f"wheel_speed_{c}") for i, c in enumerate(corners)])
        t = np.arange(750) * 0.004
        invalid = t >= 2.0
        mdf.append(Signal(-0.1 * t, t, name="accel_x\\Imu:1", invalidation_bits=invalid))
        mdf.append(Signal(np.zeros(30, np.int16), np.arange(30) * 0.1, name="gear"))
        mdf.save(path, overwrite=True)
    return path


def test_channels_of_several_rates_are_one_table(tmp_path: Path) -> None:
    path = drive(tmp_path / "drive.mf4")
    assert kind_of(path) == "signals"
    quality = SignalQuality()
    blocks = list(read_signals(path, quality))
    t = np.concatenate([block.t for block in blocks])
    values = np.concatenate([block.values for block in blocks])
    np.testing.assert_allclose(t, np.unique(np.r_[np.arange(300) * 0.01, np.arange(750) * 0.004].round(6)))
    assert list(blocks[0].places) == [*range(WHEEL_SPEED, WHEEL_SPEED + 4), ACCEL_X]
    on_grid = ~np.isnan(values[:, 0])
    np.testing.assert_allclose(values[on_grid, 1], 81.0 - t[on_grid])
    assert on_grid.sum() == 300
    known = ~np.isnan(values[:, 4])
    np.testing.assert_allclose(values[known, 4], -0.1 * t[known])
    assert known.sum() == 500
    assert quality.unknown_columns == ["gear"]
    assert quality.zero_ns == START_NS


@pytest.mark.parametrize("window", [1, 13, 100_000])
def test_windows_join_without_a_seam(tmp_path: Path, window: int) -> None:
    path = drive(tmp_path / "drive.mf4")
    whole = pa.Table.from_batches(read_channels(path, open_channels(path), Damage()))
    pieces = pa.Table.from_batches(read_channels(path, open_channels(path), Damage(), window))
    for name in whole.column_names:
        np.testing.assert_array_equal(pieces[name].to_numpy(), whole[name].to_numpy())


def test_channels_replay_like_parquet(tmp_path: Path) -> None:
    path = drive(tmp_path / "drive.mf4")
    table = pa.Table.from_batches(read_channels(path, open_channels(path), Damage()))
    pq.write_table(table, tmp_path / "drive.parquet")
    ours, theirs = (
        list(read_signals(tmp_path / f"drive.{end}", SignalQuality())) for end in ("mf4", "parquet")
    )
    for name in ("t", "t_ns", "values"):
        a, b = (np.concatenate([getattr(block, name) for block in blocks]) for blocks in (ours, theirs))
        np.testing.assert_array_equal(a, b)


def test_what_is_wrong_with_channels_gives_one_line(tmp_path: Path) -> None:
    path = tmp_path / "drive.mf4"
    name = INPUT_SIGNALS[0].name
    t = np.arange(20) * 0.01
    falling = np.r_[t[:10], t[5:]]
    cases: list[tuple[list[Signal], str]] = [
        ([Signal(t, t, name="speed")], "columns: no known input among t, speed"),
        ([Signal(t, t, name=name), Signal(t, t, name=name)], f"{name}: stands in this file twice"),
        ([Signal(falling, falling, name=name)], "group 0, record 10: time falls to 0.05 s"),
        ([Signal(t, np.floor(100 * t / 4), name=name)], "group 0, record 0: from here on 15 of 20 rows have"),
        ([Signal(t, t * 1e6, name=name)], "t: t is in seconds, but the rows are 10000 s apart"),
    ]
    for signals, line in cases:
        with MDF(version="4.10") as mdf:
            for signal in signals:
                mdf.append(signal)
            mdf.save(path, overwrite=True)
        with pytest.raises(UserError) as error:
            list(read_signals(path, SignalQuality()))
        assert str(error.value).startswith(f"{path}: {line}")
