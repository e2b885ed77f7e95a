"""Signal files: what is read, and the one line that each damaged input gives."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.replay import signal_file
from brakelab.replay.signal_file import SignalQuality, read_signals
from ecu.errors import UserError
from ecu.signals import ACCEL_X, INPUT


def write(path: Path, content: str | dict[str, list[Any]]) -> Path:
    if isinstance(content, str):
        path.write_text(content)
    else:
        pq.write_table(pa.table(content), path)
    return path


def test_rates_may_be_mixed_and_unknown_columns_are_listed(tmp_path: Path) -> None:
    content = {
        "t": [0.0, 0.005, 0.01],
        "accel_x": [-1.0, None, math.nan],
        "pedal_pressed": [True, False, None],
        "note": ["a", "b", "c"],
    }
    quality = SignalQuality()
    (block,) = read_signals(write(tmp_path / "drive.parquet", content), quality)
    assert list(block.t_ns) == [0, 5_000_000, 10_000_000]
    assert list(block.places) == [ACCEL_X, INPUT["pedal_pressed"]]
    np.testing.assert_array_equal(block.values, [[-1, 1], [np.nan, 0], [np.nan, np.nan]])
    assert (quality.rows, quality.samples, quality.unknown_columns) == (3, 3, ["note"])


def test_csv_and_parquet_read_alike(tmp_path: Path) -> None:
    csv = write(tmp_path / "drive.csv", "t,accel_x,x\n0,1e0,\n0.01,,7\n0.02,nan,a b\n0.03,-0.25,\n")
    parquet = write(
        tmp_path / "drive.parquet", {"t": [0, 0.01, 0.02, 0.03], "accel_x": [1, None, None, -0.25]}
    )
    (a,), (b,) = read_signals(csv, SignalQuality()), read_signals(parquet, SignalQuality())
    np.testing.assert_array_equal(a.values, b.values)
    np.testing.assert_array_equal(a.t_ns, b.t_ns)


@pytest.mark.parametrize("start", [0.0, -3.7, 1.6e9 + 0.123])
def test_a_10_ms_input_lies_on_the_grid_wherever_it_starts(tmp_path: Path, start: float) -> None:
    t = start + np.arange(20_000) * 0.01
    path = write(tmp_path / "drive.parquet", {"t": list(t), "accel_x": [0.0] * len(t)})
    blocks = list(read_signals(path, SignalQuality()))
    t_ns = np.concatenate([block.t_ns for block in blocks])
    assert set(np.diff(t_ns)) == {10_000_000}
    np.testing.assert_array_equal(np.concatenate([block.t for block in blocks]), t)


def test_blocks_join_without_a_seam(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(100) * 0.01
    path = write(tmp_path / "drive.parquet", {"t": list(t), "accel_x": list(t)})
    monkeypatch.setattr(signal_file, "BLOCK_ROWS", 7)
    quality = SignalQuality()
    values = np.concatenate([block.values for block in read_signals(path, quality)])
    np.testing.assert_array_equal(values[:, 0], t)
    assert quality.rows == 100


DAMAGED = {
    "infinite value, Parquet": (
        {"t": [0.0, 0.01], "accel_x": [1.0, math.inf]},
        "row 1, accel_x: infinite value",
    ),
    "infinite value, CSV": ("t,accel_x\n0,1\n0.01,-inf\n", "line 3, accel_x: infinite value"),
    "cell that is no number": ("t,accel_x\n0,1\n0.01,1.2.3\n", "line 3, accel_x: '1.2.3' is no number"),
    "row with a cell missing": ("t,accel_x,yaw_rate\n0,1,2\n0.01,1\n", "line 3: a row needs 3 cells"),
    "time missing in a row": ({"t": [0.0, None], "accel_x": [1.0, 2.0]}, "row 1, t: time is missing"),
    "time not finite": ("t,accel_x\n0,1\ninf,1\n", "line 3, t: time is missing or not finite"),
    "time repeated": ("t,accel_x\n0,1\n0.01,1\n0.01,2\n", "line 4, t: time does not rise"),
    "time falling": ({"t": [0.1, 0.0], "accel_x": [1.0, 2.0]}, "row 1, t: time does not rise"),
    "a jump": ({"t": [0.0, 0.01, 3600.1], "accel_x": [1.0] * 3}, "row 2, t: time jumps by more than an hour"),
    "a jump far away": ("t,accel_x\n0,1\n1e9,1\n", "line 3, t: time jumps by more than an hour"),
    "gaps alone": (
        {"t": [3000.0 * k for k in range(4)], "accel_x": [1.0] * 4},
        "row 2, t: so far less than a row a second",
    ),
    "time in ms": (
        {"t": [10.0 * k for k in range(100)], "accel_x": [1.0] * 100},
        "t: t is in seconds, but the rows are 10 s apart; convert it from ms",
    ),
    "Unix time in ns": (
        {"t": [1.7e18, 1.7e18 + 1e7], "accel_x": [1.0, 1.0]},
        "t: t is in seconds, but a value is 1.7e+18 s",
    ),
    "no time": ("accel_x\n1\n2\n", "line 1: column t is missing"),
    "no known column": ({"t": [0.0], "speed": [1.0]}, "columns: no known input among t, speed"),
    "column twice": ("t,accel_x,accel_x\n0,1,1\n", "line 1: column accel_x stands twice"),
    "text in a Parquet column": ({"t": [0.0], "accel_x": ["fast"]}, "row 0, accel_x: 'fast' is no number"),
    "no rows": ("t,accel_x\n", "line 2: no rows"),
    "empty file": ("", "line 1: the file is empty"),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_a_damaged_input_gives_one_line(tmp_path: Path, damage: str) -> None:
    content, line = DAMAGED[damage]
    path = write(tmp_path / ("drive.csv" if isinstance(content, str) else "drive.parquet"), content)
    with pytest.raises(UserError) as error:
        list(read_signals(path, SignalQuality()))
    assert str(error.value).startswith(f"{path}: {line}")


def test_a_parquet_file_in_name_only_gives_one_line(tmp_path: Path) -> None:
    path = tmp_path / "drive.parquet"
    path.write_text("(1600000000.000100) can0 123#0102\n")
    with pytest.raises(UserError, match="no readable Parquet file"):
        list(read_signals(path, SignalQuality()))


def test_a_jump_between_two_blocks_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    t = [0.01 * k + 4000.0 * (k >= 14) for k in range(20)]
    path = write(tmp_path / "drive.parquet", {"t": t, "accel_x": t})
    monkeypatch.setattr(signal_file, "BLOCK_ROWS", 7)
    with pytest.raises(UserError, match="row 14, t: time jumps"):
        list(read_signals(path, SignalQuality()))


def test_hours_without_a_row_are_allowed_where_enough_rows_were_written(tmp_path: Path) -> None:
    t = [*(0.5 * k for k in range(8000)), 7000.0]
    path = write(tmp_path / "drive.parquet", {"t": t, "accel_x": t})
    assert sum(len(block.t) for block in read_signals(path, SignalQuality())) == 8001
