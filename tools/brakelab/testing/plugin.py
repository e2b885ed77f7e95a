"""Fixtures: `ecu` and `plant`, which `plant.drive` drives together; `daemon`, a process of its own.

pytest loads this module in every run where the laboratory is installed; so it imports what it needs in the
fixtures that are asked for.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from brakelab.testing.daemon import Daemon
    from brakelab.testing.drive import Ecu, Plant


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known."""
    config.addinivalue_line(
        "markers", "real_time: `ecu` and `plant` are processes on a bus, not one loop in memory"
    )


@pytest.fixture
def ecu_config() -> str | Path:
    """CONFIG of `ecu`, a file or a shipped name; a fixture of that name in conftest.py gives another one."""
    return "suv"


@pytest.fixture
def ecu(ecu_config: str | Path) -> "Ecu":
    """The ECU of `ecu_config`, armed."""
    from brakelab.testing.drive import Ecu

    return Ecu(ecu_config)


@pytest.fixture
def plant(ecu: "Ecu", request: pytest.FixtureRequest, tmp_path: Path) -> "Plant":
    """The simulated car that `ecu` brakes; with the marker `real_time` on a bus, else in memory."""
    from brakelab.testing.drive import Plant

    return Plant(ecu, tmp_path if request.node.get_closest_marker("real_time") else None)


@pytest.fixture
def daemon() -> "Iterator[Callable[..., Daemon]]":
    """Start `brake-ecu run` with the arguments given; no daemon outlives the test."""
    from brakelab.testing.daemon import Daemon

    started: list[Daemon] = []

    def start(*arguments: object, **more: Any) -> Daemon:
        started.append(Daemon(*arguments, **more))
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            one.process.kill()
        one.process.wait()
