"""`[[expect]]` tables: what they say, and one line for every mistake."""

import re
from pathlib import Path
from typing import Any, get_args

import pytest

from brakelab.simulation.expectations import KEYS, UNITS, Expectation, What
from brakelab.simulation.scenario import load_scenario
from ecu.errors import UserError
from ecu.recording.events import MODES

ROOT = Path(__file__).parents[3]
FAULT = '[[fault]]\nkind = "lost"\nt = 1.0\n'
STOP = """
plant = "suv"
initial_speed = 8.0
[[phase]]
kind = "brake"
decel = 4.0
until_speed = 0.0
"""


def test_the_page_has_the_keys_of_everything_that_can_be_expected() -> None:
    page = (ROOT / "docs" / "rig.md").read_text("utf-8").partition("| `what` | keys")[2]
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \| (.*) \|$", page.partition("\n\n")[0], re.M)
    assert {what: set(re.findall(r"`(\w+)`", keys)) for what, keys, _ in rows} == KEYS
    assert KEYS.keys() == set(get_args(What))
    for what, _, met in rows:
        assert what not in UNITS or f"[{UNITS[what]}]" in met


def test_a_mode_is_any_of_the_ecu() -> None:
    assert [Expectation(what="mode", mode=mode, t=1.0).mode for mode in MODES] == list(MODES)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"what": "bit", "bit": "IMU lost", "within": 0.1}, "IMU lost within 0.1 s of fault 1"),
        ({"what": "bit", "bit": 1, "within": 0.1, "fault": 2}, "IMU lost within 0.1 s of fault 2"),
        (
            {"what": "bit", "bit": 33, "within": 0.1, "t": 9.0},
            "wheel_speed_fr implausible within 0.1 s of t = 9 s",
        ),
        ({"what": "no_bit", "bit": "late"}, "never late"),
        ({"what": "no_bit", "bit": "late", "t": 2.5}, "never late from t = 2.5 s on"),
        ({"what": "mode", "mode": "degraded", "within": 0.2}, "degraded within 0.2 s of fault 1"),
        ({"what": "mode", "mode": "active", "t": 9.5}, "active at t = 9.5 s"),
        ({"what": "recovered", "within": 0.5}, "recovered within 0.5 s after fault 1"),
        ({"what": "stopping_distance", "at_most": 70}, "stopping distance at most 70 m"),
        (
            {"what": "stopping_time", "at_least": 2, "at_most": 3.5},
            "stopping time at least 2 and at most 3.5 s",
        ),
        ({"what": "longer_stop", "at_most": 5.0}, "longer stop at most 5 %"),
        ({"what": "friction_error", "axle": "rear", "at_most": 5.0}, "rear friction error at most 5 %"),
        ({"what": "decel_error", "at_most": 0.5}, "decel error at most 0.5 m/s²"),
    ],
)
def test_an_expectation_is_one_line(keys: dict[str, Any], text: str) -> None:
    assert Expectation(**keys).text == text


@pytest.mark.parametrize(
    ("expect", "said"),
    [
        ('what = "grip"', "expect.1.what"),
        ('what = "bit"\nbit = "IMU lots"\nwithin = 0.1', "bit: no fault 'IMU lots'; did you mean IMU lost?"),
        ('what = "bit"\nbit = 31\nwithin = 0.1', "bit: no fault 31; docs/faults.md lists them"),
        ('what = "bit"\nwithin = 0.1', "'bit' needs bit"),
        ('what = "bit"\nbit = 1', "'bit' needs within"),
        ('what = "bit"\nbit = 1\nwithin = 0.1\nt = 1.0\nfault = 1', "give either t or fault"),
        ('what = "bit"\nbit = 1\nwithin = -0.1\n', "expect.1.within: give a value of at least 0 s"),
        ('what = "bit"\nbit = 1\nwithin = 0.1\nfault = 2', "expect: there is no [[fault]] number 2"),
        ('what = "no_bit"\nbit = 1\nwithin = 0.1', "within does not belong to 'no_bit'; remove it"),
        ('what = "mode"\nmode = "active"', "'mode' needs t, or within"),
        ('what = "stopping_distance"', "'stopping_distance' needs at_most or at_least"),
        ('what = "friction_error"\nat_most = 5.0', "'friction_error' needs axle"),
        ('what = "decel_error"', "'decel_error' needs at_most"),
        ('what = "decel_error"\nat_moist = 1.0', "expect.1.at_moist: unknown key; did you mean at_most?"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(tmp_path: Path, expect: str, said: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f"{STOP}{FAULT}[[expect]]\n{expect}\n")
    with pytest.raises(UserError) as caught:
        load_scenario(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "expect", ['what = "recovered"\nwithin = 0.5', 'what = "longer_stop"\nat_most = 5.0']
)
def test_what_is_said_of_a_fault_needs_one(tmp_path: Path, expect: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f"{STOP}[[expect]]\n{expect}\n")
    with pytest.raises(UserError, match=r"there is no \[\[fault\]\] number 1; add it, or give t"):
        load_scenario(path)
