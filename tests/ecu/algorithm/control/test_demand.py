"""What is asked for: the pedal map, the larger of pedal and automated demand, holding the standing car."""

import math

import numpy as np
import pytest

from ecu.algorithm.control.demand import DEMAND_STATE, hold_automated, hold_pedal, update_demand
from ecu.contract.faults import DEMAND_LOST
from ecu.contract.signals import (
    ACCELERATOR_POSITION,
    ALIVE,
    DECEL_DEMAND,
    DECEL_DEMAND_VALID,
    PEDAL_POSITION,
    PEDAL_PRESSED,
    USABLE,
    WHEEL_SPEED,
)

G, DT = 9.81, 0.01


class Holding:
    """A car whose wheels turn as given; `run` returns the demand of every cycle."""

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
    rising = holding.run(1.0, pedal=20.0)
    assert rising[-1] == pytest.approx(holding.hold)
    assert np.diff(rising).max() == pytest.approx(5.0 * DT), "as fast as a foot, no step"
    after = holding.run(1.0, **then)
    assert after[-1] == pytest.approx(asked if released else holding.hold), case
    if released:
        falling = np.diff([holding.hold, *after])
        assert np.all(falling <= 0.0)
        assert falling.min() == pytest.approx(-5.0 * DT)
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


# 2.44 m/s^2 lies between 40 % (2.1) and 60 % (4.0) of the map: 40 + 20 * 0.34 / 1.9
SECONDARY = 43.579
LOST_POSITIONS = [
    # case, position before [%], switch, its verdict, mapped, position then [%], usable
    ("pressed since before it was lost", 60.0, 1.0, USABLE, 1, 60.0, True),
    ("let go", 60.0, 0.0, USABLE, 1, 0.0, True),
    ("pressed only since it was lost", 0.0, 1.0, USABLE, 1, SECONDARY, True),
    ("pressed less than anyone brakes with", 5.5, 1.0, USABLE, 1, SECONDARY, True),
    ("the switch is lost too", 60.0, 1.0, ALIVE, 1, 60.0, False),
    ("a car without a pedal position", 60.0, 1.0, USABLE, 0, 60.0, False),
]


@pytest.mark.parametrize(
    ("case", "before", "switch", "verdict", "mapped", "then", "usable"),
    LOST_POSITIONS,
    ids=[row[0] for row in LOST_POSITIONS],
)
def test_a_pedal_whose_position_is_lost_is_held_by_its_switch(
    params, feed, case, before, switch, verdict, mapped, then, usable
) -> None:
    state, inputs = np.zeros(1, DEMAND_STATE)[0], feed(pedal_position=before, pedal_pressed=1.0)
    hold_pedal(params[0], state, inputs[0])
    assert inputs[0]["value"][PEDAL_POSITION] == before
    params["mapped"][0, PEDAL_POSITION] = mapped
    feed(inputs, pedal_pressed=switch)
    inputs[0]["verdict"][PEDAL_POSITION], inputs[0]["verdict"][PEDAL_PRESSED] = ALIVE, verdict
    hold_pedal(params[0], state, inputs[0])
    assert inputs[0]["value"][PEDAL_POSITION] == pytest.approx(then, abs=1e-3)
    assert bool(inputs[0]["verdict"][PEDAL_POSITION] & USABLE == USABLE) is usable


def test_a_map_that_asks_for_less_than_a_secondary_brake_gives_all_it_has(params, feed) -> None:
    params["pedal_decel"][0] *= 0.2
    state, inputs = np.zeros(1, DEMAND_STATE)[0], feed(pedal_pressed=1.0)
    inputs[0]["verdict"][PEDAL_POSITION] = ALIVE
    hold_pedal(params[0], state, inputs[0])
    assert inputs[0]["value"][PEDAL_POSITION] == 100.0


GAPS = [
    # case, flag, verdicts of demand and flag, demand after 0.01, 0.09, 0.11 s [m/s^2], reported after 0.11 s
    ("followed", 1.0, USABLE, USABLE, (4.0, 4.0, 4.0), False),
    ("withdrawn", 0.0, USABLE, USABLE, (0.0, 0.0, 0.0), False),
    ("withdrawn, and no value any more", 0.0, ALIVE, USABLE, (0.0, 0.0, 0.0), False),
    ("out of range or not available", 1.0, ALIVE, USABLE, (4.0, 4.0, 0.0), True),
    ("its flag says error", 1.0, USABLE, ALIVE, (4.0, 4.0, 0.0), True),
    ("both are not available", 1.0, ALIVE, ALIVE, (4.0, 4.0, 0.0), True),
    ("no frame for its time-out", 1.0, 0, 0, (0.0, 0.0, 0.0), True),
]


@pytest.mark.parametrize(
    ("case", "flag", "value", "flagged", "asked", "reported"), GAPS, ids=[row[0] for row in GAPS]
)
def test_an_automated_demand_ends_at_once_only_where_it_is_withdrawn(
    params, feed, case, flag, value, flagged, asked, reported
) -> None:
    state = np.zeros(1, DEMAND_STATE)[0]
    assert hold_automated(state, feed(decel_demand=4.0, decel_demand_valid=1.0)[0], DT) == 0
    got, bits = [], []
    for _ in range(11):
        inputs = feed(pedal_position=0.0, decel_demand=4.0, decel_demand_valid=flag)[0]
        inputs["verdict"][DECEL_DEMAND], inputs["verdict"][DECEL_DEMAND_VALID] = value, flagged
        bits.append(hold_automated(state, inputs, DT))
        got.append(update_demand(params[0], state, inputs, 20.0, DT))
    assert (got[0], got[8], got[10]) == asked, case
    at_once = DEMAND_LOST if reported and not asked[0] else 0
    assert (bits[0], bits[8], bits[10]) == (at_once, at_once, DEMAND_LOST if reported else 0)
    if reported:
        assert hold_automated(state, feed(decel_demand=2.0, decel_demand_valid=1.0)[0], DT) == 0, "it is back"


def test_a_demand_that_asked_for_nothing_is_not_missed(feed) -> None:
    state, inputs = np.zeros(1, DEMAND_STATE)[0], feed(decel_demand=0.0, decel_demand_valid=1.0)[0]
    hold_automated(state, inputs, DT)
    inputs["verdict"][DECEL_DEMAND] = ALIVE
    assert hold_automated(state, inputs, DT) == 0


@pytest.mark.parametrize(("flag", "asked"), [(0.0, 4.0), (1.0, 0.0)], ids=["withdrawn", "asked for nothing"])
def test_a_demand_that_had_ended_does_not_come_back_when_its_frames_fail(feed, flag, asked) -> None:
    state = np.zeros(1, DEMAND_STATE)[0]
    hold_automated(state, feed(decel_demand=4.0, decel_demand_valid=1.0)[0], DT)
    assert hold_automated(state, feed(decel_demand=asked, decel_demand_valid=flag)[0], DT) == 0
    inputs = feed(decel_demand=4.0, decel_demand_valid=1.0)[0]
    inputs["verdict"][DECEL_DEMAND] = inputs["verdict"][DECEL_DEMAND_VALID] = ALIVE
    assert hold_automated(state, inputs, DT) == 0
    assert inputs["verdict"][DECEL_DEMAND] == ALIVE, "no value stands for it"
