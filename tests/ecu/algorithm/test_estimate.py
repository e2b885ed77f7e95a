"""When a friction that was observed may be learned; what an estimate remembers."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE, remembered_exp, well_observed


@pytest.mark.parametrize(
    ("case", "sigma", "observed_s", "learned"),
    [
        ("a second, 9 %", 0.09, 1.0, True),
        ("long, 11 %", 0.11, 30.0, False),
        ("just before a second", 0.02, 0.99, False),
        ("not known at all", np.nan, 30.0, False),
    ],
)
def test_a_friction_is_learned_that_was_sure_for_a_second(case, sigma, observed_s, learned) -> None:
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["mu"], estimate["sigma"][2], estimate["observed_s"][2] = 0.4, 0.4 * sigma, observed_s
    assert well_observed(estimate, 2) == learned, case


def test_a_remembered_exponential_is_that_of_the_last_exponent() -> None:
    estimate = np.zeros(1, ESTIMATE)[0]
    for exponent in (0.0, 0.0, -0.3, 0.2, 0.2, math.nan, 0.2, -800.0, -800.0, 0.0):
        for place, shift in ((0, 0.0), (9, 0.1)):  # two places know nothing of each other
            found = remembered_exp(estimate, place, exponent + shift)
            assert found == pytest.approx(math.exp(exponent + shift), rel=1e-15, nan_ok=True), exponent
