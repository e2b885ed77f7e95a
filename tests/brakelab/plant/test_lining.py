"""The four brakes of a car: start of an application, scaling, torque, heat, one law or another."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brakelab.plant.description import Plant, nominal
from brakelab.plant.disc import WET
from brakelab.plant.dynamometer import nominal_friction
from brakelab.plant.friction.constant import Constant
from brakelab.plant.friction.laws import LAWS, law_row
from brakelab.plant.friction.network import Network
from brakelab.plant.friction.own import Own
from brakelab.plant.friction.quadratic import Quadratic
from brakelab.plant.friction.static_lugre import StaticLugre
from brakelab.plant.friction.table import Table
from brakelab.plant.jit import kernel
from brakelab.plant.lining import advance_disc_temperature, advance_lining
from brakelab.plant.linings import rig_with
from brakelab.plant.records import STATE, new_record

DT = 1e-3


def test_scaling_gives_the_nominal_friction_that_the_file_asks_for(suv: Plant) -> None:
    scale = nominal(suv)[0]["friction_scale"]
    own = [nominal_friction(rig_with(suv.linings.lining[name], "SIM")) for name in ("A", "A", "B", "B")]
    assert scale * own == pytest.approx([0.85 * 0.45, 0.85 * 0.45, 1.1 * 0.45, 1.1 * 0.45])


def brake(
    suv: Plant, pressure_bar: float, temperature: float, spin: float, seconds: float, law: str = "SIM"
) -> Any:
    """Return the state after braking at constant spin and temperature."""
    params, state = nominal(suv), new_record(STATE)
    for wheel in range(4):
        lining = suv.lining(wheel)
        number, row = law_row(lining.friction[law], lining.brake)
        params["friction_law"][0, wheel], params["friction_row"][0, wheel] = number, row
    state["lining_memory"] = params["friction_row"][:, :, 0]
    state["disc_temperature"] = temperature
    state["wheel_speed"] = spin
    for pressure in (0.0, pressure_bar):
        state["pressure"] = 1e5 * pressure
        advance_linings(params, state, round(seconds / DT))
    return state[0]


@kernel
def advance_linings(params: Any, state: Any, steps: int) -> None:
    for _ in range(steps):
        advance_lining(params[0], state[0], DT)


@pytest.mark.parametrize("law", ["SIM", "R1", "R2", "Ost", "Ost_revised"])
def test_a_car_brakes_under_every_law(suv: Plant, law: str) -> None:
    state = brake(suv, 30.0, 100.0, 40.0, 1.0, law)
    assert np.all((state["mu_b"] > 0.2) & (state["mu_b"] < 0.8))
    identified = (Constant, Table, Own, StaticLugre, Quadratic, Network)  # in no shipped lining
    assert {type(entry) for entry in suv.lining(0).friction.values()} == set(LAWS) - set(identified)


@pytest.mark.parametrize("pressure_bar", [5.0, 40.0, 180.0])
@pytest.mark.parametrize("temperature", [-20.0, 100.0, 700.0])
@pytest.mark.parametrize("spin", [1.0, 30.0, 140.0])
def test_contact_area_stays_within_its_bounds(
    suv: Plant, pressure_bar: float, temperature: float, spin: float
) -> None:
    state = brake(suv, pressure_bar, temperature, spin, 20.0)
    assert np.all((state["lining_memory"] >= 0.85) & (state["lining_memory"] <= 1.20))


def test_every_application_starts_with_unit_contact(suv: Plant) -> None:
    params = nominal(suv)[0]
    state = brake(suv, 40.0, 100.0, 20.0, 2.0)
    assert np.all(state["lining_memory"] > 1.05)
    state["pressure"] = 0.4e5  # below the push-out pressure: released
    advance_lining(params, state, DT)
    assert np.all(state["lining_memory"] > 1.05)
    state["pressure"] = 0.6e5
    advance_lining(params, state, DT)
    assert state["lining_memory"] == pytest.approx(np.ones(4), abs=1e-4)


def test_friction_rises_within_a_stop_and_falls_with_heat(suv: Plant) -> None:
    gentle, hot = brake(suv, 30.0, 100.0, 30.0, 1.0), brake(suv, 30.0, 420.0, 90.0, 1.0)
    assert np.all(gentle["lining_memory"] > 1.0)
    assert hot["lining_memory"][0] < 1.0


def test_nothing_changes_in_the_contact_of_a_standing_wheel(suv: Plant) -> None:
    assert np.all(brake(suv, 60.0, 300.0, 0.0, 5.0)["lining_memory"] == 1.0)


def test_torque_counts_both_faces_above_the_push_out_pressure(suv: Plant) -> None:
    state = brake(suv, 40.0, 100.0, 0.0, 0.01)
    area = math.pi / 4 * 0.060**2
    expected = 2 * 0.3883 * (0.3825 / 0.45459) * area * 39.5e5 * 0.1205
    assert state["brake_torque"][0] == pytest.approx(expected, rel=1e-4)
    assert np.all(brake(suv, 0.4, 100.0, 20.0, 0.1)["brake_torque"] == 0.0)


@pytest.mark.parametrize("wetness", [0.0, 1.0])
def test_a_disc_that_brakes_steadily_reaches_the_closed_form(suv: Plant, wetness: float) -> None:
    params, state = nominal(suv)[0], new_record(STATE)[0]
    torque, spin, speed, seconds = 800.0, 60.0, 22.0, 20.0
    state["brake_work"], state["speed_x"] = torque * spin * DT, speed
    state["disc_temperature"] = 100.0
    for _ in range(round(seconds / DT)):
        advance_disc_temperature(params, state, 20.0, wetness, DT)
    cooling = 1.792e-3 + 9.108e-5 * speed * (WET if wetness else 1.0)
    steady = 20.0 + 2.111e-4 * torque * spin / cooling
    expected = steady + (100.0 - steady) * math.exp(-cooling * seconds)
    assert state["disc_temperature"][0] == pytest.approx(expected, rel=1e-5)


def test_left_and_right_discs_are_alike(car_at: Callable[[float], Any]) -> None:
    car = car_at(30.0)
    car.press(30.0, 30.0)
    car.run(2.0)
    for name in ("mu_b", "disc_temperature", "brake_torque"):
        assert np.array_equal(car.now[name][::2], car.now[name][1::2])
