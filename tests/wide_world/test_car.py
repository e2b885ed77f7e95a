"""The car against closed forms: energy, stops without slip, the ceiling of the road, slip control, discs."""

from typing import Any

import numpy as np
import pytest

from .car import CYCLING, HOLDING, NO_ABS, Abs, Body, Car, Start, drive
from .draw import draw
from .driver import Driver, Engine
from .lining import CONSTANT, Brake
from .route import G, Route
from .state import ROW, STATE
from .tyre import BRUSH, Tyre, greatest

pytestmark = [pytest.mark.study, pytest.mark.compiled]


BODY = Body(
    mass=1200.0, fuel=0.0, wheelbase=2.6, front_axle=1.3, cog_height=0.5, track=1.6, drag=0.0, lift=0.0,
    lift_front=0.4, rolling=0.0, cornering=20.0, roll_front=0.5, inertia_front=1.2, inertia_rear=1.2,
    radius_front=0.3, radius_rear=0.3, vertical_stiffness=1e12, transfer_lag=0.05,
)  # fmt: skip
TYRE = Tyre(BRUSH, 30.0, 1.0, 0.2, greatest(BRUSH, 1.0, 0.2), 0.0, 1200.0 * G / 4)
BRAKE = Brake(40.0, 20.0, 0.5, CONSTANT, 0.4, 0.4, 0.0, 1e6, 2e-4, 3e-4, 0.0, 0.0, 1.0, 1e3, 0.35, 0.03)
ENGINE = Engine(1e5, 300.0, (4.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1e4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
DRIVER = Driver(5.0, 200.0, 1e4, 1e4, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 3.0)
CAR = Car(BODY, TYRE, BRAKE, ENGINE, DRIVER, Abs(NO_ABS, 0.15, 0.06, 8.0))
TORQUE = 2 * (40.0 + 20.0) * 0.4  # N m/bar
HEAVY = 1200.0 + 4 * 1.2 / 0.3**2  # kg, wheels included


def stop(pressure: float, car: Car = CAR, seconds: float = 3.0, speed: float = 40.0, **road: Any) -> Any:
    """A level straight on which the line pressure is `pressure` from the first row on, as one long tap."""
    n = 2000
    level = {
        "curvature": 0.0,
        "grade": 0.0,
        "grip": 1.0,
        "headwind": 0.0,
        "kerb": 0.0,
        "tap": pressure,
        "stop": 0.0,
    }
    columns = {name: np.full(n, value) for name, value in (level | road).items()}
    route = Route(**columns, speed=np.zeros(n), decel=np.zeros(n))
    count = round(seconds / ROW)
    rows = np.zeros(count, STATE)
    start = Start(0.0, speed, 100.0, 100.0, 20.0)
    return rows[: drive(car, route, start, np.zeros(count), np.ones(10), rows)]


@pytest.mark.parametrize("pressure", [5.0, 20.0, 40.0])
def test_a_stop_without_slip_is_that_of_a_point_mass(pressure: float) -> None:
    """a = T (p - p_0) / R / (m + sum I / R^2): tyres so stiff that slip tells nothing."""
    rows = stop(pressure, CAR._replace(tyre=TYRE._replace(stiffness=1e3)))
    decel = TORQUE * (pressure - 0.5) / 0.3 / HEAVY
    settled = rows[50:]
    t = ROW * np.arange(len(settled))
    assert settled["speed"] == pytest.approx(settled["speed"][0] - decel * t, abs=0.02)
    travelled = settled["distance"] - settled["distance"][0]
    assert travelled == pytest.approx(settled["speed"][0] * t - 0.5 * decel * t**2, abs=0.05)


def test_slip_of_a_gentle_stop_is_force_over_stiffness() -> None:
    """A wheel's force over load and C, below the peak where the brush is nearly linear."""
    rows = stop(10.0)
    row = rows[-1]
    x = 30.0 * row["slip"]
    force = row["force"] / row["load"]
    assert force == pytest.approx(x - x**2 / 3.0 + x**3 / 27.0, rel=0.02)


def test_loads_shift_forward_and_sum_to_the_weight() -> None:
    rows = stop(30.0)
    row = rows[-1]
    assert row["load"].sum() == pytest.approx(1200.0 * G)
    shifted = row["load"][:2].sum() - row["load"][2:].sum()
    assert shifted == pytest.approx(-2.0 * 1200.0 * row["specific_force"] * 0.5 / 2.6, rel=0.01)


@pytest.mark.parametrize("grip", [0.5, 1.0, 1.4])
def test_no_pressure_brakes_harder_than_the_road_holds(grip: float) -> None:
    decel = -stop(150.0, grip=grip)["specific_force"][40:]
    assert decel.max() < grip * G
    assert decel[-1] == pytest.approx(0.8 * grip * G, rel=0.03), "all wheels slide"


@pytest.mark.parametrize(("kind", "least"), [(CYCLING, 0.80), (HOLDING, 0.90)])
def test_a_slip_control_keeps_wheels_turning_and_most_of_the_grip(kind: int, least: float) -> None:
    rows = stop(80.0, CAR._replace(abs_=Abs(kind, 0.15, 0.06, 8.0)))[40:]
    assert np.mean(-rows["specific_force"]) > least * G
    assert np.mean(rows["slip"] > 0.5) < 0.02
    assert np.all(rows["line"][:, 0] == 80.0), "the line knows nothing of it"


def test_a_held_wheel_comes_back_when_the_road_turns_slippery() -> None:
    """From 1.2 to 0.6 at 60 m: what the tyre bore is beyond what it holds, and sliding bears less still."""
    grip = np.where(np.arange(2000) < 60, 1.2, 0.6)
    rows = stop(80.0, CAR._replace(abs_=Abs(HOLDING, 0.15, 0.06, 8.0)), grip=grip)
    slippery = rows[rows["distance"] > 64.0]
    assert len(slippery) > 50
    assert slippery["slip"].max() < 0.2


def test_a_slope_is_in_the_speed_and_not_in_the_specific_force() -> None:
    level, uphill = stop(20.0), stop(20.0, grade=0.05)
    assert uphill["specific_force"][-1] == pytest.approx(level["specific_force"][-1], rel=0.01)
    gained = (level["speed"] - uphill["speed"])[-1]
    assert gained == pytest.approx(0.05 * G * 3.0 * 1200.0 / HEAVY, rel=0.01)


def test_discs_heat_by_what_the_brakes_take() -> None:
    rows = stop(30.0)
    warmer = rows["temperature"][-1] - 100.0
    assert warmer == pytest.approx(np.array([2e-4, 2e-4, 3e-4, 3e-4]) * rows["work"][-1], rel=1e-6)
    assert rows["work"][-1].sum() == pytest.approx(rows["brake_work"][-1], rel=0.01)


@pytest.mark.parametrize("number", range(6))
def test_energy_is_neither_made_nor_lost(number: int) -> None:
    """A drawn car on its drive: what it has is what it had less all work; engine without inertia and fuel."""
    one = draw(2, range(number, number + 1))[0]
    body, engine = one.car.body._replace(fuel=0.0), one.car.engine._replace(inertia=0.0)
    count = 12_000
    rows = np.zeros(count, STATE)
    car = one.car._replace(body=body, engine=engine)
    n = drive(
        car,
        one.route._replace(stop=np.zeros_like(one.route.stop)),
        one.start,
        np.zeros(count),
        np.ones(99),
        rows,
    )
    rows = rows[100:n]
    work = sum(rows[f"{name}_work"] for name in ("brake", "slip", "engine", "resistance", "climb"))
    turned_over = np.sum(np.abs(np.diff(rows["kinetic"])))
    assert turned_over > 1.5 * rows["kinetic"].max()
    missing = rows["kinetic"] + work - (rows["kinetic"][0] + work[0])
    assert np.max(np.abs(missing)) < 0.005 * turned_over
