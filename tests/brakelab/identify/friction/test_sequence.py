"""A programme of sections: AK Master as shipped, a full factorial, and a short one run."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.sequence import Sequence, load_sequence, run_sequence
from brakelab.plant.description import PlantFileError
from brakelab.plant.linings import Lining
from ecu.settings.resources import resource

AK_MASTER = resource("config/rig/ak-master.toml")


def short(**keys: float) -> Sequence:
    gate = {"warm_speed": 80.0, "warm_pressure": 20.0, "cool_speed": 80.0}
    stop = {"name": "1", "speed": 80.0, "end_speed": 60.0, "level": [30.0], "temperature": [100.0], **keys}
    return Sequence.model_validate({"title": "short", "gate": gate, "section": [stop]})


def test_ak_master_has_its_fourteen_sections() -> None:
    sections = load_sequence(AK_MASTER).section
    assert sorted({int(section.name.split()[0].split(".")[0]) for section in sections}) == list(range(1, 15))


@pytest.mark.parametrize(
    ("name", "count", "first", "last"),
    [
        ("1 green μ", 30, (30.0, 100.0), (30.0, 100.0)),
        ("2 burnish", 64, (15.0, 100.0), (38.0, 100.0)),
        ("4.3 pressure, 120 to 80 km/h", 8, (10.0, 100.0), (80.0, 100.0)),
        ("6 cold", 1, (30.0, 40.0), (30.0, 40.0)),
        ("8 characteristic value 3", 18, (30.0, 100.0), (30.0, 100.0)),
        ("9 fade 1", 15, (3.9, 100.0), (3.9, 550.0)),
        ("12.1 temperature, 30 bar", 9, (30.0, 100.0), (30.0, 500.0)),
    ],
)
def test_a_section_s_applications(
    name: str, count: int, first: tuple[float, float], last: tuple[float, float]
) -> None:
    section = next(section for section in load_sequence(AK_MASTER).section if section.name == name)
    assert len(section.each()) == count
    assert section.each()[0] == first
    assert section.each()[-1] == last


def test_a_full_factorial_is_a_section_for_each_row_of_levels() -> None:
    sections = load_sequence(resource("config/rig/cpc.toml")).section
    assert len(sections) == 7 * 5
    assert [section.name for section in sections[:2]] == ["50 °C, 60 km/h", "50 °C, 80 km/h"]
    assert sections[-1].each() == [(10.0 * k, 200.0) for k in range(1, 10)]


@pytest.mark.parametrize(("ramp", "samples"), [(0.1, 20), (0.5, 100)])
def test_pressure_rises_in_the_time_that_the_section_asks_for(
    lining: Lining, ramp: float, samples: int
) -> None:
    recording = run_sequence(new_bench(lining, "A", 2), short(ramp=ramp), lambda share: None)
    risen = int(np.argmax(recording.pressure > 0.97 * 30e5))
    assert risen == pytest.approx(samples, abs=4)


def test_a_section_without_levels_is_one_line(tmp_path: Path) -> None:
    text = AK_MASTER.read_text("utf-8").replace("level = [30.0]", "level = []", 1)
    (tmp_path / "mine.toml").write_text(text, "utf-8")
    with pytest.raises(PlantFileError) as caught:
        load_sequence(tmp_path / "mine.toml")
    assert caught.value.place == "section.1.level"
