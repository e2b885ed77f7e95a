"""What is kept between drives: values with their covariance, a pause less sure."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.algorithm.estimate import ESTIMATE, GREATEST_RATIO, LEAST_RATIO
from ecu.algorithm.estimation.joint.bounds import HIGHEST_VALUE, LOWEST_VALUE
from ecu.algorithm.estimation.joint.layout import (
    CHANGE,
    JOINT_STATE,
    LEVEL,
    MASS,
    MEAN,
    PASSING,
    PEAK,
    N,
    V,
)
from ecu.algorithm.estimation.joint.learned import (
    KEPT,
    LEVEL_PAUSE,
    PAUSE,
    hand_over_level,
    keep_joint,
    restore_joint,
)
from ecu.algorithm.estimation.joint.observer import _choose_free
from ecu.algorithm.estimation.joint.prior import set_prior
from ecu.contract.records import LEARNED, N_KEPT
from ecu.recording.learned_range import JOINT_LIMIT, out_of_range
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


def test_the_end_of_a_braking_counts_what_it_observed() -> None:
    estimate, learned = np.zeros(1, ESTIMATE)[0], np.zeros(1, LEARNED)[0]
    learned["observed_s"], learned["brakings"] = 10.0, 3
    estimate["observed_s"] = [1.0, 2.0, 0.0, 0.5]
    hand_over_level(estimate, learned)
    np.testing.assert_allclose(learned["observed_s"], [11.0, 12.0, 10.0, 10.5])
    assert learned["brakings"] == 4
    np.testing.assert_array_equal(estimate["observed_s"], 0.0)


def test_what_pressures_cannot_tell_apart_stays_together() -> None:
    """A per cent of mass is a per cent of each friction, after a restart as well."""
    before = new_state()
    before["p"][np.ix_([MASS, *LEVELS], [MASS, *LEVELS])] = 0.01**2
    before["x"][V] = 30.0
    P = restored(keep(before))["p"]
    np.testing.assert_allclose(P[LEVELS, MASS], 0.01**2)
    np.testing.assert_allclose(P[MASS, MASS], 0.01**2 + PAUSE[MASS] ** 2)


@pytest.mark.parametrize("motors", [False, True])
@pytest.mark.parametrize("braking", [False, True])
def test_what_may_be_learned_and_is_stored_has_bounds_that_a_store_takes(braking: bool, motors: bool) -> None:
    """One value out of range costs the whole revision: friction, wear and all."""
    state = new_state()
    state["x"][V], state["drive_known"], state["last_accel"] = 20.0, 1.0, 2.0
    state["window"]["reference_samples"] = state["window"]["motor_reported"] = 1
    _choose_free(state, braking, motors, True)
    learned = [i for i in KEPT if state["free"][i]]
    assert len(learned) >= 8
    assert np.all(LOWEST_VALUE[learned] >= -JOINT_LIMIT)
    assert np.all(HIGHEST_VALUE[learned] <= JOINT_LIMIT)
