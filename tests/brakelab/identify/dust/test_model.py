"""Emission models: each finds what it can express; networks run on board as scikit-learn trained them."""

import numpy as np
import pytest

pytest.importorskip("sklearn", reason="needs scikit-learn (extra learn)")

from brakelab.identify.dust.model import (
    FITS,
    Samples,
    fit_dynamic,
    fit_law,
    fit_network,
    fit_table,
    resample,
)
from ecu.contract.dust import NUMBERS

LAW = np.array([3.5, 0.9, 0.5, 0.2])


def samples(seed: int, scatter: float = 0.0, n: int = 600) -> Samples:
    random = np.random.default_rng(seed)
    v_in = random.uniform(4.0, 33.0, n)
    v_end = v_in * random.uniform(0.05, 0.9, n)
    torque, heat = random.uniform(60.0, 700.0, n), random.uniform(10.0, 130.0, n)
    duration = random.uniform(1.0, 15.0, n)
    features = np.column_stack([v_in, v_end, torque, heat, duration, torque / 30.0])
    v = 0.5 * (v_in + v_end)
    terms = np.column_stack([np.ones(n), np.log10(torque * v * duration), np.log10(v), heat / 100])
    factor = terms @ LAW + scatter * random.normal(size=n)
    sequences = np.column_stack([np.linspace(v_in, v_end, 12).T, np.repeat(torque[:, None], 12, 1),
                                 np.repeat(heat[:, None], 12, 1), duration])  # fmt: skip
    return Samples(features, sequences, factor, np.ones(n))


# Error that each may have of a smooth law without scatter, RMS of EF; the map lacks three of its inputs.
EXPRESSES = {
    "LUT": 0.40,
    "static ANN": 0.06,
    "dynamic ANN": 0.10,
    "gradient boosting": 0.10,
    "monotone law": 1e-6,
}


@pytest.mark.parametrize(("name", "most"), EXPRESSES.items(), ids=EXPRESSES)
def test_a_smooth_law_is_found(name, most):
    model, fresh = FITS[name](samples(1), 0), samples(2)
    error = model.predict(fresh.features, fresh.sequences) - fresh.factor
    print(name, np.sqrt(np.mean(error**2)), model.size)
    assert np.sqrt(np.mean(error**2)) < most


def test_the_law_never_falls_with_work_speed_or_heat():
    """Even of data in which heat seems to lower the emission."""
    data = samples(3, 0.3)
    data = data._replace(factor=data.factor - 0.02 * data.features[:, 3])
    model = fit_law(data, 0)
    assert np.all(model.numbers[1:] >= 0.0)
    assert model.numbers[4:].sum() == 0.0


def test_knots_that_few_applications_reach_are_left_out():
    numbers = fit_law(samples(4, 0.2), 0).numbers
    assert np.all(numbers[-4:] == 0.0)  # 140 degC and above


def test_a_background_heavy_application_counts_less():
    data = samples(5)
    spoiled = data.factor.copy()
    spoiled[:100] += 1.0
    weight = np.ones(len(spoiled))
    weight[:100] = 1e-3
    found = fit_law(data._replace(factor=spoiled, weight=weight), 0)
    error = found.predict(data.features, data.sequences) - data.factor
    assert np.abs(error).max() < 0.05


@pytest.mark.parametrize("fit", [fit_network, fit_table, fit_law])
def test_what_runs_on_board_fits_its_configuration(fit):
    model = fit(samples(6, 0.2), 0)
    assert model.on_board is not None
    assert len(model.numbers) == model.size == NUMBERS[model.on_board]


def test_the_dynamic_network_has_the_inputs_of_8_3():
    model = fit_dynamic(samples(7, 0.2), 0)
    assert model.on_board is None
    assert model.size == 37 * 10 + 10 + 10 + 1 + 2 * 37 + 2


def test_resampling_makes_emission_factors_equally_frequent():
    """Figure 8.4"""
    factor = np.random.default_rng(8).normal(9.0, 0.5, 2000)
    places = resample(factor, 1)
    assert len(places) == len(factor)
    before, after = (np.histogram(x, np.arange(8.2, 9.9, 0.4))[0] for x in (factor, factor[places]))
    assert np.ptp(after) / after.mean() < 0.5 * np.ptp(before) / before.mean()
