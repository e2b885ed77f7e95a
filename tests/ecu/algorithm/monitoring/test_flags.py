"""Reverse, ABS, ESP and accelerator: for how long each is believed, and against what."""

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.flags import FLAGS_STATE, LONGEST_S, correct_flags
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.faults import IMPLAUSIBLE
from ecu.contract.signals import INPUT

DT = 0.01


class Car:
    """A car on a straight road that begins at `speed` [m/s], negative: backwards."""

    def __init__(self, params, feed, speed: float) -> None:
        self.params, self.feed, self.inputs = params[0], feed, feed()
        self.state, self.estimate = np.zeros(1, FLAGS_STATE)[0], np.zeros(1, ESTIMATE)[0]
        self.state["last"] = np.nan
        self.witness = np.zeros(1, WITNESS_STATE)[0]
        self.speed, self.across, self.clock = speed, 0.0, 0.0
        self.random = np.random.default_rng(1)
        self.said: list[int] = []

    def drive(self, seconds: float, turns: float = 1.0, wavy: float = 0.0, braking=False, **reads) -> float:
        """Return for how long of `seconds` the input `reads` was taken for something else [s].

        Args:
            seconds: duration.
            turns: of wheel rr over the car's.
            wavy: amplitude of the longitudinal acceleration at 0.5 Hz [m/s^2].
            braking: as `correct_flags` takes it.
            reads: one input and its value.
        """
        self.said = []
        (name, value), lost = next(iter(reads.items())), 0.0
        for _ in range(round(seconds / DT)):
            self.clock += DT
            accel = wavy * np.sin(np.pi * self.clock)
            self.speed += accel * DT
            self.estimate["speed"], self.estimate["accel_y"] = self.speed, self.across
            wheels = abs(self.speed) / self.params["wheel_radius"] * np.array([1, 1, 1, turns])
            noise = 0.05 * self.random.standard_normal(5)
            self.feed(self.inputs, wheel_speed=wheels + noise[:4], accel_x=accel + noise[4], **reads)
            said = correct_flags(
                self.params, self.state, self.witness, self.inputs[0], self.estimate, braking, DT
            )
            self.said.append(said)
            lost += DT * (self.inputs[0]["value"][INPUT[name]] != value)
        return lost


# car's speed [m/s], acceleration [m/s^2], seconds, seconds for which the flag is believed
REVERSES = [
    ("a car backs out of a garage", -1.0, 0.0, 5.0, 5.0),
    ("a car goes backwards, quicker and slower", -5.0, 1.5, 10.0, 10.0),
    ("the flag stands in a car at 20 m/s", 20.0, 0.0, 5.0, 0.0),
    ("the flag stands in a car that creeps, then drives forwards", 1.5, 1.5, 10.0, 2.0),
]


@pytest.mark.parametrize(("case", "speed", "wavy", "seconds", "believed"), REVERSES)
def test_reverse_is_believed_while_the_wheels_can_turn_backwards(
    params, feed, case, speed, wavy, seconds, believed
) -> None:
    car = Car(params, feed, speed)
    lost = car.drive(seconds, wavy=wavy, reverse=1.0)
    assert seconds - lost == pytest.approx(believed, abs=1.0)
    assert bool(car.said[-1] & IMPLAUSIBLE["reverse"]) == (lost > 0.0)


def test_reverse_that_is_set_in_a_moving_car_is_never_believed(params, feed) -> None:
    car = Car(params, feed, 8.0)
    car.drive(2.0, reverse=0.0)
    assert car.drive(1.0, reverse=1.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "turns", "across", "braking", "believed"),
    [
        ("abs_active", 1.0, 0.0, True, LONGEST_S),
        ("abs_active", 1.0, 0.0, False, LONGEST_S / 3.0),
        ("abs_active", 0.8, 0.0, True, 30.0),
        ("esp_active", 1.0, 0.0, False, LONGEST_S),
        ("esp_active", 1.0, 3.0, True, 5.0 * LONGEST_S),
        ("esp_active", 0.8, 3.0, True, 30.0),
    ],
)
def test_a_controller_that_has_no_wheel_to_hold_is_not_believed_for_ever(
    params, feed, name: str, turns: float, across: float, braking: bool, believed: float
) -> None:
    car = Car(params, feed, 20.0)
    car.across = across
    lost = car.drive(30.0, turns, braking=braking, **{name: 1.0})
    assert 30.0 - lost == pytest.approx(believed, abs=0.05)
    assert bool(car.said[-1] & IMPLAUSIBLE[name]) == (lost > 0.0)
    car.drive(0.02, **{name: 0.0})
    assert car.drive(1.0, turns, **{name: 1.0}) == 0.0


def test_an_accelerator_that_does_not_move_through_two_brakings_is_at_rest(params, feed) -> None:
    car = Car(params, feed, 20.0)
    for read in (20.0, 17.0, 17.0):
        car.drive(2.0, braking=True, accelerator_position=3.0)
        car.drive(1.0, accelerator_position=20.0)
        assert car.inputs[0]["value"][INPUT["accelerator_position"]] == pytest.approx(read)
    assert not any(car.said)
    assert car.drive(1.0, accelerator_position=1.0) == pytest.approx(1.0)
    assert car.inputs[0]["value"][INPUT["accelerator_position"]] == 0.0


def test_a_driver_who_presses_both_pedals_is_no_rest(params, feed) -> None:
    car = Car(params, feed, 20.0)
    for position in (20.0, 35.0, 10.0):
        car.drive(2.0, braking=True, accelerator_position=position)
        assert car.drive(1.0, accelerator_position=position) == 0.0


@pytest.mark.parametrize(("last_s", "read"), [(0.4, 0.0), (1.5, 50.0)])
def test_a_foot_that_moves_on_before_the_brakes_are_released_hides_no_rest(
    params, feed, last_s, read
) -> None:
    """A sensor that reads 50 % more; for most of the braking nobody accelerates."""
    car = Car(params, feed, 20.0)
    for _ in range(2):
        car.drive(2.0, braking=True, accelerator_position=50.0)
        car.drive(last_s, braking=True, accelerator_position=100.0)
        car.drive(1.0, accelerator_position=100.0)
    car.drive(0.1, accelerator_position=50.0)
    assert car.inputs[0]["value"][INPUT["accelerator_position"]] == read


def test_an_accelerator_far_from_zero_at_rest_is_reported(params, feed) -> None:
    car = Car(params, feed, 20.0)
    for _ in range(2):
        car.drive(2.0, braking=True, accelerator_position=50.0)
        car.drive(1.0, accelerator_position=50.0)
    assert car.said[-1] & IMPLAUSIBLE["accelerator_position"]
    assert car.inputs[0]["value"][INPUT["accelerator_position"]] == 0.0
