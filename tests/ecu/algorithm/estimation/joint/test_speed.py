"""The joint observer's speed over a gap: nobody tells how the car moves, and brakes are applied meanwhile."""

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.layout import CHANGE, JOINT_STATE, LEVEL, V
from ecu.algorithm.estimation.joint.observer import WINDOW_S, update_joint
from ecu.algorithm.estimation.joint.speed import speed_is_wrong
from ecu.contract.signals import CALLIPER_PRESSURE, VEHICLE_SPEED, WHEEL_SPEED

BRAKING = {"front": 38.0, "rear": 30.0}
SENSORS = [
    VEHICLE_SPEED,
    *range(WHEEL_SPEED, WHEEL_SPEED + 4),
    *range(CALLIPER_PRESSURE, CALLIPER_PRESSURE + 4),
]


def miss(car, seconds: float, silent: bool, **how) -> None:
    """Drive on unseen: the bus is silent, or the ECU oversleeps and reads what is newest then."""
    observe, verdict = car.observe, car.inputs[0]["verdict"].copy()
    cycles = round(seconds / 0.01)

    def blind(braking: bool) -> None:
        if not silent:
            return
        car.inputs[0]["verdict"][SENSORS] = 0
        car.inputs[0]["new"][:] = 0
        car.motion["measured"], car.motion["accel_x"] = 0, 0.0  # with no pressure either
        observe(car.braked)

    new = car.inputs[0]["new"].copy()
    car.observe = blind
    car.drive((cycles - 1) * 0.01, reference=False, **how)
    car.inputs[0]["verdict"], car.inputs[0]["new"], car.motion["measured"] = verdict, new, 1
    car.observe = observe
    if not silent:
        car.observe = lambda braking: update_joint(
            car.params, car.state, car.inputs[0], car.motion, car.load, car.hydraulics, car.braked, seconds
        )
        car.drive(0.01, reference=False, **how)
        car.observe = observe


GAPS = [
    # s, speed before, lining over nominal
    (0.15, 28.0, 1.0),
    (0.4, 28.0, 1.0),
    (0.4, 28.0, 0.8),
    (1.0, 28.0, 1.0),
    (0.4, 12.0, 1.2),
    (1.0, 12.0, 1.0),
]


@pytest.mark.parametrize("silent", [True, False], ids=["silent bus", "overslept"])
@pytest.mark.parametrize(("seconds", "speed", "lining"), GAPS)
def test_brakes_applied_in_a_gap_are_no_slip(new_car, seconds, speed, lining, silent) -> None:
    """Up to 5 m/s slower than by dead reckoning: the wheels tell the speed, not a slippery road."""
    car = new_car(quiet=True, speed=speed, mu=0.45 * lining)
    car.drive(1.0, reference=False)
    car.drive(0.5, reference=False, **BRAKING)
    car.drive(0.3, reference=False)
    miss(car, seconds, silent, **BRAKING)
    state = car.drive(0.2, reference=False, **BRAKING)
    assert state["x"][V] == pytest.approx(car.speed, rel=0.01)
    assert state["slides"].tolist() == [0] * 4
    state = car.drive(0.5, reference=False, **BRAKING)
    friction = np.exp(state["x"][LEVEL : LEVEL + 4] + np.repeat(state["x"][CHANGE : CHANGE + 2], 2))
    assert friction == pytest.approx([lining] * 4, rel=0.05)
    assert state["ceiling_variance"] == 0.0


def test_wheels_that_lock_in_a_gap_are_not_the_car(new_car) -> None:
    car = new_car(quiet=True, speed=25.0)
    car.drive(1.0, reference=False)
    miss(car, 0.3, True, slide=dict.fromkeys(range(4), -0.6), **BRAKING)
    state = car.drive(0.3, reference=False, slide=dict.fromkeys(range(4), 0.6), **BRAKING)
    assert state["x"][V] == pytest.approx(car.speed, rel=0.15)
    assert state["sliding"] == 4


SPINNING = [
    # N m of all motors, change of the wheels' distance from the speed [m/s^2], s, whether the speed is wrong
    (0.0, 0.0, 2.9, False),
    (0.0, 0.0, 3.2, True),
    (0.0, -2.5, 3.2, True),  # undriven wheels roll, whatever the accelerometer says
    (-2000.0, 0.0, 3.2, True),  # driven ones that change their speed as the car does
    (-2000.0, 0.3, 3.2, True),  # and an accelerometer's error
    (-2000.0, -2.5, 14.0, False),  # they spin: their speed stays, and the car's rises
    (-2000.0, -2.5, 15.2, True),
]


@pytest.mark.parametrize(("torque", "drift", "seconds", "wrong"), SPINNING)
def test_wheels_that_differ_from_the_speed_for_long(params, feed, torque, drift, seconds, wrong) -> None:
    state, inputs = np.zeros(1, JOINT_STATE), feed(motor_torque=torque / 4.0)
    window, found = state["window"][0], False
    window["time"], window["omega_samples"] = WINDOW_S, 5
    state["x"][0, V] = 20.0
    for _ in range(round(seconds / WINDOW_S)):
        state["untrusted_s"] += WINDOW_S
        distance = 8.0 + drift * state["untrusted_s"][0]
        window["omega"] = (20.0 + distance) / params[0]["wheel_radius"]
        found = found or speed_is_wrong(params[0], state[0], inputs[0])
    assert found == wrong


def test_without_any_wheel_the_speed_over_ground_is_the_speed(new_car) -> None:
    """For longer than the speed is believed that all wheels differ from."""
    car = new_car(quiet=True, speed=20.0)
    car.drive(0.1)
    wheels = slice(WHEEL_SPEED, WHEEL_SPEED + 4)
    car.inputs[0]["verdict"][wheels] = car.inputs[0]["new"][wheels] = 0
    for _ in range(20):
        car.drive(1.0)
        assert car.state["started"]
        assert car.state["x"][V] == pytest.approx(car.speed, abs=0.1)
