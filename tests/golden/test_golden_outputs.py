"""Every output of the ECU in six armed closed loops and on three recorded drives, as committed.

`outputs.csv` has a line for each output: a hash of its bits and six of its values. Bits are compared where
processor and libraries are those they were written with (`made_on.json`), values everywhere: to 1e-6, in
scenarios where a wheel slides to 1e-3. See README.md for an intended change.
"""

from pathlib import Path

import numpy as np
import pytest

from brakelab.replay.command import replay
from brakelab.results.files import brakes_path, read_result
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import load_scenario
from ecu.contract.signals import OUTPUT_COLUMNS
from ecu.settings.config import load_config
from ecu.settings.resources import resource

from .reference import check

LOOPS = {
    # scenario: configuration, relative tolerance of the values
    "single": ("suv", 1e-6),
    "hand-over": ("suv-blended", 1e-6),
    "stop-3": ("sedan", 1e-6),
    "low-grip": ("suv", 1e-3),
    "split": ("suv", 1e-3),
    "faults/circuit-dead-diagonal": ("suv", 1e-6),
}
DRIVES = {
    "mustang": ("mustang/mustang_s550.candump.log", "mustang"),
    "kona": ("kona/kona.candump.log", "suv"),
    "rav4": ("rav4/rav4_bus0_bus1.candump.log", "suv"),
}
CAR = 7


def outputs(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: columns[name] for name in OUTPUT_COLUMNS if name in columns}


@pytest.mark.parametrize("name", LOOPS)
def test_a_closed_loop_gives_the_committed_outputs(name: str) -> None:
    config, relative = LOOPS[name]
    scenario = load_scenario(resource(f"config/scenarios/{name}.toml"))
    drive = run(new_loop(scenario, load_config(resource(f"config/{config}.toml")), CAR))
    check(name, outputs(drive.outputs), relative)


@pytest.mark.drives
@pytest.mark.parametrize("name", DRIVES)
def test_a_recorded_drive_gives_the_committed_outputs(name: str, drives: Path, tmp_path: Path) -> None:
    log, config = DRIVES[name]
    out, maps = tmp_path / "out.parquet", resource(f"config/maps/{name}.toml")
    replay([drives / log], resource(f"config/{config}.toml"), maps, None, None, out)
    check(name, outputs(read_result(out).columns), 1e-6)
    check(f"{name}, brakes", read_result(brakes_path(out)).columns, 1e-6)
