"""A map proposed from a log: what physics and names say, against cars whose map is known."""

import re
from pathlib import Path

import cantools
import numpy as np
import pytest

from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.logs.physics.line import fit
from brakelab.mapping.command import map_text, timeout
from brakelab.mapping.motion import Found, motion_of, wheel_speeds
from brakelab.mapping.names import axle_of, corner_of, score, words
from brakelab.mapping.physics import propose
from brakelab.mapping.series import Series, read_series
from brakelab.mapping.torque import brake_torque, stand_in
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.configured import shipped
from brakelab.simulation.ecu_inputs import vehicle_frames
from ecu import cli
from ecu.bus.database import load_database
from ecu.bus.signal_map import load_signal_map, read_signal_map
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config, new_params
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


@pytest.mark.parametrize(
    ("front", "rear"), [("vorne", "hinten"), ("Vorderachse", "Hinterachse"), ("VA", "HA")]
)
def test_german_axles_are_a_pair(front: str, rear: str) -> None:
    assert axle_of(f"Bremsdruck {front}") == ("front", "bremsdruck")
    assert axle_of(f"Bremsdruck {rear}") == ("rear", "bremsdruck")


@pytest.mark.parametrize("name", ["Gaspedalstellung", "Drosselklappe", "Fahrpedal", "rFahrpedal"])
def test_a_german_accelerator_is_one(name: str) -> None:
    assert score(name, "accelerator_position") >= 1.0


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
    found, motion = propose(read_series([frames], database))
    assert motion is not None
    assert motion.drives
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
def test_the_drive_shows_a_turned_axis(drive, signal: str) -> None:
    found = proposed(drive, negated(contract(), signal))
    assert {name: found[name].factor for name in TURNED} == {
        name: -1.0 if name == signal else 1.0 for name in TURNED
    }
    assert all(found[name].series.signal == name for name in TURNED)


def test_the_drive_shows_swapped_axes(drive) -> None:
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
    found, _ = propose(read_series(read_frames(log, [], LogQuality()), database))
    shipped_map = read_signal_map(resource(f"config/maps/{car}.toml")).inputs
    for one in found:
        print(car, one.target, one.series.name, one.factor, one.evidence)
    checked = 0
    for one in found:
        known = shipped_map.get(one.target)
        if known is None or one.target == "steering_angle" or (car, one.target) == ("mustang", "accel_x"):
            continue  # the Mustang has two longitudinal accelerations
        assert (one.series.message, one.series.signal) == (known.message, known.signal)
        if one.target in TURNED and one.sure:
            assert np.sign(one.factor) == np.sign(known.factor)
        checked += 1
    assert checked >= 5


def scaled(text: str, signal: str, by: float) -> str:
    """Return the database with the scale of a signal multiplied, its offset too."""

    def changed(match: re.Match[str]) -> str:
        return f"{match[1]}({by * float(match[2]):.12g},{by * float(match[3]):.12g})"

    return re.sub(rf"( SG_ {signal} [^(]*)\(([^,]*),([^)]*)\)", changed, text)


@pytest.mark.parametrize(
    ("signal", "by", "said"),
    [
        ("accel_x", 1.0, ""),
        ("accel_x", -1.45, "slope -1.6"),
        ("accel_x", 1 / 9.80665, "it would fit g"),
        ("yaw_rate", 57.29578, "it would fit deg/s"),
    ],
)
def test_a_slope_that_is_not_one_is_reported(drive, signal: str, by: float, said: str) -> None:
    """Beside the 1.12 of the tyres, whose radius is 0.37 m instead of the 0.33 m assumed."""
    warning = proposed(drive, scaled(contract(), signal, by))[signal].warning
    assert (said in warning) if said else not warning


def test_a_zero_error_is_taken_off(drive) -> None:
    """Of an accelerometer that reads 0.45 m/s² too much, upside down; one below 0.05 m/s² is not."""
    text = re.sub(
        r"( SG_ accel_x [^(]*)\(([^,]*),([^)]*)\)",
        lambda m: f"{m[1]}({-float(m[2]):.12g},{-float(m[3]) + 0.45:.12g})",
        contract(),
    )
    right, wrong = proposed(drive, contract())["accel_x"], proposed(drive, text)["accel_x"]
    assert (right.factor, wrong.factor) == (1.0, -1.0)
    assert wrong.offset - right.offset == pytest.approx(0.45, abs=0.06)
    assert abs(right.offset) < 0.1


def series_of(target: str, period: float, gap: float) -> Found:
    t = np.arange(0.0, 10.0, period)
    t[t > 5.0] += gap - period
    one = Series("M", target, "", 0, period, False, t, np.sin(t))
    return Found(target, one, 1.0, 0.0, "", "", True)


@pytest.mark.parametrize(
    ("target", "gap", "expected"),
    [
        ("accel_x", 0.02, None),
        ("accel_x", 0.06, None),
        ("accel_x", 0.10, 0.15),
        ("calliper_pressure_fl", 0.18, 0.30),
        ("calliper_pressure_fl", 3.0, 0.75),
        ("vehicle_speed", 0.20, None),
    ],
)
def test_a_timeout_spans_the_longest_gap(target: str, gap: float, expected: float | None) -> None:
    assert timeout(series_of(target, 0.02, gap)) == expected


def test_a_timeout_is_one_that_a_map_takes() -> None:
    t = np.arange(0.0, 600.0, 50.0)
    ambient = Series("M", "ambient_temperature", "", 0, 50.0, False, t, np.sin(t))
    assert timeout(Found("ambient_temperature", ambient, 1.0, 0.0, "", "", True)) == 60.0


def test_the_faster_of_two_that_follow_equally_well_is_taken(drive) -> None:
    series = read_series([drive], cantools.database.load_string(contract(), "dbc"))
    (own,) = (one for one in series if one.signal == "accel_x")
    slow = own._replace(message="Gateway", t=own.t[::10], value=own.value[::10])
    for order in ([slow, *series], [*series, slow]):
        found, _ = propose(order)
        (taken,) = (one for one in found if one.target == "accel_x")
        assert taken.series.message == "Imu"


TORQUE = {"calliper_pressure_fl": "BrkTot_Tq_Actl", "calliper_pressure_fr": "S2"} | {
    "calliper_pressure_rl": "S3",
    "calliper_pressure_rr": "S4",
}


def test_a_brake_torque_stands_in_for_pressures(drive) -> None:
    """As many bar as give the torque at nominal friction, by the force on the pads and the lever."""
    text = renamed(contract(), **TORQUE)
    text = re.sub(r'( SG_ BrkTot_Tq_Actl .*)"bar"', r'\1"Nm"', text)
    text = re.sub(r'( SG_ S[234] .*)"bar"', r'\1""', text)
    series = read_series([drive], cantools.database.load_string(text, "dbc"))
    found, _ = propose(series)
    assert not [one for one in found if one.target.startswith("calliper")]
    torque = brake_torque(series, motion_of(wheel_speeds(series)))
    assert torque is not None
    assert torque[0].signal == "BrkTot_Tq_Actl"
    config = load_config(resource("config/mustang.toml"))
    pressures = stand_in(torque, new_params(config)[0])
    assert [one.target for one in pressures] == [f"calliper_pressure_{c}" for c in CORNERS]
    total = 0.0
    for one, axle in zip(pressures, (config.front, config.front, config.rear, config.rear), strict=True):
        clamp = axle.pistons * np.pi * (0.5 * axle.piston_diameter) ** 2 * 1e5 * 1000.0 * one.factor
        total += 2.0 * axle.mu_nominal * clamp * axle.effective_radius
    assert total == pytest.approx(1000.0)
    shipped_map = read_signal_map(resource("config/maps/mustang.toml")).inputs
    for one in pressures:
        assert one.factor == pytest.approx(shipped_map[one.target].factor, rel=0.02)


@pytest.mark.drives
def test_the_whole_mustang_gets_what_its_shipped_map_has(drives: Path, tmp_path: Path) -> None:
    log, out = drives / "mustang" / "mustang_s550.candump.log", tmp_path / "map.toml"
    database = resource("dbc/cars/mustang.dbc")
    words = ["map", "suggest", str(log), "--dbc", str(database), "--config", "mustang", "--out", str(out)]
    assert cli.main(words) == 0
    found = read_signal_map(out).inputs
    assert (found["accel_x"].message, found["accel_x"].timeout) == ("BrakeSnData_3", 0.15)
    assert found["accel_x"].offset == pytest.approx(-0.45, abs=0.03)
    assert found["calliper_pressure_fl"].signal == "BrkTot_Tq_Actl"
    assert found["calliper_pressure_rr"].timeout == 0.3


def test_the_written_map_is_one(drive, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = next(LOGS.glob("rav4*.log")), tmp_path / "maps" / "rav4.toml"
    database = resource("dbc/cars/rav4.dbc")
    assert cli.main(["map", "suggest", str(log), "--dbc", str(database), "--out", str(out)]) == 0
    plan = load_signal_map(out).plan
    assert plan.mapped.sum() >= 7
    assert "check every line" in out.read_text(encoding="utf-8")
    assert "written" in capsys.readouterr().err


def test_a_counter_that_starts_again_early_has_a_modulo(drive) -> None:
    """AUTOSAR's counts to 14 in four bits; without a modulo every fifteenth frame would be refused."""
    series = read_series([drive], cantools.database.load_string(contract(), "dbc"))
    found, _ = propose(series)
    text = map_text(found, series, Path("m.toml"), resource("dbc/brake_ecu.dbc"), True, ["can0"], 0, [])
    assert 'counter = { signal = "alive_counter", modulo = 15 }' in text


def test_a_demand_is_no_pressure() -> None:
    target = "calliper_pressure_fl"
    assert score("pressure_demand_fl", target) <= score("calliper_pressure_fl", target) - 3


def test_another_cars_database_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    log = next(LOGS.glob("rav4*.log"))
    assert cli.main(["map", "suggest", str(log), "--dbc", str(resource("dbc/cars/kona.dbc"))]) == 2
    said = capsys.readouterr().err
    assert "names no speed" in said
    assert said.count("brake-ecu: ") == said.count("\n") - said.startswith("reading") == 1
