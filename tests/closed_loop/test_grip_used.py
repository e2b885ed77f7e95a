"""Braking beyond what the road gives: how much of its grip the slip guard uses, on roads of every grip.

A stop from 28 m/s at a demand of 10 m/s^2, cars of the wide draw. Used is the tyres' force along the car over
what road and loads give, from 0.3 s after the demand until 3 m/s.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import Scenario
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config
from ecu.settings.resources import resource

CARS = {"suv": False, "suv-blended": True, "sedan": False}
"""Configurations, and whether their motors brake."""
SEEDS = (1, 2, 3)
SPEED, BEGIN = 28.0, 3.0  # m/s, s
Road = tuple[tuple[float, float, float], ...]
"""Rows of distance since the demand [m], friction left and right."""


class Stop(NamedTuple):
    """What a stop on a road shows."""

    used: float
    locked: float
    """Share of the time for which a wheel stands, the worst one."""
    turned: float
    """Greatest angle to the road [rad]."""


@cache
def stop(car: str, seed: int, road: Road, steering: float) -> Stop:
    """Drive a car of `CARS`, the wheels steered by an angle [rad]; at 0 the driver follows the road."""
    friction = np.array([(BEGIN * SPEED + at if at else 0.0, left, right) for at, left, right in road])
    angle = [(0.0, 0.0), (1.0, 0.0), (2.0, steering)]
    content = {"plant": car.partition("-")[0], "blending": CARS[car], "initial_speed": SPEED}
    content["road"] = {"friction": friction.tolist()}
    content["steering"] = {"angle": angle} if steering else {"path": [(0.0, 0.0), (5000.0, 0.0)]}
    content["phase"] = [
        {"kind": "cruise", "speed": SPEED, "seconds": BEGIN},
        {"kind": "brake", "decel": 10.0, "until_speed": 0.0},
    ]
    loop = new_loop(Scenario.model_validate(content), load_config(resource(f"config/{car}.toml")), seed)
    drive = run(loop, seconds=60.0)
    truth, plant = drive.truth, loop.sides.vehicle.params[0]
    force, load, slip = (
        np.array([truth[f"{name}_{corner}"] for corner in CORNERS])
        for name in ("wheel_force_x", "wheel_force_z", "slip")
    )
    places = [np.interp(truth["distance"], friction[:, 0], friction[:, 1 + i % 2]) for i in range(4)]
    less = 1.0 - plant["friction_degression"] * (load / plant["nominal_load"][:, None] - 1.0)
    rows = (drive.t > BEGIN + 0.3) & (truth["vehicle_speed"] > 3.0)
    used = -force.sum(axis=0) / (np.array(places) * load * less).sum(axis=0)
    locked = (slip[:, rows] < -0.8).mean(axis=1).max()
    turned = 0.0 if steering else np.abs(truth["heading"][rows]).max()
    return Stop(float(used[rows].mean()), float(locked), float(turned))


def even(*grip: float) -> Road:
    """Return a road of the same friction on both sides; a second value holds from 30 m after the demand."""
    first, last = grip[0], grip[-1]
    return ((0.0, first, first), (30.0, first, first), (30.1, last, last))


@pytest.mark.parametrize(
    ("name", "road", "steering", "least", "locked", "turned"),
    [  # used on average, the worst wheel locked for, turned by [rad] at most
        ("0.1", even(0.1), 0.0, 0.70, 0.02, 0.1),
        ("0.2", even(0.2), 0.0, 0.77, 0.02, 0.1),
        ("0.3", even(0.3), 0.0, 0.80, 0.02, 0.1),
        ("0.45", even(0.45), 0.0, 0.84, 0.03, 0.1),
        ("0.6", even(0.6), 0.0, 0.86, 0.06, 0.1),
        ("0.8", even(0.8), 0.0, 0.85, 0.05, 0.1),
        ("0.8, then 0.2", even(0.8, 0.2), 0.0, 0.76, 0.05, 0.1),
        ("0.2, then 0.8", even(0.2, 0.8), 0.0, 0.70, 0.10, 0.1),
        ("0.3 in a bend", even(0.3), 0.005, 0.75, 0.03, 0.1),
    ],
)
def test_the_grip_of_the_road_is_used(name, road, steering, least, locked, turned) -> None:
    print(f"road of {name}:")
    for car in CARS:
        stops = [stop(car, seed, road, steering) for seed in SEEDS]
        used, lock, turn = (np.array(values) for values in zip(*stops, strict=True))
        worst = f"locked {lock.max():.2f}, turned {turn.max():.2f} rad"
        print(f"  {car}: used {used.mean():.2f} ({used.min():.2f}), {worst}")
        assert used.mean() > least
        assert lock.max() < locked
        assert turn.max() < turned
