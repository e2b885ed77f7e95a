"""What is kept between drives: values with their covariance, a pause less sure; and what is published."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.algorithm.estimation.friction import FRICTION_STATE, GREATEST_RATIO, LEAST_RATIO
from ecu.algorithm.estimation.joint.layout import (
    CHANGE,
    JOINT_STATE,
    LEVEL,
    MASS,
    MEAN,
    PASSING,
    PEAK,
    RATE,
    N,
    V,
)
from ecu.algorithm.estimation.joint.learned import (
    KEPT,
    LEVEL_PAUSE,
    PAUSE,
    hand_over_level,
    keep_joint,
    publish_friction,
    restore_joint,
)
from ecu.algorithm.estimation.joint.observer import WINDOW_S
from ecu.algorithm.estimation.joint.pressure import AGREED_S
from ecu.algorithm.estimation.joint.prior import set_prior
from ecu.contract.records import LEARNED, N_KEPT
from ecu.contract.signals import CALLIPER_PRESSURE, OBSERVING
from ecu.recording.store import JOINT_LIMIT, out_of_range
from ecu.settings.config import load_config, new_params

SUV = new_params(load_config(Path(__file__).parents[5] / "config" / "suv.toml"))[0]
LEVELS = list(range(LEVEL, LEVEL + 4))
AXLE = [CHANGE, CHANGE, CHANGE + 1, CHANGE + 1]
BOUND = [math.log(LEAST_RATIO), math.log(GREATEST_RATIO)]


def new_state():
    state = np.zeros(1, JOINT_STATE)[0]
    set_prior(SUV, state)
    return state


def restored(learned):
    state = np.zeros(1, JOINT_STATE)[0]
    restore_joint(SUV, state, learned)
    return state


def sigma(state) -> np.ndarray:
    return np.sqrt(np.diag(state["p"]))


def driven(seed: int):
    """Return a state as a drive may leave it: surer than the prior, everything tied to everything."""
    state, random = new_state(), np.random.default_rng(seed)
    prior = np.maximum(sigma(state), 0.03)  # a change that the prior has not yet begun
    root = random.standard_normal((N, 2 * N))
    root *= (0.5 * prior * random.uniform(0.1, 1.0, N) / np.sqrt((root**2).sum(axis=1)))[:, None]
    state["x"], state["p"] = 0.5 * prior * random.standard_normal(N), root @ root.T
    state["x"][LEVELS] = 0.1 * random.standard_normal(4)
    state["x"][MEAN : MEAN + 2] = 0.0  # no application goes on
    return state


def keep(state):
    learned = np.zeros(1, LEARNED)[0]
    keep_joint(SUV, state, learned)
    return learned


def test_with_nothing_learned_it_is_the_prior() -> None:
    state, prior = restored(np.zeros(1, LEARNED)[0]), new_state()
    for name in ("x", "p"):
        np.testing.assert_array_equal(state[name], prior[name])
        for row in range(2):
            np.testing.assert_array_equal(state[f"kept_{name}"][row], prior[name])
    assert not state["started"]


def test_everything_but_what_passes_is_kept() -> None:
    assert len(KEPT) == N_KEPT
    assert sorted([*KEPT, *PASSING]) == list(range(N))


@pytest.mark.parametrize("seed", range(5))
def test_what_was_kept_comes_back_with_its_covariance_a_pause_less_sure(seed: int) -> None:
    before, prior = driven(seed), new_state()
    after = restored(keep(before))
    expected = before["p"] + np.diag(PAUSE**2)
    expected[np.ix_(LEVELS, LEVELS)] += LEVEL_PAUSE**2
    expected = no_less_sure(expected)
    x = before["x"].copy()
    for i in [*PASSING, PEAK]:  # and the peak is the road's
        x[i] = 0.0
        expected[i] = expected[:, i] = 0.0
        expected[i, i] = prior["p"][i, i]
    np.testing.assert_allclose(after["x"], x, rtol=1e-12)
    np.testing.assert_allclose(after["p"], expected, rtol=1e-12, atol=1e-18)
    assert (sigma(after)[KEPT] >= np.minimum(sigma(before), sigma(prior))[KEPT] * (1 - 1e-12)).all()


def no_less_sure(P: np.ndarray) -> np.ndarray:
    """Return a covariance scaled to where no state is less sure than before anything was learned."""
    scale, prior = np.ones(N), np.diag(new_state()["p"])
    own = [i for i in KEPT if P[i, i] > prior[i]]
    scale[own] = np.sqrt(prior[own] / np.diag(P)[own])
    return P * np.outer(scale, scale)


def ignitions(count: int):
    """Return the state after so many ignitions without a drive, from one as it was made."""
    learned = keep(new_state())
    for _ in range(count):
        state = restored(learned)
        keep_joint(SUV, state, learned)
    return state


def test_ignitions_alone_make_nothing_surer() -> None:
    learned = keep(driven(2))
    before = sigma(restored(learned))
    for _ in range(20):
        keep_joint(SUV, restored(learned), learned)
        now = sigma(restored(learned))
        assert (now >= before * (1 - 1e-12)).all()
        before = now


def test_ignitions_alone_make_nothing_less_sure_than_new() -> None:
    assert (sigma(ignitions(100)) <= sigma(new_state()) * (1 + 1e-9)).all()


STORED = {
    "seed": st.integers(0, 10_000),
    "share": st.floats(1e-3, 10.0),
    "joint": st.lists(st.floats(-JOINT_LIMIT, JOINT_LIMIT), min_size=N, max_size=N),
    "rank": st.integers(1, 2 * N),
}


@settings(max_examples=200)
@given(**STORED)
def test_whatever_a_drive_may_leave_gives_a_covariance(seed: int, share: float, joint, rank: int) -> None:
    state, random = new_state(), np.random.default_rng(seed)
    root = share * np.sqrt(np.diag(state["p"]))[:, None] * random.standard_normal((N, rank)) / math.sqrt(rank)
    state["x"], state["p"] = joint, root @ root.T
    learned = np.zeros(1, LEARNED)
    keep_joint(SUV, state, learned[0])
    learned["radius_sigma"] = 0.001
    assert out_of_range(learned, SUV["mu_nominal"]) == ""
    P = restored(learned[0])["p"]
    np.testing.assert_array_equal(P, P.T)
    some = np.diag(P) > 0
    scale = np.sqrt(np.diag(P)[some])
    assert (P[~some] == 0).all()
    assert np.linalg.eigvalsh(P[np.ix_(some, some)] / np.outer(scale, scale)).min() > -1e-10


KEPT_FRICTION = [
    # ln of friction over nominal of a wheel; its relative sigma by the covariance, and the least kept
    ("a fifth low", math.log(0.8), 0.04, 0.0),
    ("just inside", 0.98 * BOUND[1], 0.04, 0.0),
    ("at the least", BOUND[0], 0.04, 0.15),
    ("at the greatest", BOUND[1], 0.04, 0.15),
    ("at the greatest, unsure", BOUND[1], 0.30, 0.15),
]


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize(
    ("name", "level", "own", "least"), KEPT_FRICTION, ids=[row[0] for row in KEPT_FRICTION]
)
def test_the_base_of_the_next_braking_is_the_level(name: str, level, own, least, wheel: int) -> None:
    """Whatever an application has added to it; at a bound it is not believed."""
    state = driven(3)
    state["x"][LEVEL + wheel], state["x"][CHANGE : CHANGE + 2] = level, 0.1
    state["p"][LEVEL + wheel, LEVEL + wheel] = own**2
    learned = keep(state)
    mu = SUV["mu_nominal"][wheel] * math.exp(level)
    assert learned["mu_b"][wheel] == pytest.approx(mu)
    assert learned["sigma_mu_b"][wheel] == pytest.approx(mu * max(own, least))


def test_amid_an_application_what_it_has_shown_so_far_is_kept() -> None:
    """The ECU may lose its power at any time."""
    state = driven(3)
    state["x"][LEVEL : LEVEL + 4], state["x"][MEAN : MEAN + 2] = 0.05, (-0.10, 0.02)
    learned = keep(state)
    expected = SUV["mu_nominal"] * np.exp([-0.05, -0.05, 0.07, 0.07])
    assert learned["mu_b"] == pytest.approx(expected)
    assert restored(learned)["x"][LEVEL : LEVEL + 4] == pytest.approx([-0.05, -0.05, 0.07, 0.07])


def published(state, feed, braking: bool, friction=None):
    friction = np.zeros(1, FRICTION_STATE)[0] if friction is None else friction
    learned = np.zeros(1, LEARNED)[0]
    publish_friction(SUV, state, friction, learned, feed()[0], braking, 0.01)
    return friction


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
    state["pressures"]["agreed_s"] = 2 * AGREED_S * follows
    state["pressures"]["variance"] = 0.5**2
    more = published(state, feed, True)
    added = (more["sigma"] / more["mu"]) ** 2 - (plain["sigma"] / plain["mu"]) ** 2
    expected = np.array([0.5 / 20, 0.5 / 20, 0.5 / 10, 0.5]) ** 2 * (follows and observed)
    np.testing.assert_allclose(added, expected, atol=1e-15)


MODES = [
    # braking, observed, pressure usable; friction is being observed
    (True, True, True, True),
    (True, False, True, False),
    (True, True, False, False),
    (False, True, True, False),
]


@pytest.mark.parametrize(("braking", "observed", "usable", "observing"), MODES)
def test_a_corner_is_observed_while_its_signals_show_friction(
    feed, braking: bool, observed: bool, usable: bool, observing: bool
) -> None:
    state, friction = driven(6), np.zeros(1, FRICTION_STATE)[0]
    inputs, learned = feed()[0], np.zeros(1, LEARNED)[0]
    state["observed"] = observed
    inputs["verdict"][CALLIPER_PRESSURE + 1] *= usable
    for _ in range(5):
        publish_friction(SUV, state, friction, learned, inputs, braking, 0.01)
    assert (friction["mode"][1] == OBSERVING) == observing
    assert friction["observed_s"][1] == pytest.approx(0.05 * observing)
    assert (friction["mode"][0] == OBSERVING) == (braking and observed)


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
    published(state, feed, True)
    assert state["sigma_force"] == pytest.approx(expected, rel=1e-7)


def test_the_end_of_a_braking_counts_what_it_observed() -> None:
    friction, learned = np.zeros(1, FRICTION_STATE)[0], np.zeros(1, LEARNED)[0]
    learned["observed_s"], learned["brakings"] = 10.0, 3
    friction["observed_s"] = [1.0, 2.0, 0.0, 0.5]
    hand_over_level(friction, learned)
    np.testing.assert_allclose(learned["observed_s"], [11.0, 12.0, 10.0, 10.5])
    assert learned["brakings"] == 4
    np.testing.assert_array_equal(friction["observed_s"], 0.0)


def test_what_pressures_cannot_tell_apart_stays_together() -> None:
    """A per cent of mass is a per cent of each friction, after a restart as well."""
    before = new_state()
    before["p"][np.ix_([MASS, *LEVELS], [MASS, *LEVELS])] = 0.01**2
    before["x"][V] = 30.0
    P = restored(keep(before))["p"]
    np.testing.assert_allclose(P[LEVELS, MASS], 0.01**2)
    np.testing.assert_allclose(P[MASS, MASS], 0.01**2 + PAUSE[MASS] ** 2)
