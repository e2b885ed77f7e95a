"""All four wheel speeds at once: what no car lets a unit measure, and what cars do."""

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.wheel_unit import WHEEL_UNIT_STATE, watch_wheel_unit
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.signals import MOTOR_TORQUE, WHEEL_SPEED

DT = 0.01


class Unit:
    """Four wheels of a car at `speed` [m/s]."""

    def __init__(self, params, feed, speed: float) -> None:
        self.params, self.feed, self.inputs = params[0], feed, feed()
        self.state, self.witness = np.zeros(1, WHEEL_UNIT_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
        self.estimate = np.zeros(1, ESTIMATE)[0]
        self.estimate["speed"] = speed
        self.omega = speed / self.params["wheel_radius"]
        self.random = np.random.default_rng(1)

    def read(self, omega, torque: float = 0.0, gas: float = 0.0, noise: float = 0.1, dt: float = DT) -> bool:
        """Take a sample of each [rad/s]; return whether all are rejected."""
        self.estimate["brake_torque"] = torque
        omega = omega + noise * self.random.standard_normal(4)
        self.feed(self.inputs, wheel_speed=omega, accelerator_position=gas, motor_torque=0.0)
        if gas > 0.0:  # of an engine that reports none
            self.inputs[0]["verdict"][MOTOR_TORQUE : MOTOR_TORQUE + 4] = 0
        watch_wheel_unit(self.params, self.state, self.witness, self.inputs[0], self.estimate, 0.0, dt)
        rejected = self.witness["rejected"][WHEEL_SPEED : WHEEL_SPEED + 4]
        assert rejected.all() == rejected.any()
        return bool(rejected.any())


JUMPS = [
    # case, share of the speed then, plus [rad/s], car [m/s], brake torque [N m], accelerator [%], rejected
    ("nothing", 1.0, 0.0, 25.0, 0.0, 0.0, False),
    ("5 % more", 1.05, 0.0, 25.0, 0.0, 0.0, True),
    ("5 % less", 0.95, 0.0, 25.0, 0.0, 0.0, True),
    ("4 rad/s less", 1.0, -4.0, 25.0, 0.0, 0.0, True),
    ("zero", 0.0, 0.0, 25.0, 800.0, 0.0, True),
    ("turned round, in range", -1.0, 0.0, 5.5, 0.0, 0.0, True),
    ("5 % less as hard brakes may", 0.95, 0.0, 25.0, 800.0, 0.0, False),
    ("5 % more as an engine may", 1.05, 0.0, 25.0, 0.0, 50.0, False),
    ("20 % more, no engine may", 1.2, 0.0, 25.0, 0.0, 50.0, True),
    ("wheels that lock differ", np.array([0.9, 0.9, 0.8, 0.8]), 0.0, 25.0, 200.0, 0.0, False),
    ("a slow car", 0.0, 0.0, 4.0, 0.0, 0.0, False),
]


@pytest.mark.parametrize(("case", "share", "plus", "speed", "torque", "gas", "rejected"), JUMPS)
def test_a_jump_of_all_four(params, feed, case, share, plus, speed, torque, gas, rejected) -> None:
    unit = Unit(params, feed, speed)
    for _ in range(50):
        assert not unit.read(unit.omega, torque, gas)
    assert unit.read(share * unit.omega + plus, torque, gas) == rejected, case


def test_wheels_that_come_back_from_a_slide_have_not_jumped(params, feed) -> None:
    unit = Unit(params, feed, 25.0)
    unit.read(0.7 * unit.omega)
    assert not unit.read(unit.omega)


def test_a_sample_after_a_gap_is_no_jump(params, feed) -> None:
    unit = Unit(params, feed, 25.0)
    unit.read(unit.omega)
    assert not unit.read(0.9 * unit.omega, dt=0.2)


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
    unit.estimate["accel_x"] = -decel
    unit.state["omega"] = unit.omega if turns else 0.0
    for _ in range(round(seconds / DT)):
        found = unit.read(unit.omega if turns else 0.0 * unit.omega, 800.0, noise=noise)
    assert found == rejected


@pytest.mark.parametrize(
    ("speed", "back", "rejected"), [(4.0, 4.0, True), (2.5, 2.5, False), (4.0, 0.5, False)]
)
def test_all_turn_backwards_while_the_car_drives_forwards(params, feed, speed, back, rejected) -> None:
    unit = Unit(params, feed, speed)
    assert unit.read(-back / unit.params["wheel_radius"], dt=1.0) == rejected
