"""Emission in the table of applications: the models of the configuration on the rows of results."""

import math
from pathlib import Path

import numpy as np
import pytest

from brakelab.results.dust import airborne_mass, dust_of
from ecu.contract.dust import LAW_TERMS
from ecu.contract.signals import N_OUTPUTS, OUTPUT
from ecu.settings.config import load_config, new_params
from ecu.settings.dust import Dust, set_dust

CONFIG = Path(__file__).parents[3] / "config" / "lcv.toml"
MODEL = Dust(
    model="law",
    numbers=[4.0, 0.9, 0.5, *[0.0] * (LAW_TERMS - 2)],
    low=[2.0, 0.05, 30.0, -20.0, 0.5, 1.0],
    high=[40.0, 40.0, 1500.0, 200.0, 30.0, 60.0],
    below=-0.5,
    above=0.4,
)


@pytest.fixture
def params():
    found = new_params(load_config(CONFIG))
    for corner in (0, 1):
        set_dust(found[0], corner, MODEL)
    return found


def rows(first: float, last: float, seconds: float, torque: float = 500.0, stands: int = 0) -> np.ndarray:
    n = round(seconds / 0.01)
    table = np.zeros((n + stands, N_OUTPUTS))
    table[:n, OUTPUT["vehicle_speed"]] = np.linspace(first, last, n)
    for name, value in (("brake_torque", torque), ("disc_temperature", 90.0), ("calliper_pressure", 20.5)):
        table[:, OUTPUT[f"{name}_fl"] : OUTPUT[f"{name}_fl"] + 4] = value
    return table


def test_the_front_brakes_have_a_model_and_an_interval(params):
    found = dust_of(rows(20.0, 10.0, 5.0, stands=300), params)
    expected = 4.0 + 0.9 * math.log10(500.0 * 15.0 * 5.0) + 0.5 * math.log10(15.0)
    assert found.factor[:2] == pytest.approx([expected] * 2, abs=1e-3)
    assert found.low[0] - found.factor[0] == pytest.approx(-0.5)
    assert found.high[0] - found.factor[0] == pytest.approx(0.4)
    assert np.isnan(found.factor[2:]).all()


OUTSIDE = {
    "too fast": rows(60.0, 50.0, 5.0),
    "only felt": rows(20.0, 10.0, 5.0, 2.0),
    "standing": rows(0.0, 0.0, 5.0),
}


@pytest.mark.parametrize("given", OUTSIDE.values(), ids=OUTSIDE)
def test_what_is_not_counted(params, given):
    assert np.isnan(dust_of(given, params).factor).all()


def test_a_car_without_models_tells_nothing():
    found = dust_of(rows(20.0, 10.0, 5.0), new_params(load_config(CONFIG)))
    assert np.isnan(found.factor).all()


def test_the_mass_in_the_air_has_the_band_of_the_wear_and_of_its_share(params):
    worn, error = np.array([0.1, 0.2, 0.05, -1e-9]), np.array([0.15, 0.15, 0.15, 0.6])
    mass, low, high = airborne_mass(worn, error, params)
    assert mass == pytest.approx([50.0, 100.0, 25.0, 0.0])
    assert low[:3] == pytest.approx(1e3 * 0.02 * worn[:3] * (1.0 - 1.96 * 0.15))
    assert high[:3] == pytest.approx(1e3 * 0.70 * worn[:3] * (1.0 + 1.96 * 0.15))
    assert (low <= mass).all()
    assert (mass <= high).all()
