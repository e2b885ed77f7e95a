"""CONFIG files: the shipped ones against the thesis's tables; every kind of wrong file is one line."""

import math
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ecu.errors import UserError
from ecu.settings.config import config_hash, load_config, new_params, store_key, torque_per_bar

CONFIGS = Path(__file__).parents[3] / "config"
SUV = (CONFIGS / "suv.toml").read_text(encoding="utf-8")

# Tables D.1, D.3, D.4; the track of D.4 (1904 mm) is the overall width, assumed 1.63 m.
TABLES = [
    # name, mass, wheelbase, track, c_d, area, r_eff, mu, d_p: front/rear
    ("suv", 2105, 2.665, 1.625, 0.35, 2.32, (0.1205, 0.1288), (0.45, 0.45), (0.060, 0.034)),
    ("sedan", 2100, 3.070, 1.649, 0.26, 2.54, (0.133, 0.138), (0.43, 0.39), (0.060, 0.042)),
    ("lcv", 1900, 3.000, 1.63, 0.44, 3.1, (0.126, 0.126), (0.42, 0.41), (0.060, 0.041)),
]
# 235/55 R19, 275/40 R19, 255/45 R18: rim radius and section height
TYRES = {"suv": (19, 235, 0.55), "sedan": (19, 275, 0.40), "lcv": (18, 255, 0.45)}


@pytest.mark.parametrize(
    ("name", "mass", "wheelbase", "track", "drag", "area", "radii", "mu", "pistons"),
    TABLES,
    ids=[t[0] for t in TABLES],
)
def test_shipped_configurations_hold_the_numbers_of_the_thesis(
    name, mass, wheelbase, track, drag, area, radii, mu, pistons
) -> None:
    config = load_config(CONFIGS / f"{name}.toml")
    vehicle = config.vehicle
    assert (vehicle.mass, vehicle.wheelbase, vehicle.track) == (mass, wheelbase, track)
    assert (vehicle.drag_coefficient, vehicle.frontal_area) == (drag, area)
    for axle, radius, friction, diameter in zip((config.front, config.rear), radii, mu, pistons, strict=True):
        assert (axle.effective_radius, axle.mu_nominal, axle.piston_diameter) == (radius, friction, diameter)
        assert axle.pistons == 1
        rim, width, aspect = TYRES[name]
        assert axle.unloaded_radius == pytest.approx(0.5 * rim * 0.0254 + 1e-3 * width * aspect, abs=0.003)


def test_sensor_noise_is_that_of_table_4_1() -> None:
    sensors = load_config(CONFIGS / "suv.toml").sensors
    assert (sensors.wheel_speed, sensors.accel, sensors.pressure, sensors.vehicle_speed) == (
        0.1,
        0.01,
        1.8,
        0.027,
    )


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda p: p.stem)
def test_every_shipped_configuration_is_a_car(path: Path) -> None:
    config = load_config(path)
    p = new_params(config)[0]
    assert config.transmit is False, "shipped configurations are shadows"
    assert p["front_axle"] + p["rear_axle"] == pytest.approx(p["wheelbase"])
    assert p["static_load"].sum() == pytest.approx(p["mass"] * 9.81)
    assert (p["wheel_radius"] < p["unloaded_radius"]).all()
    assert (p["wheel_radius"] > 0.95 * p["unloaded_radius"]).all()
    assert p["max_pressure"] <= 180e5
    assert p["max_pressure_rate"] >= 1500e5
    assert pytest.approx(p["min_speed"]) == 15 / 3.6
    for name in p.dtype.names:
        assert np.isfinite(p[name]).all(), name


def test_units_of_params() -> None:
    p = new_params(load_config(CONFIGS / "suv.toml"))[0]
    assert p["piston_area"] == pytest.approx([math.pi * 0.03**2] * 2 + [math.pi * 0.017**2] * 2)
    assert torque_per_bar(p) == pytest.approx([30.663] * 2 + [10.525] * 2, abs=1e-3)  # by hand, N m/bar
    assert p["push_out_pressure"] == pytest.approx([0.5e5] * 4)
    assert p["sigma_pressure"] == pytest.approx(1.8e5)
    assert p["drag_area"] == pytest.approx(0.5 * 1.2 * 0.35 * 2.32)
    assert (p["max_pressure"], p["max_pressure_rate"]) == (180e5, 3000e5)


def change(key: str, value: str | None) -> Callable[[], str]:
    """Return the SUV with a key of a section set to the TOML text `value`, or without it."""

    def text() -> str:
        section, _, name = key.rpartition(".")
        head, mark, rest = SUV.partition(f"[{section}]") if section else ("", "", SUV)
        pattern = rf"(?m)^{name}\s*=.*$"
        new = f"{name} = {value}" if value is not None else ""
        if re.search(pattern, rest):
            rest = re.sub(pattern, new, rest, count=1)
        else:
            rest = f"\n{new}\n{rest}"
        return head + mark + rest

    return text


WRONG = [
    # case, file, what the line must name
    ("missing key", change("vehicle.mass", None), ["vehicle.mass"]),
    ("missing key of an axle", change("rear.mu_nominal", None), ["rear.mu_nominal"]),
    ("unknown key", change("vehicle.colour", '"red"'), ["vehicle.colour"]),
    ("unknown key at the top", change("transmitt", "true"), ["transmitt"]),
    ("text for a number", change("vehicle.mass", '"heavy"'), ["vehicle.mass"]),
    ("list for a number", change("front.mu_nominal", "[0.4, 0.5]"), ["front.mu_nominal"]),
    ("number for a list", change("control.pedal_position", "5.0"), ["control.pedal_position"]),
    ("text for a switch", change("transmit", '"armed"'), ["transmit"]),
    ("half a piston", change("front.pistons", "1.5"), ["front.pistons"]),
    ("negative mass", change("vehicle.mass", "-2105.0"), ["vehicle.mass"]),
    ("mass in tonnes", change("vehicle.mass", "2.105"), ["vehicle.mass"]),
    ("radius in millimetres", change("front.effective_radius", "120.5"), ["front.effective_radius"]),
    ("piston in millimetres", change("rear.piston_diameter", "34"), ["rear.piston_diameter"]),
    ("push-out in Pa", change("front.push_out_pressure", "50000.0"), ["front.push_out_pressure"]),
    *[
        (f"{value} as {key}", change(key, value), [key])
        for value in ("nan", "inf", "-inf")
        for key in ("vehicle.mass", "vehicle.imu_x", "front.wheel_inertia", "vehicle.drag_coefficient")
    ],
    (
        "pedal map with nan",
        change("control.pedal_decel", "[0, 0, 0.8, nan, 4, 6.6, 10]"),
        ["control.pedal_decel"],
    ),
    (
        "pedal map with inf",
        change("control.pedal_decel", "[0, 0, 0.8, 2, 4, 6.6, inf]"),
        ["control.pedal_decel"],
    ),
    (
        "pedal map that falls",
        change("control.pedal_decel", "[0, 0, 0.8, 2.1, 1.0, 6.6, 10]"),
        ["control.pedal_decel"],
    ),
    (
        "positions that fall",
        change("control.pedal_position", "[0, 5, 20, 10, 60, 80, 100]"),
        ["pedal_position"],
    ),
    ("a position twice", change("control.pedal_position", "[0, 5, 20, 20, 60, 80, 100]"), ["pedal_position"]),
    (
        "negative deceleration",
        change("control.pedal_decel", "[-1, 0, 0.8, 2.1, 4, 6.6, 10]"),
        ["pedal_decel"],
    ),
    (
        "a pedal at rest that brakes",
        change("control.pedal_decel", "[0.1, 0.2, 0.8, 2, 4, 6, 9]"),
        ["pedal_decel"],
    ),
    (
        "no such distribution",
        change("control.distribution", '"best"'),
        ["control.distribution", "'electronic'"],
    ),
    ("fixed without a share", change("control.distribution", '"fixed"'), ["control", "front_share"]),
    ("ideal with a share", change("control.front_share", "0.7"), ["control", "front_share"]),
    ("half laden", change("vehicle.laden_cog_height", None), ["vehicle", "laden_mass"]),
    ("laden and lighter", change("vehicle.laden_mass", "2000.0"), ["vehicle", "laden_mass"]),
    ("maps of unlike length", change("control.pedal_decel", "[0, 10]"), ["control", "pedal_decel"]),
    ("one point", change("control.pedal_decel", "[0]"), ["control.pedal_decel"]),
    ("nine points", change("control.pedal_position", "[0,1,2,3,4,5,6,7,8]"), ["control.pedal_position"]),
    ("axle behind the car", change("vehicle.front_axle", "3.0"), ["vehicle.front_axle"]),
    ("a slow limiter", change("control.max_pressure_rate", "1000.0"), ["control.max_pressure_rate"]),
    ("a ceiling beyond 180 bar", change("control.max_pressure", "200.0"), ["control.max_pressure"]),
    ("a pedal that never brakes", change("control.pedal_decel", "[0,0,0,0,0,0,0]"), ["pedal_decel", "half"]),
    ("a pedal of 1e-6", change("control.pedal_decel", "[0,0,0,0,0,0,1e-6]"), ["pedal_decel", "1 m/s^2"]),
    (
        "a pedal from 99 %",
        change("control.pedal_position", "[94,95,96,97,98,99,100]"),
        ["pedal_decel", "per %"],
    ),
    (
        "a pedal to 1000 %",
        change("control.pedal_position", "[0,5,20,40,60,80,1000]"),
        ["pedal_position.7", "100"],
    ),
    ("a pedal for 1e9", change("control.pedal_decel", "[0,0,1,2,4,6,1e9]"), ["pedal_decel.7", "at most 12"]),
    (
        "a pedal that is a switch",
        change("control.pedal_decel", "[0,5.1,6,7,8,9,10]"),
        ["pedal_decel", "per %"],
    ),
    ("a rise in no time", change("control.max_pressure_rate", "1e9"), ["control.max_pressure_rate", "18000"]),
    ("laden behind the car", change("vehicle.laden_front_axle", "3.0"), ["vehicle.laden_front_axle"]),
    ("a name of 1 MB", change("name", f'"{"x" * 1_000_000}"'), ["name", "at most 100 characters"]),
    ("a name that is not printed", lambda: SUV.replace('"suv"', r'"a\u0000b"'), ["name", "printable"]),
    (
        "a lining that is worn at once",
        change("rear.pad.coefficients", "[1e300,0,0,0,0,0,0]"),
        ["coefficients"],
    ),
    ("no section", lambda: SUV.replace("[rear]", "[back]"), ["back: unknown key", "1 more)"]),
    ("a section that is a number", lambda: "vehicle = 3\n" + SUV.split("[vehicle]")[0], ["vehicle"]),
    ("not TOML", lambda: SUV + "\n[[[", ["TOML"]),
    ("sensor noise in Pa", change("sensors.pressure", "180000.0"), ["sensors.pressure", "bar"]),
    ("YAML", lambda: "name: suv\nvehicle:\n  mass: 2105\n", ["TOML", "line 1"]),
    ("5,000 hex digits", change("vehicle.mass", "0x" + 5_000 * "f"), ["vehicle.mass", "thousands of digits"]),
    ("a text of 100 kB", change("vehicle.mass", '"' + 100_000 * "x" + '"'), ["vehicle.mass", "xxx…"]),
    ("a key twice", lambda: SUV + "\npedal_position = [0.0, 1.0]\n", ["TOML"]),
    ("empty", lambda: "", ["name"]),
]


def test_the_mark_of_a_windows_editor_is_no_mistake(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text(SUV, encoding="utf-8-sig")
    assert load_config(path).vehicle.mass == 2105.0


@pytest.mark.parametrize(("case", "text", "names"), WRONG, ids=[row[0] for row in WRONG])
def test_a_wrong_file_is_one_line_that_names_file_and_key(tmp_path: Path, case, text, names) -> None:
    path = tmp_path / "car.toml"
    path.write_text(text(), encoding="utf-8")
    with pytest.raises(UserError) as caught:
        load_config(path)
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 400
    for name in ["car.toml", *names]:
        assert name in line, line


def test_the_untouched_file_is_right(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text(SUV, encoding="utf-8")
    assert load_config(path) == load_config(CONFIGS / "suv.toml")


@pytest.mark.parametrize(
    "make",
    [
        lambda path: None,
        lambda path: path.mkdir(),
        lambda path: path.write_bytes(bytes(range(256)) * 8),
        lambda path: path.write_bytes(SUV.encode("utf-16")),
        lambda path: path.symlink_to(path),
        lambda path: path.symlink_to("/dev/zero"),
        os.mkfifo,
        lambda path: path.write_text(f"a = {'[' * 20_000}{']' * 20_000}"),
        lambda path: path.write_text(f"mass = {'9' * 5_000}"),
        lambda path: path.write_text("#" * (17 << 20)),
    ],
    ids=[
        *("missing", "directory", "binary", "UTF-16", "endless link"),
        *("endless file", "fifo", "nested 20,000 deep", "5,000 digits", "17 MB"),
    ],
)
def test_what_is_no_readable_file_is_one_line(tmp_path: Path, make) -> None:
    path = tmp_path / "car.toml"
    make(path)
    with pytest.raises(UserError) as caught:
        load_config(path)
    assert "car.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_hash_follows_what_changes_results_and_nothing_else(tmp_path: Path) -> None:
    def of(text: str):
        path = tmp_path / "car.toml"
        path.write_text(text, encoding="utf-8")
        return load_config(path)

    suv = of(SUV)
    armed, heavy = of(change("transmit", "true")()), of(change("vehicle.mass", "2200.0")())
    bigger = of(change("front.piston_diameter", "0.061")())
    commented = of("# another comment\n" + SUV)
    assert config_hash(suv) == config_hash(armed) == config_hash(commented)
    assert len({config_hash(c) for c in (suv, heavy, bigger)}) == 3
    assert store_key(suv) == store_key(heavy) == store_key(armed)
    assert store_key(suv) != store_key(bigger), "another brake has another friction"
    hotter = of(change("front.disc_heating", "3e-4")())
    assert config_hash(suv) != config_hash(hotter)
    assert store_key(suv) == store_key(hotter), "a lining's friction is not that of its disc's model"


@pytest.mark.parametrize(
    ("own", "expected"),
    [
        ("", (1.792e-3, 1.5 * 9.108e-5)),
        ("disc_cooling_wet = 2.5e-3\n", (2.5e-3, 1.5 * 9.108e-5)),
        ("disc_cooling_by_speed_wet = 3e-4\n", (1.792e-3, 3e-4)),
    ],
)
def test_rain_cools_as_given_or_by_half_more_at_speed(tmp_path: Path, own, expected) -> None:
    path = tmp_path / "car.toml"
    path.write_text(f'include = "{CONFIGS / "suv.toml"}"\n[front]\n{own}', encoding="utf-8")
    row = new_params(load_config(path))[0]
    found = row["disc_cooling_wet"][0], row["disc_cooling_by_speed_wet"][0]
    assert found == pytest.approx(expected)
    assert row["disc_cooling_wet"][2] == row["disc_cooling"][2]
    assert (row["sigma_disc_heating"][0], row["sigma_disc_cooling"][0]) == (0.10, 0.20)
    assert row["sigma_disc_cooling_wet"][0] == 0.40


PLAIN = [
    # key, value, what the line says of it
    ("vehicle.mass", '"heavy"', "give a number (found 'heavy')"),
    ("vehicle.mass", "-3.0", "give a value above 200 kg (found -3.0)"),
    ("vehicle.mass", "nan", "give a finite number (found nan)"),
    ("vehicle.rolling_resistance", "-0.1", "give a value of at least 0 (found -0.1)"),
    ("front.pistons", "1.5", "give a whole number (found 1.5)"),
    ("front.pistons", "13", "give a value of at most 12 (found 13)"),
    ("transmit", '"armed"', "give true or false (found 'armed')"),
    ("name", "3", 'give a text in "quotes" (found 3)'),
    ("control.pedal_position", "5.0", "give a list in [brackets] (found 5.0)"),
    ("control.pedal_decel", "[0]", "give at least 2 values (found [0])"),
    ("control.pedal_decel", "[2, 1]", "must rise from zero or more (found [2, 1])"),
]


@pytest.mark.parametrize(("key", "value", "said"), PLAIN, ids=[f"{row[0]} = {row[1]}" for row in PLAIN])
def test_what_is_right_is_said_in_plain_words(tmp_path: Path, key: str, value: str, said: str) -> None:
    path = tmp_path / "car.toml"
    path.write_text(change(key, value)(), encoding="utf-8")
    with pytest.raises(UserError) as caught:
        load_config(path)
    assert f"{key}: {said}" in str(caught.value)


def test_a_folder_is_answered_with_what_is_wanted(tmp_path: Path) -> None:
    with pytest.raises(UserError) as caught:
        load_config(tmp_path)
    assert str(caught.value) == f"{tmp_path}: is a folder; give a TOML file"


MERGED = [
    # the car's own [observer], the included file, mu_drift and omega_walk of both (shipped: 0.02 and 2.0)
    ("", "[observer]\nmu_drift = 0.05", (0.05, 2.0)),
    ("[observer]\nomega_walk = 4.0\n", "[observer]\nmu_drift = 0.05", (0.05, 4.0)),
    ("[observer]\nmu_drift = 0.01\n", "[observer]\nmu_drift = 0.05\nomega_walk = 4.0", (0.01, 4.0)),
    ("", "", (0.02, 2.0)),
]


@pytest.mark.parametrize(("own", "included", "expected"), MERGED)
def test_an_included_file_gives_what_the_car_does_not_give_itself(
    tmp_path: Path, own: str, included: str, expected: tuple[float, float]
) -> None:
    (tmp_path / "tuned.toml").write_text(included, encoding="utf-8")
    path = tmp_path / "car.toml"
    path.write_text(f'include = "tuned.toml"\n{SUV}\n{own}', encoding="utf-8")
    config = load_config(path)
    assert (config.observer.mu_drift, config.observer.omega_walk) == expected
    assert config.vehicle == load_config(CONFIGS / "suv.toml").vehicle


def test_the_hash_is_that_of_the_merged_content(tmp_path: Path) -> None:
    drift = "[observer]\nmu_drift = 0.05\n"
    (tmp_path / "tuned.toml").write_text(drift, encoding="utf-8")
    for name, text in (("with", f'include = "tuned.toml"\n{SUV}'), ("whole", f"{SUV}\n{drift}")):
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    merged, whole = (load_config(tmp_path / f"{name}.toml") for name in ("with", "whole"))
    assert config_hash(merged) == config_hash(whole) != config_hash(load_config(CONFIGS / "suv.toml"))


def test_a_shipped_car_is_included_by_its_name_but_for_a_file_of_that_name(tmp_path: Path) -> None:
    car = tmp_path / "car.toml"
    car.write_text('include = "suv"\nname = "mine"\n', encoding="utf-8")
    assert load_config(car).vehicle == load_config(CONFIGS / "suv.toml").vehicle
    (tmp_path / "suv").write_text((CONFIGS / "lcv.toml").read_text("utf-8"), encoding="utf-8")
    assert load_config(car).vehicle == load_config(CONFIGS / "lcv.toml").vehicle


WRONG_INCLUDES = [
    # include, content of the included file, the line
    ('"nosuch.toml"', "", "nosuch.toml: no such file"),
    ('"."', "", "is a folder"),
    ('"/dev/zero"', "", "/dev/zero: is no regular file; give a TOML file"),
    ('"a\\u0000b"', "", "cannot be read as text: embedded null"),
    ('""', "", 'car.toml: include: give the name of a TOML file in "quotes"'),
    ("3", "", 'car.toml: include: give the name of a TOML file in "quotes"'),
    ('"tuned.toml"', "[[[", "tuned.toml: not valid TOML"),
    ('"tuned.toml"', 'include = "car.toml"', "tuned.toml: include: an included file includes no other"),
    ('"tuned.toml"', "[observer]\nmu_drift = -1", "tuned.toml: observer.mu_drift: give a value above 0"),
    ('"tuned.toml"', "[observer]\nmu_drfit = 1", "tuned.toml: observer.mu_drfit: unknown key"),
    ('"tuned.toml"', "observer = 3", "tuned.toml: observer: give a table"),
]


@pytest.mark.parametrize(("include", "content", "line"), WRONG_INCLUDES)
def test_a_wrong_include_is_one_line_that_names_the_file_at_fault(
    tmp_path: Path, include: str, content: str, line: str
) -> None:
    (tmp_path / "tuned.toml").write_text(content, encoding="utf-8")
    (tmp_path / "car.toml").write_text(f"include = {include}\n{SUV}", encoding="utf-8")
    with pytest.raises(UserError) as caught:
        load_config(tmp_path / "car.toml")
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_the_car_itself_has_wrong_is_not_blamed_on_the_included_file(tmp_path: Path) -> None:
    (tmp_path / "tuned.toml").write_text("[vehicle]\nmass = 2000.0\n", encoding="utf-8")
    path = tmp_path / "car.toml"
    path.write_text(f'include = "tuned.toml"\n{change("vehicle.mass", "1.0")()}', encoding="utf-8")
    with pytest.raises(UserError, match=r"car\.toml: vehicle\.mass: give a value above 200 kg"):
        load_config(path)
