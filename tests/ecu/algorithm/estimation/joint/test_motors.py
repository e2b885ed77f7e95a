"""Motor torque as a regressor: its noise is measured, and teaches nothing."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.balance import predict_balance
from ecu.algorithm.estimation.joint.layout import DRAG, MASS, MOTOR
from ecu.algorithm.estimation.joint.motors import LARGEST_STEP, MEMORY, MOTORS_STATE, SMOOTHING, follow_motors
from ecu.algorithm.estimation.joint.observer import WINDOW_S
from ecu.algorithm.estimation.joint.wheel_speed import predict_wheel
from ecu.contract.signals import MOTOR_TORQUE

DT = 0.01
WHEELS = slice(MOTOR_TORQUE, MOTOR_TORQUE + 4)


def follow(feed, torques, every: int = 1):
    """Return `MOTORS_STATE` after readings [N m] of all wheels, shape (n, 4), new each `every` cycles."""
    state, inputs = np.zeros(1, MOTORS_STATE)[0], feed()
    for row in torques:
        for k in range(every):
            inputs[0]["value"][WHEELS], inputs[0]["new"][WHEELS] = row, k == 0
            follow_motors(state, inputs[0], DT)
    return state


TORQUES = {
    # what the torque does beside its noise, over the time [s]
    "rests": lambda time: 200.0 + 0.0 * time,
    "rises by 100 N m/s": lambda time: 100.0 * time,
    "swings by 100 N m at 0.5 Hz": lambda time: 100.0 * np.sin(math.pi * time),
}


@pytest.mark.parametrize("sigma", [2.0, 10.0, 25.0])
@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("name", TORQUES)
def test_second_differences_give_the_variance_of_white_noise(feed, name: str, every: int, sigma) -> None:
    """Mean over seeds; a torque that rests or rises evenly adds nothing to it, one that swings little."""
    torque, ratios = TORQUES[name](np.arange(3 * MEMORY) * every * DT)[:, None], []
    for seed in range(40):
        noise = sigma * np.random.default_rng(seed).standard_normal((3 * MEMORY, 4))
        ratios.append(follow(feed, torque + noise, every)["variance"] / sigma**2)
    bend = np.mean(np.diff(torque[:, 0], 2) ** 2) / 6 / sigma**2
    print(f"{name}, {sigma} N m: {np.mean(ratios):.3f} of the variance, {bend:.3f} of it by its bend")
    assert np.mean(ratios) == pytest.approx(1.0 + bend, abs=0.05)


@pytest.mark.parametrize("step", [1.01 * LARGEST_STEP, -1000.0])
def test_a_torque_that_steps_is_no_noise(feed, step: float) -> None:
    torques = np.where(np.arange(200) < 100, 0.0, step)[:, None] * np.ones(4)
    assert (follow(feed, torques)["variance"] == 0.0).all()


def test_a_torque_that_is_not_reported_has_none(feed) -> None:
    state, inputs = np.zeros(1, MOTORS_STATE)[0], feed(motor_torque=300.0)
    inputs[0]["verdict"][WHEELS] = 0
    inputs[0]["new"][WHEELS] = 0
    for _ in range(100):
        follow_motors(state, inputs[0], DT)
    assert state.tobytes() == np.zeros(1, MOTORS_STATE)[0].tobytes()


def test_the_smooth_torque_is_a_low_pass(feed) -> None:
    for count in (1, 20, 60):
        expected = 250.0 * (1 - math.exp(-count * DT / SMOOTHING))
        np.testing.assert_allclose(follow(feed, np.full((count, 4), 250.0))["smooth"], expected)


def test_derivatives_use_the_torque_up_to_the_end_of_the_last_window(new_car) -> None:
    """A second of noise, low-passed here."""
    car = new_car(speed=30.0, motor_noise=30.0)
    smooth, ends = np.zeros(4), 0
    for state in car.cycles(1.0, motor=-200.0):
        smooth = smooth + (1 - math.exp(-DT / SMOOTHING)) * (car.inputs[0]["value"][WHEELS] - smooth)
        if state["closed"]:
            ends += 1
            np.testing.assert_allclose(state["motors"]["last_smooth"], smooth, rtol=1e-12)
    assert ends == 20


@pytest.mark.parametrize("i", range(4))
def test_a_wheels_derivatives_hold_nothing_of_this_windows_torque(new_car, i: int) -> None:
    car = new_car(quiet=True, speed=30.0)
    state = car.drive(1.0, motor=200.0)

    def by_motor() -> float:
        predict_wheel(car.params, state, i, 30.0)
        return float(state["h"][MOTOR])

    before = by_motor()
    state["window"]["motor"] += 500.0
    assert by_motor() == pytest.approx(before, rel=1e-12)
    state["motors"]["last_smooth"] *= 1.01
    assert by_motor() == pytest.approx(1.01 * before, rel=1e-3)


@pytest.mark.parametrize("shift", [-300.0, 300.0])
def test_the_balances_derivatives_hold_nothing_of_this_windows_torque(new_car, shift: float) -> None:
    car = new_car(quiet=True, speed=30.0)
    state = car.drive(1.0, motor=-200.0)
    predict_balance(car.params, state, False)
    before = state["h"].copy()
    state["window"]["motor"] += shift
    predict_balance(car.params, state, False)
    np.testing.assert_array_equal(state["h"], before)


CRUISES = [
    # motor torque of each wheel [N m], which swings by as much as given every 8 s, so that mass is freed
    ("cruise", -100.0, 0.0),
    ("cruise that speeds up and slows down", -50.0, 200.0),
]


@pytest.mark.study
@pytest.mark.parametrize(("name", "mean", "swing"), CRUISES, ids=[row[0] for row in CRUISES])
def test_a_minute_of_noisy_motors_does_not_move_the_mass(new_car, name: str, mean, swing: float) -> None:
    """10 N m at each motor: were its square in what is learned, it would push the mass up for ever."""
    errors, said = [], []
    for seed in range(6):
        car = new_car(seed=seed, speed=25.0, motor_noise=10.0)
        car.drive(2.0)
        for k in range(15):
            state = car.drive(4.0, motor=mean + swing * (1 if k % 2 else -1))
        errors.append(state["x"][[MASS, MOTOR, DRAG]])
        said.append(np.sqrt(np.diag(state["p"])[[MASS, MOTOR, DRAG]]))
    shown, sigma = np.mean(errors, axis=0), np.mean(said, axis=0)
    print(f"{name}: mass, motor scale, drag {np.round(shown, 4)}, said {np.round(sigma, 4)}")
    assert (np.abs(np.array(errors)[:, 0]) < np.array(said)[:, 0]).all()
    assert (np.abs(shown) < sigma).all()
    assert abs(shown[0]) < 0.003


def test_the_variance_of_a_windows_mean_is_that_of_a_reading_over_their_number(new_car) -> None:
    """As the observer takes it: white noise of 10 N m, mean of a window's cycles."""
    car, means, said = new_car(seed=1, speed=25.0, motor_noise=10.0), [], []
    for state in car.cycles(20.0, motor=-100.0):
        if state["closed"]:
            means.append(state["window"]["motor"].copy())
            said.append(state["motors"]["variance"] / state["window"]["cycles"])
    assert np.mean(said) == pytest.approx(np.var(means), rel=0.1)
    assert np.mean(said) == pytest.approx(10.0**2 / round(WINDOW_S / DT), rel=0.1)
