"""What a drive can show of the car: rank of all derivatives over its operating points, by singular values.

Columns are in units of the prior's standard deviations, rows in those of the noise, so that a singular value
says how many standard deviations of noise a combination of prior errors makes.
"""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.balance import BALANCE_FLOOR, predict_balance
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    CHANGE,
    DRAG,
    LEVEL,
    MASS,
    MOTOR,
    OVERRUN,
    PEAK,
    RADIUS,
    RATE,
    RATIO,
    ROLLING,
    STIFFNESS,
    N,
    V,
)
from ecu.algorithm.estimation.joint.observer import WINDOW_S
from ecu.algorithm.estimation.joint.prior import CHANGE_COMMON, LEVEL_AXLE, LEVEL_COMMON, LEVEL_WHEEL, PRIOR
from ecu.algorithm.estimation.joint.wheel_speed import predict_wheel
from ecu.contract.signals import ACCEL_X, MOTOR_TORQUE

LEVELS = list(range(LEVEL, LEVEL + 4))
SCALE = PRIOR.copy()
SCALE[LEVELS] = math.hypot(LEVEL_COMMON, LEVEL_AXLE, LEVEL_WHEEL)
SCALE[V], SCALE[MOTOR], SCALE[CHANGE : CHANGE + 2] = 0.5, 0.03, CHANGE_COMMON

BRAKING = {
    # speed [m/s], front and rear [bar], front and rear motor torque [N m]
    "one level": [(30.0, 38.0, 30.0, 0.0, 0.0)],
    "three levels": [
        (30.0, 19.0, 15.0, 0.0, 0.0),
        (25.0, 38.0, 30.0, 0.0, 0.0),
        (10.0, 60.0, 50.0, 0.0, 0.0),
    ],
    "motors first": [(35.0, 0.0, 0.0, 300.0, 300.0), (30.0, 38.0, 30.0, 0.0, 0.0)],
    "motors and coasting first": [
        (35.0, 0.0, 0.0, 0.0, 0.0),
        (30.0, 0.0, 0.0, 300.0, 300.0),
        (8.0, 0.0, 0.0, 300.0, 300.0),
        (30.0, 38.0, 30.0, 0.0, 0.0),
    ],
}


def rows(car, state, points, reference: bool = False) -> np.ndarray:
    """Return the derivatives of four wheels, balance and speed reference at each point, in units of noise."""
    out, w = [], state["window"]
    for speed, front, rear, motor_front, motor_rear in points:
        state["x"][:] = 0.0
        state["x"][V] = speed
        w["load"] = car["static_load"]
        w["pressure"] = w["common_pressure"] = state["last_smooth"] = np.repeat([front, rear], 2)
        w["motor"] = state["motors"]["last_smooth"] = np.repeat([motor_front, motor_rear], 2)
        w["common_accel"] = w["change"] = 0.0
        for _ in range(5):  # the wheels' inertia is part of the balance
            w["common_accel"] -= predict_balance(car, state, front > 0)
            w["change"] = w["common_accel"]
        state["last_smooth_accel"] = w["common_accel"]
        for i in range(4):
            predict_wheel(car, state, i, speed)
            out.append(state["h"] / car["sigma_wheel_speed"])
        predict_balance(car, state, front > 0)
        out.append(state["h"] / BALANCE_FLOOR)
        if reference:
            out.append(np.eye(N)[V] / car["sigma_vehicle_speed"])
    return np.array(out)


def singular(H: np.ndarray, states) -> np.ndarray:
    return np.linalg.svd(H[:, states] * SCALE[states], compute_uv=False)


def weakest(H: np.ndarray, states) -> np.ndarray:
    """Return the direction that shows least, in units of the states, largest entry 1."""
    direction = np.linalg.svd(H[:, states] * SCALE[states])[2][-1] * SCALE[states]
    return direction / direction[np.argmax(np.abs(direction))]


def deficiency(H: np.ndarray, states) -> int:
    values = singular(H, states)
    return len(states) - int((values > 1e-5 * values[0]).sum())


@pytest.mark.parametrize("drive", ["one level", "three levels"])
def test_friction_braking_alone_does_not_tell_mass_from_friction(params, state, drive: str) -> None:
    """At no level, and not at several: all torques and the mass may be larger by the same factor."""
    H, states = rows(params[0], state, BRAKING[drive]), [*LEVELS, MASS]
    assert deficiency(H, LEVELS) == 0
    assert deficiency(H, states) == 1
    np.testing.assert_allclose(weakest(H, states), 1.0, atol=1e-6)


def test_a_motor_torque_that_is_known_does(params, state) -> None:
    H, states = rows(params[0], state, BRAKING["motors first"]), [*LEVELS, MASS]
    assert deficiency(H, states) == 0
    sigma = 1 / singular(H, states)[-1]
    print(f"one window of each leaves {sigma:.2f} of the prior's standard deviation")


def test_a_motor_torque_of_unknown_scale_does_not(params, state) -> None:
    H, states = rows(params[0], state, BRAKING["motors and coasting first"]), [*LEVELS, MASS, MOTOR, DRAG]
    assert deficiency(H, states) == 1
    same = dict(zip(states, weakest(H, states), strict=True))
    assert [same[j] for j in [*LEVELS, MASS, MOTOR]] == pytest.approx([1.0] * 6, abs=1e-6)
    assert same[DRAG] == pytest.approx(0.0, abs=1e-6)  # drag is per mass


@pytest.mark.parametrize("drive", BRAKING)
def test_without_a_speed_reference_the_common_radius_shows_nothing(params, state, drive: str) -> None:
    """Within a window a larger radius is a faster car: omega = v (1 + slip) / r."""
    for point in BRAKING[drive]:
        H, states = rows(params[0], state, [point]), [V, ROLLING]
        assert singular(H, states)[-1] < 0.3  # sigma of noise by a sigma of the prior: nothing in a window
        direction = weakest(H, states)
        # Nearly: a larger wheel also makes less force of its brake torque, which tells when braking hard.
        assert direction[0] / direction[1] == pytest.approx(point[0], rel=0.15)
        assert singular(rows(params[0], state, [point], reference=True), states)[-1] > 0.8


def test_with_a_speed_reference_five_radii_have_one_too_many(params, state) -> None:
    """The wheels' own radii and the common one: only the prior shares it out."""
    H = rows(params[0], state, BRAKING["one level"], reference=True)
    radii = list(range(RADIUS, RADIUS + 4))
    assert deficiency(H, [V, *radii]) == 0
    assert deficiency(H, [V, *radii, ROLLING]) == 1


@pytest.mark.parametrize(("drive", "missing"), [("one level", 1), ("three levels", 0)])
def test_one_level_of_braking_does_not_tell_stiffness_from_peak(
    params, state, drive: str, missing: int
) -> None:
    """A front axle at one level shows one slip for both."""
    points = [(v, front, 0.0, 0.0, 0.0) for v, front, *_ in BRAKING[drive]]
    front = [k for k in range(5 * len(points)) if k % 5 < 2]
    H = rows(params[0], state, points)[front]
    assert deficiency(H, [STIFFNESS, PEAK]) == missing


def test_level_and_change_show_alike(params, state) -> None:
    """Within an application nothing tells an axle's change from the levels of both its wheels."""
    H = rows(params[0], state, BRAKING["three levels"])
    assert deficiency(H, [*LEVELS, CHANGE, CHANGE + 1]) == 2


BY_LININGS = [LEVEL, CHANGE, RATE, PEAK, STIFFNESS, OVERRUN]
BY_MOTORS = [STIFFNESS, RATIO, PEAK, DRAG, BIAS]
FREED = [
    # name, how it is driven after 2 s of rolling, for how long [s], with a reference; freed and held
    ("rolling", {}, 2.0, True, [V, RADIUS, ROLLING, DRAG, BIAS], [LEVEL, CHANGE, MASS, STIFFNESS]),
    ("rolling, no reference", {}, 2.0, False, [V, RADIUS, DRAG, BIAS], [ROLLING, LEVEL, MASS]),
    (
        "braking",
        {"front": 38.0, "rear": 30.0},
        2.0,
        True,
        [V, ROLLING, *BY_LININGS],
        [MASS, DRAG, MOTOR, BIAS],
    ),
    ("braking, no reference", {"front": 38.0, "rear": 30.0}, 2.0, False, [V, *BY_LININGS], [ROLLING, MASS]),
    ("motors", {"motor": 300.0}, 2.0, True, [V, MASS, MOTOR, ROLLING, *BY_MOTORS], [LEVEL, CHANGE, OVERRUN]),
    ("motors, no reference", {"motor": 300.0}, 2.0, False, [V, MASS, MOTOR, *BY_MOTORS], [LEVEL, ROLLING]),
    # What does not vary cannot tell mass from bias, drag and slope.
    ("motors for long", {"motor": 200.0}, 14.0, True, [V, ROLLING, *BY_MOTORS], [MASS, MOTOR, LEVEL]),
]


@pytest.mark.parametrize(
    ("name", "how", "seconds", "reference", "freed", "held"), FREED, ids=[row[0] for row in FREED]
)
def test_only_what_shows_is_freed(new_car, name: str, how, seconds, reference: bool, freed, held) -> None:
    car = new_car(seed=1, speed=45.0)
    car.drive(2.0, reference=reference)
    before = car.state["x"].copy()
    state = car.drive(seconds, reference=reference, **how)
    assert state["free"][freed].all()
    assert not state["free"][held].any()
    if name != "motors for long":  # its first seconds varied
        np.testing.assert_array_equal(state["x"][held], before[held])
    moves = [i for i in freed if i != OVERRUN]  # where the drive is known there is none
    assert (state["x"][moves] != before[moves]).all()
    assert math.isfinite(state["p"].sum())


@pytest.mark.parametrize("how", [{}, {"front": 38.0, "rear": 30.0}], ids=["rolling", "braking"])
def test_without_a_motor_torque_rolling_shows_neither_bias_nor_drag(new_car, how) -> None:
    car = new_car(seed=1, speed=40.0)
    car.inputs[0]["verdict"][MOTOR_TORQUE : MOTOR_TORQUE + 4] = 0
    car.inputs[0]["new"][MOTOR_TORQUE : MOTOR_TORQUE + 4] = 0
    car.drive(2.0)
    before = car.state["x"].copy()
    state = car.drive(2.0, **how)
    assert state["drive_known"] == 0.0
    held = [BIAS, DRAG, MASS, MOTOR]
    np.testing.assert_array_equal(state["x"][held], before[held])


def test_wheels_alone_show_neither_mass_nor_motor_scale(new_car) -> None:
    """Slip is for stiffness to explain; a mass is for the balance, which has nothing new here."""
    car = new_car(seed=1, speed=45.0)
    car.drive(2.0)
    car.inputs[0]["new"][ACCEL_X] = 0
    car.drive(1.0)
    before, freed = car.state["x"].copy(), 0
    for _ in range(20):
        state = car.drive(WINDOW_S, motor=300.0, reference=False)  # which tells speed, and so mass
        freed += int(state["free"][MASS])
    assert freed > 10
    np.testing.assert_array_equal(state["x"][[MASS, MOTOR]], before[[MASS, MOTOR]])
    assert state["x"][STIFFNESS] != before[STIFFNESS]
