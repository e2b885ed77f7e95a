"""A recorded drive as other loggers would have it: rates, an accelerator's rest, gaps, rows from the end."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.api import Result, load, replay
from ecu.contract.signals import CORNERS

Columns = dict[str, np.ndarray]

pytestmark = pytest.mark.drives


@pytest.fixture(scope="module")
def drives_log(drives: Path) -> Path:
    return drives / "mustang" / "mustang_s550.candump.log"


@pytest.fixture(scope="module")
def recorded(drives_log: Path) -> Columns:
    drive = load(drives_log, map="mustang")
    return {name: np.asarray(drive[name]) for name in drive}


def replayed(columns: Columns, folder: Path) -> Result:
    log = folder / "drive.parquet"
    pq.write_table(pa.table({name: pa.array(v, from_pandas=True) for name, v in columns.items()}), log)
    return replay(log, config="mustang", out=folder / "out.parquet")


@pytest.fixture(scope="module")
def base(recorded: Columns, tmp_path_factory: pytest.TempPathFactory) -> Result:
    return replayed(recorded, tmp_path_factory.mktemp("base"))


def at_rate(stem: str, rate: float) -> Callable[[Columns], Columns]:
    """Sample the signals of a stem at `rate` [Hz], on a clock of their own."""

    def change(columns: Columns) -> Columns:
        t = columns["t"]
        stamps = np.round(np.arange(int(t[-1] * rate)) / rate + 0.003, 3)
        times = np.unique(np.concatenate([t, stamps]))
        changed = {"t": times}
        for name, values in columns.items():
            if name == "t":
                continue
            changed[name] = np.full(len(times), np.nan)
            known = np.isfinite(values)
            if name.startswith(stem):
                changed[name][np.searchsorted(times, stamps)] = np.interp(stamps, t[known], values[known])
            else:
                changed[name][np.searchsorted(times, t)] = values
        return changed

    return change


def resting(percent: float) -> Callable[[Columns], Columns]:
    def change(columns: Columns) -> Columns:
        pedal = percent + (1.0 - percent / 100.0) * columns["accelerator_position"]
        return columns | {"accelerator_position": pedal}

    return change


def gap(begin: float, end: float) -> Callable[[Columns], Columns]:
    def change(columns: Columns) -> Columns:
        there = (columns["t"] < begin) | (columns["t"] > end)
        return {name: values[there] for name, values in columns.items()}

    return change


def backwards(columns: Columns) -> Columns:
    return {name: values[::-1] for name, values in columns.items()}


ALTERED = [
    ("wheels at 1 Hz", at_rate("wheel_speed", 1.0), 1.0, "wheel speed lost (90 %)"),
    ("wheels at 5 Hz", at_rate("wheel_speed", 5.0), 1.0, ""),
    ("wheels at 200 Hz", at_rate("wheel_speed", 200.0), 0.2, ""),
    ("accelerometer at 5 Hz", at_rate("accel_x", 5.0), 1.0, ""),
    ("accelerometer at 200 Hz", at_rate("accel_x", 200.0), 0.2, ""),
    ("pressures at 200 Hz", at_rate("calliper_pressure", 200.0), 0.2, ""),
    ("accelerator rests at 2.5 %", resting(2.5), 1.0, ""),
    ("accelerator rests at 8 %", resting(8.0), 1.0, ""),
    ("a gap while the car drives", gap(20.0, 25.0), 0.2, "pressure lost (4.9"),
    ("a gap in a braking", gap(53.0, 58.0), 0.5, "pressure lost (4.9"),
    ("a gap in the last braking", gap(64.0, 69.0), 1.0, "pressure lost (4.9"),
    ("rows from the end", backwards, 0.0, "stored from its end, and read from there"),
]  # fmt: skip


@pytest.mark.parametrize(("what", "change", "off", "note"), ALTERED, ids=[row[0] for row in ALTERED])
def test_an_altered_drive_teaches_the_same_friction(
    recorded: Columns,
    base: Result,
    tmp_path: Path,
    what: str,
    change: Callable[[Columns], Columns],
    off: float,
    note: str,
) -> None:
    """`off` [sigma]: by how much friction may differ at the end."""
    result = replayed(change(recorded), tmp_path)
    for corner in CORNERS:
        differs = abs(result[f"mu_b_{corner}"][-1] - base[f"mu_b_{corner}"][-1])
        print(what, corner, differs / base[f"sigma_mu_b_{corner}"][-1])
        assert differs <= off * base[f"sigma_mu_b_{corner}"][-1]
    assert any(note in line for line in result.notes)
    assert not any("--force" in line for line in result.notes)


def test_a_drive_at_1_hz_is_read_and_teaches_nothing(recorded: Columns, tmp_path: Path) -> None:
    t = recorded["t"]
    seconds = np.arange(int(t[-1]))
    columns = {"t": seconds.astype(float)}
    for name, values in recorded.items():
        known = np.isfinite(values)
        if name != "t":
            columns[name] = np.interp(seconds, t[known], values[known])
    result = replayed(columns, tmp_path)
    assert any("wheel speed lost (8" in line and "pressure lost (8" in line for line in result.notes)
    assert all(np.ptp(result[f"mu_b_{corner}"]) == 0.0 for corner in CORNERS)


def test_frames_from_the_end_are_read_from_there(drives_log: Path, tmp_path: Path) -> None:
    log = tmp_path / "backwards.log"
    log.write_bytes(b"".join(reversed(drives_log.read_bytes().splitlines(keepends=True))))
    found, expected = (
        replay(source, config="mustang", map="mustang", out=tmp_path / f"{source.stem}.parquet")
        for source in (log, drives_log)
    )
    assert np.array_equal(found["mu_b_fl"], expected["mu_b_fl"])
    assert np.array_equal(found["t"], expected["t"])
