"""Lags of a recorded drive: `map check` finds them and writes them into the map of columns."""

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.api import load
from brakelab.logs.column_map import read_column_map
from brakelab.logs.physics.lags import Lag
from brakelab.mapping.lag import write_lags
from ecu import cli
from ecu.errors import UserError

CORNERS = ("fl", "fr", "rl", "rr")
RADIUS = 0.3376  # m, of the front wheels by config/mustang.toml
MAP = """# A logger's own.
time = "t"
[inputs]
{wheels}
accel_x = {{ column = "accel_x", unit = "m/s^2" }}  # of the car
vehicle_speed = {{ column = "speed", unit = "m/s" }}
"""


def written(drives: Path, folder: Path, late: float) -> tuple[Path, Path]:
    """Write the recorded Mustang as a signal file with a speed of its front wheels, 5 Hz and `late` [s]."""
    recorded = load(drives / "mustang" / "mustang_s550.candump.log", map="mustang")
    t = recorded["t"]
    wheels = [f"wheel_speed_{corner}" for corner in CORNERS]
    columns = {name: recorded[name] for name in ("t", "accel_x", *wheels)}
    front = np.stack([recorded[name] for name in wheels[:2]], axis=1).mean(axis=1) * RADIUS
    known = np.isfinite(front)
    every = np.flatnonzero(np.diff(np.floor(5.0 * t), prepend=-1.0) > 0.0)
    columns["speed"] = np.full(len(t), np.nan)
    columns["speed"][every] = np.interp(t[every] - late, t[known], front[known])
    log, map = folder / "drive.parquet", folder / "map.toml"
    pq.write_table(pa.table({name: pa.array(v, from_pandas=True) for name, v in columns.items()}), log)
    lines = "\n".join(f'{name} = {{ column = "{name}", unit = "rad/s" }}' for name in wheels)
    map.write_text(MAP.format(wheels=lines), "utf-8")
    return log, map


@pytest.mark.drives
@pytest.mark.parametrize("late", [0.1, 0.25, 0.4])
def test_the_lag_of_a_speed_goes_into_the_map(
    drives: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], late: float
) -> None:
    log, map = written(drives, tmp_path, late)
    out = tmp_path / "out.toml"
    words = ["map", "check", str(log), "--config", "mustang", "--map"]
    assert cli.main([*words, str(map), "--out", str(out)]) == 0
    (lag,) = re.findall(r"vehicle_speed: (0\.\d+) ± 0\.0\d s late; lag = \1", capsys.readouterr().out)
    assert float(lag) == pytest.approx(late, abs=0.02)
    inputs = read_column_map(out).content.inputs
    assert inputs["vehicle_speed"].lag == float(lag)
    assert inputs["accel_x"].lag == 0.0
    assert "# of the car" in out.read_text("utf-8")
    assert cli.main([*words, str(out)]) == 0
    assert " s late" not in capsys.readouterr().out


@pytest.mark.drives
def test_a_speed_that_is_not_late_stays_as_it_is(
    drives: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, map = written(drives, tmp_path, 0.0)
    assert cli.main(["map", "check", str(log), "--map", str(map), "--out", str(tmp_path / "out.toml")]) == 0
    captured = capsys.readouterr()
    assert " s late" not in captured.out
    assert "the drive shows no lag" in captured.err
    assert (tmp_path / "out.toml").read_text("utf-8") == map.read_text("utf-8")


def stated(folder: Path, line: str) -> Path:
    map = folder / "map.toml"
    map.write_text(f'rolling_radius = 0.3\n[inputs]\nwheel_speed_fl = {{ column = "a" }}\n{line}\n', "utf-8")
    return map


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('vehicle_speed = { column = "v" } # {}', 'vehicle_speed = { column = "v", lag = 0.20 } # {}'),
        ('vehicle_speed = {column="v",lag=-0.05}', 'vehicle_speed = {column="v", lag = 0.15}'),
    ],
)
def test_a_line_of_a_map_gets_its_lag(tmp_path: Path, before: str, after: str) -> None:
    map = stated(tmp_path, before)
    write_lags(map, read_column_map(map).content, [Lag("vehicle_speed", 0.2, 0.01)], tmp_path / "out.toml")
    assert (tmp_path / "out.toml").read_text("utf-8").splitlines()[-1] == after


def test_a_map_that_is_written_otherwise_is_one_line(tmp_path: Path) -> None:
    map = stated(tmp_path, '[inputs.vehicle_speed]\ncolumn = "v"')
    with pytest.raises(UserError, match=r"add lag = 0\.20 by hand"):
        write_lags(
            map, read_column_map(map).content, [Lag("vehicle_speed", 0.2, 0.01)], tmp_path / "out.toml"
        )


def test_a_map_of_frames_takes_none_and_is_refused_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = Path(__file__).parents[2] / "data" / "mustang.log"
    assert cli.main(["map", "check", str(log), "--map", "mustang", "--out", str(tmp_path / "out.toml")]) == 2
    said = capsys.readouterr()
    assert "maps messages, which have no lag" in said.err
    assert said.out == ""
