"""Rear wheel speeds lost on slippery roads: force of the tyres beside the sound car's, and wheels that stand.

Two brakings of 6 m/s^2 from 18 m/s, which no such road gives; the wires break before the second.
"""

from functools import cache

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import Scenario
from brakelab.stretches import stretches
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config
from ecu.settings.resources import resource

SPEED, DECEL, BEGIN_S = 18.0, 6.0, 0.4  # m/s, m/s^2, s: of the second braking, before it is evaluated
SLIDES, LOWEST_SPEED = -0.3, 5.0  # slip, m/s


@cache
def drive(car: str, road: tuple[float, float], corners: str = "") -> Drive:
    """Drive a car on a road of friction left and right; the wheel speeds of `corners` come to read zero."""
    accel = (0.5 if car == "sedan" else 1.5) * (0.6 if min(road) < 0.3 else 1.0)
    phases = [
        {"kind": "brake", "decel": DECEL, "until_speed": 4.0},
        {"kind": "cruise", "speed": SPEED + 1.0, "accel": accel, "until_speed": SPEED},
        {"kind": "coast", "seconds": 1.0},
        {"kind": "brake", "decel": DECEL, "until_speed": 4.0},
    ]
    content = {"plant": car.partition("-")[0], "blending": car.endswith("blended"), "initial_speed": SPEED}
    content |= {"phase": phases, "steering": {"path": [(0.0, 0.0), (5000.0, 0.0)]}}
    content["road"] = {"friction": [(0.0, *road), (5000.0, *road)]}
    if corners:
        signals = [f"wheel_speed_{corner}" for corner in corners.split()]
        begin = brakings(drive(car, road))[1].start * 0.01 - 0.5
        content["fault"] = [{"kind": "set", "t": begin, "signal": signals, "amount": 0.0}]
    return run(
        new_loop(Scenario.model_validate(content), load_config(resource(f"config/{car}.toml")), 1),
        seconds=120.0,
    )


def brakings(found: Drive) -> list[slice]:
    """Return the rows of the brakings above `LOWEST_SPEED`."""
    braking = (found.truth["decel_demand"] > 0.9 * DECEL) & (found.truth["vehicle_speed"] > LOWEST_SPEED)
    return [slice(begin, end) for begin, end in stretches(braking).tolist() if end - begin > 50]


def force(found: Drive) -> float:
    """Return the mean force of all tyres along the car in the second braking [N]."""
    rows = brakings(found)[1]
    rows = slice(rows.start + round(100 * BEGIN_S), rows.stop)
    return -float(np.mean(sum(found.truth[f"wheel_force_x_{corner}"][rows] for corner in CORNERS)))


def slid_s(found: Drive, corners: str) -> float:
    """Return the longest time for which one of the wheels slid in the second braking [s]."""
    rows = brakings(found)[1]
    slides = [stretches(found.truth[f"slip_{corner}"][rows] < SLIDES).tolist() for corner in corners.split()]
    return 0.01 * max((end - begin for wheel in slides for begin, end in wheel), default=0)


@pytest.mark.parametrize(
    ("car", "road", "corners", "least", "longest"),
    [  # force over the sound car's, s
        ("suv", (0.2, 0.2), "rr", 0.90, 0.8),
        ("suv", (0.3, 0.3), "rl rr", 0.80, 0.8),
        ("suv-blended", (0.3, 0.3), "rl rr", 0.80, 0.8),
        ("sedan", (0.2, 0.2), "rl rr", 0.75, 0.8),
        ("suv", (0.8, 0.3), "rr", 0.95, 0.8),
        ("lcv", (0.3, 0.8), "rl", 0.95, 0.8),
        ("suv", (1.0, 1.0), "rl rr", 0.99, 0.01),
    ],
)
def test_a_rear_wheel_that_is_not_seen_keeps_the_heading(car, road, corners, least, longest) -> None:
    found = drive(car, road, corners)
    share, longest_s = force(found) / force(drive(car, road)), slid_s(found, corners)
    turned = np.abs(found.truth["heading"][brakings(found)[1]]).max()
    print(f"{car} {road} {corners}: {share:.2f} of the force, slid {longest_s:.2f} s, turned {turned:.2f}")
    assert share > least
    assert longest_s < longest
    assert turned < 0.2
