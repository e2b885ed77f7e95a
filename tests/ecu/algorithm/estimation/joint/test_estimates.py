"""What the joint observer says: friction with its standard deviation and mode, car and test ratios."""

import math
from pathlib import Path

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.estimation.joint.estimates import tell_joint
from ecu.algorithm.estimation.joint.kalman import GATE
from ecu.algorithm.estimation.joint.layout import (
    BALANCE_RATIO,
    BIAS,
    CHANGE,
    JOINT_STATE,
    LEVEL,
    MASS,
    OVERRUN,
    RATE,
    STIFFNESS,
    N,
    V,
)
from ecu.algorithm.estimation.joint.observer import WINDOW_S
from ecu.algorithm.estimation.joint.prior import set_prior
from ecu.algorithm.hydraulics import HYDRAULICS_STATE
from ecu.contract.records import LEARNED
from ecu.contract.signals import CALLIPER_PRESSURE, OBSERVING
from ecu.settings.config import load_config, new_params

SUV = new_params(load_config(Path(__file__).parents[5] / "config" / "suv.toml"))[0]
LEVELS = list(range(LEVEL, LEVEL + 4))
AXLE = [CHANGE, CHANGE, CHANGE + 1, CHANGE + 1]


def driven(seed: int):
    """Return a state within its prior whose errors are all tied to each other."""
    state, random = np.zeros(1, JOINT_STATE)[0], np.random.default_rng(seed)
    set_prior(SUV, state)
    root = np.maximum(np.sqrt(np.diag(state["p"])), 0.03)[:, None] * random.standard_normal((N, 2 * N))
    state["x"], state["p"] = 0.03 * random.standard_normal(N), 0.01 * root @ root.T
    return state


def published(state, feed, braking: bool, estimate=None, pressure_sigma: float = 0.0):
    estimate = np.zeros(1, ESTIMATE)[0] if estimate is None else estimate
    learned, hydraulics = np.zeros(1, LEARNED)[0], np.zeros(1, HYDRAULICS_STATE)[0]
    hydraulics["variance"] = pressure_sigma**2
    tell_joint(SUV, state, hydraulics, estimate, learned, feed()[0], braking, 0.01)
    return estimate


AHEAD = [
    # a window has just ended; time [s] since, by which friction has moved on from that window's middle
    (True, 0.0, 0.5 * WINDOW_S),
    (False, 0.01, 0.5 * WINDOW_S + 0.01),
    (False, 0.04, 0.5 * WINDOW_S + 0.04),
]


@pytest.mark.parametrize(("closed", "since", "ahead"), AHEAD)
def test_published_friction_is_level_and_change_moved_on_by_its_rate(feed, closed, since, ahead) -> None:
    state = driven(4)
    state["closed"], state["window"]["time"] = closed, WINDOW_S if closed else since
    state["x"][RATE] = 0.3
    mu = SUV["mu_nominal"] * np.exp(state["x"][LEVELS] + state["x"][AXLE] + 0.3 * ahead)
    np.testing.assert_allclose(published(state, feed, True)["mu"], mu, rtol=1e-12)


def test_published_sigma_is_that_of_level_and_change_together(feed) -> None:
    state = driven(5)
    A = np.zeros((4, N))
    A[range(4), LEVELS] = A[range(4), AXLE] = 1.0
    got = published(state, feed, False)
    relative = np.sqrt(np.diag(A @ state["p"] @ A.T))
    np.testing.assert_allclose(got["sigma"] / got["mu"], relative, rtol=1e-12)


@pytest.mark.parametrize("follows", [True, False])
@pytest.mark.parametrize("observed", [True, False])
def test_an_observed_friction_is_as_unsure_as_the_pressure_it_is_set_against(feed, follows, observed) -> None:
    """Where the pressure is a model's, it may be off for a while: its error is friction's then."""
    state = driven(5)
    plain = published(state, feed, True)
    state["observed"], state["smooth_pressure"] = observed, [20.0, 20.0, 10.0, 0.5]
    state["follows"] = follows
    more = published(state, feed, True, pressure_sigma=0.5)
    added = (more["sigma"] / more["mu"]) ** 2 - (plain["sigma"] / plain["mu"]) ** 2
    expected = np.array([0.5 / 20, 0.5 / 20, 0.5 / 10, 0.5]) ** 2 * (follows and observed)
    np.testing.assert_allclose(added, expected, atol=1e-15)


MODES = [
    # braking, wheel and balance observed, pressure usable; friction is being observed, its time counts
    (True, True, True, True, True, True),
    (True, True, False, True, True, True),
    (True, False, True, True, False, True),
    (True, False, False, True, False, False),
    (True, True, True, False, False, False),
    (False, True, True, True, False, False),
]


@pytest.mark.parametrize(("braking", "wheel", "balance", "usable", "observing", "counts"), MODES)
def test_a_corner_is_observed_while_its_signals_show_friction(
    feed, braking: bool, wheel: bool, balance: bool, usable: bool, observing: bool, counts: bool
) -> None:
    state, estimate = driven(6), np.zeros(1, ESTIMATE)[0]
    inputs, learned = feed()[0], np.zeros(1, LEARNED)[0]
    hydraulics = np.zeros(1, HYDRAULICS_STATE)[0]
    state["observed"], state["ratio"][BALANCE_RATIO] = wheel, 0.5 if balance else math.nan
    inputs["verdict"][CALLIPER_PRESSURE + 1] *= usable
    for _ in range(5):
        tell_joint(SUV, state, hydraulics, estimate, learned, inputs, braking, 0.01)
    assert (estimate["mode"][1] == OBSERVING) == observing
    assert estimate["observed_s"][1] == pytest.approx(0.05 * counts)
    assert (estimate["mode"][0] == OBSERVING) == (braking and wheel)


def test_the_sigma_of_all_linings_force_is_that_of_its_logarithms_gradient(feed) -> None:
    """At equal pressures: force of each is 2 A r_m mu / r; by differences."""
    state = driven(7)
    lever = SUV["piston_area"] * SUV["effective_radius"] / SUV["wheel_radius"]

    def force(levels: np.ndarray) -> float:
        return math.log((lever * SUV["mu_nominal"] * np.exp(levels + state["x"][AXLE])).sum())

    at, step = state["x"][LEVELS], 1e-6
    by = [(force(at + step * e) - force(at - step * e)) / (2 * step) for e in np.eye(4)]
    expected = math.sqrt(by @ state["p"][np.ix_(LEVELS, LEVELS)] @ by)
    state["closed"] = 1
    assert published(state, feed, True)["sigma_force"] == pytest.approx(expected, rel=1e-7)


def test_car_tyres_and_pressure_zeros_are_those_of_the_states(feed) -> None:
    state = driven(8)
    state["started"], state["at_bound"], state["reset"] = 1, 1, 0
    state["x"][[V, MASS, STIFFNESS, BIAS, OVERRUN]] = 21.0, math.log(1.1), math.log(0.8), -0.05, 0.2
    state["slip"], state["force"] = [-0.02, -0.03, -0.01, -0.015], [-2e3, -2.1e3, -900.0, -950.0]
    state["zero"]["value"] = [0.1, -0.7, 0.0, 0.3]
    got = published(state, feed, False)
    assert got["speed"] == 21.0
    assert got["mass"] == pytest.approx(1.1 * SUV["mass"])
    assert got["k_f"] == pytest.approx(0.8)
    assert (got["accel_bias"], got["overrun"]) == (-0.05, 0.2)
    assert (got["started"], got["at_bound"], got["reset"]) == (1, 1, 0)
    np.testing.assert_array_equal(got["slip"], state["slip"])
    np.testing.assert_array_equal(got["force"], state["force"])
    np.testing.assert_array_equal(got["pressure_zero"], state["zero"]["value"])


@pytest.mark.parametrize("started", [True, False])
def test_a_test_ratio_is_one_at_the_gate_and_none_before_a_start(feed, started: bool) -> None:
    state = driven(9)
    state["started"] = started
    state["ratio"] = GATE**2 * np.array([0.0, 0.25, 1.0, math.nan, 4.0, 0.5])
    got = published(state, feed, True)
    found = [*got["test_ratio"], got["test_ratio_balance"], got["test_ratio_speed"]]
    expected = [0.0, 0.25, 1.0, math.nan, 4.0, 0.5] if started else [math.nan] * 6
    assert found == pytest.approx(expected, nan_ok=True)


@pytest.mark.parametrize(("sigma", "known"), [(0.0, False), (0.05, True), (0.19, True), (0.21, False)])
def test_a_ceiling_of_grip_is_published_where_it_is_known(feed, sigma, known) -> None:
    """A road of 0.25: 2.45 m/s^2, with the sigma of its logarithm; 0: nothing is known of it."""
    state = driven(6)
    state["ceiling"], state["ceiling_variance"] = 0.25, sigma**2
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["grip_limit"] = estimate["sigma_grip_limit"] = math.nan
    got = published(state, feed, True, estimate)
    assert math.isfinite(got["grip_limit"]) == known
    if known:
        assert got["grip_limit"] == pytest.approx(2.45, abs=0.01)
        assert got["sigma_grip_limit"] == pytest.approx(2.45 * sigma, rel=0.01)
