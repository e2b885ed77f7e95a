"""A log decoded through KCD, SYM and ARXML gives the rows that it gives through the DBC."""

from pathlib import Path

import cantools
import numpy as np
import pytest

from brakelab.api import Drive, load
from ecu import cli

DATA = Path(__file__).parents[1] / "data"
DBC = cantools.database.load_file(DATA / "databases" / "chassis.dbc")
START_S = 1600000861.127
MAP = """
database = "{database}"
[messages.WheelSpeed]
period = 0.015
[messages.BrakeSnData_3]
slowest_period = 0.04
[inputs]
wheel_speed_fl = {{ message = "WheelSpeed", signal = "WhlFl_W_Meas" }}
wheel_speed_fr = {{ message = "WheelSpeed", signal = "WhlFr_W_Meas" }}
wheel_speed_rl = {{ message = "WheelSpeed", signal = "WhlRl_W_Meas" }}
wheel_speed_rr = {{ message = "WheelSpeed", signal = "WhlRr_W_Meas" }}
accel_x = {{ message = "BrakeSnData_3", signal = "VehLongComp_A_Actl" }}
accel_y = {{ message = "BrakeSnData_3", signal = "VehLatComp_A_Actl" }}
yaw_rate = {{ message = "BrakeSnData_3", signal = "VehYawComp_W_Actl" }}
calliper_pressure_fl = {{ message = "BrakePressures", signal = "P_FL" }}
calliper_pressure_fr = {{ message = "BrakePressures", signal = "P_FR" }}
calliper_pressure_rl = {{ message = "BrakePressures", signal = "P_RL" }}
calliper_pressure_rr = {{ message = "BrakePressures", signal = "P_RR" }}
"""


def pressure(corner: int, t: float) -> float:
    return round(5.0 * (corner + 1) + 10.0 * t, 1)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Mustang's cut, its wheels "not available" once for 0.2 s, and multiplexed pressures every 20 ms."""
    lines = []
    for line in (DATA / "mustang.log").read_text().splitlines():
        t = float(line[1:18]) - START_S
        if 1.0 < t < 1.2 and " 217#" in line:
            line = line.partition("#")[0] + "#7FFF7FFF7FFF7FFF"
        lines.append((t, line))
    for turn in range(100):
        t, rear = 0.02 * turn, turn % 2
        names = ("P_RL", "P_RR") if rear else ("P_FL", "P_FR")
        values = {name: pressure(2 * rear + place, t) for place, name in enumerate(names)}
        data = DBC.encode_message("BrakePressures", {"Axle": rear, **values})
        lines.append((t, f"({START_S + t:.6f}) can0 320#{data.hex().upper()}"))
    path = tmp_path_factory.mktemp("log") / "drive.log"
    path.write_text("\n".join(line for _, line in sorted(lines, key=lambda one: one[0])) + "\n")
    return path


def through(folder: Path, kind: str, log: Path) -> Drive:
    text = {
        "dbc": DBC.as_dbc_string,
        "kcd": DBC.as_kcd_string,
        "sym": DBC.as_sym_string,
        "arxml": (DATA / "databases" / "chassis.arxml").read_text,
    }[kind]()
    (folder / f"car.{kind}").write_text(text)
    path = folder / f"{kind}.toml"
    path.write_text(MAP.format(database=f"car.{kind}"))
    return load(log, map=path)


@pytest.fixture(scope="module")
def by_dbc(tmp_path_factory: pytest.TempPathFactory, log: Path) -> Drive:
    return through(tmp_path_factory.mktemp("dbc"), "dbc", log)


def test_the_rows_of_the_dbc_are_what_was_sent(by_dbc: Drive) -> None:
    """Pressures as encoded, wheels of the recorded drive in rad/s, gaps where they were not available."""
    assert 190 < len(by_dbc) < 210
    for corner, name in enumerate(("fl", "fr", "rl", "rr")):
        column = by_dbc[f"calliper_pressure_{name}"]
        known = np.isfinite(column)
        assert known.sum() > 180
        sent = [pressure(corner, t) for t in by_dbc["t"][known]]
        assert np.abs(column[known] - sent).max() < 0.55  # held for up to 50 ms of 10 bar/s
    speed = by_dbc["wheel_speed_fl"]
    assert np.isnan(speed[(by_dbc["t"] > 1.13) & (by_dbc["t"] < 1.19)]).all()
    assert 20.0 < np.nanmedian(speed) < 40.0


@pytest.mark.parametrize("kind", ["kcd", "sym", "arxml"])
def test_the_rows_are_those_of_the_dbc(tmp_path: Path, by_dbc: Drive, log: Path, kind: str) -> None:
    other = through(tmp_path, kind, log)
    assert list(other) == list(by_dbc)
    assert other.units == by_dbc.units
    assert other.notes == [note.replace(".dbc", f".{kind}") for note in by_dbc.notes]
    for name in by_dbc:
        np.testing.assert_array_equal(other[name], by_dbc[name], err_msg=name)


@pytest.mark.parametrize("kind", ["kcd", "sym", "arxml"])
def test_a_map_is_proposed_from_every_kind(
    tmp_path: Path, log: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    through(tmp_path, kind, log)
    out = tmp_path / "proposed.toml"
    assert (
        cli.main(["map", "suggest", str(log), "--dbc", str(tmp_path / f"car.{kind}"), "--out", str(out)]) == 0
    )
    assert 'wheel_speed_fl = { message = "WheelSpeed", signal = "WhlFl_W_Meas"' in out.read_text()


@pytest.mark.parametrize("command", ["suggest", "check", "replay"])
def test_a_truncated_database_ends_a_command_with_one_line(
    tmp_path: Path, log: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = (DATA / "databases" / "chassis.arxml").read_text()
    (tmp_path / "car.arxml").write_text(whole[: len(whole) // 2])
    (tmp_path / "map.toml").write_text(MAP.format(database="car.arxml"))
    arguments = {
        "suggest": ["map", "suggest", str(log), "--dbc", str(tmp_path / "car.arxml")],
        "check": ["map", "check", str(log), "--map", str(tmp_path / "map.toml")],
        "replay": [
            *("replay", str(log), "--config", "mustang", "--map", str(tmp_path / "map.toml")),
            *("--out", str(tmp_path / "out.parquet")),
        ],
    }[command]
    assert cli.main(arguments) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("reading ")]
    assert len(said) == 1
    assert "car.arxml: line " in said[0]
    assert "cut off or damaged" in said[0]
