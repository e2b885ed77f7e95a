"""Brakes that fail, in one drawn car: deceleration is kept where grip allows."""

from pathlib import Path

import pytest

from brakelab.simulation.closed_loop import new_loop, run
from brakelab.studies.control.failures import FAILURES, braking, left_of
from ecu.settings.config import load_config

CONFIG = load_config(Path(__file__).parents[4] / "config" / "suv.toml")
CAR = 11


@pytest.fixture(scope="module")
def sound():
    return run(new_loop(braking(4.0, False, []), CONFIG, CAR))


@pytest.mark.parametrize(
    ("case", "least", "most", "reported_ms"),
    [
        ("calliper front left", -5.0, 5.0, 120.0),
        ("circuit of the rear axle", -5.0, 6.0, 120.0),
        ("diagonal circuit", -5.0, 5.0, 120.0),
        ("circuit of the front axle", -30.0, 0.0, 120.0),  # the rear's grip
        ("pedal position, its switch goes on", -0.1, 0.1, None),
        ("sensor keeps its value, front left", -6.0, 6.0, None),
    ],
)
def test_what_a_failure_leaves(sound, case, least, most, reported_ms) -> None:
    left = left_of(run(new_loop(braking(4.0, False, [FAILURES[case]]), CONFIG, CAR)), sound)
    print(left)
    assert least <= left.deceleration <= most
    assert (left.reported_ms <= reported_ms) if reported_ms else left.reported_ms != left.reported_ms
    assert left.beside < 0.5
    assert left.slip < 10.0
