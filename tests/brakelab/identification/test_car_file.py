"""Configurations that take the rest from another one, which may itself be such a one."""

from pathlib import Path

import pytest

from brakelab.identification.car_file import car_toml
from ecu.settings.config import load_config

CONFIG = Path(__file__).parents[3] / "config"
FITTED = {"front": {"disc_heating": ("3e-4", "fitted")}, "rear": {"disc_cooling": ("2e-3", "fitted")}}


@pytest.mark.parametrize("name", ["suv", "suv-blended", "mustang"])
def test_all_but_the_fitted_keys_are_those_of_the_start(tmp_path, name) -> None:
    start = CONFIG / f"{name}.toml"
    out = tmp_path / "car.toml"
    out.write_text(car_toml(start, out, "# head", FITTED), encoding="utf-8")
    config, before = load_config(out), load_config(start)
    assert config.front.disc_heating == 3e-4
    assert config.rear.disc_cooling == 2e-3
    front = config.front.model_copy(update={"disc_heating": before.front.disc_heating})
    rear = config.rear.model_copy(update={"disc_cooling": before.rear.disc_cooling})
    assert config.model_copy(update={"front": front, "rear": rear}) == before


def test_what_was_identified_before_stays(tmp_path) -> None:
    first, second = tmp_path / "a.toml", tmp_path / "sub" / "b.toml"
    second.parent.mkdir()
    first.write_text(
        f'include = "{CONFIG / "suv.toml"}"\nname = "my \\"car\\""\n[front]\ndisc_heating = 4e-4\n'
        "[front.pad]\ncoefficients = [0.2, 0.0, 1e-6, 0.1, 0.0, 0.0, 0.0]\n",
        encoding="utf-8",
    )
    second.write_text(car_toml(first, second, "# head", FITTED), encoding="utf-8")
    config = load_config(second)
    assert config.name == 'my "car"'
    assert config.front.disc_heating == 3e-4
    assert config.front.pad.coefficients[0] == 0.2
