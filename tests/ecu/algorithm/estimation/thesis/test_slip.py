"""Slip of the wheels, what is expected of it, and the rolling radii learned while they roll freely."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.thesis.slip import expect_slip, learn_radius, update_radius, update_slip
from ecu.algorithm.estimation.thesis.tyre import CURVE
from ecu.algorithm.step import STATE
from ecu.contract.signals import INPUT, WHEEL_SPEED

DT = 0.01
RADIUS = 0.36
LOADS = np.array([5000.0, 5000.0, 4000.0, 4000.0])


@pytest.fixture
def s():
    state = np.zeros(1, STATE)[0]
    state["wheels"]["radius"], state["wheel_load"]["load"] = RADIUS, LOADS
    state["learned"]["radius_sigma"] = 0.004
    return state


@pytest.mark.parametrize("frequency", [1.0, 4.0, 16.0])
def test_slip_is_low_passed_at_16_hz(params, feed, s, frequency: float) -> None:
    """First order: amplitude 1 / sqrt(1 + (f / 16)^2), sampled at 1 kHz."""
    speed, dt = 20.0, 0.001
    inputs = feed()
    slips = []
    for k in range(4000):
        slip = -0.02 + 0.01 * math.sin(2 * math.pi * frequency * k * dt)
        feed(inputs, wheel_speed=speed * (1 + slip) / RADIUS)
        update_slip(params[0], s["wheels"], s["motion"], inputs[0], speed, 0.0, dt)
        slips.append(s["wheels"]["slip"].copy())
    tail = np.array(slips[2000:])
    assert tail.mean(axis=0) == pytest.approx(np.full(4, -0.02), abs=1e-4)
    amplitude = (tail.max(axis=0) - tail.min(axis=0)) / 2
    assert amplitude == pytest.approx(np.full(4, 0.01 / math.sqrt(1 + (frequency / 16.0) ** 2)), rel=0.05)


def test_a_held_wheel_speed_is_no_new_slip(params, feed, s) -> None:
    inputs = feed(wheel_speed=19.6 / RADIUS)
    inputs[0]["new"][WHEEL_SPEED] = 0
    update_slip(params[0], s["wheels"], s["motion"], inputs[0], 20.0, 0.0, DT)
    assert list(s["wheels"]["fresh"]) == [0, 1, 1, 1]
    assert s["wheels"]["slip"][0] == 0.0
    assert (s["wheels"]["slip"][1:] < 0).all()


def test_an_old_sample_is_compared_with_the_speed_of_its_time(params, feed, s) -> None:
    inputs = feed(wheel_speed=20.0 / RADIUS)
    inputs[0]["age_ns"][WHEEL_SPEED : WHEEL_SPEED + 4] = 8_000_000
    for _ in range(100):  # now 19.936 m/s, 8 ms ago 20 m/s at -8 m/s^2
        update_slip(params[0], s["wheels"], s["motion"], inputs[0], 20.0 - 8.0 * 0.008, -8.0, DT)
    assert s["wheels"]["slip"] == pytest.approx(np.zeros(4), abs=1e-9)


@pytest.mark.parametrize("torque", [[1000.0, 1000.0, 300.0, 300.0], [0.0, 0.0, 0.0, 0.0]])
def test_expected_slip_accounts_for_the_total_force(params, feed, s, torque: list[float]) -> None:
    total = -7000.0
    params[0]["stiffness_degression"] = 0.0
    expect_slip(params[0], s["wheels"], feed()[0], LOADS, total, np.array(torque))
    adhesion = np.abs(s["wheels"]["expected_force"]) / LOADS
    secant = params[0]["slip_stiffness"] * LOADS * (1.0 - CURVE * adhesion)
    force = s["wheels"]["expected_slip"] * secant
    assert s["wheels"]["expected_force"].sum() == pytest.approx(total)
    assert force.sum() == pytest.approx(total)
    share = np.array(torque) / sum(torque) if any(torque) else LOADS / LOADS.sum()
    assert force / total == pytest.approx(share)


@pytest.mark.parametrize("total", [-1e9, 1e9])
def test_expected_slip_has_bounds(params, feed, s, total: float) -> None:
    expect_slip(params[0], s["wheels"], feed()[0], LOADS, total, np.full(4, 100.0))
    assert np.abs(s["wheels"]["expected_slip"]).max() <= 0.15


def coast(params, feed, s, seconds: float, errors, reference: bool, seed: int = 0, **motion) -> None:
    random, inputs, speed = np.random.default_rng(seed), feed(), 20.0
    s["speed"]["speed"], s["speed"]["started"] = speed, 1
    s["speed"]["reference_s"] = 0.0 if reference else 100.0
    for name, value in motion.items():
        s["motion"][name] = value
    for _ in range(round(seconds / DT)):
        update_radius(params[0], s["wheels"], s["learned"], LOADS)
        true = s["wheels"]["radius"] / (1 + s["learned"]["radius_error"]) * (1 + np.array(errors))
        feed(inputs, wheel_speed=speed / true + 0.1 * random.standard_normal(4))
        update_slip(params[0], s["wheels"], s["motion"], inputs[0], speed, 0.0, DT)
        learn_radius(params[0], s["wheels"], s["learned"], s["motion"], inputs[0], s["speed"], False, DT)


ERRORS = [0.003, -0.002, 0.001, -0.002]  # no common part


@pytest.mark.parametrize("reference", [True, False])
def test_radii_are_learned_while_the_wheels_roll_freely(params, feed, s, reference: bool) -> None:
    coast(params, feed, s, 60.0, ERRORS, reference)
    print("learned", s["learned"]["radius_error"], "sigma", s["learned"]["radius_sigma"])
    difference = s["learned"]["radius_error"] - s["learned"]["radius_error"].mean()
    assert difference == pytest.approx(ERRORS, abs=5e-4)
    assert (s["learned"]["radius_sigma"] < 0.001).all()


@pytest.mark.parametrize(
    "motion", [{"accel_x": -2.0}, {"accel_y": 2.0}, {"yaw_rate": 0.1}], ids=["braking", "curve", "turning"]
)
def test_nothing_is_learned_of_radii_otherwise(params, feed, s, motion: dict[str, float]) -> None:
    coast(params, feed, s, 5.0, ERRORS, True, **motion)
    assert not s["learned"]["radius_error"].any()


def test_a_wheel_that_is_not_heard_of_teaches_nothing(params, feed, s) -> None:
    inputs = feed(wheel_speed=20.0 / RADIUS)
    s["speed"]["speed"] = 20.0
    inputs[0]["new"][INPUT["wheel_speed_rr"]] = 0
    learn_radius(params[0], s["wheels"], s["learned"], s["motion"], inputs[0], s["speed"], False, DT)
    assert not s["learned"]["radius_error"].any()
