"""What is asked for: the pedal map, the larger of pedal and automated demand, holding the standing car."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.algorithm.control.demand import DEMAND_STATE, pedal_to_decel, requested_decel, update_demand
from ecu.contract.signals import (
    ACCELERATOR_POSITION,
    ALIVE,
    DECEL_DEMAND,
    DECEL_DEMAND_VALID,
    PEDAL_POSITION,
    VALID,
    WHEEL_SPEED,
)
from ecu.settings.config import load_config, new_params

G, DT = 9.81, 0.01
CONFIGS = Path(__file__).parents[4] / "config"
MAP = [(0, 0), (5, 0), (20, 0.8), (40, 2.1), (60, 4.0), (80, 6.6), (100, 10.0)]  # config/suv.toml


@pytest.mark.parametrize(("position", "decel"), MAP)
def test_the_points_of_the_map(params, position: float, decel: float) -> None:
    assert pedal_to_decel(params[0], float(position)) == pytest.approx(decel)


@pytest.mark.parametrize(
    ("position", "decel"), [(12.5, 0.4), (50.0, 3.05), (90.0, 8.3), (-5.0, 0.0), (130.0, 10.0)]
)
def test_between_and_beyond_the_points(params, position: float, decel: float) -> None:
    assert pedal_to_decel(params[0], position) == pytest.approx(decel)


@pytest.fixture(scope="module")
def suv():
    return new_params(load_config(CONFIGS / "suv.toml"))[0]


@given(st.floats(-20, 150), st.floats(0, 50))
def test_pushing_further_never_asks_for_less(suv, position: float, further: float) -> None:
    assert pedal_to_decel(suv, position + further) >= pedal_to_decel(suv, position)


@given(st.lists(st.tuples(st.floats(0, 100), st.floats(0, 12)), min_size=2, max_size=8))
def test_any_rising_map_gives_what_numpy_interpolates(suv, points: list[tuple[float, float]]) -> None:
    xs, ys = sorted({round(x, 3) for x, _ in points}), sorted(y for _, y in points)
    ys = ys[: len(xs)]
    params = suv.copy()
    params["pedal_position"] = xs + xs[-1:] * (8 - len(xs))
    params["pedal_decel"] = ys + ys[-1:] * (8 - len(ys))
    for position in np.linspace(-10, 110, 25):
        expected = np.interp(position, xs, ys)
        assert pedal_to_decel(params, position) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("case", "pedal", "demand", "valid", "decel"),
    [
        ("pedal alone", 60.0, 0.0, 0.0, 4.0),
        ("automated demand alone", 0.0, 3.0, 1.0, 3.0),
        ("pedal is the larger", 80.0, 3.0, 1.0, 6.6),
        ("demand is the larger", 40.0, 3.0, 1.0, 3.0),
        ("demand not valid", 40.0, 9.0, 0.0, 2.1),
        ("nobody brakes", 0.0, 0.0, 1.0, 0.0),
    ],
)
def test_the_larger_of_pedal_and_valid_demand_counts(params, feed, case, pedal, demand, valid, decel) -> None:
    inputs = feed(pedal_position=pedal, decel_demand=demand, decel_demand_valid=valid)
    assert requested_decel(params[0], inputs[0]) == pytest.approx(decel), case


@pytest.mark.parametrize("verdict", [0, ALIVE, VALID])
@pytest.mark.parametrize(
    ("case", "lost", "decel_valid", "expected"),
    [
        ("pedal lost, demand valid", (PEDAL_POSITION,), 1.0, 3.0),
        ("pedal lost, demand not valid: nobody asks", (PEDAL_POSITION,), 0.0, math.nan),
        ("demand lost", (DECEL_DEMAND,), 1.0, 2.1),
        ("both lost", (PEDAL_POSITION, DECEL_DEMAND), 1.0, math.nan),
        ("validity of the demand lost", (DECEL_DEMAND_VALID,), 1.0, 2.1),
    ],
)
def test_a_lost_request_is_not_a_request_for_nothing(
    params, feed, verdict, case, lost, decel_valid, expected
) -> None:
    inputs = feed(pedal_position=40.0, decel_demand=3.0, decel_demand_valid=decel_valid)
    for place in lost:
        inputs[0]["verdict"][place] = verdict
    assert requested_decel(params[0], inputs[0]) == pytest.approx(expected, nan_ok=True), case


@pytest.mark.parametrize("asked", [-1.0, 15.0, 1e9])
def test_an_absurd_demand_is_cut_to_what_a_road_holds(params, feed, asked: float) -> None:
    inputs = feed(decel_demand=asked, decel_demand_valid=1.0)
    assert 0.0 <= requested_decel(params[0], inputs[0]) <= 12.0


class Holding:
    """A car whose wheels turn as told; `run` returns the demand of every cycle."""

    def __init__(self, params, feed) -> None:
        self.params, self.feed, self.state = params[0], feed, np.zeros(1, DEMAND_STATE)
        self.hold = float(params[0]["hold_decel"])

    def run(self, seconds: float, pedal=0.0, speed=0.0, accelerator=0.0, demand=0.0, lost=()) -> np.ndarray:
        inputs = self.feed(
            wheel_speed=speed / self.params["wheel_radius"],
            pedal_position=pedal,
            decel_demand=demand,
            decel_demand_valid=float(demand > 0.0),
            accelerator_position=accelerator,
        )
        for place in lost:
            inputs[0]["verdict"][place] = 0
        cycle = (self.params, self.state[0], inputs[0], math.nan, DT)
        return np.array([update_demand(*cycle) for _ in range(round(seconds / DT))])


@pytest.fixture
def holding(params, feed) -> Holding:
    return Holding(params, feed)


def test_the_holding_demand_is_enough_for_the_grade(params) -> None:
    """20 %, 2600 kg laden, linings at 0.45 - 2 * 15 %: what they give balances m g sin."""
    p = params[0]
    brakes = p["mass"] * p["hold_decel"] * 0.7
    assert brakes == pytest.approx(2600.0 * G * 0.2 / math.hypot(1.0, 0.2))


RELEASES = [
    # what lets the car go
    ("pedal at rest", {"pedal": 0.0}, True),
    ("pedal in its free travel", {"pedal": 4.9}, True),
    ("accelerator with the brake still touched", {"pedal": 8.0, "accelerator": 4.0}, True),
    ("pedal eased", {"pedal": 8.0}, False),
    ("accelerator at rest", {"pedal": 8.0, "accelerator": 2.0}, False),
    (
        "accelerator without a valid signal",
        {"pedal": 8.0, "accelerator": 50.0, "lost": (ACCELERATOR_POSITION,)},
        False,
    ),
    ("rolling while the pedal is touched", {"pedal": 8.0, "speed": 2.0}, False),
]


@pytest.mark.parametrize(("case", "then", "released"), RELEASES, ids=[row[0] for row in RELEASES])
def test_the_standing_car_is_held_until_the_driver_lets_it_go(holding, case, then, released) -> None:
    asked = 0.16 if then["pedal"] == 8.0 else 0.0
    assert holding.run(0.4, pedal=20.0) == pytest.approx(0.8), "has not stood long enough"
    assert holding.run(1.0, pedal=20.0)[-1] == pytest.approx(holding.hold)
    after = holding.run(1.0, **then)
    assert after[-1] == pytest.approx(asked if released else holding.hold), case
    if released:
        assert np.all(np.diff(after) <= 0.0)
        assert np.abs(np.diff(after)).max() <= 5.0 * DT + 1e-9
        assert after[-1] == asked or asked > 0.0, "exactly zero, not nearly"


def test_an_automated_demand_holds_and_lets_go_as_the_pedal_does(holding) -> None:
    assert holding.run(1.5, demand=0.5)[-1] == pytest.approx(holding.hold)
    assert holding.run(1.0)[-1] == 0.0


def test_who_asks_for_more_than_holding_gets_it(holding) -> None:
    assert holding.run(2.0, pedal=80.0) == pytest.approx(6.6)


NOT_HELD = [
    ("nobody brakes: the car may creep", {}),
    ("it moves at walking pace", {"pedal": 20.0, "speed": 0.5}),
    ("accelerator and brake", {"pedal": 20.0, "accelerator": 30.0}),
    ("a wheel speed is lost", {"pedal": 20.0, "lost": (WHEEL_SPEED + 2,)}),
]


@pytest.mark.parametrize(("case", "given"), NOT_HELD, ids=[row[0] for row in NOT_HELD])
def test_who_is_not_held(holding, case, given) -> None:
    expected = 0.8 if given.get("pedal") else 0.0
    assert holding.run(2.0, **given) == pytest.approx(expected), case


def test_standing_wheels_of_a_moving_car_are_no_standstill(params, feed) -> None:
    """All wheels locked on ice: the vehicle's speed says otherwise."""
    inputs, state = feed(pedal_position=20.0, wheel_speed=0.0), np.zeros(1, DEMAND_STATE)
    for _ in range(200):
        assert update_demand(params[0], state[0], inputs[0], 8.0, DT) == pytest.approx(0.8)


def test_a_lost_request_is_no_release(holding) -> None:
    holding.run(2.0, pedal=20.0)
    lost = (PEDAL_POSITION, DECEL_DEMAND)
    assert np.isnan(holding.run(0.5, pedal=20.0, lost=lost)).all()
    assert holding.run(0.01, pedal=20.0)[0] == pytest.approx(holding.hold)
