"""Reverse, ABS, ESP and accelerator: for how long each is believed, and against what."""

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.accel_error import ACCEL_ERROR_STATE
from ecu.algorithm.monitoring.application import APPLICATION_STATE
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
        self.witness, self.lines = np.zeros(1, WITNESS_STATE)[0], np.zeros(1, ACCEL_ERROR_STATE)[0]
        self.application = np.zeros(1, APPLICATION_STATE)[0]
        self.speed, self.across, self.clock = speed, 0.0, 0.0
        self.random = np.random.default_rng(1)
        self.said: list[int] = []

    def drive(self, seconds: float, turns: float = 1.0, wavy: float = 0.0, braking=False, **reads) -> float:
        """Return for how long of `seconds` the input `reads` was taken for something else [s].

        Args:
            seconds: duration.
            turns: of wheel rr over the car's.
            wavy: amplitude of the longitudinal acceleration at 0.5 Hz [m/s^2].
            braking: a brake application lasts.
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
            self.application["braking"] = braking
            said = correct_flags(
                self.params,
                self.state,
                self.witness,
                self.lines,
                self.inputs[0],
                self.estimate,
                self.application,
                DT,
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
    for read in (20.0, 18.5, 18.5):
        car.drive(2.0, braking=True, accelerator_position=1.5)
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


@pytest.mark.parametrize("position", [3.0, 50.0])
def test_an_accelerator_whose_rest_reads_pressed_is_reported(params, feed, position) -> None:
    car = Car(params, feed, 20.0)
    for _ in range(2):
        car.drive(2.0, braking=True, accelerator_position=position)
        car.drive(1.0, accelerator_position=position)
    assert car.said[-1] & IMPLAUSIBLE["accelerator_position"]
    assert car.inputs[0]["value"][INPUT["accelerator_position"]] == 0.0


STANDS = [
    # case, motors have been shown to drive alone, torque of each [N m] or None: lost, left out, car's speed,
    # braking, read
    ("no motor drives", True, 0.0, False, 20.0, True, 0.0),
    ("motors brake", True, 200.0, False, 20.0, True, 0.0),
    ("motors drive", True, -200.0, False, 20.0, True, 50.0),
    ("torque is lost", True, None, False, 20.0, True, 50.0),
    ("a torque is left out", True, 0.0, True, 20.0, True, 50.0),
    ("an engine may drive too", False, 0.0, False, 20.0, True, 50.0),
    ("the car stands", True, 0.0, False, 0.0, True, 50.0),
    ("brakes are released", True, 0.0, False, 20.0, False, 50.0),
]


@pytest.mark.parametrize(
    ("case", "alone", "torque", "left_out", "speed", "braking", "read"), STANDS, ids=[c[0] for c in STANDS]
)
def test_an_accelerator_says_nothing_that_motors_do_not(
    params, feed, case, alone, torque, left_out, speed, braking, read
) -> None:
    """While the car brakes: the feet may be on both pedals, or the sensor wrong; nothing drives the car."""
    car = Car(params, feed, speed)
    car.lines["proven_s"] = 3.0 if alone else 0.0
    place = INPUT["motor_torque_fl"]
    if left_out:
        car.witness["rejected"][place] = 1
    car.feed(car.inputs, motor_torque=-300.0)
    if torque is None:
        car.inputs[0]["verdict"][place] = 0
    else:
        car.feed(car.inputs, motor_torque=torque)
    car.drive(0.9, braking=braking, accelerator_position=50.0)
    assert car.inputs[0]["value"][INPUT["accelerator_position"]] == 50.0
    car.drive(0.2, braking=braking, accelerator_position=50.0)
    assert car.inputs[0]["value"][INPUT["accelerator_position"]] == read
