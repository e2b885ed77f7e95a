"""docs/identify-vehicle.md: its commands run as they stand, and what it names is there."""

import re
from pathlib import Path

import pytest

from ecu.cli import main
from ecu.settings.config import load_config

from .example import SUV

pytestmark = pytest.mark.study

PAGE = (Path(__file__).parents[4] / "docs/identify-vehicle.md").read_text("utf-8")
BLOCKS = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)


def test_the_commands_without_a_car_run(tmp_path, monkeypatch, capsys):
    (block,) = [block for block in BLOCKS if "simulate" in block]
    monkeypatch.chdir(tmp_path)
    for line in block.splitlines():
        assert main(line.split()[1:]) == 0
    car = load_config(tmp_path / "out/car.toml")
    assert car.vehicle.drag_coefficient != load_config(SUV).vehicle.drag_coefficient
    assert (tmp_path / "out/car.md").is_file()
    assert "next: brake-ecu replay out/identify.parquet --config out/car.toml" in capsys.readouterr().err


@pytest.mark.parametrize("key", re.findall(r"^\| `(\w+)`(?:, `\w+`)? \|", PAGE, re.MULTILINE))
def test_keys_of_the_page_are_keys_of_a_configuration(key):
    config = load_config(SUV)
    sections = config.vehicle, config.front, config.sensors
    assert any(key in type(section).model_fields for section in sections), key
