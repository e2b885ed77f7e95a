"""A short programme on brake A, with a drawn pad and with ILVO of the set R1; and as a stranger's CSV."""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.friction.columns import Columns, columns_text
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.recording import Recording, joined
from brakelab.identify.friction.stops import Stops, find_stops
from brakelab.plant.description import read_file
from brakelab.plant.dynamometer import PRESSURE, new_stop
from brakelab.plant.linings import Lining, Linings, rig_with
from brakelab.studies.lab.brakes import r1_recording
from ecu.settings.resources import resource

KMH = 1.0 / 3.6


@pytest.fixture(scope="session")
def lining() -> Lining:
    return read_file(resource("config/plant/linings.toml"), Linings).lining["A"]


@pytest.fixture(scope="session")
def columns(lining: Lining) -> Columns:
    rig = rig_with(lining, "SIM")[0]
    return Columns.own(lining, float(rig["mass"] * rig["tyre_radius"] ** 2))


@pytest.fixture(scope="session")
def recording(lining: Lining) -> Recording:
    """Return 24 stops of a drawn pad."""
    bench = new_bench(lining, "A", 1)
    parts = []
    for temperature, speed, bar in product((80.0, 140.0, 200.0), (80.0, 120.0), (15.0, 30.0, 50.0, 70.0)):
        bench.temperature = temperature
        bench.wait(60.0, 0.0)
        bench.temperature = temperature
        parts.append(
            bench.measure(new_stop(PRESSURE, speed * KMH, 30.0 * KMH, temperature, pressure=bar * 1e5))
        )
    return joined(parts)


@pytest.fixture(scope="session")
def ilvo_recording(lining: Lining) -> Callable[[float, int], Recording]:
    """Return the function of noise and seed that runs R1."""
    return partial(r1_recording, lining)


@pytest.fixture(scope="session")
def stops(recording: Recording, columns: Columns) -> Stops:
    return find_stops(recording, columns, "recording")


STRANGE = {
    "time": ("Zeit", "ms", 1e3, 0.0),
    "pressure": ("P_Line", "psi", 1.0 / 6894.757, 0.0),
    "torque": ("M_B", "kN m", -1e-3, 0.0),
    "speed": ("n", "rpm", 60.0 / (2.0 * np.pi), 0.0),
    "temperature": ("T_Scheibe", "°F", 1.8, 32.0),
}


def write_strange(columns: Columns, folder: Path, recording: Recording, damaged: bool = False) -> Path:
    """Write `recording` with semicolons, decimal commas and STRANGE units, and its file of columns."""
    values = [getattr(recording, name) * factor + zero for name, (_, _, factor, zero) in STRANGE.items()]
    rows = [";".join(f"{v:.6f}".replace(".", ",") for v in row) for row in zip(*values, strict=True)]
    if damaged:
        rows[50], rows[60], rows[70] = "12;13", rows[60].replace(";", ";x", 1), rows[10]
    path = folder / "strange.csv"
    path.write_text("\n".join([";".join(name for name, *_ in STRANGE.values()), *rows, ""]), "utf-8")
    text = columns_text(columns)
    for name, (label, unit, _, _) in STRANGE.items():
        before = next(line for line in text.splitlines() if line.startswith(f"{name} = ["))
        text = text.replace(before, f'{name} = ["{label}", "{unit}"]')
    path.with_suffix(".toml").write_text(text, "utf-8")
    return path


@pytest.fixture
def strange(columns: Columns) -> Callable[..., Path]:
    """Return the function of folder and recording that writes a stranger's CSV."""
    return partial(write_strange, columns)
