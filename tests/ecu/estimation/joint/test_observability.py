"""What a drive can show of the car: rank of all derivatives over its operating points, by singular values.

Columns are in units of the prior's standard deviations, rows in those of the noise, so that a singular value
says how many standard deviations of noise a combination of prior errors makes.
"""

import math

import numpy as np
import pytest

from ecu.estimation.joint.layout import DRAG, MASS, MOTOR, MU, PEAK, RADIUS, ROLLING, STIFFNESS, N, V
from ecu.estimation.joint.observer import BALANCE_FLOOR
from ecu.estimation.joint.prior import MU_COMMON, PRIOR
from ecu.estimation.joint.wheel import predict_balance, predict_wheel

MU_ALL = list(range(MU, MU + 4))
SCALE = PRIOR.copy()
SCALE[MU_ALL], SCALE[V], SCALE[MOTOR] = MU_COMMON, 0.5, 0.015

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
    w["motor_reported"] = 1
    for speed, front, rear, motor_front, motor_rear in points:
        state["x"][:] = 0.0
        state["x"][V] = speed
        w["load"] = car["static_load"]
        w["pressure"] = state["smooth_pressure"] = state["last_smooth"] = np.repeat([front, rear], 2)
        w["motor"] = np.repeat([motor_front, motor_rear], 2)
        w["accel"] = w["change"] = 0.0
        for _ in range(3):  # the wheels' inertia is part of the balance
            w["accel"] -= predict_balance(car, state)
            w["change"] = w["accel"]
        for i in range(4):
            predict_wheel(car, state, i, speed)
            out.append(state["h"] / car["sigma_wheel_speed"])
        predict_balance(car, state)
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
    H, states = rows(params[0], state, BRAKING[drive]), [*MU_ALL, MASS]
    assert deficiency(H, MU_ALL) == 0
    assert deficiency(H, states) == 1
    np.testing.assert_allclose(weakest(H, states), 1.0, atol=1e-6)


def test_a_motor_torque_that_is_known_does(params, state) -> None:
    H, states = rows(params[0], state, BRAKING["motors first"]), [*MU_ALL, MASS]
    assert deficiency(H, states) == 0
    sigma = 1 / singular(H, states)[-1]
    print(f"one window of each leaves {sigma:.2f} of the prior's standard deviation")


def test_a_motor_torque_of_unknown_scale_does_not(params, state) -> None:
    H, states = rows(params[0], state, BRAKING["motors and coasting first"]), [*MU_ALL, MASS, MOTOR, DRAG]
    assert deficiency(H, states) == 1
    same = dict(zip(states, weakest(H, states), strict=True))
    assert [same[j] for j in [*MU_ALL, MASS, MOTOR]] == pytest.approx([1.0] * 6, abs=1e-6)
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


FREED = [
    # name, how it is driven after 2 s of rolling, with a reference; freed and held
    ("rolling", {}, True, [V, RADIUS, ROLLING, DRAG], [MU, MASS, STIFFNESS]),
    ("rolling, no reference", {}, False, [V, RADIUS, DRAG], [ROLLING, MU, MASS]),
    ("braking", {"front": 38.0, "rear": 30.0}, True, [V, MU, STIFFNESS, ROLLING], [MASS, DRAG, MOTOR]),
    ("braking, no reference", {"front": 38.0, "rear": 30.0}, False, [V, MU, STIFFNESS], [ROLLING, MASS]),
    ("motors", {"motor": 300.0}, True, [V, MASS, STIFFNESS, DRAG, ROLLING], [MU]),
    ("motors, no reference", {"motor": 300.0}, False, [V, MASS, STIFFNESS, DRAG], [MU, ROLLING]),
]


@pytest.mark.parametrize(("name", "how", "reference", "freed", "held"), FREED, ids=[row[0] for row in FREED])
def test_only_what_shows_is_freed(new_car, name: str, how, reference: bool, freed, held) -> None:
    car = new_car(seed=1)
    car.drive(2.0, reference=reference)
    before = car.state["x"].copy()
    state = car.drive(2.0, reference=reference, **how)
    assert state["free"][freed].all()
    assert not state["free"][held].any()
    np.testing.assert_array_equal(state["x"][held], before[held])
    assert (state["x"][freed] != before[freed]).all()
    assert math.isfinite(state["p"].sum())
