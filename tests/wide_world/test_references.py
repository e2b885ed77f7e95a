"""Reference predictors on brakings whose law is known."""

import numpy as np
import pytest

from .brakings import Braking
from .references import (
    PRIOR,
    REFERENCES,
    average,
    expected,
    hindsight,
    never,
    saturating,
    saturating_hindsight,
)
from .route import Values

REST = 0.4


def brakings(law: object, demands: Values, noise: float = 0.0) -> list[Braking]:
    """Brakings that ramp up to each demand [m/s^2], measured by a law of the lining's deceleration."""
    rng = np.random.default_rng(5)
    made = []
    for demand in demands:
        lining = demand * np.clip(np.linspace(0.0, 5.0, 150), 0.0, 1.0)
        measured = float(np.mean(law(lining))) + REST + noise * rng.normal()
        made.append(Braking(0, 150, np.arange(150), measured, lining, REST))
    return made


def errors(predicted: Values, made: list[Braking], first: int = 0) -> Values:
    measured = np.array([one.measured for one in made])
    return np.abs(predicted / measured - 1.0)[first:]


GENTLE = np.random.default_rng(1).uniform(2.0, 6.0, 30)
HARD = np.random.default_rng(2).uniform(4.0, 20.0, 30)


def linear(lining: Values) -> Values:
    return 1.3 * lining


def ceiling(lining: Values) -> Values:
    return 11.0 * np.tanh(1.4 * lining / 11.0) + 0.3


def test_a_scale_is_found_by_all_who_learn() -> None:
    made = brakings(linear, GENTLE)
    assert np.all(errors(never(made).decel, made) > 0.1)
    assert errors(average(made).decel, made, 12).max() < 0.01
    assert errors(hindsight(made).decel, made).max() < 1e-9
    assert errors(saturating(made).decel, made, 10).max() < 0.04


def test_the_average_moves_by_two_fifths() -> None:
    made = brakings(linear, np.full(3, 5.0))
    lining = np.mean(made[0].lining)
    assert (average(made).decel - REST) / lining == pytest.approx([1.0, 1.12, 1.192])


def test_a_ceiling_is_found_by_those_who_look_for_one() -> None:
    made = brakings(ceiling, HARD)
    assert errors(average(made).decel, made, 5).mean() > 0.12
    assert errors(hindsight(made).decel, made).mean() > 0.08
    assert errors(saturating(made).decel, made, 8).mean() < 0.02
    assert errors(saturating_hindsight(made).decel, made).max() < 1e-3


def test_the_filter_says_how_wrong_it_is() -> None:
    """Within two sigma for 95 % of noisy brakings."""
    made = brakings(ceiling, np.tile(HARD, 10), noise=0.35)
    said = saturating(made)
    measured = np.array([one.measured for one in made])
    assert 0.9 < np.mean(np.abs(said.decel - measured) < 2.0 * said.sigma) <= 1.0
    assert np.mean(said.sigma[20:]) < 0.8


def test_nobody_knows_what_comes() -> None:
    """A changed last braking changes no causal prediction before it."""
    made, other = brakings(ceiling, HARD), brakings(ceiling, HARD)
    other[-1] = other[-1]._replace(measured=1.0)
    for name, predict in REFERENCES.items():
        same = np.array_equal(predict(made).decel[:-1], predict(other).decel[:-1])
        assert same == ("hindsight" not in name), name


def test_derivatives_are_those_of_the_expectation() -> None:
    lining = np.linspace(0.0, 18.0, 50)
    _, derivatives = expected(PRIOR[0], lining)
    for k in range(3):
        ahead, back = PRIOR[0].copy(), PRIOR[0].copy()
        ahead[k] += 1e-5
        back[k] -= 1e-5
        slope = (expected(ahead, lining)[0] - expected(back, lining)[0]) / 2e-5
        assert derivatives[k] == pytest.approx(slope, rel=1e-6)
