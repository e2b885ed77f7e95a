"""Wheel loads (4.33) against the equilibrium of forces and moments of a rigid car."""

import numpy as np
import pytest

from ecu.algorithm.estimation.wheel_load import WHEEL_LOAD_STATE, update_wheel_load

G = 9.81
FL, FR, RL, RR = range(4)
NO_LAG = 100.0  # s: long enough to settle


def loads(params, accel_x: float, accel_y: float, speed: float = 0.0) -> np.ndarray:
    state = np.zeros(1, WHEEL_LOAD_STATE)
    update_wheel_load(params[0], state[0], accel_x, accel_y, speed, NO_LAG)
    return state[0]["load"].copy()


STATES = [(0, 0), (-4, 0), (-8, 0), (3, 0), (0, 4), (0, -4), (-4, 3), (-6, -2), (2, 5)]


@pytest.mark.parametrize("speed", [0.0, 30.0])
@pytest.mark.parametrize(("accel_x", "accel_y"), STATES)
def test_loads_carry_the_car_and_balance_its_moments(params, accel_x, accel_y, speed: float) -> None:
    p = params[0]
    drag = float(p["drag_area"]) * speed**2
    m, h, b, l_f, l_r = (float(p[k]) for k in ("mass", "cog_height", "track", "front_axle", "rear_axle"))
    z = loads(params, accel_x, accel_y, speed)
    assert z.sum() == pytest.approx(m * G, rel=1e-12)
    # About the lateral axis through the centre of gravity: tyre forces m a_x + drag act h below it.
    assert l_f * (z[FL] + z[FR]) - l_r * (z[RL] + z[RR]) == pytest.approx(-(m * accel_x + drag) * h, abs=1e-6)
    # About the longitudinal axis; ISO 8855, a left turn has a_y > 0 and loads the right wheels.
    assert 0.5 * b * (z[FR] + z[RR] - z[FL] - z[RL]) == pytest.approx(m * accel_y * h, abs=1e-6)


@pytest.mark.parametrize(
    ("manoeuvre", "accel_x", "accel_y", "heavier", "lighter"),
    [
        ("braking", -5, 0, (FL, FR), (RL, RR)),
        ("driving", 3, 0, (RL, RR), (FL, FR)),
        ("left turn", 0, 4, (FR, RR), (FL, RL)),
        ("right turn", 0, -4, (FL, RL), (FR, RR)),
    ],
)
def test_signs(params, manoeuvre: str, accel_x: float, accel_y: float, heavier, lighter) -> None:
    change = loads(params, accel_x, accel_y) - loads(params, 0, 0)
    assert all(change[i] > 100 for i in heavier), manoeuvre
    assert all(change[i] < -100 for i in lighter), manoeuvre


def test_closed_form_of_the_evoque(params) -> None:
    """m 2105 kg, L 2.665 m, l_f 1.28 m, h 0.65 m, b 1.625 m; hand-worked at -4 m/s^2 and 3 m/s^2."""
    front, rear = 2105 * 9.81 * 1.385 / 2.665 / 2, 2105 * 9.81 * 1.28 / 2.665 / 2
    pitch = 2105 * 4 * 0.65 / 2.665 / 2
    roll_front, roll_rear = 2105 * 3 * 0.65 / 1.625 * 1.385 / 2.665, 2105 * 3 * 0.65 / 1.625 * 1.28 / 2.665
    expected = [
        front + pitch - roll_front,
        front + pitch + roll_front,
        rear - pitch - roll_rear,
        rear - pitch + roll_rear,
    ]
    assert loads(params, -4, 3) == pytest.approx(expected, rel=1e-9)
    assert params[0]["static_load"] == pytest.approx([front, front, rear, rear], rel=1e-9)


def test_a_wheel_is_never_taken_as_lifted(params) -> None:
    for accel_x, accel_y in [(-30, 0), (30, 0), (0, 40), (0, -40), (-30, 40)]:
        assert (loads(params, accel_x, accel_y) > 200.0).all()


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.05])
def test_transfer_lags_by_its_time_constant_whatever_the_step(params, dt: float) -> None:
    lag = float(params[0]["load_transfer_lag"])
    state = np.zeros(1, WHEEL_LOAD_STATE)
    update_wheel_load(params[0], state[0], 0.0, 0.0, 0.0, NO_LAG)
    settled = loads(params, -5, 0)[FL]
    static = state[0]["load"][FL]
    cycles = round(lag * 5 / dt)
    for _ in range(cycles):
        update_wheel_load(params[0], state[0], -5.0, 0.0, 0.0, dt)
    reached = (state[0]["load"][FL] - static) / (settled - static)
    assert reached == pytest.approx(1 - np.exp(-cycles * dt / lag), rel=1e-6)
