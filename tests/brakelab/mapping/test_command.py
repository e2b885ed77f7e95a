"""A map proposed from a log: what physics and names say, against cars whose map is known."""

from pathlib import Path

import cantools
import numpy as np
import pytest

from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.mapping.names import corner_of, words
from brakelab.mapping.physics import Found, fit, propose
from brakelab.mapping.series import read_series
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.ecu_inputs import vehicle_frames
from brakelab.studies.observers_cases import shipped
from ecu import cli
from ecu.bus.database import load_database
from ecu.bus.signal_map import load_signal_map, read_signal_map
from ecu.settings.config import load_config
from ecu.settings.resources import resource

LOGS = Path(__file__).parents[2] / "data"

NAMES = [
    ("WhlFl_W_Meas", "fl", "whl_w_meas"),
    ("WHEEL_SPEED_RR", "rr", "wheel_speed"),
    ("WHL_SPD_FR", "fr", "whl_spd"),
    ("RaddrehzahlHL", "rl", "raddrehzahl"),
    ("FrontLeftWheelSpeed", "fl", "wheel_speed"),
    ("ESP_VR_Radgeschw", "fr", "esp_radgeschw"),
    ("VehicleSpeed", "", "vehicle_speed"),
]


@pytest.mark.parametrize(("name", "corner", "stem"), NAMES)
def test_a_name_tells_its_corner(name: str, corner: str, stem: str) -> None:
    assert corner_of(name) == (corner, stem)


def test_words_of_a_name() -> None:
    assert words("StePinRelInit_An_Sns") == ["ste", "pin", "rel", "init", "an", "sns"]


@pytest.mark.parametrize("lag", [-5, 0, 8])
@pytest.mark.parametrize("slope", [-0.8, 2.0])
def test_a_fit_finds_slope_and_lag(slope: float, lag: int) -> None:
    t = np.arange(0.0, 60.0, 0.02)
    reference = np.sin(0.7 * t) + 0.5 * np.sin(1.9 * t)
    line = fit(np.roll(slope * reference + 0.3, lag), reference, np.ones(len(t), np.bool_))
    assert line.slope == pytest.approx(slope, rel=1e-3)
    assert line.intercept == pytest.approx(0.3, abs=2e-3)
    assert abs(line.correlation) == pytest.approx(1.0, abs=1e-3)


@pytest.fixture(scope="module")
def drive():
    """Two hundred seconds of ordinary driving on the contract's frames."""
    loop = new_loop(shipped("ordinary"), load_config(resource("config/suv.toml")), 0)
    return vehicle_frames(run(loop, seconds=200.0).frames)


def proposed(frames, text: str) -> dict[str, Found]:
    database = cantools.database.load_string(text, "dbc")
    found, drives = propose(read_series([frames], database))
    assert drives
    return {one.target: one for one in found}


def contract() -> str:
    return resource("dbc/brake_ecu.dbc").read_text(encoding="utf-8")


def negated(text: str, signal: str) -> str:
    """Return the database with the sign of a signal turned round."""
    lines = []
    for line in text.splitlines():
        if f" SG_ {signal} " in line:
            before, rest = line.split("(", 1)
            numbers, after = rest.split(")", 1)
            scale, offset = (float(number) for number in numbers.split(","))
            line = f"{before}({-scale:.12g},{-offset:.12g}){after}"
        lines.append(line)
    return "\n".join(lines)


def renamed(text: str, **names: str) -> str:
    for old in names:
        text = text.replace(f" {old} ", f" @{old}@ ")
    for old, new in names.items():
        text = text.replace(f" @{old}@ ", f" {new} ")
    return text


def test_the_own_database_is_found_whole(drive) -> None:
    found = proposed(drive, contract())
    own = (
        "accel_x",
        "accel_y",
        "yaw_rate",
        "accelerator_position",
        "abs_active",
        "esp_active",
        "pedal_pressed",
    )
    corners = [
        f"{name}_{c}" for name in ("wheel_speed", "calliper_pressure") for c in ("fl", "fr", "rl", "rr")
    ]
    for target in (*own, *corners):
        assert found[target].series.signal == target
        assert found[target].factor == 1.0
    assert found["steering_angle"].series.signal == "steering_angle"
    assert found["steering_angle"].factor == pytest.approx(1.0, rel=0.15)


TURNED = ["accel_x", "accel_y", "yaw_rate"]


@pytest.mark.parametrize("signal", TURNED)
def test_a_turned_axis_is_told_by_the_drive(drive, signal: str) -> None:
    found = proposed(drive, negated(contract(), signal))
    assert {name: found[name].factor for name in TURNED} == {
        name: -1.0 if name == signal else 1.0 for name in TURNED
    }
    assert all(found[name].series.signal == name for name in TURNED)


def test_swapped_axes_are_told_by_the_drive(drive) -> None:
    found = proposed(drive, renamed(contract(), accel_x="accel_y", accel_y="accel_x"))
    assert found["accel_x"].series.signal == "accel_y"
    assert found["accel_y"].series.signal == "accel_x"


def test_names_that_say_nothing_leave_the_drive_to_tell(drive) -> None:
    found = proposed(drive, renamed(contract(), accel_x="S17", accel_y="S18", yaw_rate="S19"))
    assert [found[name].series.signal for name in TURNED] == ["S17", "S18", "S19"]


@pytest.mark.parametrize("car", ["mustang", "rav4", "kona"])
def test_real_cars_get_what_their_maps_say(car: str) -> None:
    """The shipped maps were made by hand on the whole drives; the logs here are parts of them."""
    log = next(LOGS.glob(f"{car}*.log"), None)
    if log is None:
        pytest.skip(f"no log of the {car} here")
    database = load_database(resource(f"dbc/cars/{car}.dbc"), strict=False)
    found, drives = propose(read_series(read_frames(log, [], LogQuality()), database))
    shipped_map = read_signal_map(resource(f"config/maps/{car}.toml")).inputs
    for one in found:
        print(car, drives, one.target, one.series.name, one.factor, one.evidence)
    checked = 0
    for one in found:
        known = shipped_map.get(one.target)
        if known is None or one.target == "steering_angle" or (car, one.target) == ("mustang", "accel_x"):
            continue  # the Mustang has two longitudinal accelerations
        assert (one.series.message, one.series.signal) == (known.message, known.signal)
        if one.target in TURNED:
            assert np.sign(one.factor) == np.sign(known.factor)
        checked += 1
    assert checked >= 5


def test_the_written_map_is_one(drive, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = next(LOGS.glob("rav4*.log")), tmp_path / "maps" / "rav4.toml"
    database = resource("dbc/cars/rav4.dbc")
    assert cli.main(["map", "suggest", str(log), "--dbc", str(database), "--out", str(out)]) == 0
    plan = load_signal_map(out).plan
    assert plan.mapped.sum() >= 7
    assert "check every line" in out.read_text(encoding="utf-8")
    assert "written" in capsys.readouterr().err


def test_another_cars_database_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    log = next(LOGS.glob("rav4*.log"))
    assert cli.main(["map", "suggest", str(log), "--dbc", str(resource("dbc/cars/kona.dbc"))]) == 2
    said = capsys.readouterr().err
    assert "no four wheel speeds" in said
    assert said.count("\n") == 1
