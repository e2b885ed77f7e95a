"""Zero and scale of the accelerometer: what wheels and coasting show of them, and what they do not."""

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.accel_error import (
    ACCEL_ERROR_STATE,
    correct_accel,
    follow_accel_error,
    watch_frozen,
)
from ecu.algorithm.monitoring.acceleration import ACCELERATION_STATE, watch_acceleration
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.params import GRAVITY
from ecu.contract.signals import INPUT

DT = 0.01


class Car:
    """Ten brakings of 4 m/s^2, between them the motors drive and the car coasts."""

    def __init__(self, params, feed) -> None:
        self.p, self.feed, self.inputs = params[0], feed, feed()
        self.blocks, self.estimate = np.zeros(1, ACCELERATION_STATE)[0], np.zeros(1, ESTIMATE)[0]
        self.state, self.witness = np.zeros(1, ACCEL_ERROR_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
        self.random, self.clock = np.random.default_rng(7), 0.0
        self.estimate["mu"] = self.p["mu_nominal"]

    def asked(self, t: float) -> float:
        """Acceleration of a cycle of 12 s [m/s^2]: 4 s driven, 3 s coasting, 5 s braked."""
        t %= 12.0
        return 2.5 if t < 4.0 else 0.0 if t < 7.0 else -4.0 * min((t - 7.0) / 0.4, 1.0) if t < 9.5 else 0.0

    def drive(self, seconds, zero=0.0, scale=0.0, slope=0.0, motors=1.0, frozen=False) -> None:
        """`motors`: share of the driving force that their torques show; `slope` of the road [m/s^2]."""
        p, base = self.p, self.p["mu_nominal"].copy()
        speed = 20.0
        for _ in range(round(seconds / DT)):
            self.clock += DT
            force = self.asked(self.clock)
            resistance = p["drag_area"] * speed * speed / p["mass"] + p["rolling_resistance"] * GRAVITY
            if force > 0.0:  # a third of the time: what keeps the speed
                force += 3.0 * (resistance + slope)
            dv = force - resistance - slope
            speed = max(speed + DT * dv, 12.0)
            slip = force / (GRAVITY * p["slip_stiffness"][0])
            wheels = speed * (1.0 + slip) / p["wheel_radius"]
            reading = (1.0 + scale) * dv + slope + zero + self.random.normal(0.0, 0.05)
            wheel_torque = force * p["mass"] * p["wheel_radius"] / 4.0
            self.feed(
                self.inputs,
                wheel_speed=wheels + self.random.normal(0.0, p["sigma_wheel_speed"], 4),
                motor_torque=-wheel_torque * (motors if force > 0.0 else 0.0),
                calliper_pressure=0.0,
            )
            if not frozen:
                self.inputs[0]["value"][INPUT["accel_x"]] = reading
            self.estimate["speed"] = speed
            self.estimate["brake_torque"] = np.maximum(-wheel_torque, 0.0)
            braking = force < 0.0
            watch_acceleration(
                p, self.blocks, self.witness, self.inputs[0], self.estimate, base, 0.0, braking, DT
            )
            watch_frozen(self.state, self.blocks, self.witness, self.inputs[0], DT)
            if self.blocks["time"] == 0.0:
                follow_accel_error(p, self.state, self.witness, self.blocks, 0.0, braking)


# reading, seconds; taken off a reading of 0 and of -4 m/s2
CASES = [
    ("right", {}, 60.0, 0.0, 0.0),
    ("a slope of 5 %", {"slope": 0.5}, 60.0, 0.0, 0.0),
    ("a zero of 0.1 is left to the observer", {"zero": 0.1}, 60.0, 0.0, 0.0),
    ("a scale of 2 % too", {"scale": 0.02}, 60.0, 0.0, 0.0),
    ("a scale of 15 %", {"scale": 0.15}, 60.0, 0.0, -0.52),
    ("a scale of -15 %", {"scale": -0.15}, 60.0, 0.0, 0.7),
]


@pytest.mark.parametrize(("case", "wrong", "seconds", "at_rest", "braked"), CASES, ids=[c[0] for c in CASES])
def test_what_is_taken_off_a_reading(params, feed, case, wrong, seconds, at_rest, braked) -> None:
    car = Car(params, feed)
    car.drive(24.0)
    car.drive(seconds, **wrong)
    print(car.state)
    assert -correct_accel(car.state, 0.0) == pytest.approx(at_rest, abs=0.1)
    assert -4.0 - correct_accel(car.state, -4.0) == pytest.approx(braked, abs=0.2)


ON_A_SLOPE = [
    # what begins to lie, taken off a reading of 0
    ("the accelerometer's zero, up", {"zero": 0.5}, 0.5),
    ("down", {"zero": -0.5}, -0.5),
    ("the motors, by as much as the slope", {"motors": 1.3}, 0.0),
    ("nobody", {}, 0.0),
]


@pytest.mark.parametrize("slope", [-0.6, 0.0, 0.6])
@pytest.mark.parametrize(("case", "wrong", "off"), ON_A_SLOPE, ids=[c[0] for c in ON_A_SLOPE])
def test_a_slope_is_no_zero(params, feed, slope: float, case, wrong, off: float) -> None:
    """The wheels show it as they did before; what motors alone show is none either."""
    car = Car(params, feed)
    car.drive(48.0, slope=slope)
    car.drive(40.0, **{"slope": slope} | wrong)
    print(car.state)
    assert -correct_accel(car.state, 0.0) == pytest.approx(off, abs=0.1)
