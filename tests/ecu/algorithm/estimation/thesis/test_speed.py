"""The speed filter against a Kalman filter of plain 2 x 2 matrices, and against braked wheels that slip."""

import numpy as np
import pytest

from ecu.algorithm.estimation.motion import MOTION_STATE
from ecu.algorithm.estimation.thesis.slip import WHEELS_STATE
from ecu.algorithm.estimation.thesis.speed import (
    BIAS_DRIFT,
    BIAS_START,
    RADIUS_SAMPLES,
    SPEED_STATE,
    SPEED_WALK,
    update_speed,
)
from ecu.contract.records import LEARNED
from ecu.contract.signals import ACCEL_X, VEHICLE_SPEED, WHEEL_SPEED

DT = 0.01
RADIUS = 0.36
RADIUS_SIGMA = 0.0005
SIGMA_OMEGA, SIGMA_V, SIGMA_A = 0.1, 0.027, 0.01  # Table 4.1


class Filter:
    """The filter on the inputs of a straight road."""

    def __init__(self, params, feed, expected_slip=0.0) -> None:
        self.params, self.feed, self.inputs = params[0], feed, feed()
        self.inputs[0]["new"][:] = 0
        self.state = np.zeros(1, SPEED_STATE)[0]
        self.motion = np.zeros(1, MOTION_STATE)[0]
        self.wheels = np.zeros(1, WHEELS_STATE)[0]
        self.learned = np.zeros(1, LEARNED)[0]
        self.wheels["radius"], self.wheels["expected_slip"] = RADIUS, expected_slip
        self.learned["radius_sigma"] = RADIUS_SIGMA

    def cycle(self, accel, omega=None, reference=None, age_s=0.0, braking=False, dt=DT) -> float:
        new, age = self.inputs[0]["new"], self.inputs[0]["age_ns"]
        new[:], age[:] = 0, round(age_s * 1e9)
        self.motion["accel_x"] = accel
        if omega is not None:
            self.feed(self.inputs, wheel_speed=omega)
            new[WHEEL_SPEED : WHEEL_SPEED + 4] = 1
        if reference is not None:
            self.feed(self.inputs, vehicle_speed=reference, vehicle_speed_valid=1.0)
            new[VEHICLE_SPEED] = 1
        update_speed(
            self.params, self.state, self.motion, self.wheels, self.learned, self.inputs[0], braking, dt
        )
        return float(self.state["speed"])


def dense(rows, start_radius: np.ndarray) -> np.ndarray:
    """Return (v, b, P_vv, P_vb, P_bb) after each cycle; rows: accel, omega, reference, age."""
    x = np.array([np.mean(rows[0][1] * start_radius), 0.0])
    P = np.diag([0.25, BIAS_START**2])
    F = np.array([[1.0, -DT], [0.0, 1.0]])
    Q = np.diag([(DT * SIGMA_A) ** 2 + SPEED_WALK**2 * DT, BIAS_DRIFT**2 * DT])
    H = np.array([[1.0, 0.0]])
    out = []
    for accel, omega, reference, age in rows:
        x = F @ x + np.array([DT * accel, 0.0])
        P = F @ P @ F.T + Q
        measurements = []
        if reference is not None:
            measurements.append((reference, SIGMA_V**2, age))
        if omega is not None:
            variance = (SIGMA_OMEGA * RADIUS) ** 2
            measurements += [(w * RADIUS, variance, age) for w in omega]
        for z, variance, late in measurements:
            if variance != SIGMA_V**2:
                variance += RADIUS_SAMPLES * (RADIUS_SIGMA * x[0]) ** 2
            S = H @ P @ H.T + variance
            K = P @ H.T / S
            at_sample = x[0] - late * (accel - x[1])
            x = x + (K * (z - at_sample)).ravel()
            P = (np.eye(2) - K @ H) @ P
        out.append([*x, P[0, 0], P[0, 1], P[1, 1]])
    return np.array(out)


def drive(seed: int, seconds: float, reference_every: int | None, age: float):
    """Return rows of a gentle drive: speed, accelerations, wheels that roll freely."""
    random = np.random.default_rng(seed)
    speed, rows = 20.0, []
    for k in range(round(seconds / DT)):
        accel = 0.8 * np.sin(0.01 * k)
        speed += DT * accel
        seen = speed - age * accel
        omega = seen / RADIUS + SIGMA_OMEGA * random.standard_normal(4)
        with_reference = reference_every and k % reference_every == 0
        reference = seen + SIGMA_V * random.standard_normal() if with_reference else None
        rows.append((accel + 0.1 + SIGMA_A * random.standard_normal(), omega, reference, age))
    return rows, speed


@pytest.mark.parametrize("age", [0.0, 0.006])
@pytest.mark.parametrize("reference_every", [None, 1, 10])
def test_it_is_the_textbook_filter(params, feed, reference_every, age) -> None:
    rows, _ = drive(3, 10.0, reference_every, age)
    expected = dense(rows, params[0]["wheel_radius"])
    unit = Filter(params, feed)
    for row, reference in zip(rows, expected, strict=True):
        unit.cycle(*row)
        got = [float(unit.state[k]) for k in ("speed", "bias", "p_vv", "p_vb", "p_bb")]
        assert got == pytest.approx(reference, rel=1e-7, abs=1e-10)


def test_the_bias_of_the_accelerometer_and_the_grade_are_found(params, feed) -> None:
    rows, speed = drive(4, 60.0, 10, 0.0)
    unit = Filter(params, feed)
    for row in rows:
        unit.cycle(*row)
    assert unit.state["speed"] == pytest.approx(speed, abs=0.05)
    assert unit.state["bias"] == pytest.approx(0.1, abs=0.05)


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.2])
def test_a_reference_that_comes_late_does_not_lag_the_estimate(params, feed, delay: float) -> None:
    params[0]["vehicle_speed_delay"] = delay
    unit = Filter(params, feed)
    accel, speed, errors = -4.0, 35.0, []
    history = [speed - accel * DT * k for k in range(30, 0, -1)]
    unit.cycle(0.0, np.full(4, speed / RADIUS))
    for _ in range(500):
        speed += DT * accel
        history.append(speed)
        estimate = unit.cycle(accel, reference=history[-1 - round(delay / DT)])
        errors.append(estimate - speed)
    assert np.abs(errors[200:]).max() < 0.03


@pytest.mark.parametrize("seconds", [0.5, 2.0])
def test_without_new_samples_it_integrates_the_accelerometer(params, feed, seconds: float) -> None:
    unit = Filter(params, feed)
    for _ in range(200):
        unit.cycle(0.0, np.full(4, 30.0 / RADIUS))
    start, bias, variance = (float(unit.state[k]) for k in ("speed", "bias", "p_vv"))
    cycles = round(seconds / DT)
    for _ in range(cycles):
        unit.cycle(-3.0)
    assert unit.state["speed"] == pytest.approx(start + cycles * DT * (-3.0 - bias), abs=1e-6)
    assert unit.state["p_vv"] > variance


def test_a_lost_accelerometer_leaves_the_speed_to_the_wheels(params, feed) -> None:
    unit = Filter(params, feed)
    speed = 30.0
    unit.cycle(0.0, np.full(4, speed / RADIUS))
    unit.inputs[0]["verdict"][ACCEL_X] = 0
    for _ in range(300):
        speed -= 2.0 * DT
        unit.cycle(0.0, np.full(4, speed / RADIUS))
    assert unit.state["speed"] == pytest.approx(speed, abs=0.3)


@pytest.mark.parametrize("corner", range(4))
def test_it_does_not_start_before_every_wheel_is_known(params, feed, corner: int) -> None:
    unit = Filter(params, feed)
    unit.inputs[0]["verdict"][WHEEL_SPEED + corner] = 0
    unit.cycle(0.0, np.full(4, 50.0))
    assert not unit.state["started"]
    unit.inputs[0]["verdict"][WHEEL_SPEED + corner] = 7
    unit.cycle(0.0, np.full(4, 50.0))
    assert unit.state["started"]


def test_one_wheel_that_jumps_hardly_moves_the_car(params, feed) -> None:
    unit = Filter(params, feed)
    for _ in range(200):
        unit.cycle(0.0, np.full(4, 20.0 / RADIUS))
    unit.cycle(0.0, [0.0, 20.0 / RADIUS, 20.0 / RADIUS, 20.0 / RADIUS])
    assert unit.state["speed"] == pytest.approx(20.0, abs=0.3)


def test_speed_is_never_negative(params, feed) -> None:
    unit = Filter(params, feed)
    unit.cycle(0.0, np.full(4, 1.0))
    for _ in range(300):
        assert unit.cycle(-8.0) >= 0.0


@pytest.mark.parametrize("with_reference", [True, False])
@pytest.mark.parametrize(("decel", "front", "rear"), [(4.0, -0.02, -0.016), (7.0, -0.038, -0.030)])
def test_braked_wheels_do_not_pull_the_speed_down_to_theirs(
    params, feed, with_reference: bool, decel: float, front: float, rear: float
) -> None:
    """The slip expected is 20 % off; the error stays well below the slip itself (errata 53)."""
    slip = np.array([front, front, rear, rear])
    shares = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        unit = Filter(params, feed)
        speed = 33.3
        for _ in range(500):
            omega = speed / RADIUS + SIGMA_OMEGA * random.standard_normal(4)
            unit.cycle(SIGMA_A * random.standard_normal(), omega, speed if with_reference else None)
        unit.wheels["expected_slip"] = slip * random.choice([0.8, 1.2])
        while speed > 8.0:
            speed -= decel * DT
            omega = speed * (1 + slip) / RADIUS + SIGMA_OMEGA * random.standard_normal(4)
            reference = speed + SIGMA_V * random.standard_normal() if with_reference else None
            accel = -decel + SIGMA_A * random.standard_normal()
            estimate = unit.cycle(accel, omega, reference, braking=True)
            shares.append((estimate - speed) / (-np.mean(slip) * speed))
    rms = float(np.sqrt(np.mean(np.square(shares))))
    limit = 0.06 if with_reference else 0.25
    print(f"{decel} m/s^2, reference {with_reference}: speed error is {rms:.3f} of the slip (limit {limit})")
    assert rms < limit
