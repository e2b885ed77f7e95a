"""A stop short enough to be driven again and again."""

from pathlib import Path

import pytest

from brakelab.simulation.configured import with_observer
from ecu.settings.config import Config, load_config
from ecu.settings.resources import resource

STOP = """
plant = "suv"
draw = "nominal"
initial_speed = 15.0
phase = [
    { kind = "cruise", speed = 15.0, seconds = 1.0 },
    { kind = "brake", decel = 4.0, seconds = 1.5 },
    { kind = "cruise", speed = 11.0, seconds = 1.0 },
    { kind = "brake", decel = 5.0, until_speed = 0.0 },
]
"""


@pytest.fixture
def stop(tmp_path: Path) -> Path:
    """Two applications between 15 m/s and standstill, 6 s."""
    path = tmp_path / "stop.toml"
    path.write_text(STOP, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def manual() -> Config:
    """The SUV with Observer 2 as it is shipped."""
    return with_observer(load_config(resource("config/suv.toml")), kind="observer2")
