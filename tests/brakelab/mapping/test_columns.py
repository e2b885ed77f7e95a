"""`map suggest`, `map check` and `replay` on a signal file of a logger: a drive with curves and brakings."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from brakelab.logs.column_map import read_column_map
from brakelab.logs.csv_header import split_title
from ecu import cli

RADIUS, TRACK, GRAVITY = 0.33, 1.55, 9.80665


def write_drive(path: Path, seconds: float = 80.0, head: str = "") -> Path:
    """Write a drive of 50 Hz as AiM's logger would: axes to the rear and to the right, km/h, g, deg/s."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, seconds, 0.02)
    change = np.where(t % 20.0 < 10.0, 1.5, 0.0) - np.where((t % 20.0 >= 14.0) & (t % 20.0 < 19.0), 3.0, 0.0)
    change[0:50] = 0.0
    speed = 5.0 + np.maximum(np.cumsum(change) * 0.02, 0.0)
    change = np.gradient(speed, 0.02)
    yaw = 0.12 * np.sin(2.0 * np.pi * t / 13.0) * np.minimum(speed / 10.0, 1.0)
    columns = {
        "Time": t,
        **{
            f"WheelSpd_{c}": 3.6 * (speed + s * yaw * TRACK / 2)
            for c, s in zip(("FL", "FR", "RL", "RR"), (-1, 1, -1, 1), strict=True)
        },
        "InlineAcc": -change / GRAVITY + rng.normal(0.0, 0.002, len(t)),
        "LateralAcc": -speed * yaw / GRAVITY + rng.normal(0.0, 0.002, len(t)),
        "YawRate": -np.degrees(yaw),
        "BrakePress": np.maximum(-change, 0.0) * 10.0,
    }
    units = ["s", *["km/h"] * 4, "g", "g", "deg/s", "bar"]
    rows = np.column_stack([*columns.values()])
    text = "\n".join(",".join(f"{cell:.4f}" for cell in row) for row in rows)
    path.write_text(f"{head}{','.join(columns)}\n{','.join(units)}\n\n{text}\n")
    return path


def with_units(log: Path) -> pd.DataFrame:
    """Return the drive of `write_drive` with its units behind the names."""
    names, units, *_ = log.read_text().splitlines()
    titles = [f"{name} [{unit}]" for name, unit in zip(names.split(","), units.split(","), strict=True)]
    return pd.read_csv(log, skiprows=[1]).set_axis(titles, axis=1)


def test_suggest_check_and_replay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = write_drive(tmp_path / "aim.csv", head='"Format","AiM CSV File"\n"Sample Rate","50"\n\n')
    out = tmp_path / "map.toml"
    assert cli.main(["map", "suggest", str(log), "--out", str(out)]) == 0
    assert f"next: brake-ecu map check {log} --map {out}" in capsys.readouterr().err
    text = out.read_text("utf-8")
    assert 'accel_x = { column = "InlineAcc", factor = -1 }' in text
    assert 'accel_y = { column = "LateralAcc", factor = -1 }' in text
    assert 'yaw_rate = { column = "YawRate", factor = -1 }' in text
    assert 'wheel_speed_rr = { column = "WheelSpd_RR" }' in text
    assert 'calliper_pressure_fl = { column = "BrakePress" }' in text
    assert "rolling_radius = 0.33" in text
    assert cli.main(["map", "check", str(log), "--map", str(out)]) == 0
    said = capsys.readouterr().out
    assert "physics agrees" in said
    assert "InlineAcc" in said
    result = tmp_path / "result.parquet"
    assert cli.main(["replay", str(log), "--config", "suv", "--map", str(out), "--out", str(result)]) == 0
    rows = pq.read_table(result)
    speed = rows.column("vehicle_speed").to_numpy()
    # the wheels turned as 18.5 m/s with the logger's radius; the car of CONFIG has 0.363 m
    assert np.nanmax(speed) == pytest.approx(18.5 * 0.363 / RADIUS, abs=0.3)
    brakings = pq.read_table(tmp_path / "result.brakes.parquet").to_pydict()
    front = [
        time for time, corner in zip(brakings["t_start"], brakings["corner"], strict=True) if corner == "fl"
    ]
    assert front == pytest.approx([14.0, 34.0, 54.0, 74.0], abs=0.2)


def test_one_speed_stands_in_the_place_of_four_wheels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As Tesla's track mode writes it; the speed of another sensor, in coarse steps, is not taken."""
    table = pd.read_csv(write_drive(tmp_path / "aim.csv"), skiprows=[1])
    speed = 0.25 * sum(table[f"WheelSpd_{corner}"] for corner in ("FL", "FR", "RL", "RR"))
    log, out, result = (tmp_path / name for name in ("lap.csv", "map.toml", "result.parquet"))
    columns = {
        "Elapsed Time (ms)": 1000.0 * table["Time"],
        "Display Speed (MPH)": (speed / 1.609344 / 2.0).round() * 2.0,
        "Speed (MPH)": (speed / 1.609344).round(2),
        "Wind Speed (m/s)": 0.0 * speed + 3.0,
        "Longitudinal Acceleration (m/s^2)": (table["InlineAcc"] * GRAVITY).round(4),
        "Lateral Acceleration (m/s^2)": (table["LateralAcc"] * GRAVITY).round(4),
        "Brake Pressure (bar)": table["BrakePress"],
    }
    pd.DataFrame(columns).to_csv(log, index=False)
    assert cli.main(["map", "suggest", str(log), "--out", str(out)]) == 0
    said = capsys.readouterr().err
    assert "accel_y: its name alone speaks for it, no wheel speeds show the curves: check sign" in said
    text = out.read_text("utf-8")
    assert 'vehicle_speed = { column = "Speed" }' in text
    assert 'accel_x = { column = "Longitudinal Acceleration", factor = -1 }' in text
    assert 'calliper_pressure_rr = { column = "Brake Pressure" }' in text
    assert "wheel_speed" not in text.replace("wheel speeds", "")
    assert "rolling_radius" not in text
    assert cli.main(["replay", str(log), "--config", "suv", "--map", str(out), "--out", str(result)]) == 0
    said = capsys.readouterr().err
    assert "wheel_speed_*: not mapped; the speed of the car, which shows no slip, stands for it" in said
    assert "degraded" not in said
    brakes = pq.read_table(tmp_path / "result.brakes.parquet").to_pydict()
    assert "learned" in brakes["learning"]


@pytest.mark.parametrize(("per_second", "unit"), [(1e3, "ms"), (1e6, "us")])
def test_a_time_that_is_not_in_seconds_is_refused_or_read_by_its_unit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], per_second: float, unit: str
) -> None:
    log = write_drive(tmp_path / "aim.csv", seconds=30.0)
    head, units, *rows = log.read_text().splitlines()
    cells = [row.split(",", 1) for row in rows if row]
    rows = [f"{1.5e9 * per_second + float(t) * per_second:.0f},{rest}" for t, rest in cells]
    log.write_text("\n".join([head, units.replace("s,", ",", 1), *rows]) + "\n")
    assert cli.main(["map", "suggest", str(log)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert "aim.csv: Time: Time is in seconds, but " in line
    assert 'write its unit behind the name, "Time [us]"' in line
    log.write_text("\n".join([head, units.replace("s,", f"{unit},", 1), *rows]) + "\n")
    assert cli.main(["map", "suggest", str(log)]) == 0


def test_parquet_of_a_csv_file_gets_its_map(tmp_path: Path) -> None:
    log = write_drive(tmp_path / "aim.csv")
    made, maps = tmp_path / "aim.parquet", [tmp_path / "csv.toml", tmp_path / "parquet.toml"]
    with_units(log).to_parquet(made)
    for one, out in zip((log, made), maps, strict=True):
        assert cli.main(["map", "suggest", str(one), "--out", str(out)]) == 0
    csv, parquet = (
        [line for line in out.read_text("utf-8").splitlines() if line[:1] not in "#t"] for out in maps
    )
    assert parquet == csv


@pytest.mark.parametrize(
    ("clock", "says"),
    [
        (lambda t: f"14:23:{int(t):02d}", "rows have the time of the row before and other values"),
        (lambda t: "5.0", "rows have the time of the row before and other values"),
        (lambda t: f"14:23:{int(t):02d}:{t % 1 * 1e3:03.0f}", "'14:23:00:000' is no time; give s, or the"),
    ],
)
def test_a_time_that_tells_no_rows_apart_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], clock: Callable[[float], str], says: str
) -> None:
    log = write_drive(tmp_path / "aim.csv", seconds=30.0)
    head, units, *rows = log.read_text().splitlines()
    cells = [row.split(",", 1) for row in rows if row]
    rows = [f"{clock(float(t))},{rest}" for t, rest in cells]
    log.write_text("\n".join([head, units.replace("s,", ",", 1), *rows]) + "\n")
    assert cli.main(["map", "suggest", str(log)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


def test_a_time_of_day_needs_no_unit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = write_drive(tmp_path / "aim.csv"), tmp_path / "map.toml"
    head, units, _, *rows = log.read_text().splitlines()
    cells = [(float(t), rest) for t, rest in (row.split(",", 1) for row in rows)]
    rows = [f"14:{23 + int(t / 60)}:{t % 60:06.3f},{rest}" for t, rest in cells]
    log.write_text("\n".join([head, units.replace("s,", ",", 1), *rows, ""]))
    assert cli.main(["map", "suggest", str(log), "--out", str(out)]) == 0
    assert "time_unit" not in out.read_text("utf-8")
    assert cli.main(["map", "check", str(log), "--map", str(out)]) == 0
    log.write_text("\n".join([head.replace("Time", "Stoppuhr"), units, *rows, ""]))
    assert cli.main(["map", "suggest", str(log)]) == 2
    assert 'BrakePress; give that of time such a name, its unit in brackets: "time [s]"' in (
        capsys.readouterr().err
    )


def test_damage_and_columns_that_stand_twice_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By all that read them; of one heading the first column is read, with its unit or without."""
    log, out = write_drive(tmp_path / "aim.csv"), tmp_path / "map.toml"
    lines = log.read_text().replace("BrakePress\n", "BrakePress,YawRate\n").replace("bar\n", "bar,deg/s\n")
    head, units, _, *rows = lines.splitlines()
    log.write_text("\n".join([head, units, *(f"{row},0.0" for row in rows), "90.0,1.0"]))
    said = [
        f"{log}: line 4003: the last line is cut off and was not used",
        f'{log}: columns that stand twice: YawRate; the first is read, "YawRate#2" the second',
    ]
    assert cli.main(["map", "suggest", str(log), "--out", str(out)]) == 0
    assert capsys.readouterr().err.splitlines()[:2] == said
    assert 'yaw_rate = { column = "YawRate", factor = -1 }' in out.read_text("utf-8")
    out.write_text(out.read_text("utf-8").replace('"YawRate"', '"YawRate [deg/s]"'))
    log.write_text(log.read_text().replace("YawRate", "YawRate [deg/s]"))
    assert cli.main(["map", "check", str(log), "--map", str(out)]) == 0
    printed = capsys.readouterr()
    assert set(said) <= {*printed.out.splitlines(), *printed.err.splitlines()}


def test_a_drive_of_a_few_rows_is_too_short(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["map", "suggest", str(write_drive(tmp_path / "aim.csv", seconds=0.3))]) == 2
    assert ", of which none has 20 numbers at times of their own" in capsys.readouterr().err


WRITTEN = {
    "capitals": lambda name, unit: f"{name.replace('Spd_', 'Speed').upper()} [{unit}]",
    "words": lambda name, unit: f"{name} in {unit}",
    "German": lambda name, unit: f"{name} [{unit.replace('deg/s', 'Grad/s')}]",
    "two levels": lambda name, unit: (name, unit),
}


@pytest.mark.parametrize("kind", [".parquet", ".csv"])
@pytest.mark.parametrize("written", WRITTEN.values(), ids=WRITTEN)
def test_names_and_units_as_others_write_them(
    tmp_path: Path, kind: str, written: Callable[[str, str], str | tuple[str, str]]
) -> None:
    table = with_units(write_drive(tmp_path / "aim.csv"))
    heads = [written(*split_title(title)) for title in table.columns]
    table.columns = pd.MultiIndex.from_tuples(heads) if isinstance(heads[0], tuple) else pd.Index(heads)
    made, out = tmp_path / f"drive{kind}", tmp_path / "map.toml"
    table.to_parquet(made) if kind == ".parquet" else table.to_csv(made, index=False)
    assert cli.main(["map", "suggest", str(made), "--out", str(out)]) == 0
    found = read_column_map(out).content.inputs
    assert {f"wheel_speed_{corner}" for corner in ("fl", "fr", "rl", "rr")} < set(found)
    assert (found["accel_x"].factor, found["yaw_rate"].factor) == (-1.0, -1.0)
    assert "CHECK" not in out.read_text("utf-8")


SPOILT = {
    "t: time falls by ": lambda table: pd.concat(
        [table[:1000], table[1000:1200].sample(frac=1.0, random_state=1), table[1200:]]
    ),
    "row 900, InlineAcc: infinite value": lambda table: table.assign(
        **{"InlineAcc [g]": table["InlineAcc [g]"].where(table.index != 900, np.inf)}
    ),
}


@pytest.mark.parametrize(("says", "spoil"), SPOILT.items(), ids=["order", "infinite"])
def test_nothing_is_proposed_for_a_file_that_replay_refuses(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    says: str,
    spoil: Callable[[pd.DataFrame], pd.DataFrame],
) -> None:
    made, out = tmp_path / "spoilt.parquet", tmp_path / "map.toml"
    spoil(with_units(write_drive(tmp_path / "aim.csv"))).to_parquet(made, index=False)
    assert cli.main(["map", "suggest", str(made), "--out", str(out)]) == 2
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_time_alone_is_no_drive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pd.DataFrame({"t": [0.0, 0.1, 0.2]}).to_parquet(tmp_path / "drive.parquet")
    assert cli.main(["map", "suggest", str(tmp_path / "drive.parquet")]) == 2
    assert "no speed by its name and unit among t, of which none" in capsys.readouterr().err


def test_names_of_the_contract_need_no_map_but_a_t(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write_drive(tmp_path / "aim.csv", seconds=40.0)
    text = re.sub("WheelSpd_(..)", lambda found: f"wheel_speed_{found[1].lower()}", log.read_text())
    log.write_text(text.replace("km/h", ""))
    assert cli.main(["map", "suggest", str(log)]) == 2
    assert "or call its time t: the contract's names have" in capsys.readouterr().err
    log.write_text(log.read_text().replace("Time", "t", 1))
    assert cli.main(["map", "suggest", str(log)]) == 2
    assert "or take it as it is: the contract's names have" in capsys.readouterr().err


def test_wheel_speeds_without_a_unit_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """28 m/s at most: 102 km/h; all else is judged by the wheels."""
    log = write_drive(tmp_path / "aim.csv", seconds=40.0)
    log.write_text(log.read_text().replace("km/h", ""))
    assert cli.main(["map", "suggest", str(log)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert "aim.csv: WheelSpd_FL: no unit is stated" in line
    assert 'write it behind the names: "WheelSpd_FL [km/h]"' in line
    assert "m/s if it is rpm" in line


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('"InlineAcc", factor = -1', '"InlineAcc"'), "accel_x: turned against dv/dt; factor = -1"),
        (('"YawRate", factor = -1', '"YawRate", factor = -1, unit = "rad/s"'), "yaw_rate"),
        (('"InlineAcc"', '"LateralAcc"'), "accel_x"),
    ],
)
def test_a_wrong_map_is_found_by_the_motion_of_the_car(
    change: tuple[str, str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = write_drive(tmp_path / "aim.csv"), tmp_path / "map.toml"
    assert cli.main(["map", "suggest", str(log), "--out", str(out)]) == 0
    text = out.read_text("utf-8")
    assert change[0] in text
    out.write_text(text.replace(*change), "utf-8")
    capsys.readouterr()
    assert cli.main(["map", "check", str(log), "--map", str(out)]) == 1
    assert says in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("map suggest LOG.log", "--dbc: missing"),
        ("map suggest few.csv", "no speed by its name and unit among Time, ax"),
        ("map suggest empty.csv", "the file is empty"),
        ("map suggest race.log", "this is a CSV file; let its name end in .csv"),
        ("replay aim.csv --config suv --out r.parquet", "or the map of columns that `map suggest` proposes"),
        ("replay aim.csv --config suv --map bus.toml --out r.parquet", "no.dbc: no such file"),
        (
            "replay drive.log --config suv --map map.toml --out r.parquet",
            "maps columns, but drive.log holds frames",
        ),
    ],
)
def test_a_mistake_is_one_line(
    words: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_drive(tmp_path / "aim.csv", 1.0)
    (tmp_path / "few.csv").write_text("Time,ax\ns,g\n0,1\n0.02,1\n0.04,1\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "bus.toml").write_text(
        'database = "no.dbc"\n[inputs]\naccel_x = { message = "M", signal = "S" }\n'
    )
    (tmp_path / "map.toml").write_text('[inputs]\naccel_x = { column = "ax" }\n')
    (tmp_path / "race.log").write_text('"Interval"|"ms"|0|0|1,"AccelX"|"G"|-3.0|3.0|25\n1,2\n')
    frame = "(1.000000) can0 100#0000\n"
    for name in ("LOG.log", "drive.log"):
        (tmp_path / name).write_text(frame)
    assert cli.main(words.split()) == 2
    said = capsys.readouterr().err
    assert says in said
    assert said.count("brake-ecu: ") == said.count("\n") - said.startswith("reading") == 1


@pytest.mark.parametrize("felt", [True, False], ids=["accelerometer", "pressures alone"])
@pytest.mark.parametrize("late", [0.0, 0.3])
def test_a_speed_that_comes_late_is_proposed_so(tmp_path: Path, felt: bool, late: float) -> None:
    """The car follows its pressures after 0.08 s."""
    table = pd.read_csv(write_drive(tmp_path / "aim.csv", seconds=160.0), skiprows=[1])
    t = table["Time"]
    columns = {
        "Time [s]": t,
        "GPS Speed [km/h]": np.interp(t - late, t, table["WheelSpd_FL"]),
        "BrakePress [bar]": np.interp(t + 0.08, t, table["BrakePress"]),
    }
    if felt:
        columns["LongAcc [g]"] = -table["InlineAcc"]
    log, out = tmp_path / "gps.csv", tmp_path / "map.toml"
    pd.DataFrame(columns).to_csv(log, index=False)
    assert cli.main(["map", "suggest", str(log), "--out", str(out)]) == 0
    lags = {name: one.lag for name, one in read_column_map(out).content.inputs.items()}
    assert lags.pop("vehicle_speed") == pytest.approx(late, abs=0.03)
    assert set(lags.values()) == {0.0}
