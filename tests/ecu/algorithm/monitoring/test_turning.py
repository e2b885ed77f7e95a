"""Yaw rate, lateral acceleration, steering angle: which of them contradicts the others."""

import numpy as np
import pytest

from ecu.algorithm.monitoring.turning import TURNING_STATE, watch_turning
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.signals import INPUT, WHEEL_SPEED

DT = 0.01
WATCHED = ("yaw_rate", "accel_y", "steering_angle")

CASES = [
    # case, true yaw rate [rad/s], what reads something else, seconds, rejected
    ("straight", 0.0, {}, 20.0, ()),
    ("a bend", 0.3, {}, 20.0, ()),
    ("a banked road", 0.0, {"accel_y": 0.8}, 20.0, ()),
    ("an axle that slips in a bend", 0.2, {"accel_x": -4.0, "slip": 0.06}, 20.0, ()),
    ("a car that understeers", 0.2, {"steering_angle": 0.055}, 20.0, ()),
    ("yaw rate at its end", 0.0, {"yaw_rate": 5.9}, 0.1, ("yaw_rate",)),
    ("yaw rate stuck from the bend before", 0.0, {"yaw_rate": 0.3}, 0.3, ("yaw_rate",)),
    ("yaw rate turned round", 0.3, {"yaw_rate": -0.3}, 0.3, ("yaw_rate",)),
    ("lateral acceleration at its end", 0.0, {"accel_y": 39.0}, 0.1, ("accel_y",)),
    ("lateral acceleration of zero in a bend", 0.3, {"accel_y": 0.0}, 0.3, ("accel_y",)),
    ("steering at its end", 0.0, {"steering_angle": 1.5}, 0.8, ("steering_angle",)),
    ("steering of the wrong sign", 0.3, {"steering_angle": -0.04}, 0.9, ("steering_angle",)),
]


def drive(params, feed, yaw: float, reads: dict[str, float], seconds: float, speed: float = 20.0) -> np.void:
    state, witness = np.zeros(1, TURNING_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
    p = params[0]
    sides = 0.5 * p["track"] * np.array([-1, 1, -1, 1])
    true = {"yaw_rate": yaw, "accel_y": yaw * speed, "steering_angle": yaw * p["wheelbase"] / speed}
    turns = (speed + yaw * sides) * (1.0 - np.array([reads.get("slip", 0.0), 0, 0, 0]))
    given = {name: value for name, value in (true | reads).items() if name != "slip"}
    inputs = feed(wheel_speed=turns / p["wheel_radius"], **given)
    for _ in range(round(seconds / DT)):
        watch_turning(p, state, witness, inputs[0], speed, DT)
    return witness


@pytest.mark.parametrize(("case", "yaw", "reads", "seconds", "rejected"), CASES, ids=[c[0] for c in CASES])
def test_who_contradicts_the_others(params, feed, case, yaw, reads, seconds, rejected) -> None:
    witness = drive(params, feed, yaw, reads, seconds)
    assert tuple(name for name in WATCHED if witness["rejected"][INPUT[name]]) == rejected


@pytest.mark.parametrize(("accel", "rejected"), [(-4.4, ()), (0.0, ("steering_angle",))])
def test_brakes_that_pull_turn_a_fast_car_against_its_steering(params, feed, accel, rejected) -> None:
    """As measured: linings whose friction has come to differ between left and right, 120 km/h."""
    reads = {"accel_x": accel, "steering_angle": 0.0013}
    witness = drive(params, feed, -0.2, reads, 5.0, 33.0)
    assert tuple(name for name in WATCHED if witness["rejected"][INPUT[name]]) == rejected


@pytest.mark.parametrize("speed", [4.9, -8.0, np.nan])
def test_slow_or_backwards_nobody_is_judged(params, feed, speed: float) -> None:
    assert not drive(params, feed, 0.0, {"yaw_rate": 5.9}, 1.0, speed)["rejected"].any()


def test_two_that_lie_alike_are_not_believed_against_three(params, feed) -> None:
    """Yaw rate and lateral acceleration come in one frame."""
    witness = drive(params, feed, 0.0, {"yaw_rate": 2.0, "accel_y": 40.0}, 0.5)
    assert [int(witness["rejected"][INPUT[name]]) for name in WATCHED] == [1, 1, 0]


def test_wheels_are_no_part_of_the_verdict(params, feed) -> None:
    witness = drive(params, feed, 0.0, {"yaw_rate": 5.9}, 1.0)
    assert not witness["rejected"][WHEEL_SPEED : WHEEL_SPEED + 4].any()
