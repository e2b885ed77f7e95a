"""`brake-ecu fmu ecu|vehicle`: write an FMU, a library of C over the compiled kernels in a zip file."""

import platform
import tempfile
import zipfile
from pathlib import Path
from typing import Final

from brakelab.fmu.description import Version, model_description
from brakelab.fmu.ecu_unit import ecu_unit
from brakelab.fmu.source import c_source
from brakelab.fmu.unit import Unit
from brakelab.fmu.vehicle_unit import vehicle_unit
from brakelab.results.outputs import whole
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.scenario_car import with_car, with_draw
from ecu.building.c_compiler import compile_shared
from ecu.errors import UserError
from ecu.library import BASELINE, V3
from ecu.output import give, wrote
from ecu.settings.config import load_config
from ecu.settings.resources import command_name

OPTIONS: Final = ("-std=c11", "-ffp-contract=off", "-ldl", "-lm")
SUFFIX: Final = ".fmu"
ZIP_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
"""Earliest time of a zip file, that of every entry: the same unit gives the same bytes."""


def write_ecu(config: Path, out: Path, version: Version = 3) -> None:
    """Write the ECU of a configuration for a version of FMI.

    Raises:
        UserError: the configuration is wrong, the compiled library is not there, there is no C compiler, or
            `out` cannot be written.
    """
    write_fmu(ecu_unit(load_config(config)), out, version)


def write_vehicle(
    scenario: Path,
    config: Path | None,
    out: Path,
    seed: int,
    draw: str | None,
    plant: str | None,
    version: Version = 3,
) -> None:
    """Write the simulated vehicle of a scenario.

    `config` is the car of the plant "as-config", and of no other.

    Raises:
        UserError: as `write_ecu`, of the scenario; "as-config" without `config`, or this without that.
    """
    driven = load_scenario(scenario)
    if draw is not None:
        driven = with_draw(driven, draw)
    with tempfile.TemporaryDirectory(prefix="brake-ecu-") as folder:
        driven = with_car(driven, plant, config, Path(folder))
        write_fmu(vehicle_unit(driven, seed, command_name(scenario)), out, version)


def write_fmu(unit: Unit, out: Path, version: Version) -> None:
    """Write an FMU.

    Raises:
        UserError: there is no C compiler, `out` is not named as an FMU or cannot be written, or this version
            of FMI has no name for this processor.
    """
    machine = platform.machine()
    if version == 2 and machine != "x86_64":
        raise UserError("--fmi", "2", f"has no name for {machine}; take 3")
    if out.suffix != SUFFIX:
        raise UserError(str(out), "", f"importers know an FMU by its name; end it with {SUFFIX}")
    library = unit.calls[0].library
    known = library.manifest["processors"]
    kernels = {name: known[name] for name in (V3, BASELINE[machine]) if name in known}
    token, text = c_source(unit, kernels, version)
    with tempfile.TemporaryDirectory(prefix="brake-ecu-") as folder:
        source, shared = Path(folder, f"{unit.name}.c"), Path(folder, f"{unit.name}.so")
        source.write_text(text, "utf-8")
        compile_shared((source,), OPTIONS, shared)
        binaries = "binaries/linux64" if version == 2 else f"binaries/{machine}-linux"
        files = {
            "modelDescription.xml": model_description(unit, token, version),
            f"{binaries}/{shared.name}": shared.read_bytes(),
            **{f"{binaries}/{file}": (library.folder / file).read_bytes() for file in kernels.values()},
            "resources/origin.json": unit.origin.encode(),
        }
    with whole(out) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as fmu:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, ZIP_EPOCH)
            entry.external_attr = (0o755 if name.endswith(".so") else 0o644) << 16
            fmu.writestr(entry, content, zipfile.ZIP_DEFLATED)
    give(processors=list(kernels), variables=len(unit.variables))
    wrote(out)
