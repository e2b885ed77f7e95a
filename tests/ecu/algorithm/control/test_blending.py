"""Who brakes a wheel: the table of (5.2, 5.3), limits that fall, motors that are lost, ABS."""

import math

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from ecu.algorithm.control.blending import (
    AHEAD,
    BLENDING_STATE,
    blends,
    motor_torque_demand,
    share_torque,
    update_motors,
)
from ecu.contract.signals import CORNERS, INPUT, USABLE

DT = 0.01
SPEED, DECEL = 15.0, 4.0


class Motors:
    """Blending of four wheels, cycle by cycle; what motors report is `gives` of their demand."""

    def __init__(
        self, params, feed, share: float, limit: float, gives: float = 1.0, slowness: float = 1.0
    ) -> None:
        self.slowness = slowness
        params["blending"] = share
        self.p, self.feed, self.inputs = params[0], feed, feed(motor_limit=limit)
        self.state = np.zeros(1, BLENDING_STATE)[0]
        self.gives, self.asked, self.guarded = gives, np.zeros(4), np.zeros(4, np.uint8)
        for _ in range(300):  # s until the plan counts on all of the limit
            self.cycle(0.0)

    def cycle(self, torque: float, lag: float = 0.0, speed: float = SPEED, **inputs: float) -> float:
        """Run a cycle with this torque demanded of each wheel; return what the first motor is asked for."""
        self.feed(self.inputs, **{"motor_torque": self.gives * self.asked, **inputs})
        update_motors(self.p, self.state, self.inputs[0], self.guarded, speed, DECEL, self.slowness, DT)
        share_torque(self.p, self.state, np.full(4, torque), self.slowness, DT)
        self.asked = np.array([motor_torque_demand(self.p, self.state, lag, i) for i in range(4)])
        return float(self.asked[0])

    def settle(self, torque: float) -> tuple[float, float]:
        """Return what motor and lining are asked for after a second."""
        for _ in range(100):
            motor = self.cycle(torque)
        return motor, float(self.state["lining"][0])


@pytest.mark.parametrize(
    ("share", "torque", "limit", "motor", "lining"),
    [
        (0.0, 900.0, 1350.0, 0.0, 900.0),  # (5.3a): off
        (0.2, 900.0, 1350.0, 180.0, 720.0),  # (5.3c): parallel
        (0.7, 900.0, 1350.0, 630.0, 270.0),
        (1.0, 900.0, 1350.0, 900.0, 0.0),  # (5.3b): series
        (0.7, 900.0, 400.0, 400.0, 500.0),  # the linings for what the motor cannot (ECE R13-H)
        (1.0, 900.0, 400.0, 400.0, 500.0),
        (1.0, 900.0, 0.0, 0.0, 900.0),
        (0.7, 0.0, 1350.0, 0.0, 0.0),
    ],
)
def test_motor_and_lining_share_the_torque(params, feed, share, torque, limit, motor, lining) -> None:
    found = Motors(params, feed, share, limit).settle(torque)
    assert found == pytest.approx((motor, lining), abs=1e-6)


def test_each_axle_has_its_share(params, feed) -> None:
    motors = Motors(params, feed, 0.5, 2000.0)
    params["blending"] = (1.0, 1.0, 0.0, 0.0)
    motors.settle(600.0)
    assert motors.state["lining"] == pytest.approx([0.0, 0.0, 600.0, 600.0], abs=1e-6)
    assert blends(motors.p)
    params["blending"] = 0.0
    assert not blends(motors.p)


@pytest.mark.parametrize(
    ("lag", "motor"), [(0.0, 540.0), (100.0, 640.0), (-100.0, 440.0), (500.0, 700.0), (-600.0, 0.0)]
)
def test_the_motor_makes_up_for_the_linings_lag_within_its_limit(params, feed, lag, motor) -> None:
    motors = Motors(params, feed, 0.6, 700.0)
    motors.settle(900.0)
    assert motors.cycle(900.0, lag) == pytest.approx(motor)


def test_the_motor_never_gives_more_than_is_demanded(params, feed) -> None:
    motors = Motors(params, feed, 0.6, 2000.0)
    motors.settle(900.0)
    assert motors.cycle(900.0, 5000.0) == pytest.approx(900.0)


@pytest.mark.parametrize(("rate", "slowness"), [(500.0, 1.0), (2000.0, 1.0), (1000.0, 0.5), (1000.0, 2.0)])
def test_a_limit_that_falls_is_planned_for_a_tenth_of_a_second_before(params, feed, rate, slowness) -> None:
    """As much longer as the hydraulics are slower."""
    motors = Motors(params, feed, 1.0, 900.0, slowness=slowness)
    motors.settle(800.0)
    for cycle in range(20):
        limit = 900.0 - rate * DT * (cycle + 1)
        asked = motors.cycle(800.0, motor_limit=limit)
        assert asked <= limit
    assert motors.state["lining"][0] >= 800.0 - (limit - 0.10 * slowness * rate)
    assert motors.state["lining"][0] <= 800.0 - (limit - 0.15 * slowness * rate)


@pytest.mark.parametrize("slowness", [0.5, 2.0, 4.0])
def test_the_slower_the_hydraulics_the_earlier_the_plan(params, feed, slowness: float) -> None:
    motors = Motors(params, feed, 1.0, 500.0, slowness=slowness)
    for k in range(1, 46):  # 1000 N m/s
        motors.cycle(10.0 * k)
    planned = max(500.0 - 0.12 * slowness * 1000.0, 0.0)
    assert motors.state["plan"][0] <= planned + 0.2 * 120.0 * slowness
    assert motors.state["lining"][0] == pytest.approx(450.0 - planned, rel=0.06)


def test_the_fade_at_low_speed_is_planned_for_before_the_limit_falls(params, feed) -> None:
    motors = Motors(params, feed, 1.0, 900.0)
    motors.settle(900.0)
    for speed, lining in ((5.0, 0.0), (3.5, 0.0), (3.1, 900.0 * (1 - (3.1 - 0.12 * DECEL) / 3.0))):
        for _ in range(100):
            motors.cycle(900.0, speed=speed)
        assert motors.state["lining"][0] == pytest.approx(lining, abs=1e-4)


def test_a_demand_that_rises_to_the_limit_calls_the_linings_before(params, feed) -> None:
    motors = Motors(params, feed, 1.0, 500.0)
    for k in range(1, 46):  # 1000 N m/s
        motors.cycle(10.0 * k)
    assert motors.state["lining"][0] == pytest.approx(450.0 - (500.0 - 0.12 * 1000.0), rel=0.02)


@pytest.mark.parametrize("name", ["abs_active", "esp_active", "reverse"])
def test_no_motor_brakes_where_another_controls_the_wheels_or_in_reverse(params, feed, name) -> None:
    motors = Motors(params, feed, 0.7, 1350.0)
    motors.settle(900.0)
    assert motors.cycle(900.0, 50.0, **{name: 1.0}) == 0.0
    for _ in range(60):
        motors.cycle(900.0, **{name: 1.0})
    assert motors.state["lining"][0] == pytest.approx(900.0, rel=1e-3)


def test_a_wheel_that_the_slip_guard_holds_has_no_motor(params, feed) -> None:
    motors = Motors(params, feed, 0.7, 1350.0)
    motors.settle(900.0)
    motors.guarded[0] = 1
    assert motors.cycle(900.0, 50.0) == 0.0
    assert motors.asked[1] == pytest.approx(680.0)


@pytest.mark.parametrize("name", ["motor_limit", "motor_torque"])
@pytest.mark.parametrize("how", ["invalid", "stale"])
@pytest.mark.parametrize("i", [0, 3])
def test_an_unknown_motor_fades_while_its_lining_takes_over(params, feed, name, how, i) -> None:
    motors = Motors(params, feed, 0.7, 1350.0)
    motors.settle(900.0)
    place = INPUT[f"{name}_{CORNERS[i]}"]
    asked = [motors.asked[i]]
    for k in range(40):
        if how == "invalid":
            motors.inputs["verdict"][0, place] = 0
        motors.inputs["age_ns"][0, place] = (k + 1) * 10_000_000
        motors.inputs["new"][0, place] = 0
        motors.cycle(900.0, lag=630.0)  # the lining has not moved yet
        asked.append(motors.asked[i])
    at_once = 1 if how == "invalid" else 5  # 50 ms old
    assert motors.state["lining"][i] == pytest.approx(900.0, rel=1e-3)
    assert np.all(np.diff(asked[at_once:]) <= 1e-9)
    assert asked[at_once + 1] > 600.0
    assert asked[at_once + 25] == 0.0
    assert motors.state["lining"][1] == pytest.approx(270.0)  # the other wheel's is known


def test_a_motor_whose_torque_is_unknown_is_asked_for_no_more_than_its_limit(params, feed) -> None:
    motors = Motors(params, feed, 0.7, 1350.0)
    motors.settle(40.0)
    motors.inputs["verdict"][0, INPUT["motor_torque_fl"]] = 0
    assert motors.cycle(1900.0, lag=1900.0, motor_limit=200.0) <= 200.0
    assert motors.cycle(1900.0, lag=1900.0, motor_limit=0.0) == 0.0
    assert motors.asked[1] == 0.0


@pytest.mark.parametrize(("gives", "lost"), [(1.0, False), (0.9, False), (0.5, True), (0.0, True)])
def test_a_motor_that_gives_too_little_is_planned_for_no_longer(params, feed, gives, lost) -> None:
    motors = Motors(params, feed, 0.7, 1350.0)
    motors.settle(900.0)
    motors.gives = gives
    for cycle in range(40):
        motors.cycle(900.0)
        if motors.state["lost"][0]:
            assert cycle <= 3
            break
    assert bool(motors.state["lost"][0]) == lost
    motors.settle(0.0)
    motors.gives = 1.0
    assert motors.settle(900.0)[0] == pytest.approx(630.0)  # tried again


def test_a_motor_that_drove_until_the_brakes_are_asked_for_is_not_short(params, feed) -> None:
    motors = Motors(params, feed, 0.7, 1350.0)
    for _ in range(100):
        motors.cycle(0.0, motor_torque=-900.0)
    motors.cycle(900.0, motor_torque=-900.0)
    assert motors.settle(900.0)[0] == pytest.approx(630.0)
    assert not motors.state["lost"].any()


def test_the_hydraulics_do_not_overshoot_when_a_motor_is_lost(params, feed) -> None:
    """(A.17) solved by scipy: a plain step of 630 N m would overshoot by 5.6 % and settle after 0.18 s."""
    motors = Motors(params, feed, 0.7, 1350.0)
    before = motors.settle(900.0)[1]
    asked = []
    for _ in range(40):
        motors.cycle(900.0, motor_limit=0.0)
        asked.append(float(motors.state["lining"][0]))
    t = np.arange(0.0, 0.4, 0.001)
    step = np.repeat(asked, 10) - before
    _, taken, _ = lsim(TransferFunction([1.0], [0.00075, 0.037, 1.0]), step, t)
    error = taken / (900.0 - before) - 1.0
    assert np.max(error) < 0.015
    assert np.max(np.abs(error[t > 0.13])) < 0.015


def test_the_plan_comes_back_slowly(params, feed) -> None:
    motors = Motors(params, feed, 1.0, 1000.0)
    motors.settle(900.0)
    motors.cycle(900.0, abs_active=1.0)
    lining = []
    for _ in range(60):
        motors.cycle(900.0, abs_active=0.0)
        lining.append(float(motors.state["lining"][0]))
    assert np.min(np.diff(lining)) == pytest.approx(-20.0)  # 2000 N m/s
    assert lining[-1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_the_sum_is_the_demand_and_nothing_is_ever_wild(params, feed, seed) -> None:
    random = np.random.default_rng(seed)
    motors = Motors(params, feed, random.uniform(), 1350.0)
    for _ in range(200):
        torque = random.choice([0.0, 300.0, 900.0, 2500.0])
        limit = random.choice([0.0, 200.0, 1350.0, math.nan])
        flags = {name: float(random.uniform() < 0.05) for name in ("abs_active", "esp_active")}
        verdict = USABLE if random.uniform() < 0.9 else 0
        for corner in CORNERS:
            motors.inputs["verdict"][0, INPUT[f"motor_limit_{corner}"]] = verdict
        asked = motors.cycle(torque, random.choice([0.0, 50.0, -50.0, math.nan]), motor_limit=limit, **flags)
        assert motors.state["lining"] + motors.state["plan"] == pytest.approx(np.full(4, torque))
        assert np.all(motors.state["lining"] >= 0.0)
        assert 0.0 <= asked <= max(torque, 0.0)


def test_without_a_request_there_is_none(params, feed) -> None:
    motors = Motors(params, feed, 0.7, 1350.0)
    motors.settle(900.0)
    assert motors.cycle(math.nan) == 0.0
    assert math.isnan(motors.state["lining"][0])


@pytest.mark.parametrize(
    ("of_fade_speed", "decel", "fade_speed", "left"),
    [
        (5.0, 4.0, 3.0, 1.0),  # far above it
        (1.0 + 0.5 * AHEAD, 3.0, 3.0, 1.0 - 0.5 * AHEAD),  # v - 0.1 s * 3 m/s^2, over 3 m/s
        (0.9, 4.0, 3.0, 1.0),  # below it the limit says so itself
        (1.01, 0.0, 3.0, 1.0),  # does not brake
        (1.01, -1.0, 3.0, 1.0),
        (1.01, 100.0, 3.0, 0.0),  # stands before the plan is due
        (1.01, 4.0, 0.0, 1.0),  # motors that do not fade
    ],
)
def test_what_will_be_left_of_a_limit_that_fades(
    params, feed, of_fade_speed, decel, fade_speed, left
) -> None:
    params["fade_speed"] = fade_speed
    state, inputs = np.zeros(1, BLENDING_STATE)[0], feed(motor_limit=1000.0, motor_torque=0.0)
    for _ in range(300):
        update_motors(params[0], state, inputs[0], np.zeros(4, np.uint8), of_fade_speed * 3.0, decel, 1.0, DT)
    assert state["allowed"] == pytest.approx([1000.0 * left] * 4)
