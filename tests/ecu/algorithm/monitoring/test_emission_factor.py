"""Emission factor by network, table and law, beside numpy and scipy; what a model was trained on."""

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from ecu.algorithm.monitoring.emission_factor import emission_factor, inside
from ecu.contract.dust import HIDDEN, INPUTS, KNOTS, LAW, LAW_TERMS, NETWORK, NODES, NUMBERS, TABLE

STOP = np.array([20.0, 5.0, 400.0, 90.0, 6.0, 15.0])


def changed(place: int, value: float) -> np.ndarray:
    features = STOP.copy()
    features[place] = value
    return features


def test_the_network_is_that_of_figure_8_7():
    random = np.random.default_rng(1)
    centre, half = random.uniform(1, 3, INPUTS), random.uniform(1, 5, INPUTS)
    w, b = random.normal(size=(HIDDEN, INPUTS)), random.normal(size=HIDDEN)
    out, bias, level, spread = random.normal(size=HIDDEN), 0.3, 9.0, 0.7
    hidden = np.column_stack([w, b]).ravel()
    numbers = np.concatenate([centre, half, [level, spread], hidden, out, [bias]])
    assert len(numbers) == NUMBERS[NETWORK]
    x = STOP[:5].copy()
    x[2], x[4] = np.log10(x[2]), np.log10(x[4])
    expected = level + spread * (out @ np.tanh(w @ ((x - centre) / half) + b) + bias)
    assert emission_factor(NETWORK, numbers, STOP) == pytest.approx(expected)


PLACES = {"inside": (12.0, 8.0), "at a node": (10.0, 10.0), "below": (0.5, 0.1), "beyond": (60.0, 90.0)}


@pytest.mark.parametrize(("speed", "pressure"), PLACES.values(), ids=PLACES)
def test_the_table_is_bilinear_and_holds_its_edges(speed, pressure):
    random = np.random.default_rng(2)
    speeds, pressures = np.array([2.0, 6, 10, 16, 24, 36]), np.array([1.0, 4, 7, 10, 20, 40])
    values = random.normal(9.0, 0.5, (NODES, NODES))
    numbers = np.concatenate([speeds, pressures, values.ravel()])
    assert len(numbers) == NUMBERS[TABLE]
    features = changed(0, speed)
    features[5] = pressure
    held = (np.clip(speed, 2.0, 36.0), np.clip(pressure, 1.0, 40.0))
    expected = RegularGridInterpolator((speeds, pressures), values)(held).item()
    assert emission_factor(TABLE, numbers, features) == pytest.approx(expected)


def test_the_law_is_a_power_law_that_bends_with_heat():
    coefficients = np.array([3.0, 0.9, 0.4, 0.2, 0.1, *np.linspace(0.5, 1.0, len(KNOTS))])
    assert len(coefficients) == NUMBERS[LAW] == 1 + LAW_TERMS
    v, torque, heat, duration = 12.5, 400.0, 150.0, 6.0
    expected = 3.0 + 0.9 * np.log10(torque * v * duration) + 0.4 * np.log10(v) + 0.2 * np.log10(torque * v)
    expected += 0.1 * 1.5
    expected += sum(c * max(150.0 - k, 0.0) / 100 for c, k in zip(coefficients[5:], KNOTS, strict=True))
    assert emission_factor(LAW, coefficients, changed(3, heat)) == pytest.approx(expected)


def test_more_work_never_emits_less_by_the_law():
    coefficients = np.array([3.0, 0.9, 0.4, 0.2, 0.1, *np.linspace(0.5, 1.0, len(KNOTS))])
    for place, more in ((0, 30.0), (1, 8.0), (2, 500.0), (3, 210.0), (4, 9.0)):
        base, other = (emission_factor(LAW, coefficients, x) for x in (STOP, changed(place, more)))
        assert other > base


OUTSIDE = {
    "faster": (0, 50.0),
    "hotter": (3, 300.0),
    "shorter": (4, 0.1),
    "not a number": (3, np.nan),
}


@pytest.mark.parametrize(("place", "value"), OUTSIDE.values(), ids=OUTSIDE)
def test_outside_what_it_was_trained_on(place, value):
    low, high = np.array([1.0, 0.1, 20, 0, 0.5, 1]), np.array([35.0, 30, 900, 200, 30, 40])
    assert inside(low, high, STOP)
    assert not inside(low, high, changed(place, value))
