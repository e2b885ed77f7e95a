"""The car on its suspension: statics, eigenfrequencies, action and reaction, energy, step size.

Expectations are written from the free-body diagram of a car on four springs, not from the plant's code.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.plant.chassis import advance_chassis, damper_force, settle, spring_force
from brakelab.plant.description import draw, load_plant
from brakelab.plant.sensors import body_accelerations
from brakelab.plant.vehicle import new_state

CONFIG = Path(__file__).parents[3] / "config" / "plant"
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


def travel(car: Any) -> NDArray[np.float64]:
    """Compression of the four struts [m] (A.10 with pitch on the axles, roll on the sides)."""
    now = car.now
    mount = now["heave"] - ALONG * math.sin(now["pitch"]) + SIDE * math.sin(now["roll"])
    mount = mount + HEIGHT * (2.0 - math.cos(now["pitch"]) - math.cos(now["roll"]))
    return np.asarray(now["unsprung_height"] - mount)


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


def test_a_drawn_car_rolls_without_a_jolt(sprung_at: Maker) -> None:
    car = sprung_at(20.0)
    car.params[:] = draw(load_plant(CONFIG / "suv14.toml"), 4)
    car.state[:] = new_state(car.params, 20.0, (100.0, 100.0))
    before = float(car.now["heave"])
    accelerations: list[float] = []
    car.run(0.5, watch=lambda state: accelerations.append(float(state["heave_accel"])))
    assert before != 0.0
    assert max(map(abs, accelerations)) < 0.05


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


def test_dampers_follow_their_table_and_resist_both_ways(sprung_at: Maker) -> None:
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


def test_a_wheel_leaves_the_road_and_the_car_lives(sprung_at: Maker) -> None:
    car = sprung_at(15.0)
    car.commands["road_height"] = (-0.5, 0.0, 0.0, 0.0)
    car.run(0.05)
    assert car.now["wheel_load"][0] == 0.0
    assert car.now["force_x"][0] == pytest.approx(0.0, abs=5.0)
    assert all(np.all(np.isfinite(car.now[name])) for name in ("force_x", "force_y", "wheel_speed", "roll"))


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


class Account:
    """Energy of a car, and what leaves it: brakes, tyres, drag, rolling, dampers, motors. Joule."""

    def __init__(self, car: Any) -> None:
        self.car = car
        self.spent = dict.fromkeys(("brakes", "tyres", "drag", "rolling", "dampers", "motors"), 0.0)
        self.before = self.look()
        self.start = self.stored()

    def look(self) -> dict[str, Any]:
        now = self.car.now
        names = ("speed_x", "speed_y", "yaw_rate", "heave_rate", "pitch_rate", "roll_rate")
        seen: dict[str, Any] = {name: float(now[name]) for name in names}
        seen |= {name: now[name].copy() for name in ("wheel_speed", "unsprung_rate")}
        seen["travel"] = travel(self.car)
        return seen

    def stored(self) -> float:
        now, t = self.car.now, travel(self.car)
        moving = 0.5 * MASS * (now["speed_x"] ** 2 + now["speed_y"] ** 2)
        moving += 0.5 * 3350.0 * now["yaw_rate"] ** 2 + 0.5 * 1.6 * np.sum(now["wheel_speed"] ** 2)
        moving += 0.5 * BODY * now["heave_rate"] ** 2 + 0.5 * PITCH_INERTIA * now["pitch_rate"] ** 2
        moving += 0.5 * ROLL_INERTIA * now["roll_rate"] ** 2 + 0.5 * UNSPRUNG @ now["unsprung_rate"] ** 2
        static = 0.5 * MASS * G * np.array([REAR, REAR, FRONT, FRONT]) / BASE
        springs = np.sum(0.5 * SPRING * t**2 + (static - UNSPRUNG * G) * t)
        springs += 0.5 * BAR[0] * (t[0] - t[1]) ** 2 + 0.5 * BAR[2] * (t[2] - t[3]) ** 2
        height = now["unsprung_height"]
        tyres = np.sum(0.5 * TYRE * height**2 - static * height)
        lifted = G * (BODY * now["heave"] + UNSPRUNG @ height)
        return float(moving + springs + tyres + lifted)

    def step(self, state: Any) -> None:
        after = self.look()
        mean = {name: 0.5 * (self.before[name] + after[name]) for name in after}
        dt, spin, load = 1e-3, mean["wheel_speed"], state["wheel_load"]
        radius = state["rolling_radius"]
        side = 0.5 * TRACK * np.array([1, -1, 1, -1])
        along = np.array([FRONT, FRONT, -REAR, -REAR])
        x = mean["speed_x"] - mean["yaw_rate"] * side - HEIGHT * mean["pitch_rate"]
        y = mean["speed_y"] + mean["yaw_rate"] * along + HEIGHT * mean["roll_rate"]
        angle = float(self.car.commands["steering_angle"][0]) * np.array([1, 1, 0, 0])
        forward = x * np.cos(angle) + y * np.sin(angle)
        sideways = y * np.cos(angle) - x * np.sin(angle)
        self.spent["brakes"] += dt * float(np.sum(state["brake_torque"] * np.abs(spin)))
        self.spent["motors"] += dt * float(np.sum(state["motor_torque"] * spin))
        self.spent["tyres"] += dt * float(
            np.sum(state["force_x"] * (radius * spin - forward) - state["force_y"] * sideways)
        )
        self.spent["drag"] += dt * 0.5 * 1.2 * 0.35 * 2.32 * mean["speed_x"] ** 3
        self.spent["rolling"] += dt * float(np.sum(0.010 * load * radius * spin))
        rate = (after["travel"] - self.before["travel"]) / dt
        for wheel in range(4):
            table = DAMPER_FRONT if wheel < 2 else DAMPER_REAR
            self.spent["dampers"] += dt * float(np.interp(rate[wheel], DAMPER_SPEED, table)) * rate[wheel]
        self.before = after

    def imbalance(self) -> float:
        """Return what is missing as a share of what was exchanged."""
        lost = self.start - self.stored()
        return (lost - sum(self.spent.values())) / sum(map(abs, self.spent.values()))


@pytest.mark.parametrize(
    "manoeuvre", ["braking", "coasting", "step-steer", "driving off", "braking in a curve"]
)
def test_energy_is_accounted_for(sprung_at: Maker, manoeuvre: str) -> None:
    car = sprung_at(5.0 if manoeuvre == "driving off" else 30.0)
    seconds = 3.0
    if "braking" in manoeuvre:
        car.press(35.0, 45.0)
    if manoeuvre in ("step-steer", "braking in a curve"):
        car.commands["steering_angle"] = 0.03
    if manoeuvre == "driving off":
        car.commands["motor_demand"] = -600.0
    account = Account(car)
    car.run(seconds, watch=account.step)
    assert abs(account.imbalance()) < 0.0005, account.spent
    assert account.spent["dampers"] >= 0.0
    assert account.spent["tyres"] > 0.0
    if manoeuvre == "step-steer":
        assert account.spent["dampers"] > 20.0


def test_a_bump_costs_what_the_dampers_take(sprung_at: Maker) -> None:
    car = sprung_at(0.0)
    car.state["heave_rate"] = 0.5
    account = Account(car)
    car.run(2.0, watch=account.step)
    assert account.spent["dampers"] == pytest.approx(0.5 * BODY * 0.25, rel=0.005)


def stop(car: Any, dt: float) -> tuple[float, float]:
    """Brake to a standstill at 1 ms or finer; return distance and mean friction by distance."""
    car.press(40.0, 40.0)
    weighted = rolled = 0.0
    while car.now["speed_x"] > 0.05:
        speed = float(car.now["speed_x"])
        weighted += speed * float(car.now["mu_b"].mean())
        rolled += speed
        car.run(dt, dt)
    return float(car.now["distance"]), weighted / rolled


def test_halving_the_step_changes_a_stop_by_less_than_a_thousandth(sprung_at: Maker) -> None:
    whole, half = (stop(sprung_at(30.0), dt) for dt in (1e-3, 0.5e-3))
    assert whole == pytest.approx(half, rel=1e-3)


def test_halving_the_step_changes_a_step_steer_by_less_than_a_thousandth(sprung_at: Maker) -> None:
    found = []
    for dt in (1e-3, 0.5e-3):
        car = sprung_at(25.0)
        car.commands["steering_angle"] = 0.03
        car.run(1.5, dt)
        found.append([float(car.now[name]) for name in ("yaw_rate", "roll", "accel_y", "speed_x")])
    assert found[0] == pytest.approx(found[1], rel=1e-3)


def test_same_car_same_bits(sprung_at: Maker) -> None:
    states = []
    for _ in range(2):
        car = sprung_at(25.0)
        car.commands["steering_angle"] = 0.02
        car.press(30.0, 30.0)
        car.run(0.5)
        states.append(car.state.tobytes())
    assert states[0] == states[1]


@pytest.mark.parametrize("steering", [0.0, 0.01])
def test_it_brakes_and_steers_as_its_reduced_form_does(
    sprung_at: Maker, car_at: Maker, steering: float
) -> None:
    cars = sprung_at(25.0), car_at(25.0)
    for car in cars:
        car.freeze_friction()
        car.commands["steering_angle"] = steering
        car.press(20.0, 20.0)
        car.run(2.0)
    full, reduced = (car.now for car in cars)
    assert full["speed_x"] == pytest.approx(reduced["speed_x"], rel=2e-3)
    assert full["wheel_load"] == pytest.approx(reduced["wheel_load"], rel=0.03)
    assert full["yaw_rate"] == pytest.approx(reduced["yaw_rate"], rel=0.02, abs=1e-9)


def test_straight_stops_stay_straight(sprung_at: Maker) -> None:
    car = sprung_at(30.0)
    car.press(60.0, 60.0)
    car.run(7.5)
    for name in ("speed_y", "yaw_rate", "roll", "roll_rate"):
        assert car.now[name] == 0.0
    assert car.now["speed_x"] == pytest.approx(0.0, abs=1e-3)
    assert car.now["pitch"] == pytest.approx(0.0, abs=1e-4)  # it has rocked back and forth


def test_the_accelerometer_pitches_and_heaves_with_the_body(sprung_at: Maker) -> None:
    car = sprung_at(30.0)
    car.freeze_friction()
    car.press(60.0, 70.0)
    car.run(1.6)
    read, _ = body_accelerations(car.params[0], car.now, 0.0)
    accel, pitch = float(car.now["accel_x"]), float(car.now["pitch"])
    assert read == pytest.approx(accel * math.cos(pitch) - G * math.sin(pitch), abs=0.02)
    car = sprung_at(0.0)
    car.state["pitch"], car.state["heave"] = 0.02, 0.03
    car.run(0.002)
    car.state["pitch"] = 0.02
    up = float(car.now["vertical_accel"])
    assert abs(up) > 1.0
    read, _ = body_accelerations(car.params[0], car.now, 0.0)
    still = float(car.now["accel_x"]) * math.cos(0.02) + float(car.now["pitch_accel"]) * -0.10 * math.cos(
        0.02
    )
    assert read == pytest.approx(still - (G + up) * math.sin(0.02), abs=0.01)
