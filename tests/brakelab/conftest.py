"""A simulated stop and its result, for what is asked of the Python interface."""

import pytest

from brakelab.api import Result, Simulation, replay, simulate


@pytest.fixture(scope="session")
def drive() -> Simulation:
    return simulate("stop-1", config="suv")


@pytest.fixture(scope="session")
def result(drive: Simulation) -> Result:
    return replay(drive.log, config="suv")
