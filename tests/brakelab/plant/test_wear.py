"""Wear of the simulated pads: Archard's law, its regimes, and the dynamometer that wears them."""

import numpy as np
import pytest

from brakelab.plant.description import Plant, nominal
from brakelab.plant.records import STATE, new_record
from brakelab.plant.wear import AREA, DENSITY, WearLaw, advance_wear, pad_wear, running_in, wear_rate
from brakelab.plant.wear_rig import TORQUE, T, wear_block

PLAIN = WearLaw(by_pressure=0.0, by_speed=0.0, hot=0.0, flash=0.0, run_in=0.0)


def row(law: WearLaw) -> np.ndarray:
    return np.array(law.row(7.125e-3))


def test_plain_archard_is_rate_times_force_times_distance():
    law = row(PLAIN)
    for force, speed in ((5e3, 2.0), (20e3, 8.0), (5e3, 8.0)):
        assert wear_rate(law, force, speed, 20e5, 100.0) == pytest.approx(PLAIN.rate * 1e-6 * force * speed)


NOTHING = {"no force": (0.0, 5.0), "standing": (1e4, 0.0)}


@pytest.mark.parametrize(("force", "speed"), NOTHING.values(), ids=NOTHING)
def test_nothing_wears_without_force_and_sliding(force, speed):
    assert wear_rate(row(WearLaw()), force, speed, 20e5, 300.0) == 0.0


def test_heat_activates_and_the_contact_is_hotter_than_the_disc():
    law = row(WearLaw(by_pressure=0.0, by_speed=0.0, flash=0.0))
    rates = [wear_rate(law, 1e4, 5.0, 20e5, heat) for heat in (20.0, 230.0, 600.0)]
    assert rates[1] / rates[0] == pytest.approx(2.0, rel=0.02)  # half of the activation at 230 degC
    assert rates[2] / rates[0] == pytest.approx(3.0, rel=0.02)
    flash = row(WearLaw(by_pressure=0.0, by_speed=0.0))
    hotter = WearLaw().flash * 1e4 * 5.0
    assert wear_rate(flash, 1e4, 5.0, 20e5, 150.0) == pytest.approx(
        wear_rate(law, 1e4, 5.0, 20e5, 150.0 + hotter)
    )


def test_a_new_lining_runs_in():
    law = row(WearLaw())
    assert running_in(law, 0.0) == pytest.approx(1.5)
    assert running_in(law, 60.0) == pytest.approx(1.0, abs=1e-4)


def test_mass_and_thickness_belong_to_two_pads():
    law = row(WearLaw())
    assert pad_wear(law, 2 * law[AREA] * 1e-3 * law[DENSITY] * 1e3) == pytest.approx(1.0)  # 1 mm


def test_a_car_wears_its_pads_by_lot_and_lining(suv: Plant):
    car, state = nominal(suv), new_record(STATE)
    car["wear_scale"] = [[1.0, 2.0, 1.0, 1.0]]
    state["pressure"], state["wheel_speed"], state["disc_temperature"] = 20e5, 50.0, 100.0
    for _ in range(1000):
        advance_wear(car[0], state[0], 1e-3)
    worn = state["pad_wear_mass"][0]
    assert worn[1] / worn[0] == pytest.approx(2.0, rel=1e-2)
    area, radius = car["piston_area"][0], car["effective_radius"][0]
    force = 2.0 * (20e5 - car["push_out_pressure"][0]) * area
    expected = 1.5 * wear_rate(car["wear_row"][0, 0], force[0], 50.0 * radius[0], 19.5e5, 100.0)
    assert worn[0] == pytest.approx(expected, rel=0.01)


def test_the_rig_takes_the_energy_of_its_flywheel_out_by_the_brake(suv: Plant):
    """(7.21) without resistance: 0.5 m (v^2 - u^2) of each application."""
    stops = np.array([[25.0, 5.0, 2.0, 60.0], [15.0, 0.0, 1.0, 30.0]])
    trace = np.zeros((5000, 5))
    rows, worn = wear_block(nominal(suv)[0], 0, 690.0, 0.36, stops, 20.0, trace)
    t, omega, torque = trace[:rows, T], trace[:rows, 1], trace[:rows, TORQUE]
    braked = np.diff(t) < 0.021
    work = np.sum((torque * omega)[:-1][braked] * np.diff(t)[braked])
    assert work == pytest.approx(0.5 * 690.0 * (25.0**2 - 5.0**2 + 15.0**2), rel=0.01)
    assert 20.0 < worn < 20.2
