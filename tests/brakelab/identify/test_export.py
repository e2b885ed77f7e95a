"""`lab export`: the C of a law does what the law does, its table is the law's friction."""

import ctypes
from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.export import COLUMNS, export
from brakelab.plant.description import read_file
from brakelab.plant.friction.law import START
from brakelab.plant.friction.laws import friction, law_row
from brakelab.plant.friction.network import WEIGHTS
from brakelab.plant.linings import Linings
from ecu.algorithm.monitoring.emission_factor import emission_factor
from ecu.contract.dust import MODELS, NUMBERS
from ecu.errors import UserError
from ecu.settings.resources import resource
from tests.brakelab.test_c_source import compiled

pytestmark = pytest.mark.study

SHIPPED = resource("config/plant/linings.toml")
RANDOM = np.random.default_rng(1)
BRAKE = """
[lining.mine.brake]
piston_area = 2.5e-3
pad_area = 7e-3
effective_radius = 0.13
tyre_radius = 0.33
[lining.mine.disc]
diameter = 0.33
heating = 2e-5
cooling = 1.8e-3
cooling_by_speed = 9e-5
[lining.mine.friction.SIM]
rig_mass = 500.0
"""
OWN = """
import math
NUMBERS = {"mu": ("-", 0.1, 0.8), "bite": ("-", -0.3, 0.6), "distance": ("m", 1.0, 100.0)}
START = 0.25
def step(numbers, memory, pressure, speed, slowing, temperature, dt):
    mu, bite, distance = numbers
    memory += (1.0 - memory) * (1.0 - math.exp(-speed * dt / distance))
    return memory, mu * (1.0 + bite * memory)
"""
OTHERS = {
    "table": 'law = "table"\ntemperature = [50.0, 200.0, 400.0]\npressure = [5.0, 60.0]\n'
    "mu = [[0.41, 0.45, 0.3], [0.4, 0.42, 0.28]]",
    "network": 'law = "network"\nlow = [0.5, 5e5, 20.0]\nhigh = [20.0, 1e7, 400.0]\n'
    "middle = [8.0, 3e6, 150.0, 0.4]\nscale = [5.0, 2e6, 90.0, 0.05]\n"
    f"weights = {RANDOM.normal(size=WEIGHTS).tolist()}",
    "static_lugre": 'law = "static_lugre"\ncoulomb = 0.4\nstatic = 0.45\nstribeck = 5.0\n'
    "viscous = 1e-3\nhighest_speed = 20.0",
    "quadratic": 'law = "quadratic"\nspeed = [0.5, 20.0]\npressure = [5.0, 100.0]\n'
    "factors = [0.4, -0.03, 0.02, 0.01, 0.005, -0.01]",
    "own": 'law = "own"\ncode = "own.py"\nnumbers = { mu = 0.4, bite = 0.2, distance = 12.0 }',
}


def _alike(path: Path, brake: str, law: str, folder: Path) -> None:
    out = folder / "made-law.c"
    export(path, out, brake, law, "front")
    library = compiled(folder, out.read_text("utf-8"))
    call, start = library.made_law, library.made_law_start
    call.restype = start.restype = ctypes.c_double
    call.argtypes = [ctypes.POINTER(ctypes.c_double), *[ctypes.c_double] * 5]
    lining = read_file(path, Linings).lining[brake]
    number, row = law_row(lining.friction[law], lining.brake)
    memory, held = float(row[START]), ctypes.c_double(start())
    assert held.value == memory
    random = np.random.default_rng(2)
    for _ in range(300):
        inputs = random.uniform((0.0, 0.0, 0.0, 20.0, 0.0), (1.5e7, 25.0, 60.0, 600.0, 0.02))
        memory, mu = friction(number, row, memory, *inputs)
        assert call(ctypes.byref(held), *inputs) == pytest.approx(mu, rel=1e-12), inputs
        assert held.value == pytest.approx(memory, rel=1e-12, abs=1e-300)


@pytest.mark.parametrize("law", ["SIM", "R1", "surface", "Ost", "Ost_revised"])
def test_a_shipped_law_is_the_same_in_c(law: str, tmp_path: Path) -> None:
    _alike(SHIPPED, "B", law, tmp_path)


@pytest.mark.parametrize("law", OTHERS)
def test_any_other_law_is_the_same_in_c(law: str, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    path = tmp_path / "brake.toml"
    path.write_text(BRAKE + OTHERS[law])
    _alike(path, "mine", "SIM", tmp_path)


def test_the_table_has_first_contact_and_held_friction(tmp_path: Path) -> None:
    out = tmp_path / "law.csv"
    export(SHIPPED, out, "A", "surface", "front")
    names, units, *rows = out.read_text("utf-8").splitlines()
    assert names == COLUMNS
    assert units.count(",") == names.count(",")
    heat, bar, speed, first, held = (float(cell) for cell in rows[200].split(","))
    lining = read_file(SHIPPED, Linings).lining["A"]
    number, row = law_row(lining.friction["surface"], lining.brake)
    assert first == pytest.approx(friction(number, row, 0.0, 1e5 * bar, speed, 0.0, heat, 0.0)[1], abs=1e-5)
    grown = 1.0 - np.exp(-speed / row[7])
    assert held == pytest.approx(first * (1.0 + row[6] * grown), rel=1e-4)


@pytest.mark.parametrize("model", MODELS)
def test_an_emission_model_and_wear_of_config_are_the_same_in_c(model: str, tmp_path: Path) -> None:
    kind = MODELS.index(model)
    numbers = np.abs(RANDOM.normal(size=NUMBERS[kind])) + 0.1
    if model == "table":
        numbers[:12] = [*range(5, 35, 5), *range(5, 35, 5)]
    car = tmp_path / "car.toml"
    car.write_text(
        f'include = "{resource("config/suv.toml")}"\n[rear.dust]\nmodel = "{model}"\n'
        f"numbers = {numbers.tolist()}\nlow = [0, 0, 0, 0, 0, 0]\nhigh = [40, 40, 2000, 300, 60, 100]\n"
        "factor = 1.25\nbelow = -0.5\nabove = 0.5\n"
    )
    export(car, tmp_path / "rear.c", None, "SIM", "rear")
    library = compiled(tmp_path, (tmp_path / "rear.c").read_text("utf-8"))
    library.rear_particles.restype = library.rear_wear.restype = ctypes.c_double
    features = np.array([20.0, 5.0, 400.0, 130.0, 6.0, 22.0])
    given = (ctypes.c_double * 6)(*features)
    expected = 1.25 * 10.0 ** emission_factor(kind, numbers, features)
    assert library.rear_particles(given) == pytest.approx(expected, rel=1e-12)
    given[0] = 41.0
    assert np.isnan(library.rear_particles(given))
    assert library.rear_wear((ctypes.c_double * 7)(1, 0, 0, 0, 0, 0, 0)) > 0.0


@pytest.mark.parametrize(
    ("source", "out", "brake", "law", "axle", "said"),
    [
        (SHIPPED, "law.h", "A", "SIM", "front", "neither .c nor .csv"),
        (SHIPPED, "law.c", None, "SIM", "front", "choose one of A, B, C"),
        (SHIPPED, "law.c", "A", "sim", "front", "no such law"),
        (resource("config/suv.toml"), "law.csv", None, "SIM", "front", "has no friction law"),
        (resource("config/suv.toml"), "law.c", None, "SIM", "left", "front or rear"),
        (resource("dbc/brake_ecu.dbc"), "law.c", None, "SIM", "front", "cannot be read as TOML"),
    ],
)
def test_wrong_arguments_are_refused(
    source: Path, out: str, brake: str | None, law: str, axle: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(UserError, match=said):
        export(source, tmp_path / out, brake, law, axle)
