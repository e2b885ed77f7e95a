"""Signal files: what is read, and the one line that each damaged input gives."""

import math
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.logs import signal_batches
from brakelab.logs.column_map import ColumnMap, MappedFile, read_column_map
from brakelab.logs.log_quality import SignalQuality
from brakelab.logs.signal_file import read_signals
from ecu.contract.signals import ACCEL_X, INPUT
from ecu.errors import UserError


def write(path: Path, content: str | bytes | dict[str, list[Any]]) -> Path:
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, str):
        path.write_text(content, newline="")
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


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
@pytest.mark.parametrize(("kind", "start"), [(pa.timestamp, 1_600_000_000_000), (pa.duration, 0)])
def test_dates_and_durations_of_pandas_are_times(tmp_path: Path, kind: Any, start: int, unit: str) -> None:
    ticks = {"ms": 1, "us": 1_000, "ns": 1_000_000}[unit]
    t = pa.array([(start + 10 * k) * ticks for k in range(100)], kind(unit))
    path = write(tmp_path / "drive.parquet", {"t": t, "accel_x": [0.5] * 100})
    (block,) = read_signals(path, SignalQuality())
    assert block.t_ns.tolist() == [(start + 10 * k) * 1_000_000 for k in range(100)]


@pytest.mark.parametrize("name", [None, "when"])
@pytest.mark.parametrize("kind", [pd.to_datetime, pd.to_timedelta])
def test_an_index_of_times_is_the_time(tmp_path: Path, kind: Any, name: str | None) -> None:
    frame = pd.DataFrame({"accel_x": [0.5] * 100}, kind(np.arange(100) * 10, unit="ms").rename(name))
    frame.to_parquet(tmp_path / "drive.parquet")
    (block,) = read_signals(tmp_path / "drive.parquet", SignalQuality())
    assert (np.diff(block.t_ns) == 10_000_000).all()
    frame["t"] = np.arange(100) * 0.02  # then it is no longer clear
    frame.to_parquet(tmp_path / "drive.parquet")
    (block,) = read_signals(tmp_path / "drive.parquet", SignalQuality())
    assert (np.diff(block.t_ns) == 20_000_000).all()


def test_a_map_reads_an_index_of_times(tmp_path: Path) -> None:
    path = tmp_path / "drive.parquet"
    pd.DataFrame({"a": [0.5] * 9}, pd.to_datetime(np.arange(9), unit="s")).to_parquet(path)
    mapped = {"inputs": {"accel_x": {"column": "a", "unit": "m/s^2"}}}
    (block,) = read_signals(path, SignalQuality(), MappedFile(path, ColumnMap.model_validate(mapped)))
    assert (np.diff(block.t_ns) == 1_000_000_000).all()


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
    monkeypatch.setattr(signal_batches, "BLOCK_ROWS", 7)
    quality = SignalQuality()
    values = np.concatenate([block.values for block in read_signals(path, quality)])
    np.testing.assert_array_equal(values[:, 0], t)
    assert quality.rows == 100


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_rows_stored_from_the_end_are_read_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    t = np.round(np.arange(100)[::-1] * 0.01, 2)
    content = {"t": list(t), "accel_x": list(t)}
    text = "t,accel_x\n" + "".join(f"{x},{x}\n" for x in t)
    path = write(tmp_path / f"drive.{ending}", content if ending == "parquet" else text)
    monkeypatch.setattr(signal_batches, "BLOCK_ROWS", 30)
    quality = SignalQuality()
    blocks = list(read_signals(path, quality))
    np.testing.assert_array_equal(np.concatenate([block.t for block in blocks]), t[::-1])
    np.testing.assert_array_equal(np.concatenate([block.values[:, 0] for block in blocks]), t[::-1])
    assert quality.backwards


DAMAGED = {
    "infinite value, Parquet": (
        {"t": [0.0, 0.01], "accel_x": [1.0, math.inf]},
        "row 1, accel_x: infinite value",
    ),
    "infinite value, CSV": ("t,accel_x\n0,1\n0.01,-inf\n", "line 3, accel_x: infinite value"),
    "no number at all": ("t,accel_x\n0,fast\n\n0.01,1.2.3\n", "line 2, accel_x: 'fast' is no number"),
    "decimal commas between commas": (
        "t,accel_x\n0,0,1,5\n0,1,1,6\n",
        "line 2 (4 cells instead of 2): no row",
    ),
    "no time in any row": ({"t": [None, math.nan], "accel_x": [1.0, 2.0]}, "row 0, t: time is missing"),
    "time falling": (
        {"t": [0.1, 0.0], "accel_x": [1.0, 2.0]},
        "row 1, t: time falls by 0.1 s to 0 s; sort the rows, or split the file",
    ),
    "two rows exchanged": ("t,accel_x\n0,1\n.2,2\n.1,3\n.3,4\n", "line 4, t: time falls by 0.1 s to 0.1 s"),
    "a clock set back": ("t,accel_x\n11,1\n\n1,2\n", "line 4, t: time falls by 10 s to 1 s"),
    "UTF-16": (
        "\ufefft,accel_x\n0,1\n".encode("utf-16-le"),
        "line 1: this is UTF-16; save it as CSV in UTF-8",
    ),
    "lines that end in CR": ("t,accel_x\r0,1\r", "line 1: does not end; every line has to end in LF"),
    "a first line of 3 MB": ("t" * 3_000_000, "line 1: does not end"),
    "garbage": (bytes(range(128, 256)) + b"\n\xff,\xfe,\n" * 3, "line 1: column t is missing"),
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
    "a clock of whole seconds": (
        {"t": [float(k // 4) for k in range(40)], "accel_x": [0.1 * k for k in range(40)]},
        "row 0: from here on 30 of 40 rows have the time of the row before and other values; give time",
    ),
    "Unix time in ns": (
        {"t": [1.7e18, 1.7e18 + 1e7], "accel_x": [1.0, 1.0]},
        "t: t is in seconds, but a value is 1.7e+18 s",
    ),
    "no time": ("accel_x\n1\n2\n", "line 1: column t is missing"),
    "no known column": ({"t": [0.0], "speed": [1.0]}, "columns: no known input among t, speed"),
    "column twice": ("t,accel_x,accel_x\n0,1,1\n", "line 1: column accel_x stands twice"),
    "text in a Parquet column": ({"t": [0.0], "accel_x": ["fast"]}, "row 0, accel_x: 'fast' is no number"),
    "no rows": ("t,accel_x\n", "line 2: no row that can be read"),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_a_damaged_input_gives_one_line(tmp_path: Path, damage: str) -> None:
    content, line = DAMAGED[damage]
    path = write(tmp_path / ("drive.parquet" if isinstance(content, dict) else "drive.csv"), content)
    with pytest.raises(UserError) as error:
        list(read_signals(path, SignalQuality()))
    assert str(error.value).startswith(f"{path}: {line}")


# What is damaged: the file, the values of accel_x that are read, how many pieces are not and where.
MENDED: dict[str, tuple[Any, list[float], int, str]] = {
    "a cell that is no number": (
        "t,accel_x\n0,1\n\n1,x\n2,3\n",
        [1, math.nan, 3],
        1,
        "line 4, accel_x ('x' is no number)",
    ),
    "cells missing": ("t,accel_x\n0,1\n1\n2,3\n", [1, 3], 1, "line 3 (1 cell instead of 2)"),
    "time missing": ("t,accel_x\n0,1\n,2\ninf,3\n3,4\n", [1, 4], 2, "line 3, t (missing)"),
    "time missing, Parquet": (
        {"t": [0.0, None, 2.0], "accel_x": [1.0, 2.0, 3.0]},
        [1, 3],
        1,
        "row 1, t (missing)",
    ),
    "bytes that are no text": (
        b"t,accel_x\n0,1\n\xff\xfe,\x8c,\n2,3\n",
        [1, 3],
        1,
        "line 3 (3 cells instead of 2)",
    ),
    "a quote that never closes": ('t,accel_x\n0,1\n1,"2\n2,3\n', [1, 3], 1, "line 3 (1 cell instead of 2)"),
    "a line of 3 MB": ("t,accel_x\n0,1\n" + "7" * 3_000_000 + "\n2,3\n", [1, 3], 1, "line 3"),
    "a line of 3 MB at the end": ("t,accel_x\n0,1\n2,3\n" + "7" * 3_000_000, [1, 3], 1, "line 4"),
    "a last line that is cut off": ("t,accel_x\n0,1\n2,3\n3", [1, 3], 0, "line 4: the last line is cut off"),
    "a last line without its end": ("t,accel_x\n0,1\n2,3", [1, 3], 0, ""),
    "a line of units": ("t,accel_x\ns,m/s^2\n0,1\n2,3\n", [1, 3], 2, "line 2, t ('s' is no number)"),
    "semicolons and decimal commas": ("t;accel_x\n0,5;1,25\n1,5;-3,5\n", [1.25, -3.5], 0, ""),
    "tabs": ('"t"\t"accel_x"\r\n0.5\t"1.25"\r\n', [1.25], 0, ""),
    "a digit lost": ("t,accel_x\n7.0,1\n7.1,2\n.2,3\n7.3,4\n", [1, 2, 4], 1, "line 4, t (does not fit"),
    "a digit twice": ("t,accel_x\n7.0,1\n77.1,2\n7.2,3\n", [1, 3], 1, "line 3, t (does not fit"),
    "two samples at one instant": ("t,accel_x\n0,1\n0,2\n1,3\n", [1, 2, 3], 0, ""),
}


@pytest.mark.parametrize("damage", MENDED)
def test_what_can_be_read_is_read_and_the_rest_has_its_place(tmp_path: Path, damage: str) -> None:
    content, values, damaged, place = MENDED[damage]
    path = write(tmp_path / ("drive.parquet" if isinstance(content, dict) else "drive.CSV"), content)
    quality = SignalQuality()
    blocks = list(read_signals(path, quality))
    np.testing.assert_array_equal(np.concatenate([block.values[:, 0] for block in blocks]), values)
    assert quality.damaged == damaged
    assert (quality.first_damaged or quality.cut)[: len(place) or None] == place
    assert quality.stamps_repeated == (1 if damage == "two samples at one instant" else 0)


def test_of_a_parquet_file_the_row_groups_before_the_damage_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(signal_batches, "BLOCK_ROWS", 1000)
    path, t = tmp_path / "drive.parquet", np.arange(3000) * 0.01
    pq.write_table(pa.table({"t": t, "accel_x": t}), path, row_group_size=1000)
    content = bytearray(path.read_bytes())
    content[2 * len(content) // 3 : 2 * len(content) // 3 + 2000] = bytes(2000)
    path.write_bytes(content)
    quality = SignalQuality()
    rows = sum(len(block.t) for block in read_signals(path, quality))
    assert rows == quality.rows == 2000 or rows == 1000
    assert quality.cut.startswith(f"row {rows}: cannot be read (")


@pytest.mark.parametrize("first", [0.0, 5.0])
def test_the_date_of_a_parquet_file_is_that_of_its_first_row(tmp_path: Path, first: float) -> None:
    table = pa.table({"t": [first, first + 1.0], "accel_x": [0.0, 0.0]})
    path, quality = tmp_path / "drive.parquet", SignalQuality()
    pq.write_table(table.replace_schema_metadata({"start_time_ns": "1700000000000000000"}), path)
    (block,) = read_signals(path, quality)
    assert quality.zero_ns is not None
    assert quality.zero_ns + block.t_ns[0] == 1_700_000_000_000_000_000


def test_a_parquet_file_in_name_only_gives_one_line(tmp_path: Path) -> None:
    path = tmp_path / "drive.parquet"
    path.write_text("(1600000000.000100) can0 123#0102\n")
    with pytest.raises(UserError, match="no readable Parquet file"):
        list(read_signals(path, SignalQuality()))


def test_a_jump_between_two_blocks_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    t = [0.01 * k + 4000.0 * (k >= 14) for k in range(20)]
    path = write(tmp_path / "drive.parquet", {"t": t, "accel_x": t})
    monkeypatch.setattr(signal_batches, "BLOCK_ROWS", 7)
    with pytest.raises(UserError, match="row 14, t: time jumps"):
        list(read_signals(path, SignalQuality()))


def test_hours_without_a_row_are_allowed_where_enough_rows_were_written(tmp_path: Path) -> None:
    t = [*(0.5 * k for k in range(8000)), 7000.0]
    path = write(tmp_path / "drive.parquet", {"t": t, "accel_x": t})
    assert sum(len(block.t) for block in read_signals(path, SignalQuality())) == 8001


@pytest.mark.parametrize("row", ["0.01,\r2", "0.0\r1,2", "\r0.01,2", "0.01,2\r"])
def test_a_cr_alone_costs_its_line_and_no_other(tmp_path: Path, row: str) -> None:
    """Other readers end a line there, and count more rows than there are lines."""
    quality = SignalQuality()
    content = f"t,accel_x\n0.00,1\n{row}\n0.02,3\n".encode()
    (block,) = read_signals(write(tmp_path / "drive.csv", content), quality)
    assert block.values[[0, -1], 0].tolist() == [1.0, 3.0]
    assert (len(block.t_ns), quality.damaged) == ((3, 0) if row.endswith("\r") else (2, 1))


# What stands in column t of rows 0.1 s apart: how often its clock was set, and where first.
CLOCKS: dict[str, tuple[list[float], int, str]] = {
    "set back by 2 s": ([0.1 * k - 2.0 * (k >= 30) for k in range(60)], 1, "row 30, back by 1.9 s"),
    "set on by an hour": ([0.1 * k + 3600.0 * (k >= 30) for k in range(60)], 1, "row 30, on by 3600.1 s"),
    "set on, then back": (
        [0.1 * k + 4000.0 * (20 <= k < 40) for k in range(60)],
        2,
        "row 20, on by 4000.1 s",
    ),
    "seconds of a day, at midnight": ([(86_398.0 + 0.1 * k) % 86_400.0 for k in range(60)], 0, ""),
}


@pytest.mark.parametrize("block_rows", [2, 3, 4])
def test_a_time_that_does_not_fit_is_found_between_two_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block_rows: int
) -> None:
    monkeypatch.setattr(signal_batches, "BLOCK_ROWS", block_rows)
    path = write(tmp_path / "drive.parquet", {"t": [0.0, 0.1, 0.2, 9.3, 0.4], "accel_x": [1.0] * 5})
    assert sum(len(block.t_ns) for block in read_signals(path, SignalQuality())) == 4


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("block_rows", [1 << 16, 25])
def test_where_a_clock_was_set_time_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clock: str, block_rows: int
) -> None:
    monkeypatch.setattr(signal_batches, "BLOCK_ROWS", block_rows)
    t, times, place = CLOCKS[clock]
    path = write(tmp_path / "drive.parquet", {"t": t, "accel_x": [float(k) for k in range(len(t))]})
    quality = SignalQuality()
    blocks = list(read_signals(path, quality))
    read = np.concatenate([block.t_ns for block in blocks])
    np.testing.assert_allclose(np.diff(read), 1e8, rtol=1e-4)
    assert np.concatenate([block.values for block in blocks])[:, 0].tolist() == list(range(len(t)))
    assert (quality.clock_set, quality.first_set) == (times, place)


@pytest.mark.parametrize("block_rows", [1 << 16, 25])
def test_rows_that_stand_twice_count_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block_rows: int
) -> None:
    monkeypatch.setattr(signal_batches, "BLOCK_ROWS", block_rows)
    rows = [*range(60), *range(40, 60), *range(60, 90)]
    cells: list[float | None] = [None if k % 3 else float(k) for k in rows]
    path = write(tmp_path / "drive.parquet", {"t": [0.1 * k for k in rows], "accel_x": cells})
    quality = SignalQuality()
    blocks = list(read_signals(path, quality))
    read = np.concatenate([block.t for block in blocks])
    np.testing.assert_allclose(read, 0.1 * np.arange(90))
    assert (quality.rows, quality.rows_twice, quality.clock_set) == (90, 20, 0)


def test_rows_at_one_instant_that_do_not_contradict_each_other_are_read(tmp_path: Path) -> None:
    """As programs write them that give each signal rows of its own."""
    speed, accel = [1.0, None, None] * 20, [None, 2.0, 2.0] * 20
    table = {"t": [0.01 * (k // 3) for k in range(60)], "vehicle_speed": speed, "accel_x": accel}
    (block,) = read_signals(write(tmp_path / "drive.parquet", table), SignalQuality())
    assert len(block.t) == 60


@pytest.mark.parametrize("form", ["%I:%M:%S.%f %p", "%m/%d/%Y %I:%M:%S.%f %p", "%I:%M:%S.%fpm"])
def test_a_time_of_day_has_twelve_hours_in_america(tmp_path: Path, form: str) -> None:
    start = datetime(2026, 11, 28, 12, 59, 59)
    stamps = [start + timedelta(milliseconds=50 * k) for k in range(40)]
    log = write(tmp_path / "drive.csv", "\n".join(["t,accel_x", *(f"{t:{form}},1" for t in stamps), ""]))
    (block,) = read_signals(log, SignalQuality())
    np.testing.assert_allclose(block.t, 46_799.0 + 0.05 * np.arange(40))


@pytest.mark.parametrize("date", ["", "28.11.2026 ", "2026-11-28T", "2026-11-28 "])
def test_a_time_of_day_is_a_time_also_at_midnight(tmp_path: Path, date: str) -> None:
    stamps = [(86_399.5 + 0.05 * k) % 86_400.0 for k in range(40)]
    text = [f"{int(s // 3600):02d}:{int(s // 60) % 60:02d}:{s % 60:06.3f}".replace(".", ",") for s in stamps]
    lines = [f"{date}{clock};{k},5" for k, clock in enumerate(text)]
    log = write(tmp_path / "fahrt.csv", "\n".join(["Uhrzeit;a", "hh:mm:ss;m/s^2", *lines, ""]))
    (tmp_path / "map.toml").write_text('[inputs]\naccel_x = { column = "a" }\n')
    (block,) = read_signals(log, SignalQuality(), read_column_map(tmp_path / "map.toml"))
    assert block.t[0] == pytest.approx(86_399.5)
    np.testing.assert_allclose(np.diff(block.t), 0.05, atol=1e-9)
    assert block.values[:, 0].tolist() == [k + 0.5 for k in range(40)]
