"""Tyre: rolling radius A.4, Magic Formula A.11, load dependence, combined slip, relaxation A.14."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brakelab.plant.description import Plant, nominal
from brakelab.plant.tyre import (
    burckhardt,
    degressive,
    magic_formula,
    relaxation_rate,
    rolling_radius,
    steady_forces,
    stiffnesses,
)
from brakelab.plant.wheel import advance_wheel

RADIUS, STIFFNESS = 0.3706, 2.6e5


def forces_of(tyre: Any, load: float, road: float, slip: float, angle: float) -> tuple[float, float, float]:
    """Steady forces of the front left tyre under `load` on a road's friction."""
    peak = degressive(road, tyre["friction_degression"], load, tyre["nominal_load"][0])
    return steady_forces(tyre, *stiffnesses(tyre, 0, load), peak, slip, angle)


def test_an_unloaded_tyre_rolls_on_its_free_radius() -> None:
    assert rolling_radius(RADIUS, STIFFNESS, 0.0) == RADIUS
    assert rolling_radius(RADIUS, STIFFNESS, 1e-3) == pytest.approx(RADIUS, rel=1e-6)


@pytest.mark.parametrize("load", [500.0, 2000.0, 5000.0, 9000.0])
def test_rolling_radius_shrinks_by_a_third_of_the_deflection(load: float) -> None:
    deflection = load / STIFFNESS  # sin(x)/x with x^2 = 2 deflection / r_0, first order
    assert RADIUS - rolling_radius(RADIUS, STIFFNESS, load) == pytest.approx(deflection / 3, rel=0.03)


@pytest.mark.parametrize("peak", [2000.0, 6000.0])
def test_magic_formula_starts_linear_and_reaches_its_peak(peak: float) -> None:
    assert magic_formula(1.0, peak, 1.6, 0.2) == pytest.approx(1.0, rel=1e-4)
    forces = [magic_formula(50.0 * k, peak, 1.6, 0.2) for k in range(4000)]
    assert max(forces) == pytest.approx(peak, rel=1e-4)
    assert forces[-1] < 0.95 * peak  # falls beyond its peak, and does not oscillate
    top = forces.index(max(forces))
    assert all(b <= a for a, b in zip(forces[top:], forces[top + 1 :], strict=False))


@pytest.fixture(scope="module")
def tyre(suv: Plant) -> Any:
    return nominal(suv)[0]


def test_slip_stiffness_is_the_slope_at_the_origin_on_every_road(tyre: Any) -> None:
    load = float(tyre["nominal_load"][0])
    for road in (1.2, 0.7, 0.2):
        force, _, _ = forces_of(tyre, load, road, -1e-5, 0.0)
        assert force / -1e-5 == pytest.approx(22.0 * load, rel=1e-3)


def test_friction_and_stiffness_grow_less_than_load() -> None:
    assert degressive(1.2, 0.08, 5000.0, 5000.0) == pytest.approx(6000.0)
    assert degressive(1.2, 0.08, 7500.0, 5000.0) == pytest.approx(1.2 * 7500.0 * 0.96)
    assert degressive(1.2, 0.08, 2500.0, 5000.0) == pytest.approx(1.2 * 2500.0 * 1.04)


@settings(max_examples=200, deadline=None)
@given(
    slip=st.floats(-1.0, 1.0), angle=st.floats(-0.6, 0.6), load=st.floats(50.0, 15000.0),
    road=st.floats(0.1, 1.3),
)  # fmt: skip
def test_force_stays_within_kamms_circle_and_has_the_sign_of_its_slip(
    tyre: Any, slip: float, angle: float, load: float, road: float
) -> None:
    along, across, _ = forces_of(tyre, load, road, slip, angle)
    peak = degressive(road, tyre["friction_degression"], load, tyre["nominal_load"][0])
    assert math.hypot(along, across) <= peak * (1 + 1e-9)
    assert along * slip >= 0.0
    assert across * angle >= 0.0


def test_side_slip_costs_braking_force(tyre: Any) -> None:
    straight, _, _ = forces_of(tyre, 5000.0, 1.2, -0.05, 0.0)
    turning, _, _ = forces_of(tyre, 5000.0, 1.2, -0.05, 0.10)
    assert straight < turning < 0.0


@pytest.mark.parametrize("speed", [5.0, 15.0, 40.0, -15.0])
def test_relaxation_length_is_the_same_at_every_speed(speed: float) -> None:
    assert abs(speed) / relaxation_rate(1.1e5, 4.0e5, speed) == pytest.approx(0.275)


@pytest.mark.parametrize("speed", [8.0, 25.0, 60.0])
def test_side_force_builds_up_over_the_relaxation_length(
    car_at: Callable[[float], Any], speed: float
) -> None:
    """A sudden side slip: after C_S / K_S = 0.44 m the tyre has 1 - 1/e of its force."""
    car = car_at(speed)
    length = 15.0 * float(car.now["wheel_load"][0]) / 1.8e5
    dt = 1e-3
    for _ in range(round(length / speed / dt)):
        advance_wheel(car.params[0], car.now, 0, speed, -0.002 * speed, 1.2, dt)
    steady = forces_of(car.params[0], car.now["wheel_load"][0], 1.2, 0.0, 0.002)[1]
    assert car.now["force_y"][0] == pytest.approx((1 - math.exp(-1)) * steady, rel=0.04)


SURFACES = {  # c_1, c_2, c_3 as Burckhardt gives them
    "dry asphalt": (1.2801, 23.99, 0.52),
    "wet asphalt": (0.857, 33.822, 0.347),
    "snow": (0.1946, 94.129, 0.0646),
}


@pytest.mark.parametrize("surface", SURFACES)
def test_burckhardts_curve_comes_back_from_its_stiffness_and_peak(surface: str) -> None:
    c_1, c_2, c_3 = SURFACES[surface]
    load = 5000.0

    def friction(slip: float) -> float:
        return c_1 * (1.0 - math.exp(-c_2 * slip)) - c_3 * slip

    peak = load * max(friction(1e-5 * k) for k in range(100_001))
    stiffness = load * (c_1 * c_2 - c_3)
    for slip in (0.0, 0.001, 0.02, 0.1, 0.17, 0.4, 1.0):
        found = burckhardt(slip * stiffness, stiffness, peak, c_3 / c_1)
        assert found == pytest.approx(load * friction(slip), rel=1e-4, abs=1e-6)
    assert burckhardt(3.0 * stiffness, stiffness, peak, c_3 / c_1) == pytest.approx(
        load * friction(1.0), rel=1e-4
    )


def test_a_car_may_have_burckhardts_tyres(car_at: Callable[[float], Any]) -> None:
    """Same slope at the origin, same peak within Kamm's circle, less force when sliding, on every road."""
    params = car_at(20.0).params
    params["burckhardt_fall"] = 0.406
    tyre, load = params[0], float(params["nominal_load"][0, 0])
    for road in (1.2, 0.7, 0.2):
        assert forces_of(tyre, load, road, -1e-6, 0.0)[0] / -1e-6 == pytest.approx(22.0 * load, rel=1e-3)
        forces = [-forces_of(tyre, load, road, -0.001 * k, 0.0)[0] for k in range(1, 1001)]
        assert max(forces) == pytest.approx(road * load, rel=1e-3)
        assert 0.55 < forces[-1] / max(forces) < 0.75
        both = forces_of(tyre, load, road, -0.1, 0.2)
        assert math.hypot(both[0], both[1]) <= road * load * (1 + 1e-5)


def test_burckhardts_car_stops_about_as_the_magic_formulas(car_at: Callable[[float], Any]) -> None:
    distance = []
    for fall in (0.0, 0.406):
        car = car_at(25.0)
        car.params["burckhardt_fall"] = fall
        car.press(40.0, 40.0)
        car.run(8.0)
        assert abs(float(car.now["speed_x"])) < 0.02
        distance.append(float(car.now["distance"]))
    assert distance[1] == pytest.approx(distance[0], rel=0.01)
    assert distance[1] != distance[0]
