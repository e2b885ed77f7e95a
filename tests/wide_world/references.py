"""Predictors to judge the product by: each predicts a braking from its pressures and the brakings before it.

    never        the configured friction
    average      a scale s of the configured friction, s += 0.4 (measured ratio - s)
    hindsight    one scale for the drive, chosen afterwards
    saturating   mean of c tanh(k p / c) + offset; ln k, ln c and the offset by an extended Kalman filter
    saturating, hindsight   the same form, one triple for the drive, chosen afterwards

p is the lining deceleration that the configured car expects, row by row.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from .brakings import Braking
from .route import Values

AVERAGE = 0.4
PRIOR = (
    np.array([0.0, np.log(14.0), 0.2]),
    np.array([0.25, 0.4, 0.3]),
)  # ln k, ln c, offset [m/s^2]: mean, sigma
WALK = np.array([0.05, 0.03, 0.03])  # of the same, a braking
NOISE = 0.35  # m/s^2, of a braking's mean
GATE = 2.5  # sigma beyond which an innovation is weighed down


class Prediction(NamedTuple):
    """Mean deceleration of each braking [m/s^2]; sigma is NaN for whom states none."""

    decel: Values
    sigma: Values


def _ratio(braking: Braking) -> float:
    return float((braking.measured - braking.rest) / max(np.mean(braking.lining), 0.1))


def scaled(brakings: list[Braking], scales: Values) -> Prediction:
    """Return what linings give that grip `scales` times as well as configured, a scale for each braking."""
    decel = np.array([s * np.mean(b.lining) + b.rest for s, b in zip(scales, brakings, strict=True)])
    return Prediction(decel, np.full(len(brakings), np.nan))


def never(brakings: list[Braking]) -> Prediction:
    """Return predictions by the configured friction."""
    return scaled(brakings, np.ones(len(brakings)))


def average(brakings: list[Braking]) -> Prediction:
    """Return predictions by a running average that starts at the configured friction."""
    scales, scale = [], 1.0
    for braking in brakings:
        scales.append(scale)
        scale += AVERAGE * (_ratio(braking) - scale)
    return scaled(brakings, np.array(scales))


def hindsight(brakings: list[Braking]) -> Prediction:
    """Return predictions by the one scale that has the least squares of relative errors."""
    share = np.array([np.mean(b.lining) / b.measured for b in brakings])
    missing = np.array([1.0 - b.rest / b.measured for b in brakings])
    return scaled(brakings, np.full(len(brakings), share @ missing / (share @ share)))


def expected(state: Values, lining: Values) -> tuple[float, Values]:
    """Return the mean of c tanh(k p / c) + offset [m/s^2] and its derivatives to ln k, ln c and offset."""
    k, c, offset = np.exp(state[0]), np.exp(state[1]), state[2]
    u = k * lining / c
    tanh, slope = np.tanh(u), 1.0 - np.tanh(u) ** 2
    derivatives = np.array([np.mean(k * lining * slope), c * np.mean(tanh - u * slope), 1.0])
    return float(c * np.mean(tanh) + offset), derivatives


def saturating(brakings: list[Braking]) -> Prediction:
    """Return predictions by the filter of a lining with a ceiling, and their standard deviations."""
    state, covariance = PRIOR[0].copy(), np.diag(PRIOR[1] ** 2)
    decel, sigma = [], []
    for braking in brakings:
        mean, h = expected(state, braking.lining)
        variance = h @ covariance @ h + NOISE**2
        decel.append(mean + braking.rest)
        sigma.append(np.sqrt(variance))
        innovation = braking.measured - braking.rest - mean
        variance = max(variance, (innovation / GATE) ** 2)
        gain = covariance @ h / variance
        state = state + gain * innovation
        covariance = covariance - np.outer(gain, gain) * variance + np.diag(WALK**2)
    return Prediction(np.array(decel), np.array(sigma))


def saturating_hindsight(brakings: list[Braking]) -> Prediction:
    """Return predictions by the form of `saturating` with the triple of least squared relative errors."""

    def errors(state: Values) -> Values:
        return np.array([(expected(state, b.lining)[0] + b.rest) / b.measured - 1.0 for b in brakings])

    best = least_squares(errors, PRIOR[0], bounds=([-1.5, np.log(1.5), -1.0], [1.5, np.log(40.0), 3.0])).x
    decel = np.array([expected(best, b.lining)[0] + b.rest for b in brakings])
    return Prediction(decel, np.full(len(brakings), np.nan))


REFERENCES = {
    "never learning": never,
    "running average": average,
    "one scale, hindsight": hindsight,
    "saturating filter": saturating,
    "its form, hindsight": saturating_hindsight,
}
