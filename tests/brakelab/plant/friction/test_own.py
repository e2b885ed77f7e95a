"""A law of one's own from a file, as docs/own-friction-law.md has it: rig, car, what is refused in a line."""

import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from brakelab.plant.description import PlantFileError, load_plant, nominal
from brakelab.plant.dynamometer import PRESSURE, new_stop, run_stop
from brakelab.plant.friction import own
from brakelab.plant.friction.law import ROW, RigBrake
from brakelab.plant.friction.laws import friction, law_row
from brakelab.plant.friction.own import GROUP, Own, read_code
from brakelab.plant.linings import rig_with
from ecu.settings.resources import resource

BRAKE = RigBrake(piston_area=2.827e-3, pad_area=7.125e-3, effective_radius=0.1459, tyre_radius=0.36)
PAGE = resource("docs") / "own-friction-law.md"
NUMBERS = {"mu": 0.42, "drop": 0.15, "speed": 5.0, "heat": 3e-4, "bite": 0.1, "distance": 12.0}


def example(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert found is not None
    return found[1]


@pytest.fixture
def burnish(tmp_path: Path) -> Path:
    path = tmp_path / "burnish.py"
    path.write_text(example("python"), "utf-8")
    return path


def test_the_page_s_law_is_its_closed_form(burnish: Path) -> None:
    """At constant speed the memory has rubbed v t: 1 - exp(-v t / distance)."""
    number, row = law_row(Own(law="own", rig_mass=996.0, code=str(burnish), numbers=NUMBERS), BRAKE)
    memory = float(row[0])
    assert memory == 0.0
    for _ in range(500):
        memory, mu = friction(number, row, memory, 30e5, 8.0, 30.0, 180.0, 1e-3)
    rubbed = 1.0 - math.exp(-8.0 * 0.5 / 12.0)
    falls = 1.0 - 0.15 * (1.0 - math.exp(-8.0 / 5.0))
    assert memory == pytest.approx(rubbed)
    assert mu == pytest.approx(0.42 * falls * (1.0 + 3e-4 * 80.0) * (1.0 + 0.1 * rubbed))


def test_the_page_s_entry_puts_it_on_a_car(burnish: Path) -> None:
    """Both axles of the SUV: friction at 30 bar from 80 km/h is the nominal one, by the law's scale."""
    folder = burnish.parent
    for name in ("suv.toml", "linings.toml"):
        text = (resource("config/plant") / name).read_text("utf-8")
        if name == "suv.toml":
            text = text.replace("[brake_front]", '[brake_front]\nfriction = "BURNISH"')
        else:
            text += "\n" + example("toml")
        (folder / name).write_text(text, "utf-8")
    plant = load_plant(folder / "suv.toml")
    assert plant.vehicle.brake_front.lining == "A"
    car = nominal(plant)[0]
    memory, mu = 0.0, 0.0
    for _ in range(2000):
        memory, mu = friction(
            car["friction_law"][0], car["friction_row"][0], memory, 30e5, 6.0, 30.0, 120.0, 1e-3
        )
    own_mu = 0.42 * (1.0 - 0.15 * (1.0 - math.exp(-6.0 / 5.0))) * (1.0 + 3e-4 * 20.0) * (1.0 + 0.1 * memory)
    scale = car["friction_scale"][0]
    assert scale * mu == pytest.approx(scale * own_mu)
    brake = plant.vehicle.brake_front
    assert 0.9 < scale * mu / (brake.friction_level * brake.friction_nominal) < 1.1


def test_a_stop_on_the_rig_slows_by_its_torque(burnish: Path) -> None:
    lining = load_plant(resource("config/plant/suv.toml")).linings.lining["A"]
    law = Own(law="own", rig_mass=996.0, code=str(burnish), numbers=NUMBERS)
    rig = rig_with(lining.model_copy(update={"friction": {"it": law}}), "it")
    trace = run_stop(rig, new_stop(PRESSURE, 25.0, 10.0, 100.0, pressure=30e5))
    energy = float(np.sum(trace["torque"] * trace["speed"] / 0.36) * 1e-3)
    assert energy == pytest.approx(0.5 * 996.0 * (25.0**2 - float(trace["speed"][-1]) ** 2), rel=2e-3)


def test_an_edit_is_read_anew(burnish: Path) -> None:
    before = read_code(str(burnish)).address
    assert read_code(str(burnish)).address == before
    burnish.write_text(example("python").replace("START = 0.0", "START = 0.25"), "utf-8")
    assert read_code(str(burnish)).start == 0.25


def test_an_entry_point_is_a_law(burnish: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Entry:
        def load(self) -> object:
            return sys.modules["burnish_of_a_package"]

    module = own._module(str(burnish))
    monkeypatch.setitem(sys.modules, "burnish_of_a_package", module)
    monkeypatch.setattr(
        own.importlib.metadata,
        "entry_points",
        lambda group, name: [Entry()] if (group, name) == (GROUP, "burnish") else [],
    )
    assert list(read_code("burnish").numbers) == list(NUMBERS)
    with pytest.raises(ValueError, match="no entry point"):
        read_code("polish")


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("NUMBERS =", "NAMES =", r"give NUMBERS = \{name: \(unit, least, greatest\)\}"),
        ('("–", 0.1, 0.8)', '("–", 0.8, 0.1)', r"NUMBERS\['mu'\]: least 0.8 is not below greatest 0.1"),
        ("def step", "def stop", "has no function step"),
        ("import math", "import maths", "No module named 'maths'"),
        ("math.exp(-speed / stribeck)", "nowhere(speed)", "numba cannot compile step: .*nowhere"),
        ("heat * (temperature", "math.sqrt(-1.0) * (temperature", "step gives nan at 30 bar"),
    ],
)
def test_a_mistake_in_the_law_is_one_line(burnish: Path, old: str, new: str, line: str) -> None:
    text = example("python")
    assert old in text
    burnish.write_text(text.replace(old, new), "utf-8")
    with pytest.raises(ValueError, match=line) as caught:
        read_code(str(burnish))
    assert "burnish.py: " in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('"burnish.py"', '"polish.py"', "polish.py: No such file"),
        ("distance = 12.0", "path = 12.0", "numbers.distance is missing; burnish.py wants mu, drop"),
        ("distance = 12.0", "distance = 12.0, path = 1.0", "numbers.path is unknown"),
    ],
)
def test_a_mistake_in_the_lining_file_is_one_line(burnish: Path, old: str, new: str, line: str) -> None:
    for name in ("suv.toml", "linings.toml"):
        text = (resource("config/plant") / name).read_text("utf-8")
        text += ("\n" + example("toml").replace(old, new)) if name == "linings.toml" else ""
        (burnish.parent / name).write_text(text, "utf-8")
    with pytest.raises(PlantFileError) as caught:
        load_plant(burnish.parent / "suv.toml")
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_more_numbers_than_a_row_holds_are_refused(burnish: Path) -> None:
    many = ", ".join(f'"n{k}": ("–", 0.0, 1.0)' for k in range(ROW))
    burnish.write_text(
        f"NUMBERS = {{{many}}}\n\ndef step(numbers, memory, *inputs):\n    return memory, 0.4\n"
    )
    with pytest.raises(ValueError, match=f"{ROW} numbers; at most {ROW - 2}"):
        read_code(str(burnish))
