"""Speed traces: files that can be followed, one line for those that cannot, the generated cycle."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.speed_trace import generated_trace, read_trace, wltp_brake_trace
from ecu.errors import UserError

SCENARIO = """
plant = "suv"
initial_speed = 0.0
[[phase]]
kind = "follow"
[trace]
"""


def test_a_file_beside_the_scenario_is_followed_to_its_end(tmp_path: Path) -> None:
    (tmp_path / "town.csv").write_text("t,speed\n0,0\n2.5, 4.0\n4.0,3\n")
    (tmp_path / "town.toml").write_text(SCENARIO + 'file = "town.csv"\n')
    script = load_scenario(tmp_path / "town.toml").script()
    assert np.array_equal(script.trace, [[0.0, 0.0], [2.5, 4.0], [4.0, 3.0]])
    assert list(script.phases["seconds"]) == [4.0]
    assert len(script.road.grade) == 0


def test_the_generated_cycle_brings_its_hills(tmp_path: Path) -> None:
    (tmp_path / "cycle.toml").write_text(SCENARIO + 'generate = "real-driving"\nseed = 2\n')
    script = load_scenario(tmp_path / "cycle.toml").script()
    cycle = generated_trace(2)
    assert np.array_equal(script.trace, cycle.speed)
    assert np.array_equal(script.road.grade, cycle.grade)
    assert script.phases["seconds"][0] == cycle.speed[-1, 0] > 90 * 60


def test_the_wltp_brake_cycle_is_followed_whole_or_by_trip_on_a_level_road(tmp_path: Path) -> None:
    (tmp_path / "cycle.toml").write_text(SCENARIO + 'generate = "wltp-brake"\n')
    (tmp_path / "trip.toml").write_text(SCENARIO + 'generate = "wltp-brake"\ntrip = 6\n')
    whole, trip = (load_scenario(tmp_path / name).script() for name in ("cycle.toml", "trip.toml"))
    assert whole.phases["seconds"][0] == pytest.approx(15_826.0)
    assert np.array_equal(trip.trace, wltp_brake_trace(6).speed)
    assert trip.phases["seconds"][0] == pytest.approx(700.0)
    assert len(whole.road.grade) == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "cannot be read (No such file or directory)"),
        ("time,v\n0,0\n1,1\n", "line 1: start with the line t,speed"),
        ("", "line 1: start with the line t,speed"),
        ("t,speed\n0,0\n1,fast\n", "line 3: give two numbers (found 1,fast)"),
        ("t,speed\n0,0\n1,2,3\n", "line 3: give two numbers"),
        ("t,speed\n0,0\n", "rows of rising time from 0.0 on, two at least"),
        ("t,speed\n0,0\n2,1\n2,3\n", "rows of rising time"),
        ("t,speed\n0,0\n1,-1\n", "speeds of at least 0"),
        ("t,speed\n0,0\n1,nan\n", "finite"),
    ],
)
def test_a_file_that_cannot_be_followed_is_one_line(tmp_path: Path, text: str | None, said: str) -> None:
    path = tmp_path / "trace.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(UserError) as caught:
        read_trace(path)
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
