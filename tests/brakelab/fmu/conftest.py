"""An ECU and a vehicle as FMUs, unpacked and loaded."""

from collections.abc import Callable
from pathlib import Path

import pytest

from brakelab.fmu.command import write_ecu, write_vehicle
from ecu import jit
from ecu.building.c_compiler import compiler
from ecu.settings.resources import resource

from .master import Fmu

Make = Callable[[str], Fmu]


@pytest.fixture(scope="session", autouse=True)
def _kernels() -> None:
    if compiler() is None:
        pytest.skip("no C compiler")
    for module in ("ecu.algorithm.step", "brakelab.fmu.vehicle_cycle"):
        if jit.library_of(module) is None:
            pytest.skip(f"the library of {module} is missing or of another text: python -m brakelab.build")


@pytest.fixture(scope="session")
def make_ecu(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Return the ECU of a shipped configuration."""

    def make(config: str) -> Fmu:
        folder = tmp_path_factory.mktemp("ecu")
        write_ecu(resource(f"config/{config}.toml"), folder / "ecu.fmu")
        return Fmu(folder / "ecu.fmu", folder / "unpacked")

    return make


@pytest.fixture(scope="session")
def make_vehicle(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Return the vehicle of a shipped scenario, of seed 0."""

    def make(scenario: str) -> Fmu:
        folder = tmp_path_factory.mktemp("vehicle")
        path: Path = resource(f"config/scenarios/{scenario}.toml")
        write_vehicle(path, None, folder / "vehicle.fmu", 0, None, None)
        return Fmu(folder / "vehicle.fmu", folder / "unpacked")

    return make


@pytest.fixture(scope="session")
def suv(make_ecu: Make) -> Fmu:
    return make_ecu("suv")


@pytest.fixture(scope="session")
def stop(make_vehicle: Make) -> Fmu:
    """4 m/s² from 120 km/h to rest, on a dry road."""
    return make_vehicle("stop-1")
