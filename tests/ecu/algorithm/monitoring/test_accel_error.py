"""Zero and scale of the accelerometer: what wheels and coasting show of them, and what they do not."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.accel_error import (
    ACCEL_ERROR_STATE,
    accel_unknown,
    correct_accel,
    follow_accel_error,
)
from ecu.algorithm.monitoring.accel_timing import watch_timing
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
        self.reported: float | None = None
        self.estimate["mu"] = self.p["mu_nominal"]

    def asked(self, t: float) -> float:
        """Acceleration of a cycle of 12 s [m/s^2]: 4 s driven, 3 s coasting, 5 s braked."""
        t %= 12.0
        return 2.5 if t < 4.0 else 0.0 if t < 7.0 else -4.0 * min((t - 7.0) / 0.4, 1.0) if t < 9.5 else 0.0

    def drive(
        self, seconds, zero=0.0, scale=0.0, slope=0.0, motors=1.0, rolled=1.0, ground=None, grows=False
    ) -> None:
        """Drive on.

        Args:
            seconds: duration.
            zero: of the accelerometer [m/s^2].
            scale: of it.
            slope: of the road [m/s^2].
            motors: share of the driving force that their torques show.
            rolled: of their speed that all wheel speeds show.
            ground: share of their speed that the vehicle speed shows; None: there is none.
            grows: these are what is added to each in a second.
        """
        p, base = self.p, self.p["mu_nominal"].copy()
        speed, each = 20.0, (zero, scale, slope, motors - 1.0, rolled - 1.0, (ground or 1.0) - 1.0)
        for k in range(round(seconds / DT)):
            self.clock += DT
            if grows:
                zero, scale, slope, motors, rolled, over = (k * DT * value for value in each)
                motors, rolled, ground = 1.0 + motors, 1.0 + rolled, None if ground is None else 1.0 + over
            force = self.asked(self.clock)
            resistance = p["drag_area"] * speed * speed / p["mass"] + p["rolling_resistance"] * GRAVITY
            if force > 0.0:  # a third of the time: what keeps the speed
                force += 3.0 * (resistance + slope)
            dv = force - resistance - slope
            speed = max(speed + DT * dv, 12.0)
            slip = force / (GRAVITY * p["slip_stiffness"][0])
            wheels = rolled * speed * (1.0 + slip) / p["wheel_radius"]
            reading = (1.0 + scale) * dv + slope + zero + self.random.normal(0.0, 0.05)
            wheel_torque = force * p["mass"] * p["wheel_radius"] / 4.0
            self.feed(
                self.inputs,
                wheel_speed=wheels + self.random.normal(0.0, p["sigma_wheel_speed"], 4),
                motor_torque=-wheel_torque * (motors if force > 0.0 else 0.0),
                calliper_pressure=0.0,
            )
            self.inputs[0]["value"][INPUT["accel_x"]] = reading
            self.estimate["speed"] = rolled * speed
            self.estimate["brake_torque"] = np.maximum(-wheel_torque, 0.0)
            braking, above = force < 0.0, math.nan if ground is None else ground / rolled - 1.0
            watch_acceleration(
                p, self.blocks, self.witness, self.inputs[0], self.estimate, base, 0.0, braking, DT
            )
            watch_timing(self.state["timing"], self.blocks, self.witness, self.inputs[0], DT)
            if self.blocks["time"] == 0.0:
                follow_accel_error(p, self.state, self.witness, self.blocks, 0.0, above, braking)
            if self.state["reported"] and self.reported is None:
                self.reported = self.clock

    def stand(self, seconds) -> None:
        self.blocks["mean"] = 0.0
        self.blocks["good_blocks"] = self.blocks["known_blocks"] = 0
        for _ in range(round(seconds / 0.1)):
            follow_accel_error(self.p, self.state, self.witness, self.blocks, 0.0, math.nan, False)


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


GROWS = [
    # what grows, each second; reported after [s], None: never
    ("nothing", {}, None),
    ("the accelerometer's zero by 0.05 m/s2", {"zero": 0.05}, 6.0),
    ("by -0.05 m/s2", {"zero": -0.05}, 6.0),
    ("its scale by 1 %", {"scale": 0.01}, 15.0),
    ("by -1 %", {"scale": -0.01}, 15.0),
    ("the slope by 0.05 m/s2", {"slope": 0.05}, None),
    ("all wheel speeds by 0.5 %", {"rolled": 1.005}, None),
    ("by -0.5 %", {"rolled": 0.995}, None),
    ("motor torques by 1 %", {"motors": 1.01}, None),
]


@pytest.mark.parametrize(("case", "wrong", "after"), GROWS, ids=[c[0] for c in GROWS])
def test_when_the_accelerometer_is_reported(params, feed, case, wrong, after: float | None) -> None:
    """By two witnesses; what one alone shows is taken off no reading."""
    car = Car(params, feed)
    car.drive(48.0)
    car.drive(20.0, grows=True, **wrong)
    print(car.reported, car.state)
    if after is None:
        assert car.reported is None
        assert correct_accel(car.state, -4.0) == -4.0
    else:
        assert car.reported is not None
        assert 1.0 < car.reported - 48.0 < after


AT_ONCE = [
    # what errs after two drives; is it reported in the next one
    ("nothing", {}, False),
    ("the accelerometer's zero by 0.25 m/s2", {"zero": 0.25}, True),
    ("by -0.25 m/s2", {"zero": -0.25}, True),
    ("its scale by 7 %", {"scale": 0.07}, True),
    ("by -7 %", {"scale": -0.07}, True),
    ("the slope by 0.25 m/s2", {"slope": 0.25}, False),
    ("motor torques by 7 %", {"motors": 1.07}, False),
]


@pytest.mark.parametrize(("case", "wrong", "reported"), AT_ONCE, ids=[c[0] for c in AT_ONCE])
def test_an_error_that_stays_is_not_learned_as_usual(params, feed, case, wrong, reported: bool) -> None:
    car = Car(params, feed)
    car.drive(24.0)
    car.drive(4.0, **wrong)
    print(car.state)
    assert bool(car.state["reported"]) == reported
    assert accel_unknown(car.state) == reported
    car.drive(2.5, **wrong)  # coasting, where a scale does not show
    assert bool(car.state["reported"]) == reported


@pytest.mark.parametrize(("stands", "reported"), [(0.0, True), (15.0, False)])
def test_who_gets_in_at_a_standstill_is_no_error_of_the_accelerometer(
    params, feed, stands: float, reported: bool
) -> None:
    """A sixth more of mass, on a road that climbs as much as the car then lacks."""
    car = Car(params, feed)
    car.drive(48.0)
    car.stand(stands)
    car.drive(12.0, motors=1.17)
    car.drive(24.0, motors=1.17, slope=-0.5)
    assert (car.reported is not None) == reported


ROLLS = [
    # what is wrong, are all wheel speeds reported
    ("nothing", {}, False),
    ("all wheel speeds by 3 %", {"rolled": 1.03}, False),
    ("by 8 %", {"rolled": 1.08}, True),
    ("by -8 %", {"rolled": 0.92}, True),
    ("the accelerometer's scale by 8 %", {"scale": 0.08}, False),
    ("motor torques by 8 %", {"motors": 1.08}, False),
    ("a slope of 8 %", {"slope": 0.8}, False),
]


@pytest.mark.parametrize(("case", "wrong", "reported"), ROLLS, ids=[c[0] for c in ROLLS])
def test_all_wheel_speeds_are_scaled(params, feed, case, wrong, reported: bool) -> None:
    """Against the accelerometer, which the torques confirm; nothing is taken off it then."""
    car = Car(params, feed)
    car.drive(48.0)
    car.drive(24.0, **wrong)
    print(car.state)
    assert bool(car.state["rolls_wrong"]) == reported
    if reported:
        assert correct_accel(car.state, -4.0) == -4.0


SLOWLY = [
    # what grows each second beside a speed over ground, taken off a reading of -4 m/s2 after five minutes
    ("nothing", {"ground": 1.0}, 0.0),
    ("the accelerometer's scale by 0.02 %", {"scale": 2e-4, "ground": 1.0}, -0.16),
    ("by -0.02 %", {"scale": -2e-4, "ground": 1.0}, 0.16),
    ("all wheel speeds by 0.02 %", {"rolled": 1.0002, "ground": 1.0}, 0.0),
    ("by -0.02 %", {"rolled": 0.9998, "ground": 1.0}, 0.0),
    ("the vehicle speed by 0.02 %", {"ground": 1.0002}, 0.0),
    ("motor torques by 0.02 %", {"motors": 1.0002, "ground": 1.0}, 0.0),
]


@pytest.mark.parametrize(("case", "wrong", "off"), SLOWLY, ids=[c[0] for c in SLOWLY])
def test_a_scale_that_grows_slowly_is_no_usual_one(params, feed, case, wrong, off: float) -> None:
    """Wheels and speed over ground are two witnesses; what is not taken off is a sound sensor's 2 %."""
    car = Car(params, feed)
    car.drive(48.0, ground=1.0)
    car.drive(300.0, grows=True, **wrong)
    print(car.reported, car.state)
    assert -4.0 - correct_accel(car.state, -4.0) == pytest.approx(off, abs=0.06)


def test_a_slope_that_begins_as_the_car_brakes_is_in_no_usual_scale(params, feed) -> None:
    """While the brakes act it looks like a scale; once they are released it does not."""
    usual = []
    for slope in (0.0, -0.6):
        car = Car(params, feed)
        car.drive(7.0)
        car.drive(17.0, slope=slope)
        usual.append(float(car.state["wheels"]["usual"]["scale"]))
    print(usual)
    assert usual[1] == pytest.approx(usual[0], abs=0.015)


@pytest.mark.parametrize(("blocks", "off"), [(3, 0.0), (4, 0.05)])
def test_a_scale_that_a_few_blocks_show_is_none_yet(params, feed, blocks: int, off: float) -> None:
    car = Car(params, feed)
    car.drive(48.0)
    for line in ("wheels", "torques"):
        car.state[line]["now"]["scale"] = car.state[line]["usual"]["scale"] + 0.05
    car.blocks["good_blocks"] = car.blocks["known_blocks"] = 0
    for _ in range(blocks):
        follow_accel_error(car.p, car.state, car.witness, car.blocks, 0.0, math.nan, False)
    assert car.state["scale_off"] == pytest.approx(off)
