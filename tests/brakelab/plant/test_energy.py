"""Energy: what the plant books, beside an onlooker's account, closed forms, and every shipped scenario."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.plant.body import advance_planar
from brakelab.plant.energy import Energy, energy
from brakelab.plant.records import STATE, new_record
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import load_scenario
from ecu.settings.config import load_config

pytestmark = pytest.mark.study

CONFIG = Path(__file__).parents[3] / "config"
SCENARIOS = sorted(path.stem for path in (CONFIG / "scenarios").glob("*.toml"))
LONGEST_SCENARIO = 60.0  # s of a scenario
G, MASS, BASE, FRONT, REAR, TRACK, HEIGHT = 9.81, 2105.0, 2.665, 1.29, 1.375, 1.625, 0.66
DRAG, ROLLING, CARCASS = 0.5 * 1.2 * 0.35 * 2.32, 0.010, (4.0e5, 1.8e5)
DAMPER_SPEED = [-1.0, -0.3, -0.1, 0.0, 0.1, 0.3, 1.0]
DAMPERS = (
    [-2700.0, -1300.0, -600.0, 0.0, 300.0, 650.0, 1400.0],
    [-2500.0, -1200.0, -560.0, 0.0, 280.0, 600.0, 1300.0],
)
LOSSES = ("brakes", "tyres", "drag", "rolling", "dampers")

Maker = Callable[[str, float], Any]
MANOEUVRES: dict[str, dict[str, Any]] = {
    "braking": {"speed": 30.0, "bar": 35.0},
    "coasting": {"speed": 30.0},
    "step-steer": {"speed": 30.0, "steering_angle": 0.03},
    "braking in a curve": {"speed": 25.0, "bar": 30.0, "steering_angle": 0.03},
    "driving off": {"speed": 5.0, "motor_demand": -600.0},
    "regenerating": {"speed": 25.0, "motor_demand": 400.0},
    "wheels locked on ice": {"speed": 20.0, "bar": 150.0, "road_friction": 0.2},
    "coming to rest uphill": {"speed": 8.0, "bar": 60.0, "grade": 0.1},
    "rolling down a bank": {"speed": 15.0, "grade": -0.05, "bank": 0.05},
}


def drive(shipped: Maker, name: str, manoeuvre: str) -> tuple[Any, Any, Energy]:
    """Drive for 3 s; return the car, its state after every step and before the first, and its energy."""
    given = dict(MANOEUVRES[manoeuvre])
    car = shipped(name, given.pop("speed"))
    if bar := given.pop("bar", None):
        car.press(bar, bar)
    for command, value in given.items():
        car.commands[command] = value
    start = car.state.copy()
    states = np.concatenate([start, car.states(3.0)])
    return car, states, energy(car.params, start, car.state)


def compression(seen: Any) -> NDArray[np.float64]:
    """Compression of the struts at every state [m], shape (n, 4) (A.10)."""
    unsprung = np.array([48.0, 48.0, 46.0, 46.0])
    front = (MASS * FRONT - unsprung[2:].sum() * BASE) / (MASS - unsprung.sum())
    along, side = np.array([front, front, front - BASE, front - BASE]), 0.5 * TRACK * np.array([1, -1, 1, -1])
    pitch, roll = seen["pitch"][:, None], seen["roll"][:, None]
    mount = seen["heave"][:, None] + HEIGHT * (2.0 - np.cos(pitch) - np.cos(roll))
    return np.asarray(seen["unsprung_height"] - mount + along * np.sin(pitch) - side * np.sin(roll))


def onlooker(car: Any, seen: Any) -> dict[str, float]:
    """Integrate force times speed of each part from the states alone, by the trapezoidal rule. Joule."""
    dt = 1e-3

    def mean(name: str) -> Any:
        return 0.5 * (seen[name][1:] + seen[name][:-1])

    spin, radius, after = mean("wheel_speed"), seen["rolling_radius"][1:], seen[1:]
    vx, vy, yaw, roll = mean("speed_x"), mean("speed_y"), mean("yaw_rate"), mean("roll_rate")
    x = (vx - HEIGHT * mean("pitch_rate"))[:, None] - yaw[:, None] * 0.5 * TRACK * np.array([1, -1, 1, -1])
    y = (vy + HEIGHT * roll)[:, None] + yaw[:, None] * np.array([FRONT, FRONT, -REAR, -REAR])
    angle = float(car.commands["steering_angle"][0]) * np.array([1, 1, 0, 0])
    forward, left = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    into_tyres = np.sum(mean("force_x") * (radius * spin - forward) - mean("force_y") * left)
    first, last = (
        seen["force_x"][i] ** 2 / CARCASS[0] + seen["force_y"][i] ** 2 / CARCASS[1] for i in (0, -1)
    )
    motors = after["motor_torque"] * spin
    uphill, aside = (float(car.commands[name][0]) for name in ("grade", "bank"))
    found = {
        "brakes": dt * np.sum(after["brake_torque"] * np.abs(spin)),
        "tyres": dt * into_tyres - 0.5 * np.sum(last - first),
        "drag": dt * DRAG * np.sum(vx**3),
        "rolling": dt * ROLLING * np.sum(after["wheel_load"] * radius * np.abs(spin)),
        "driven": dt * -np.sum(np.minimum(motors, 0.0)),
        "regenerated": dt * np.sum(np.maximum(motors, 0.0)),
        "gravity": -dt * MASS * G * np.sum(vx * math.sin(uphill) + vy * math.cos(uphill) * math.sin(aside)),
        "dampers": 0.0,
    }
    if car.params["suspended"][0]:
        rate = np.diff(compression(seen), axis=0) / dt
        force = np.hstack([np.interp(rate[:, i : i + 2], DAMPER_SPEED, DAMPERS[i // 2]) for i in (0, 2)])
        found["dampers"] = dt * np.sum(force * rate)
    return {term: float(value) for term, value in found.items()}


@pytest.mark.parametrize("manoeuvre", MANOEUVRES)
@pytest.mark.parametrize("name", ["suv", "suv14"])
def test_the_plant_books_what_an_onlooker_finds(shipped: Maker, name: str, manoeuvre: str) -> None:
    car, seen, booked = drive(shipped, name, manoeuvre)
    for term, expected in onlooker(car, seen).items():
        # A force acts on the car with the end of a step, on the wheel with its middle: half a step of the
        # brakes' first bite is found with the tyres.
        margin = (1e-3 if term == "tyres" else 3e-4) * booked.turned_over
        assert getattr(booked, term) == pytest.approx(expected, rel=2e-3, abs=margin), term


@pytest.mark.parametrize("manoeuvre", MANOEUVRES)
@pytest.mark.parametrize("name", ["suv", "suv14"])
def test_nothing_goes_missing_and_losses_only_grow(shipped: Maker, name: str, manoeuvre: str) -> None:
    car, seen, booked = drive(shipped, name, manoeuvre)
    assert abs(booked.missing) < 1e-6
    windows = [energy(car.params, seen[k : k + 1], seen[k + 10 : k + 11]) for k in range(0, 3000, 10)]
    for term in LOSSES:
        gained = -sum(min(getattr(window, term), 0.0) for window in windows)
        assert gained <= (2e-4 if term == "tyres" else 1e-12) * booked.turned_over, term


@pytest.mark.parametrize("car", [None, "suv14"])
@pytest.mark.parametrize("name", SCENARIOS)
def test_energy_of_every_scenario_is_accounted_for(name: str, car: str | None) -> None:
    scenario = load_scenario(CONFIG / "scenarios" / f"{name}.toml")
    loop = new_loop(
        scenario.model_copy(update={"plant": car or scenario.plant}), load_config(CONFIG / "suv.toml"), 0
    )
    vehicle = loop.sides.vehicle
    start = vehicle.state.copy()
    run(loop, seconds=LONGEST_SCENARIO)
    found = energy(vehicle.params, start, vehicle.state)
    assert found.turned_over > 1e5
    assert abs(found.missing) < 1e-5, found
    assert min(found.brakes, found.tyres, found.drag, found.rolling, found.regenerated) >= 0.0


def test_a_turn_without_forces_changes_direction_and_no_energy(shipped: Maker) -> None:
    params, state = shipped("suv", 20.0).params[0], new_record(STATE)[0]
    params["drag_factor"] = 0.0
    state["speed_x"], state["speed_y"], state["yaw_rate"] = 20.0, 3.0, 1.5
    for _ in range(4000):
        advance_planar(params, state, 0.0, 0.0, 0.0, 1e-3)
    over_ground = complex(20.0, 3.0) * complex(math.cos(1.5 * 4.0), -math.sin(1.5 * 4.0))
    assert math.hypot(state["speed_x"], state["speed_y"]) == pytest.approx(abs(over_ground), rel=1e-12)
    assert complex(state["speed_x"], state["speed_y"]) == pytest.approx(over_ground, rel=1e-5)


def test_an_uncooled_disc_takes_the_heat_of_its_brake(shipped: Maker) -> None:
    car = shipped("suv", 30.0)
    car.params["cooling"] = car.params["cooling_by_speed"] = 0.0
    car.press(40.0, 60.0)
    car.run(8.0)
    assert car.now["wheel_speed"] == pytest.approx(np.zeros(4))
    taken = (car.now["disc_temperature"] - 100.0) / car.params["heating"][0]
    assert car.now["brake_heat"] == pytest.approx(taken, rel=1e-9)


def test_the_road_lifts_a_parked_car_by_its_weight(shipped: Maker) -> None:
    car = shipped("suv14", 0.0)
    start = car.state.copy()
    for height in np.linspace(0.0, 0.1, 5001):
        car.commands["road_height"] = height
        car.run(1e-3)
    found = energy(car.params, start, car.state)
    assert found.road == pytest.approx(MASS * G * 0.1, rel=5e-3)
    assert -found.gravity == pytest.approx(MASS * G * 0.1, rel=5e-3)
    assert abs(found.missing) < 1e-6


def test_what_a_bounce_had_the_dampers_take(shipped: Maker) -> None:
    car = shipped("suv14", 0.0)
    car.state["heave_rate"] = 0.5
    start = car.state.copy()
    car.run(2.0)
    found = energy(car.params, start, car.state)
    assert found.dampers == pytest.approx(0.5 * (MASS - 188.0) * 0.25, rel=1e-3)
    assert abs(found.missing) < 1e-3


@pytest.mark.parametrize("manoeuvre", ["regenerating", "driving off", "braking"])
def test_the_battery_gets_what_the_motors_leave(shipped: Maker, manoeuvre: str) -> None:
    car, seen, booked = drive(shipped, "suv14", manoeuvre)
    torque, spin = (np.asarray(seen[name][1:]) for name in ("motor_torque", "wheel_speed"))
    loss = np.where(np.abs(torque) < 1.0, 0.0, 1.2e-3 * torque**2 + 10.0 * np.abs(spin))
    lost = 1e-3 * float(np.sum(loss))
    given = booked.regenerated - booked.driven
    assert float(car.now["charged"] - car.now["discharged"]) == pytest.approx(given - lost, rel=1e-3, abs=1.0)
    assert (lost > 0.0) == (manoeuvre != "braking")
