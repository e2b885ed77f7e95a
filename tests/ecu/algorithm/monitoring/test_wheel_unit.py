"""All four wheel speeds at once: what no car lets a unit measure, and what cars do."""

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.wheel_unit import WHEEL_UNIT_STATE, watch_wheel_unit
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.signals import VEHICLE_SPEED, WHEEL_SPEED

DT = 0.01


class Unit:
    """Four wheels of a car at `speed` [m/s]."""

    def __init__(self, params, feed, speed: float) -> None:
        self.params, self.feed, self.inputs = params[0], feed, feed()
        self.state, self.witness = np.zeros(1, WHEEL_UNIT_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
        self.estimate = np.zeros(1, ESTIMATE)[0]
        self.estimate["measured"] = 1
        self.estimate["speed"] = speed
        self.omega = speed / self.params["wheel_radius"]
        self.random = np.random.default_rng(1)

    def read(
        self, omega, torque: float = 0.0, accel: float = 0.0, noise: float = 0.1, dt: float = DT, **signals
    ) -> bool:
        """Take a sample of each [rad/s]; return whether all are rejected."""
        self.estimate["brake_torque"], self.estimate["accel_x"] = torque, accel
        signals = {"accel_x": accel, "motor_torque": 0.0} | signals
        omega = omega + noise * self.random.standard_normal(4)
        self.feed(self.inputs, wheel_speed=omega, **signals)
        jitter = np.full(4, noise)
        watch_wheel_unit(
            self.params, self.state, self.witness, self.inputs[0], self.estimate, 0.0, jitter, dt
        )
        rejected = self.witness["rejected"][WHEEL_SPEED : WHEEL_SPEED + 4]
        assert rejected.all() == rejected.any()
        return bool(rejected.any())


BRAKE = 800.0  # N m
JUMPS = [
    # case, share of the speed then, plus [rad/s], share thereafter, car [m/s], brake torque [N m],
    # acceleration [m/s^2], rejected
    ("nothing", 1.0, 0.0, 1.0, 25.0, 0.0, 0.0, False),
    ("5 % more", 1.05, 0.0, 1.05, 25.0, 0.0, 0.0, True),
    ("5 % less", 0.95, 0.0, 0.95, 25.0, 0.0, 0.0, True),
    ("5 % more at half the speed", 1.05, 0.0, 1.05, 12.0, 0.0, 0.0, True),
    ("5 % less while linings brake", 0.95, 0.0, 0.95, 25.0, BRAKE, -4.0, True),
    ("1.5 rad/s less", 1.0, -1.5, 1.0, 25.0, 0.0, 0.0, True),
    ("zero", 0.0, 0.0, 0.0, 25.0, BRAKE, -4.0, True),
    ("half", 0.5, 0.0, 0.5, 7.0, 0.0, 0.0, True),
    ("wheels that lock go on", 0.95, 0.0, 0.9, 25.0, BRAKE, -4.0, False),
    ("wheels that lock differ", np.array([0.97, 0.97, 0.91, 0.91]), 0.0, 0.94, 25.0, BRAKE, -4.0, False),
    ("a slow car", 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, False),
]


@pytest.mark.parametrize(("case", "share", "plus", "then", "speed", "torque", "accel", "rejected"), JUMPS)
def test_a_jump_of_all_four(params, feed, case, share, plus, then, speed, torque, accel, rejected) -> None:
    unit = Unit(params, feed, speed)
    for _ in range(50):
        assert not unit.read(unit.omega, torque, accel)
    assert not unit.read(share * unit.omega + plus, torque, accel)
    assert unit.read(then * unit.omega + plus, torque, accel) == rejected, case


KICKS = [
    # case, motor torque then [N m], acceleration then [m/s^2], rejected
    ("nothing", 0.0, 0.0, True),
    ("a motor's torque", -300.0, 0.0, False),
    ("an engine's, unreported", 0.0, 1.5, False),
]


@pytest.mark.parametrize(("case", "torque", "accel", "rejected"), KICKS)
def test_a_torque_that_begins_turns_all_four(params, feed, case, torque, accel, rejected) -> None:
    unit = Unit(params, feed, 25.0)
    for _ in range(50):
        unit.read(unit.omega)
    unit.read(1.03 * unit.omega, accel=0.3 * accel, motor_torque=torque)
    assert unit.read(1.03 * unit.omega, accel=accel, motor_torque=torque) == rejected, case


def test_an_accelerometer_that_is_left_out_does_not_say_that_all_four_have_jumped(params, feed) -> None:
    unit = Unit(params, feed, 25.0)
    unit.estimate["measured"] = 0
    for _ in range(50):
        unit.read(unit.omega)
    unit.read(1.05 * unit.omega)
    assert not unit.read(1.05 * unit.omega)


def test_rough_wheel_speeds_have_not_jumped(params, feed) -> None:
    unit = Unit(params, feed, 25.0)
    assert not any(unit.read(unit.omega, noise=1.0) for _ in range(2000))


def test_values_that_a_gateway_repeats_have_not_jumped(params, feed) -> None:
    unit = Unit(params, feed, 25.0)
    for step in range(40):
        assert not unit.read((1.0 - 0.02 * (step // 5)) * unit.omega, BRAKE, -9.0, noise=0.0)


def test_wheels_that_come_back_from_a_slide_have_not_jumped(params, feed) -> None:
    unit = Unit(params, feed, 25.0)
    for share in (0.7, 0.7, 1.0, 1.0):
        assert not unit.read(share * unit.omega)


def test_a_sample_after_a_gap_is_no_jump(params, feed) -> None:
    unit = Unit(params, feed, 25.0)
    unit.read(unit.omega)
    unit.read(unit.omega)
    assert not unit.read(0.9 * unit.omega, dt=0.2)
    assert not unit.read(0.9 * unit.omega)


STUCK = [
    # deceleration, seconds, noise [rad/s], turning, rejected
    (4.0, 0.2, 0.0, True, False),
    (4.0, 0.3, 0.0, True, True),
    (4.0, 3.0, 0.1, True, False),
    (0.0, 60.0, 0.0, True, False),  # a logger rounds, the car keeps its speed
    (4.0, 3.0, 0.0, False, False),  # all are locked
]


@pytest.mark.parametrize(("decel", "seconds", "noise", "turns", "rejected"), STUCK)
def test_samples_that_stay_while_the_car_slows(params, feed, decel, seconds, noise, turns, rejected) -> None:
    unit, found = Unit(params, feed, 25.0), False
    unit.state["omega"] = unit.omega if turns else 0.0
    for _ in range(round(seconds / DT)):
        found = unit.read(unit.omega if turns else 0.0 * unit.omega, BRAKE, -decel, noise=noise)
    assert found == rejected


@pytest.mark.parametrize(
    ("speed", "back", "rejected"), [(4.0, 4.0, True), (2.5, 2.5, False), (4.0, 0.5, False)]
)
def test_all_turn_backwards_while_the_car_drives_forwards(params, feed, speed, back, rejected) -> None:
    unit = Unit(params, feed, speed)
    assert unit.read(-back / unit.params["wheel_radius"], dt=1.0) == rejected


BACK = [
    # case, brake torque [N m], acceleration [m/s^2], other signals, rejected
    ("brakes slow the car as forwards", BRAKE, -3.0, {}, True),
    ("brakes slow it as backwards", BRAKE, 3.0, {}, False),
    ("motors brake", 0.0, -3.0, {"motor_torque": BRAKE}, True),
    ("motors drive it backwards", 0.0, -3.0, {"motor_torque": -BRAKE}, False),
    ("nothing brakes", 0.0, -3.0, {}, False),
    ("an engine drives against the brakes", BRAKE, -3.0, {"accelerator_position": 30.0}, False),
    ("in reverse", BRAKE, -3.0, {"reverse": 1.0}, False),
]


@pytest.mark.parametrize(("case", "torque", "accel", "signals", "rejected"), BACK)
def test_all_turn_backwards_while_the_brakes_are_applied(
    params, feed, case, torque, accel, signals, rejected
) -> None:
    unit = Unit(params, feed, -2.0)
    unit.witness["rejected"][VEHICLE_SPEED] = 1
    assert unit.read(unit.omega, torque, accel, dt=1.0, **signals) == rejected, case
    assert unit.witness["rejected"][VEHICLE_SPEED] == (not rejected), case


@pytest.mark.parametrize(
    ("back", "accel", "rejected"), [(0.4, -3.0, True), (0.2, -3.0, False), (0.4, 0.0, False)]
)
def test_wheels_that_turn_backwards_turn_no_car_that_the_brakes_slow(
    params, feed, back, accel, rejected
) -> None:
    """From the speed on at which the car counts as one that rolls back; one that has stopped rocks."""
    unit = Unit(params, feed, 0.0)
    assert unit.read(-back / unit.params["wheel_radius"], BRAKE, accel, dt=1.0) == rejected
