"""An ECU and a vehicle as FMUs, unpacked and loaded."""

import platform
from collections.abc import Callable

import pytest

from brakelab.fmu.command import write_ecu, write_vehicle
from brakelab.fmu.description import Version
from ecu import jit
from ecu.building.c_compiler import compiler
from ecu.settings.resources import resource

from .master import Fmu

Make = Callable[..., Fmu]


@pytest.fixture(scope="session", autouse=True)
def _kernels() -> None:
    if jit.interprets():
        pytest.skip("kernels run as plain Python")
    if compiler() is None:
        pytest.skip("no C compiler")
    for module in ("ecu.algorithm.step", "brakelab.fmu.vehicle_cycle"):
        if jit.library_of(module) is None:
            pytest.skip(f"the library of {module} is missing or of another text: python -m brakelab.build")


def skip_other_machines(version: Version) -> None:
    if version == 2 and platform.machine() != "x86_64":
        pytest.skip("FMI 2.0 has a name for x86-64 alone")


@pytest.fixture(scope="session")
def make_ecu(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Return the ECU of a shipped configuration."""

    def make(config: str, version: Version = 3) -> Fmu:
        skip_other_machines(version)
        folder = tmp_path_factory.mktemp("ecu")
        write_ecu(resource(f"config/{config}.toml"), folder / "ecu.fmu", version)
        return Fmu(folder / "ecu.fmu", folder / "unpacked")

    return make


@pytest.fixture(scope="session")
def make_vehicle(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Return the vehicle of a shipped scenario, of seed 0."""

    def make(scenario: str, version: Version = 3) -> Fmu:
        skip_other_machines(version)
        folder = tmp_path_factory.mktemp("vehicle")
        path = resource(f"config/scenarios/{scenario}.toml")
        write_vehicle(path, None, folder / "vehicle.fmu", 0, None, None, version)
        return Fmu(folder / "vehicle.fmu", folder / "unpacked")

    return make


@pytest.fixture(scope="session")
def suv(make_ecu: Make) -> Fmu:
    return make_ecu("suv")


@pytest.fixture(scope="session")
def stop(make_vehicle: Make) -> Fmu:
    """4 m/s² from 120 km/h to rest, on a dry road."""
    return make_vehicle("stop-1")


@pytest.fixture(scope="session")
def suv_2(make_ecu: Make) -> Fmu:
    """Of FMI 2.0."""
    return make_ecu("suv", 2)


@pytest.fixture(scope="session")
def stop_2(make_vehicle: Make) -> Fmu:
    """Of FMI 2.0."""
    return make_vehicle("stop-1", 2)
