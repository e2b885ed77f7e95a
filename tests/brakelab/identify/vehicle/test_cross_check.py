"""Whose brakes predict applications that they were not fitted to: a car of one parameter, in closed form."""

import numpy as np
import pytest

from brakelab.identify.vehicle.cross_check import BRAKING, cross_check, keep_start
from brakelab.identify.vehicle.fit import Prior, Residuals, fit
from brakelab.identify.vehicle.parameters import Parameter

START = 1.0
WINDOWS = 4  # of an application
PRIOR = Prior(np.array([START]), np.array([0.7]))
FRICTION = Parameter("front.mu_nominal", "-", 0.42, 0.31, 0.03, 40, "torque per bar", "")
MASS = Parameter("vehicle.mass", "kg", 2105.0, 1990.0, 20.0, 300, "motor torque", "")


def brakings(scales: list[float]) -> Residuals:
    """Return the balances of applications, each with brakes of its own scale, and of a car that rolls."""
    each = np.repeat([*scales, 0.0], WINDOWS)
    kind = np.repeat([*[BRAKING] * len(scales), 0], WINDOWS)

    def of(theta: np.ndarray, half: int) -> np.ndarray:
        return np.where(kind == BRAKING, theta[0] - each, 0.0)

    return Residuals(of, kind, np.repeat(np.arange(len(scales) + 1), WINDOWS), np.full(len(kind), 0.05))


@pytest.mark.parametrize(
    ("scales", "worse", "said"),
    [
        pytest.param([0.7] * 6, False, "found are better", id="another car than START"),
        pytest.param([0.8, 1.2, 0.8, 1.2, 0.8, 1.2, 1.0], True, "are kept", id="START, and much scatter"),
        pytest.param([0.7] * 4, False, "fewer than 5 cannot tell", id="too few"),
        pytest.param([0.8, 1.2, 0.8, 1.2], False, "cannot tell", id="too few for START, which is better"),
        pytest.param([0.8], False, "1 brake application, ", id="one"),
        pytest.param([], True, "no steady brake application", id="none"),
    ],
)
def test_whose_brakes_are_better(scales: list[float], worse: bool, said: str) -> None:
    residuals = brakings(scales)
    check = cross_check(residuals, PRIOR, fit(residuals, PRIOR).theta)
    assert check.applications == len(scales)
    assert check.worse == worse
    assert said in check.line
    kept = keep_start([FRICTION, MASS], check)
    assert kept[1] == MASS
    assert (kept[0].value == FRICTION.start, bool(kept[0].remedy)) == (worse, worse)


def test_a_single_application_and_nothing_else_leaves_start() -> None:
    residuals = Residuals(
        lambda theta, half: theta[0] - np.full(WINDOWS, 0.8),
        np.full(WINDOWS, BRAKING),
        np.zeros(WINDOWS, int),
        np.full(WINDOWS, 0.05),
    )
    check = cross_check(residuals, PRIOR, np.array([0.8]))
    assert check.fitted == check.start == pytest.approx(0.2)


def test_errors_are_of_applications_that_were_not_fitted_to() -> None:
    """One that differs from the others is off by that difference, and each of these hardly."""
    scales = [0.8] * 5 + [1.4]
    residuals = brakings(scales)
    check = cross_check(residuals, PRIOR, np.array([START]))
    assert check.start == pytest.approx(np.mean(np.abs(np.array(scales) - START)), rel=1e-6)
    assert check.fitted > 0.6 / len(scales)
