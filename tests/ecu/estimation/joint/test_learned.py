"""What is kept between drives: values as they were, never surer than they were, never less sure than new."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.config import load_config, new_params
from ecu.diagnostics.store import JOINT_LIMIT, out_of_range
from ecu.estimation.friction import FRICTION_STATE, GREATEST_RATIO, LEAST_RATIO
from ecu.estimation.joint.layout import BIAS, JOINT_STATE, MASS, MU, OFFSET, RATE, SLOPE, STIFFNESS, N, V
from ecu.estimation.joint.learned import (
    MU_PAUSE,
    PAUSE,
    begin_course,
    keep_joint,
    publish_friction,
    restore_joint,
    settle_friction,
    take_mean,
)
from ecu.estimation.joint.observer import WINDOW_S
from ecu.estimation.joint.prior import set_prior
from ecu.records import LEARNED

SUV = new_params(load_config(Path(__file__).parents[4] / "config" / "suv.toml"))[0]
FRICTION = list(range(MU, MU + 4))
BOUND = [math.log(LEAST_RATIO), math.log(GREATEST_RATIO)]
KEPT = [i for i in range(N) if i not in (V, SLOPE, RATE, OFFSET, OFFSET + 1, *FRICTION)]


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
    """Return a state as a drive may leave it: somewhere inside the prior, surer than it."""
    state, random = new_state(), np.random.default_rng(seed)
    prior = sigma(state)
    state["x"] = 0.5 * prior * random.standard_normal(N)
    state["p"] = np.diag((prior * random.uniform(0.05, 0.9, N)) ** 2)
    return state


def keep(state, relative: float = 0.03):
    """Return the record after a drive: states by the joint observer, friction as handed over."""
    learned = np.zeros(1, LEARNED)[0]
    keep_joint(state, learned)
    learned["mu_b"] = SUV["mu_nominal"] * np.exp(state["x"][FRICTION])
    learned["sigma_mu_b"] = relative * learned["mu_b"]
    learned["observed_s"] = 12.0
    return learned


def test_with_nothing_learned_it_is_the_prior() -> None:
    state, prior = restored(np.zeros(1, LEARNED)[0]), new_state()
    for name in ("x", "p"):
        np.testing.assert_array_equal(state[name], prior[name])
        for row in range(2):
            np.testing.assert_array_equal(state[f"kept_{name}"][row], prior[name])
    assert not state["started"]


@pytest.mark.parametrize("seed", range(5))
def test_what_was_kept_comes_back_less_sure_and_surer_than_new(seed: int) -> None:
    before, prior = driven(seed), sigma(new_state())
    after = restored(keep(before))
    np.testing.assert_allclose(after["x"][KEPT + FRICTION], before["x"][KEPT + FRICTION], rtol=1e-12)
    expected = np.minimum(np.hypot(sigma(before), PAUSE), prior)
    np.testing.assert_allclose(sigma(after)[KEPT], expected[KEPT], rtol=1e-12)
    assert (sigma(after)[KEPT] >= np.minimum(sigma(before), prior)[KEPT] * (1 - 1e-12)).all()
    np.testing.assert_allclose(sigma(after)[FRICTION], math.hypot(0.03, MU_PAUSE))
    assert (sigma(after) <= prior * (1 + 1e-12)).all()


@pytest.mark.parametrize("seed", range(3))
def test_speed_slope_rate_and_pressure_offsets_begin_anew(seed: int) -> None:
    after, prior = restored(keep(driven(seed))), new_state()
    anew = [SLOPE, RATE, OFFSET, OFFSET + 1, V]
    np.testing.assert_array_equal(after["x"][anew], 0.0)
    np.testing.assert_array_equal(sigma(after)[anew], sigma(prior)[anew])


def test_friction_that_was_never_observed_is_the_priors() -> None:
    learned, prior = keep(driven(1)), new_state()
    learned["observed_s"] = [10.0, 0.0, 0.0, 0.0]
    P = restored(learned)["p"]
    np.testing.assert_array_equal(
        P[MU + 1 : MU + 4, MU + 1 : MU + 4], prior["p"][MU + 1 : MU + 4, MU + 1 : MU + 4]
    )
    np.testing.assert_array_equal(P[MU, MU + 1 : MU + 4], 0.0)
    np.testing.assert_array_equal(P[:, MU], P[MU])
    assert P[MU, MASS] > 0 == P[MU + 1, MASS]


def test_restarts_alone_make_nothing_surer() -> None:
    """Twenty ignitions without a drive."""
    learned = keep(driven(2))
    before = sigma(restored(learned))
    for _ in range(20):
        state = restored(learned)
        keep_joint(state, learned)
        now = sigma(restored(learned))
        assert (now >= before * (1 - 1e-12)).all()
        before = now
    assert (before <= sigma(new_state()) * (1 + 1e-12)).all()


@pytest.mark.parametrize("relative", [0.01, 0.1, 0.2, 0.3])
def test_friction_comes_back_no_less_sure_than_new(relative: float) -> None:
    after = restored(keep(driven(3), relative))
    assert (sigma(after)[FRICTION] <= sigma(new_state())[FRICTION] * (1 + 1e-12)).all()


LEARNED_VALUES = {
    "share": st.tuples(*[st.floats(0.5, 1.5)] * 4),
    "relative": st.tuples(*[st.floats(1e-4, 1.0)] * 4),
    "observed": st.tuples(*[st.sampled_from([0.0, 5.0])] * 4),
    "joint": st.lists(st.floats(-JOINT_LIMIT, JOINT_LIMIT), min_size=N, max_size=N),
    "joint_sigma": st.lists(st.floats(0.0, 2.0), min_size=N, max_size=N),
    "mass": st.sampled_from([0.0, 1e-4, 0.005, 0.02, 1.0]),
}


@settings(max_examples=300)
@given(**LEARNED_VALUES)
def test_whatever_the_store_accepts_gives_a_covariance(
    share, relative, observed, joint, joint_sigma, mass
) -> None:
    learned = np.zeros(1, LEARNED)
    row = learned[0]
    row["mu_b"] = SUV["mu_nominal"] * share
    row["sigma_mu_b"] = row["mu_b"] * relative
    row["observed_s"], row["joint"], row["joint_sigma"] = observed, joint, joint_sigma
    row["joint_sigma"][MASS] = mass
    row["radius_sigma"] = 0.001
    assert out_of_range(learned, SUV["mu_nominal"]) == ""
    P = restored(row)["p"]
    np.testing.assert_array_equal(P, P.T)
    some = np.diag(P) > 0
    scale = np.sqrt(np.diag(P)[some])
    assert (P[~some] == 0).all()
    assert np.linalg.eigvalsh(P[np.ix_(some, some)] / np.outer(scale, scale)).min() > -1e-12


def test_mass_is_in_every_friction_alike() -> None:
    """A per cent of mass is a per cent of each friction: what is left of each is its own."""
    before = new_state()
    before["p"][MASS, MASS] = 0.01**2
    learned = keep(before, 0.04)
    P = restored(learned)["p"]
    shared = P[np.ix_(FRICTION, [MASS])].ravel()
    np.testing.assert_allclose(shared, 0.01**2 + PAUSE[MASS] ** 2)
    off = P[np.ix_(FRICTION, FRICTION)][~np.eye(4, dtype=bool)]
    np.testing.assert_allclose(off, 0.01**2 + PAUSE[MASS] ** 2)


AT_BOUND = [
    # ln of friction over nominal: of one wheel; goes back
    ("at the least", BOUND[0], True),
    ("at the greatest", BOUND[1], True),
    ("a fifth low", math.log(0.8), False),
    ("just inside", 0.99 * BOUND[1], False),
]


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize(("name", "left", "goes_back"), AT_BOUND, ids=[row[0] for row in AT_BOUND])
def test_friction_at_its_bound_is_not_carried_on(name: str, left: float, goes_back: bool, wheel: int) -> None:
    state, learned = driven(4), keep(driven(5), 0.05)
    state["x"][FRICTION] = 0.1
    state["x"][MU + wheel] = left
    state["p"][MU, MASS] = state["p"][MASS, MU] = 1e-5
    before = state.copy()
    settle_friction(SUV, state, learned)
    if not goes_back:
        assert state.tobytes() == before.tobytes()
        return
    np.testing.assert_allclose(SUV["mu_nominal"] * np.exp(state["x"][FRICTION]), learned["mu_b"])
    np.testing.assert_allclose(sigma(state)[FRICTION], math.hypot(0.05, MU_PAUSE))
    others = [i for i in range(N) if i not in FRICTION]
    np.testing.assert_array_equal(state["x"][others], before["x"][others])
    np.testing.assert_array_equal(state["p"][np.ix_(others, others)], before["p"][np.ix_(others, others)])
    np.testing.assert_array_equal(state["p"][np.ix_(FRICTION, others)], 0.0)


def test_settled_friction_is_base_of_the_next_braking_where_nothing_was_learned() -> None:
    """A first braking that ends at a bound: the base is nominal, and no sigma was ever written."""
    state, learned = driven(6), np.zeros(1, LEARNED)[0]
    learned["mu_b"], learned["sigma_mu_b"] = SUV["mu_nominal"], 0.15 * SUV["mu_nominal"]
    state["x"][MU] = BOUND[1]
    settle_friction(SUV, state, learned)
    np.testing.assert_array_equal(state["x"][FRICTION], 0.0)
    assert (sigma(state)[FRICTION] > 0.1).all()


@pytest.mark.parametrize(("first", "last"), [(0.33, 0.41), (0.45, 0.45), (0.50, 0.42)])
def test_a_braking_leaves_the_mean_of_its_friction_over_the_distance(params, feed, first, last) -> None:
    """Friction changes evenly over the distance of a stop; half way it has its mean."""
    state, friction = driven(8), np.zeros(1, FRICTION_STATE)[0]
    at_rest, learned, inputs = SUV["static_load"].copy(), np.zeros(1, LEARNED)[0], feed()[0]
    state["x"][RATE], state["window"]["time"] = 0.0, -0.5 * WINDOW_S
    state["observed"] = 1
    state["p"][FRICTION, FRICTION] = 0.05**2
    variance = np.diag(state["p"]).copy()
    begin_course(state)
    decel, speed, distance = 4.0, 25.0, 0.0
    whole = speed**2 / (2 * decel)
    while speed > 0.0:
        mu = first + (last - first) * distance / whole
        state["x"][FRICTION] = np.log(mu / SUV["mu_nominal"])
        state["x"][V] = speed
        publish_friction(SUV, state, friction, learned, inputs, at_rest, True, 0.01)
        distance += speed * 0.01
        speed -= decel * 0.01
    unsure = state.copy()
    take_mean(SUV, state, friction)
    mean = 0.5 * (first + last)
    assert SUV["mu_nominal"] * np.exp(state["x"][FRICTION]) == pytest.approx([mean] * 4, rel=2e-3)
    assert friction["mu"] == pytest.approx([mean] * 4, rel=2e-3)
    spread = np.log(last / mean) ** 2 / 3
    added = (np.diag(state["p"]) - variance)[FRICTION]
    assert added == pytest.approx([spread] * 4, rel=0.05, abs=1e-7)

    friction["sigma"][2] = 0.2 * friction["mu"][2]
    last_value = unsure["x"].copy()
    take_mean(SUV, unsure, friction)
    np.testing.assert_array_equal(unsure["x"], last_value)


@pytest.mark.parametrize("ratio", [0.7, 1.0, 1.2, LEAST_RATIO, GREATEST_RATIO])
def test_published_friction_is_the_states_moved_on_by_its_rate(params, feed, ratio: float) -> None:
    state, friction = driven(7), np.zeros(1, FRICTION_STATE)[0]
    state["x"][FRICTION], state["x"][RATE] = math.log(ratio), 0.0
    at_rest, learned, inputs = SUV["static_load"].copy(), np.zeros(1, LEARNED)[0], feed()[0]
    publish_friction(SUV, state, friction, learned, inputs, at_rest, False, 0.01)
    np.testing.assert_allclose(friction["mu"], ratio * SUV["mu_nominal"])
    own = sigma(state)[FRICTION]
    if ratio in (LEAST_RATIO, GREATEST_RATIO):
        own = np.maximum(own, SUV["sigma_mu_initial"])
    np.testing.assert_allclose(friction["sigma"], friction["mu"] * own)
    state["x"][RATE], state["window"]["time"] = 0.05, 0.02
    state["x"][FRICTION] = 0.0
    publish_friction(SUV, state, friction, learned, inputs, at_rest, False, 0.01)
    np.testing.assert_allclose(friction["mu"], SUV["mu_nominal"] * math.exp(0.05 * (0.5 * WINDOW_S + 0.02)))


def test_what_is_kept_is_neither_speed_nor_slope() -> None:
    state, learned = driven(8), np.zeros(1, LEARNED)[0]
    state["x"][V], state["x"][SLOPE] = 30.0, 0.5
    keep_joint(state, learned)
    assert learned["joint"][[V, SLOPE]] == pytest.approx([0.0, 0.0])
    assert learned["joint"][[STIFFNESS, BIAS]] == pytest.approx(state["x"][[STIFFNESS, BIAS]])
    assert learned["joint_sigma"][MASS] == pytest.approx(sigma(state)[MASS])


@pytest.mark.parametrize("transfer", [-0.4, 0.0, 0.3])  # of the load at rest
@pytest.mark.parametrize("side", [0.0, 0.1])  # left over right
def test_what_does_not_average_out_is_in_the_published_sigma(feed, transfer: float, side: float) -> None:
    """Load transfer known to 6 %, and half of what sets left against right."""
    state, friction = driven(9), np.zeros(1, FRICTION_STATE)[0]
    state["x"][FRICTION], state["x"][RATE] = np.array([0.5, -0.5, 0.5, -0.5]) * side, 0.0
    load = SUV["static_load"] * (1 + transfer)
    publish_friction(SUV, state, friction, np.zeros(1, LEARNED)[0], feed()[0], load, False, 0.01)
    expected = np.sqrt(sigma(state)[FRICTION] ** 2 + (0.06 * transfer) ** 2 + (0.5 * side) ** 2)
    np.testing.assert_allclose(friction["sigma"] / friction["mu"], expected, rtol=1e-12)
