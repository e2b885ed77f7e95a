"""`brake-ecu map check` on recorded drives, with their maps and with maps that are wrong in one line."""

import re
from pathlib import Path

import pytest

from ecu import cli
from ecu.settings.resources import resource

LOGS = Path(__file__).parents[2] / "data"
WHOLE = [("mustang", "mustang_s550"), ("rav4", "rav4_bus0_bus1"), ("kona", "kona")]


def changed(car: str, to: Path, pattern: str, new: str) -> Path:
    """Write a shipped map with a change of its text to the folder `to`."""
    text, count = re.subn(pattern, new, resource(f"config/maps/{car}.toml").read_text("utf-8"))
    assert count
    out = to / "map.toml"
    out.write_text(text.replace("../../dbc/cars", str(resource(f"dbc/cars/{car}.dbc").parent)), "utf-8")
    return out


@pytest.mark.parametrize("car", ["mustang", "rav4", "kona"])
def test_the_dry_run_names_what_feeds_each_input(car: str, capsys: pytest.CaptureFixture[str]) -> None:
    log = next(LOGS.glob(f"{car}*.log"))
    assert cli.main(["map", "check", str(log), "--map", car]) == 0
    said = capsys.readouterr().out
    for text in ("wheel_speed_fl fr rl rr", "accel_x", "time-out s"):
        assert text in said


@pytest.mark.drives
@pytest.mark.parametrize("config", [None, "of the car"])
@pytest.mark.parametrize(("car", "log"), WHOLE)
def test_recorded_drives_are_as_their_maps_say(
    drives: Path, capsys: pytest.CaptureFixture[str], car: str, log: str, config: str | None
) -> None:
    words = ["map", "check", str(drives / car / f"{log}.candump.log"), "--map", car]
    words += ["--config", "mustang" if car == "mustang" else "suv"] if config else []
    assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert ("the car hardly moves" if car == "kona" else "physics agrees: wheel_speed, accel_x") in said


WRONG = [
    ("mustang", "offset = -0.45, ", "", "accel_x: reads +0.4"),
    ("rav4", 'signal = "ACCEL_X", factor = -1', 'signal = "ACCEL_X"', "accel_x: turned against dv/dt"),
    ("mustang", '"VehLongComp_A_Actl", offset = -0.45', '"VehLongComp_A_Actl", unit = "g"', "accel_x: reads"),
    (
        "mustang",
        '"VehYawComp_W_Actl"',
        '"VehYawComp_W_Actl", unit = "rad/s"',
        "yaw_rate: reads some 57 times",
    ),
    ("mustang", '"WhlFl_W_Meas"', '"WhlFl_W_Meas", factor = 0.75', "wheel_speed_fl: reads 0.7"),
    (
        "mustang",
        'factor = 0.008\\d+, unit = "bar"',
        'factor = 0.008, unit = "kPa"',
        "calliper_pressure_*: the car",
    ),
    ("mustang", "factor = 0.008\\d+", "factor = -0.00825", "calliper_pressure_fl"),
]


@pytest.mark.drives
@pytest.mark.parametrize(("car", "pattern", "new", "line"), WRONG, ids=[row[3] for row in WRONG])
def test_a_wrong_map_of_a_recorded_drive_is_reported(
    drives: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    car: str,
    pattern: str,
    new: str,
    line: str,
) -> None:
    log = drives / car / f"{dict(WHOLE)[car]}.candump.log"
    wrong = changed(car, tmp_path, pattern, new)
    config = ["--config", "mustang"] if car == "mustang" else []
    assert cli.main(["map", "check", str(log), "--map", str(wrong), *config]) == 1
    assert line in capsys.readouterr().out


def test_signals_need_no_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text("t,accel_x\n0,1\n")
    assert cli.main(["map", "check", str(tmp_path / "a.csv"), "--map", "rav4"]) == 2
    assert "decoded already" in capsys.readouterr().err
