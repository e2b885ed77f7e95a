"""What a map says of the wheels beside what a configuration says of them."""

from pathlib import Path

import pytest

from brakelab.api import load
from brakelab.replay.source import announced, delay_line, load_source, radius_line
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

PARAMS = new_params(load_config(resource("config/suv.toml")))[0]
MUSTANG = resource("config").parent / "tests/data/mustang.log"
ROLLS = float(PARAMS["wheel_radius"].mean())


@pytest.mark.parametrize(("share", "off"), [(0.91, "+10 %"), (1.0, ""), (1.012, ""), (1.1, "-9 %")])
def test_a_rolling_radius_that_is_not_the_cars_is_reported(tmp_path: Path, share: float, off: str) -> None:
    """Speeds in km/h would come out wrong by as much, and friction with them."""
    text = resource("config/maps/rav4.toml").read_text("utf-8")
    text = text.replace("../../dbc/cars", str(resource("dbc/cars/rav4.dbc").parent))
    map = tmp_path / "map.toml"
    map.write_text(text.replace("rolling_radius = 0.352", f"rolling_radius = {share * ROLLS:.5f}"), "utf-8")
    line = radius_line(map, load_source(map), PARAMS)
    assert (off in line and f"give {ROLLS:.4g}" in line) if off else not line


def test_wheels_in_rad_per_s_need_no_radius() -> None:
    map = resource("config/maps/mustang.toml")
    assert not radius_line(map, load_source(map), PARAMS)
    assert not radius_line(None, load_source(None), PARAMS)


def test_mistakes_that_the_map_does_not_meet_are_reported_once_and_by_who_reads_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = resource("dbc/cars/mustang.dbc").read_text("utf-8")
    overlapping = (
        'BO_ 2000 Radio: 8 X\n SG_ Volume : 0|8@1+ (1,0) [0|0] "" X\n SG_ Band : 4|8@1+ (1,0) [0|0] "" X\n'
    )
    database = tmp_path / "car.dbc"
    database.write_text(f"{text}\n{overlapping}", "utf-8")
    map = tmp_path / "map.toml"
    shipped = resource("config/maps/mustang.toml").read_text("utf-8")
    map.write_text(shipped.replace("../../dbc/cars/mustang.dbc", "car.dbc"), "utf-8")
    source = load_source(map)
    assert capsys.readouterr() == ("", "")  # of Python nothing is printed
    assert announced(source) is source
    said = capsys.readouterr().err
    assert said == f"{source.left_out}\n"
    assert said.endswith("1 message left out, which the map does not use\n")
    assert load(MUSTANG, map=map).notes[0] == source.left_out


@pytest.mark.parametrize(
    ("lag", "delay", "reported"), [(0.2, 0.1, True), (0.2, 0.0, False), (0.0, 0.1, False)]
)
def test_a_lag_beside_that_of_the_car_is_reported(
    tmp_path: Path, lag: float, delay: float, reported: bool
) -> None:
    map = tmp_path / "map.toml"
    map.write_text(f'[inputs]\nvehicle_speed = {{ column = "v", lag = {lag} }}\n')
    params = new_params(load_config(resource("config/suv.toml")))
    params["vehicle_speed_delay"] = delay
    line = delay_line(load_source(map), params[0])
    assert ("inputs.vehicle_speed.lag: 0.2 s beside 0.1 s" in line) == reported
    assert bool(line) == reported


def test_the_shipped_van_rolls_as_the_shipped_configuration_of_one() -> None:
    map = resource("config/maps/van.toml")
    assert not radius_line(map, load_source(map), new_params(load_config(resource("config/lcv.toml")))[0])
