"""What a map says of the wheels beside what a configuration says of them."""

from pathlib import Path

import pytest

from brakelab.replay.source import load_source, radius_line
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

PARAMS = new_params(load_config(resource("config/suv.toml")))[0]
ROLLS = float(PARAMS["wheel_radius"].mean())


@pytest.mark.parametrize(("share", "told"), [(0.91, "+10 %"), (1.0, ""), (1.012, ""), (1.1, "-9 %")])
def test_a_rolling_radius_that_is_not_the_cars_is_told(tmp_path: Path, share: float, told: str) -> None:
    """Speeds in km/h would come out wrong by as much, and friction with them."""
    text = resource("config/maps/rav4.toml").read_text("utf-8")
    text = text.replace("../../dbc/cars", str(resource("dbc/cars/rav4.dbc").parent))
    map = tmp_path / "map.toml"
    map.write_text(text.replace("rolling_radius = 0.352", f"rolling_radius = {share * ROLLS:.5f}"), "utf-8")
    line = radius_line(map, load_source(map), PARAMS)
    assert (told in line and f"give {ROLLS:.4g}" in line) if told else not line


def test_wheels_in_rad_per_s_need_no_radius() -> None:
    map = resource("config/maps/mustang.toml")
    assert not radius_line(map, load_source(map), PARAMS)
    assert not radius_line(None, load_source(None), PARAMS)
