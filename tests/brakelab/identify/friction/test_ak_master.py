"""A programme of sections and its table of means: AK Master as shipped, and a short one run."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.friction.ak_master import Sequence, load_sequence, means_table, run_sequence
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.stops import find_stops
from brakelab.plant.description import PlantFileError
from brakelab.plant.linings import Lining
from ecu.settings.resources import resource

AK_MASTER = resource("config/rig/ak-master.toml")


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


def test_the_means_are_those_of_the_recording(lining: Lining, columns: Columns) -> None:
    """Law of constant friction 0.455 within the sensors' errors; the recording has the same stops."""
    gate = {"warm_speed": 80.0, "warm_pressure": 20.0, "cool_speed": 80.0}
    stop = {"speed": 80.0, "end_speed": 40.0, "temperature": [100.0, 140.0]}
    sequence = Sequence.model_validate(
        {
            "title": "short",
            "gate": gate,
            "section": [
                {"name": "3 characteristic value 3", "level": [30.0], "times": 2} | stop,
                {"name": "9 fade 1", "control": "deceleration", "level": [4.0]} | stop,
            ],
        }
    )
    recording, means = run_sequence(new_bench(lining, "A", 2), sequence, columns, lambda share: None)
    whole = find_stops(recording, columns, "short")
    assert [len(each.mu) for each in means] == [4, 2]
    assert np.concatenate([each.mu for each in means]) == pytest.approx(whole.mean)
    assert means[0].start == pytest.approx([100.0, 140.0, 100.0, 140.0], abs=3.0)
    assert means[0].pressure == pytest.approx([30e5] * 4, rel=0.01)
    table = means_table("short", means)
    assert table.rows[0][2:4] == ("4", f"{whole.mean[:4].mean():.3f}")
    assert table.below == (
        f"Friction: nominal {whole.mean[:4].mean():.3f}, least in fade 1 {whole.mean[4:].min():.3f}."
    )


def test_a_section_without_levels_is_one_line(tmp_path: Path) -> None:
    text = AK_MASTER.read_text("utf-8").replace("level = [30.0]", "level = []", 1)
    (tmp_path / "mine.toml").write_text(text, "utf-8")
    with pytest.raises(PlantFileError) as caught:
        load_sequence(tmp_path / "mine.toml")
    assert caught.value.place == "section.0.level"
