"""Particles of the simulated brakes: the effects (i) to (v) of section 8.1, the cut, a car that brakes."""

import numpy as np
import pytest
from scipy.stats import lognorm

from brakelab.plant.description import Plant, nominal
from brakelab.plant.emission import (
    EmissionLaw,
    advance_emission,
    conditioning,
    emission_rate,
    share_counted,
    treat,
)
from brakelab.plant.records import STATE, new_record

LAW = EmissionLaw()
ROW = np.array(LAW.row())
PLAIN = np.array(LAW.model_copy(update={"by_power": 0.0, "by_speed": 0.0, "hot": 0.0, "flash": 0.0}).row())


def test_without_its_effects_the_law_counts_work():
    for power, speed in ((2e3, 3.0), (20e3, 3.0), (20e3, 12.0)):
        counted = LAW.rate * share_counted(LAW.coarse_median, LAW.coarse_spread)
        assert emission_rate(PLAIN, power, speed, 300.0) == pytest.approx(counted * power)


VAPOUR = LAW.model_copy(update={"activation": 12e3, "flash": 0.0})
COARSE = VAPOUR.rate * share_counted(LAW.coarse_median, LAW.coarse_spread)
ULTRAFINE = VAPOUR.rate * LAW.hot * share_counted(LAW.ultrafine_median, LAW.ultrafine_spread)
SECOND_FORM = {  # power [W], sliding [m/s], disc [degC] -> particles per J
    "cold, at reference force: abrasion alone": ((5e3, 5.0, -200.0), COARSE),
    "force x 8 at equal power": ((5e3, 0.625, -200.0), COARSE * 8.0**LAW.by_power),
    "power and speed x 2: the same force": ((10e3, 10.0, -200.0), COARSE),
    "at the critical temperature": ((5e3, 5.0, 185.0), COARSE + 0.5 * ULTRAFINE),
    "20 K below": ((5e3, 5.0, 165.0), COARSE + 0.5 * ULTRAFINE * np.exp(-12e3 * 20.0 / (458.15 * 438.15))),
    "far above: what the lining holds": ((5e3, 5.0, 400.0), COARSE + ULTRAFINE),
}


@pytest.mark.parametrize(("at", "per_joule"), SECOND_FORM.values(), ids=SECOND_FORM)
def test_the_second_form_adds_abrasion_by_force_and_vapours(at, per_joule):
    assert emission_rate(np.array(VAPOUR.row()), *at) == pytest.approx(per_joule * at[0])


# power [W], speed of sliding [m/s], disc [degC] of the one that emits more, and of the other; which effect
MORE = {
    "(i) more friction power, per joule too": ((2e4, 5.0, 80.0), (1e4, 5.0, 80.0), 2.0),
    "(i) a hotter disc": ((1e4, 5.0, 160.0), (1e4, 5.0, 80.0), 1.0),
    "(ii) faster sliding at equal power": ((1e4, 10.0, 80.0), (1e4, 5.0, 80.0), 1.0),
    "(iv) beyond the critical temperature": ((1e4, 5.0, 230.0), (1e4, 5.0, 150.0), 5.0),
}


@pytest.mark.parametrize(("more", "less", "factor"), MORE.values(), ids=MORE)
def test_effects_of_section_8_1(more, less, factor):
    assert emission_rate(ROW, *more) > factor * emission_rate(ROW, *less)


def test_pressure_acts_through_power_alone():
    """(iii): half the pressure at twice the sliding speed is the same power; what differs is the speed's."""
    ratio = emission_rate(ROW, 1e4, 8.0, 80.0) / emission_rate(ROW, 1e4, 4.0, 80.0)
    assert ratio == pytest.approx(2.0**LAW.by_speed)


def test_ultrafine_particles_rise_between_170_and_200_degc():
    heat = np.arange(60.0, 300.0, 1.0)
    plain = np.array([emission_rate(ROW, 1e3, 5.0, h) for h in heat])
    steepest = heat[np.argmax(np.gradient(plain))]
    assert 170.0 < steepest < 200.0


def test_a_surface_runs_in_and_heat_treats_it():
    """(v)"""
    assert conditioning(ROW, 0.0, 0.0) == pytest.approx(1.0 + LAW.run_in)
    assert conditioning(ROW, 20.0 * LAW.run_in_work, 0.0) == pytest.approx(1.0)
    treatment = 0.0
    for _ in range(200):
        treatment = treat(ROW, treatment, 20e3, 300.0, 10.0)
    assert treatment == pytest.approx(1.0, abs=1e-3)
    assert conditioning(ROW, 1e9, treatment) == pytest.approx(np.exp(-LAW.treated), rel=1e-3)
    assert treat(ROW, 0.7, 0.0, 20.0, 1e4) == 0.7  # rest changes nothing
    half = treat(ROW, treat(ROW, 0.2, 5e3, 60.0, 4.0), 5e3, 60.0, 6.0)
    assert half == pytest.approx(treat(ROW, 0.2, 5e3, 60.0, 10.0))  # in two steps as in one


CUTS = {"coarse": (0.30e-6, 2.0), "ultrafine": (30e-9, 1.6), "at the cut": (23e-9, 1.5)}


@pytest.mark.parametrize(("median", "spread"), CUTS.values(), ids=CUTS)
def test_counted_is_what_lies_between_23_nm_and_2_5_um(median, spread):
    sizes = lognorm(np.log(spread), scale=median)
    assert share_counted(median, spread) == pytest.approx(sizes.cdf(2.5e-6) - sizes.cdf(23e-9))


NOTHING = {"no power": (0.0, 5.0), "standing": (1e4, 0.0)}


@pytest.mark.parametrize(("power", "speed"), NOTHING.values(), ids=NOTHING)
def test_nothing_is_emitted_without_friction(power, speed):
    assert emission_rate(ROW, power, speed, 300.0) == 0.0


def test_a_car_emits_by_lot_and_lining(suv: Plant):
    car, state = nominal(suv), new_record(STATE)
    car["emission_scale"] = [[1.0, 2.0, 1.0, 1.0]]
    state["brake_work"], state["wheel_speed"], state["disc_temperature"] = 10.0, 50.0, 100.0
    state["brake_heat"] = 1e9
    for _ in range(1000):
        advance_emission(car[0], state[0], 1e-3)
    emitted = state["particles"][0]
    assert emitted[1] / emitted[0] == pytest.approx(2.0)
    radius = car["effective_radius"][0, 0]
    expected = emission_rate(car["emission_row"][0, 0], 10e3, 50.0 * radius, 100.0)
    assert emitted[0] == pytest.approx(expected, rel=0.01)  # of one second
