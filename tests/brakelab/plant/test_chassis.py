"""The suspension: statics, eigenfrequencies, action and reaction, dampers, stops, kerb, dive.

Expectations are written from the free-body diagram of a car on four springs, not from the plant's code.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.plant.chassis import advance_chassis, damper_force, settle, spring_force

G, MASS, BASE, FRONT, REAR, TRACK, HEIGHT = 9.81, 2105.0, 2.665, 1.29, 1.375, 1.625, 0.66
UNSPRUNG = np.array([48.0, 48.0, 46.0, 46.0])
SPRING = np.array([6.0e4, 6.0e4, 6.4e4, 6.4e4])
BAR = np.array([2.2e4, 2.2e4, 1.2e4, 1.2e4])
TYRE = 2.6e5
BODY = MASS - UNSPRUNG.sum()
BODY_FRONT = (MASS * FRONT - UNSPRUNG[2:].sum() * BASE) / BODY  # front axle to the body's centre of gravity
PITCH_INERTIA, ROLL_INERTIA = 2900.0, 820.0
ALONG = np.array([BODY_FRONT, BODY_FRONT, BODY_FRONT - BASE, BODY_FRONT - BASE])
SIDE = 0.5 * TRACK * np.array([1.0, -1.0, 1.0, -1.0])
DAMPER_SPEED = [-1.0, -0.3, -0.1, 0.0, 0.1, 0.3, 1.0]
DAMPER_FRONT = [-2700.0, -1300.0, -600.0, 0.0, 300.0, 650.0, 1400.0]
DAMPER_REAR = [-2500.0, -1200.0, -560.0, 0.0, 280.0, 600.0, 1300.0]

Maker = Callable[[float], Any]


@pytest.fixture
def sprung_at(shipped: Callable[[str, float], Any]) -> Maker:
    """Return a maker of cars with a suspension that roll at a speed [m/s]."""
    return lambda speed: shipped("suv14", speed)


def stiffness_matrix() -> NDArray[np.float64]:
    """Return K of heave, pitch, roll and four wheels; mount heights are rows of H."""
    h = np.column_stack([np.ones(4), -ALONG, SIDE])
    to_travel = np.hstack([-h, np.eye(4)])  # compression of each strut
    bar = np.zeros((4, 4))
    for left, right in ((0, 1), (2, 3)):
        difference = np.zeros(4)
        difference[left], difference[right] = 1.0, -1.0
        bar += BAR[left] * np.outer(difference, difference)
    strut = to_travel.T @ (np.diag(SPRING) + bar) @ to_travel
    leaning = -BODY * G * HEIGHT  # its weight turns a body further over
    return np.asarray(strut + np.diag([0, leaning, leaning, TYRE, TYRE, TYRE, TYRE]))


MASSES = np.diag([BODY, PITCH_INERTIA, ROLL_INERTIA, *UNSPRUNG])


def test_a_parked_car_stands_at_its_design_height_and_stays(sprung_at: Maker) -> None:
    car = sprung_at(0.0)
    front = 0.5 * MASS * G * REAR / BASE
    rear = 0.5 * MASS * G * FRONT / BASE
    for _ in range(2):
        assert car.now["wheel_load"] == pytest.approx([front, front, rear, rear], rel=1e-9)
        assert car.now["heave"] == pytest.approx(0.0, abs=1e-12)
        assert car.now["pitch"] == pytest.approx(0.0, abs=1e-12)
        car.run(1.0)


def test_load_lowers_the_body_by_springs_and_tyres_in_series(sprung_at: Maker) -> None:
    car = sprung_at(0.0)
    car.params["mass"] += 200.0
    settle(car.params[0], car.now)
    load = car.now["wheel_load"].copy()
    heave, pitch = float(car.now["heave"]), float(car.now["pitch"])
    assert load.sum() == pytest.approx((MASS + 200.0) * G)
    assert load[:2].sum() * FRONT == pytest.approx(load[2:].sum() * REAR)
    static = 0.5 * MASS * G * np.array([REAR, REAR, FRONT, FRONT]) / BASE
    extra = load - static
    sinking = extra / SPRING + extra / TYRE
    body = float((2105.0 + 200.0) * FRONT - UNSPRUNG[2:].sum() * BASE) / (BODY + 200.0)
    assert heave - body * math.sin(pitch) == pytest.approx(-sinking[0], rel=5e-4)
    assert heave + (BASE - body) * math.sin(pitch) == pytest.approx(-sinking[2], rel=5e-4)
    car.run(2.0)
    assert car.now["wheel_load"] == pytest.approx(load, rel=5e-4)
    assert float(car.now["heave"]) == pytest.approx(heave, rel=5e-4)


@pytest.mark.parametrize(("grade", "bank"), [(0.1, 0.0), (-0.1, 0.0), (0.0, 0.08), (0.05, -0.06)])
def test_loads_on_a_slope_balance_moments_about_the_contact_patches(
    sprung_at: Maker, grade: float, bank: float
) -> None:
    car = sprung_at(0.0)
    car.commands["grade"], car.commands["bank"] = grade, bank
    car.press(80.0, 80.0)
    car.state["wheel_speed"] = 0.0
    car.run(4.0)
    load = car.now["wheel_load"]
    normal = G * math.cos(grade) * math.cos(bank)
    assert load.sum() == pytest.approx(MASS * normal, rel=1e-4)
    leaning = BODY * normal * HEIGHT
    pull_back = MASS * G * math.sin(grade) * HEIGHT - leaning * math.sin(car.now["pitch"])
    assert load[2:].sum() * REAR - load[:2].sum() * FRONT == pytest.approx(pull_back, abs=5.0)
    pull_right = MASS * G * math.cos(grade) * math.sin(bank) * HEIGHT + leaning * math.sin(car.now["roll"])
    assert (load[1::2].sum() - load[::2].sum()) * TRACK / 2 == pytest.approx(pull_right, abs=5.0)
    assert car.now["accel_y"] == pytest.approx(G * math.cos(grade) * math.sin(bank), abs=0.01)


@pytest.mark.parametrize("mode", range(7))
def test_undamped_modes_swing_at_the_eigenfrequencies_of_the_matrices(sprung_at: Maker, mode: int) -> None:
    """Released in an eigenvector of M^-1 K, the car swings in it at the eigenvalue's frequency."""
    values, vectors = np.linalg.eig(np.linalg.solve(MASSES, stiffness_matrix()))
    order = np.argsort(values.real)
    frequency = math.sqrt(values.real[order[mode]])
    shape = vectors.real[:, order[mode]]
    shape *= 1e-3 / np.abs(shape).max()
    car = sprung_at(0.0)
    car.params["damper_force"] = 0.0
    car.state["heave"], car.state["pitch"], car.state["roll"] = shape[:3]
    car.state["unsprung_height"] = shape[3:]
    dt, steps = 1e-3, 2000
    found = np.empty((steps, 7))
    for k in range(steps):
        advance_chassis(car.params[0], car.now, car.commands[0], dt)
        found[k] = (car.now["heave"], car.now["pitch"], car.now["roll"], *car.now["unsprung_height"])
    inverse = np.linalg.inv(vectors.real[:, order])
    modal = found @ inverse.T
    own = modal[:, mode]
    others = np.delete(modal, mode, axis=1)
    assert np.abs(others).max() < 0.02 * np.abs(own).max()
    crossings = np.nonzero(np.diff(np.sign(own)))[0]
    exact = crossings + own[crossings] / (own[crossings] - own[crossings + 1])
    period = 2.0 * dt * (exact[-1] - exact[0]) / (len(exact) - 1)
    assert 2.0 * math.pi / period == pytest.approx(frequency, rel=2e-3)
    assert 6.0 < frequency < 110.0  # rad/s: the body at 1 to 2.5 Hz, the wheels at 12 to 17


def test_body_and_wheels_swing_where_cars_do() -> None:
    values = np.linalg.eigvals(np.linalg.solve(MASSES, stiffness_matrix())).real
    hertz = np.sort(np.sqrt(values)) / (2.0 * math.pi)
    assert 1.2 < hertz[0] < hertz[1] < hertz[2] < 2.8
    assert 11.0 < hertz[3] < hertz[6] < 16.0


def test_struts_push_body_and_wheels_apart_with_the_same_force(sprung_at: Maker) -> None:
    """Whatever the struts do, only road and gravity change the vertical momentum of the whole car."""
    car = sprung_at(0.0)
    random = np.random.default_rng(1)
    car.state["unsprung_rate"] = random.uniform(-0.5, 0.5, 4)
    car.state["unsprung_height"] = random.uniform(-0.01, 0.01, 4)
    car.state["heave_rate"], car.state["roll_rate"], car.state["pitch_rate"] = 0.3, 0.4, -0.2
    for _ in range(200):
        advance_chassis(car.params[0], car.now, car.commands[0], 1e-3)
        now = car.now
        inert = BODY * now["heave_accel"] + float(UNSPRUNG @ now["unsprung_accel"])
        assert inert == pytest.approx(float(now["wheel_load"].sum()) - MASS * G, abs=1e-6)


def test_an_anti_roll_bar_acts_in_roll_and_not_in_heave(sprung_at: Maker) -> None:
    def accelerations(heave: float, roll: float, bar: float) -> tuple[float, float]:
        car = sprung_at(0.0)
        car.params["anti_roll_stiffness"] *= bar
        car.state["heave"], car.state["roll"] = heave, roll
        advance_chassis(car.params[0], car.now, car.commands[0], 1e-6)
        return float(car.now["heave_accel"]), float(car.now["roll_accel"])

    assert accelerations(0.02, 0.0, 1.0) == accelerations(0.02, 0.0, 0.0)
    difference = accelerations(0.0, 0.02, 1.0)[1] - accelerations(0.0, 0.02, 0.0)[1]
    moment = -(BAR[0] + BAR[2]) * TRACK**2 * math.sin(0.02) * math.cos(0.02)
    assert difference == pytest.approx(moment / ROLL_INERTIA, rel=1e-6)


def test_dampers_follow_their_table_and_resist_in_both_directions(sprung_at: Maker) -> None:
    params = sprung_at(0.0).params[0]
    for wheel, table in ((0, DAMPER_FRONT), (3, DAMPER_REAR)):
        for speed in np.linspace(-1.0, 1.0, 81):
            expected = np.interp(speed, DAMPER_SPEED, table)
            assert damper_force(params, wheel, speed) == pytest.approx(expected, abs=1e-9)
    assert damper_force(params, 0, 2.0) == pytest.approx(1400.0 + 750.0 / 0.7)
    assert damper_force(params, 0, -2.0) == pytest.approx(-2700.0 - 1400.0 / 0.7)


def test_stops_harden_the_spring_beyond_their_clearance(sprung_at: Maker) -> None:
    params = sprung_at(0.0).params[0]
    assert spring_force(params, 0, 0.085) - spring_force(params, 0, 0.0) == pytest.approx(6.0e4 * 0.085)
    assert spring_force(params, 0, 0.105) - spring_force(params, 0, 0.085) == pytest.approx(3.60e5 * 0.02)
    assert spring_force(params, 0, -0.085) - spring_force(params, 0, -0.105) == pytest.approx(3.60e5 * 0.02)


def test_a_kerb_lifts_one_wheel_and_the_body_follows(sprung_at: Maker) -> None:
    car = sprung_at(0.0)
    car.commands["road_height"] = (0.03, 0.0, 0.0, 0.0)
    highest: list[float] = []
    car.run(3.0, watch=lambda state: highest.append(float(state["wheel_load"][0])))
    static = 0.5 * MASS * G * REAR / BASE
    assert max(highest) == pytest.approx(static + 0.03 * TYRE, rel=0.02)
    at_rest = np.linalg.solve(stiffness_matrix(), [0.0, 0.0, 0.0, 0.03 * TYRE, 0.0, 0.0, 0.0])
    assert car.now["heave"] == pytest.approx(at_rest[0], rel=0.01)
    assert car.now["roll"] == pytest.approx(at_rest[2], rel=0.02)
    assert car.now["unsprung_height"][0] == pytest.approx(at_rest[3], rel=0.01)


def test_dive_and_loads_settle_where_the_springs_balance_the_braking(sprung_at: Maker) -> None:
    car = sprung_at(30.0)
    car.freeze_friction()
    car.press(50.0, 60.0)
    car.run(1.6)
    force = float(car.now["force_x"].sum())
    load = car.now["wheel_load"]
    assert load[:2].sum() * FRONT - load[2:].sum() * REAR == pytest.approx(
        -force * HEIGHT + BODY * G * HEIGHT * math.sin(car.now["pitch"]), rel=5e-3
    )
    at_rest = np.linalg.solve(stiffness_matrix(), [0.0, -force * HEIGHT, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert car.now["pitch"] == pytest.approx(at_rest[1], rel=0.01)
    degrees_per_g = math.degrees(car.now["pitch"]) / (-car.now["accel_x"] / G)
    assert 1.5 < degrees_per_g < 2.5
