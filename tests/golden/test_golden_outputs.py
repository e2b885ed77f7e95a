"""Every output of the ECU in six armed closed loops and on three recorded drives, as committed.

`outputs.csv` has a line for each output: a hash of its bits and six of its values. Bits are compared where
processor and libraries are those they were written with (`made_on.json`), values everywhere: to 1e-6, in
scenarios where a wheel slides to 1e-3. See README.md for an intended change.
"""

import csv
import hashlib
import json
import os
import platform
from pathlib import Path

import numba
import numpy as np
import pytest

from brakelab.replay.command import replay
from brakelab.results.files import read_result
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import load_scenario
from ecu.contract.signals import OUTPUT_COLUMNS
from ecu.settings.config import load_config
from ecu.settings.resources import resource

HERE = Path(__file__).parent
REFERENCE, MADE_ON = HERE / "outputs.csv", HERE / "made_on.json"
UPDATE = os.environ.get("BRAKE_ECU_UPDATE_GOLDEN") == "1"
SAMPLES = 6
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


def machine() -> dict[str, str]:
    """Return what may round differently."""
    info = Path("/proc/cpuinfo").read_text().splitlines()
    flags = sorted(next((line for line in info if line.startswith("flags")), "").split())
    return {
        "processor": hashlib.sha256(" ".join(flags).encode()).hexdigest()[:12],
        "libc": "-".join(platform.libc_ver()),
        "numba": numba.__version__,
        "numpy": np.__version__,
    }


def lines_of(columns: dict[str, np.ndarray]) -> dict[str, list[str]]:
    """Return hash and values of each output."""
    found = {}
    for name in filter(columns.__contains__, OUTPUT_COLUMNS):
        values = np.array(columns[name], np.float64)
        values[np.isnan(values)] = np.nan  # one NaN, whatever its payload
        places = np.linspace(0, len(values) - 1, SAMPLES + 2).round().astype(int)[1:-1]
        bits = hashlib.sha256((values + 0.0).tobytes()).hexdigest()[:12]
        found[name] = [bits, *(f"{values[place]:.9g}" for place in places)]
    return found


def committed(name: str) -> dict[str, list[str]]:
    with REFERENCE.open(newline="") as file:
        return {row[1]: row[2:] for row in csv.reader(file) if row[0] == name}


def write(name: str, found: dict[str, list[str]]) -> None:
    """Replace the lines of one run."""
    others = []
    if REFERENCE.exists():
        with REFERENCE.open(newline="") as file:
            others = [row for row in csv.reader(file) if row[0] != name]
    rows = others + [[name, column, *cells] for column, cells in found.items()]
    with REFERENCE.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(sorted(rows, key=lambda row: row[0]))
    MADE_ON.write_text(json.dumps(machine(), indent=1) + "\n")


def check(name: str, columns: dict[str, np.ndarray], relative: float) -> None:
    found = lines_of(columns)
    if UPDATE:
        write(name, found)
        return
    expected = committed(name)
    assert list(found) == list(expected), "outputs came or went"
    exact = machine() == json.loads(MADE_ON.read_text())
    wrong = []
    for column, (bits, *values) in found.items():
        was_bits, *was = expected[column]
        now, before = np.array(values, float), np.array(was, float)
        scale = np.nanmax(np.abs(before), initial=1e-9)
        close = np.isclose(now, before, relative, relative * scale, equal_nan=True)
        if not close.all():
            place = int(np.argmin(close))
            part = (place + 1) / (SAMPLES + 1)
            wrong.append(f"{column}: {values[place]}, was {was[place]} after {part:.0%} of the drive")
        elif exact and bits != was_bits:
            wrong.append(f"{column}: other bits, the same {SAMPLES} values")
    assert not wrong, f"{len(wrong)} of {len(found)} outputs of {name} changed:\n" + "\n".join(wrong)


@pytest.mark.parametrize("name", LOOPS)
def test_a_closed_loop_gives_the_committed_outputs(name: str) -> None:
    config, relative = LOOPS[name]
    scenario = load_scenario(resource(f"config/scenarios/{name}.toml"))
    drive = run(new_loop(scenario, load_config(resource(f"config/{config}.toml")), CAR))
    check(name, drive.outputs, relative)


@pytest.mark.drives
@pytest.mark.parametrize("name", DRIVES)
def test_a_recorded_drive_gives_the_committed_outputs(name: str, drives: Path, tmp_path: Path) -> None:
    log, config = DRIVES[name]
    out, maps = tmp_path / "out.parquet", resource(f"config/maps/{name}.toml")
    replay([drives / log], resource(f"config/{config}.toml"), maps, None, None, out)
    check(name, read_result(out).columns, 1e-6)
