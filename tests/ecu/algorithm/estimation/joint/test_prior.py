"""What a brake application begins and ends with."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.layout import (
    CHANGE,
    DRIVE,
    JOINT_STATE,
    LEVEL,
    MEAN,
    OFFSET,
    OVERRUN,
    RATE,
    SIDE,
    N,
)
from ecu.algorithm.estimation.joint.prior import (
    CHANGE_AXLE,
    CHANGE_COMMON,
    LEVEL_AXLE,
    LEVEL_COMMON,
    LEVEL_WHEEL,
    MEAN_ZERO,
    OVERRUN_MEAN,
    OVERRUN_SIGMA,
    PRIOR,
    RATE_SIGMA,
    STEP_AXLE,
    STEP_COMMON,
    STEP_WHEEL,
    UNKNOWN_DRIVE,
    begin_application,
    end_application,
    forget_levels,
    note_change,
    pressure_change,
    set_prior,
)

from .conftest import tied

LEVELS = list(range(LEVEL, LEVEL + 4))
CHANGES, MEANS, DRIVES = [CHANGE, CHANGE + 1], [MEAN, MEAN + 1], [DRIVE, DRIVE + 1]
SAME_AXLE = np.kron(np.eye(2), np.ones((2, 2)))


def shared(common: float, axle: float, wheel: float) -> np.ndarray:
    """Return the covariance of four wheels by what all, an axle's and single ones have."""
    return common**2 * np.ones((4, 4)) + axle**2 * SAME_AXLE + wheel**2 * np.eye(4)


def test_friction_is_prior_by_what_all_an_axle_and_a_wheel_share(params) -> None:
    state = np.zeros(1, JOINT_STATE)[0]
    set_prior(params[0], state)
    expected = shared(LEVEL_COMMON, LEVEL_AXLE, LEVEL_WHEEL)
    np.testing.assert_allclose(state["p"][np.ix_(LEVELS, LEVELS)], expected, rtol=1e-12)
    others = [i for i in range(N) if i not in LEVELS]
    np.testing.assert_array_equal(state["p"][np.ix_(LEVELS, others)], 0.0)


def test_levels_that_are_forgotten_are_the_priors_and_tied_to_nothing() -> None:
    state = tied(1)
    before = state.copy()
    forget_levels(state)
    others = [i for i in range(N) if i not in LEVELS]
    np.testing.assert_array_equal(state["x"][LEVELS], 0.0)
    np.testing.assert_allclose(
        state["p"][np.ix_(LEVELS, LEVELS)], shared(LEVEL_COMMON, LEVEL_AXLE, LEVEL_WHEEL), rtol=1e-12
    )
    np.testing.assert_array_equal(state["p"][np.ix_(LEVELS, others)], 0.0)
    np.testing.assert_array_equal(state["p"][np.ix_(others, others)], before["p"][np.ix_(others, others)])


BEGINNINGS = [
    # share of the drive that is reported, standard deviation of each axle's unknown drive [m/s^2]
    (1.0, 0.0),
    (0.5, 0.5 * UNKNOWN_DRIVE),
    (0.0, UNKNOWN_DRIVE),
]


@pytest.mark.parametrize(("known", "drive"), BEGINNINGS)
@pytest.mark.parametrize("heat", [[0.0, 0.0, 0.0, 0.0], [0.05, 0.05, 0.01, 0.0]], ids=["cold", "hot"])
def test_an_application_begins_at_the_level_as_sure_as_last_time_less_a_step(
    heat, known: float, drive: float
) -> None:
    """Discs heat together: what that does to friction is one direction."""
    state = tied(2)
    state["drive_known"] = known
    P, x = state["p"].copy(), state["x"].copy()
    P[np.ix_(LEVELS, LEVELS)] += shared(STEP_COMMON, STEP_AXLE, STEP_WHEEL) + np.outer(heat, heat)
    anew = [*CHANGES, *MEANS, RATE, *DRIVES, SIDE]
    P[anew], P[:, anew], x[anew] = 0.0, 0.0, 0.0
    P[SIDE, SIDE] = PRIOR[SIDE] ** 2
    P[np.ix_(CHANGES, CHANGES)] = CHANGE_COMMON**2 + CHANGE_AXLE**2 * np.eye(2)
    P[RATE, RATE] = (RATE_SIGMA * known) ** 2
    P[DRIVES, DRIVES] = drive**2
    if known > 0.0:  # what a reported torque errs by is another value each time
        P[OVERRUN], P[:, OVERRUN], x[OVERRUN] = 0.0, 0.0, 0.0
        P[OVERRUN, OVERRUN] = (OVERRUN_SIGMA * (1.0 - known)) ** 2
    for i in (OFFSET, OFFSET + 1):
        P[i, i] = max(P[i, i], PRIOR[i] ** 2)
    begin_application(state, np.array(heat))
    np.testing.assert_allclose(state["p"], P, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(state["x"], x, rtol=1e-12)
    assert state["weight"] == 0.0


@pytest.mark.parametrize("front", [0.0, 0.4])
@pytest.mark.parametrize("rear", [0.0, 1.2])
def test_a_pressure_that_is_lost_is_as_unsure_as_the_zeros_of_its_sensors(front: float, rear: float) -> None:
    """Of an axle: the mean of two sensors that err independently."""
    state = tied(3)
    state["p"][[OFFSET, OFFSET + 1], [OFFSET, OFFSET + 1]] = 1e-4
    state["zero"]["variance"] = np.repeat([front, rear], 2) ** 2
    begin_application(state, np.zeros(4))
    for i, sigma in ((OFFSET, front), (OFFSET + 1, rear)):
        assert state["p"][i, i] == pytest.approx(PRIOR[i] ** 2 + sigma**2 / 2)


OVERRUNS = [
    # share of the drive that is reported; mean and standard deviation of an engine's drag at first [m/s^2]
    (1.0, 0.0, 0.0),
    (0.5, 0.0, 0.5 * OVERRUN_SIGMA),
    (0.0, OVERRUN_MEAN, OVERRUN_SIGMA),
]


@pytest.mark.parametrize(("known", "mean", "sigma"), OVERRUNS)
def test_an_engines_drag_is_as_unknown_as_its_torque(params, known: float, mean: float, sigma: float) -> None:
    state = np.zeros(1, JOINT_STATE)[0]
    set_prior(params[0], state)
    state["drive_known"] = known
    begin_application(state, np.zeros(4))
    assert state["x"][OVERRUN] == mean
    assert math.sqrt(state["p"][OVERRUN, OVERRUN]) == pytest.approx(sigma)


def test_the_drag_of_an_engine_that_nobody_reports_is_learned_over_applications() -> None:
    state = tied(4)
    state["drive_known"] = 0.0
    before = state["x"][OVERRUN], state["p"][OVERRUN, OVERRUN]
    begin_application(state, np.zeros(4))
    assert (state["x"][OVERRUN], state["p"][OVERRUN, OVERRUN]) == before


def test_the_mean_of_changes_is_weighted_by_pressure() -> None:
    """Against the covariance of all changes together, each window's drawn as a state of its own."""
    state, weights = tied(4), [40.0, 80.0, 20.0, 60.0]
    state["p"][MEANS] = state["p"][:, MEANS] = 0.0
    state["x"][MEANS] = 0.0
    others = [i for i in range(N) if i not in MEANS]
    P, x = state["p"].copy(), state["x"].copy()
    steps, means = [], []
    for weight in weights:
        note_change(state, weight)
        steps.append(state["x"][CHANGES].copy())
        means.append(weight)
        np.testing.assert_allclose(state["x"][MEANS], np.average(steps, axis=0, weights=means))
        state["x"][CHANGES] += 0.1
    # Changes whose errors stay what they are have a mean with that error.
    np.testing.assert_allclose(state["p"][np.ix_(MEANS, others)], P[np.ix_(CHANGES, others)], rtol=1e-9)
    np.testing.assert_allclose(state["p"][np.ix_(MEANS, MEANS)], P[np.ix_(CHANGES, CHANGES)], rtol=1e-9)
    np.testing.assert_array_equal(state["p"][np.ix_(others, others)], P[np.ix_(others, others)])
    np.testing.assert_array_equal(state["x"][LEVELS], x[LEVELS])
    assert state["weight"] == sum(weights)


def test_an_application_ends_with_the_mean_in_the_level() -> None:
    """As measurements, in matrices, that the means of both axles' changes are zero; levels follow."""
    state = tied(5)
    state["x"][MEANS], state["weight"] = [0.04, -0.03], 100.0
    x, P = state["x"].copy(), state["p"].copy()
    freed = np.isin(np.arange(N), [*LEVELS, RATE, *CHANGES, *MEANS])
    for m in MEANS:  # Schmidt: what an application does not free stays
        K = P[:, m] / (P[m, m] + MEAN_ZERO**2) * freed
        A = np.eye(N) - np.outer(K, np.eye(N)[m])
        x, P = x - K * x[m], A @ P @ A.T + MEAN_ZERO**2 * np.outer(K, K)
    gone = [*CHANGES, *MEANS, RATE, SIDE]
    P[gone], P[:, gone], x[gone] = 0.0, 0.0, 0.0
    P[SIDE, SIDE] = PRIOR[SIDE] ** 2
    end_application(state)
    np.testing.assert_allclose(state["x"], x, rtol=1e-10)
    np.testing.assert_allclose(state["p"], P, rtol=1e-8, atol=1e-12)


def test_where_nothing_was_observed_the_level_is_left_alone() -> None:
    state = tied(6)
    before = state.copy()
    state["weight"] = 0.0
    end_application(state)
    np.testing.assert_array_equal(state["x"][LEVELS], before["x"][LEVELS])
    np.testing.assert_array_equal(state["p"][np.ix_(LEVELS, LEVELS)], before["p"][np.ix_(LEVELS, LEVELS)])


@pytest.mark.parametrize("error", [-0.08, 0.05])
def test_a_change_that_passed_is_in_the_levels_mean(error: float) -> None:
    """Friction known to 1 % that was so much off its level all along: the level was off, not the change."""
    state = np.zeros(1, JOINT_STATE)[0]
    state["p"][np.ix_(LEVELS, LEVELS)] = 0.1**2
    state["drive_known"] = 1.0
    begin_application(state, np.zeros(4))
    total = np.zeros((4, N))
    total[range(4), LEVELS] = total[range(4), np.repeat(CHANGES, 2)] = 1.0
    P = state["p"]
    K = P @ total.T @ np.linalg.inv(total @ P @ total.T + 1e-4 * np.eye(4))
    state["x"], state["p"] = K @ np.full(4, error), P - K @ total @ P
    for _ in range(20):
        note_change(state, 100.0)
    assert abs(state["x"][LEVEL]) < 0.8 * abs(error)
    end_application(state)
    np.testing.assert_allclose(state["x"][LEVELS], error, rtol=0.02)


CHANGED = [
    # last and this window's mean pressure of an axle [bar]; relative change, softened by 10 bar of each
    (40.0, 40.0, 0.0),
    (20.0, 40.0, 0.5),
    (40.0, 20.0, -0.5),
    (0.0, 5.0, 0.4),
]


@pytest.mark.parametrize(("last", "now", "change"), CHANGED)
def test_relative_change_of_an_axles_pressure(last: float, now: float, change: float) -> None:
    state = np.zeros(1, JOINT_STATE)[0]
    state["last_pressure"][2:], state["window"]["pressure"][2:] = [last - 2, last + 2], [now + 1, now - 1]
    assert pressure_change(state, 2) == pytest.approx(change)
    assert pressure_change(state, 0) == 0.0
