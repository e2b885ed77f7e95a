"""What a bound does to what is tied to it."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.bounds import (
    FRONT_REAR,
    HIGHEST_VALUE,
    LEFT_RIGHT,
    LOWEST_VALUE,
    PARTED,
    keep_within_bounds,
)
from ecu.algorithm.estimation.joint.layout import CHANGE, JOINT_STATE, LEVEL, MASS, PEAK, SLOPE, STIFFNESS, N
from ecu.algorithm.estimation.joint.prior import begin_application

from .conftest import tied

BOUNDED = [i for i in range(N) if math.isfinite(HIGHEST_VALUE[i])]


@pytest.mark.parametrize("side", ["lowest", "highest"])
@pytest.mark.parametrize("i", BOUNDED)
def test_a_state_beyond_its_bound_is_put_on_it_and_what_it_is_tied_to_follows(i: int, side: str) -> None:
    """As a measurement without noise that it lies there would move them."""
    state = tied(7)
    bound = (LOWEST_VALUE if side == "lowest" else HIGHEST_VALUE)[i]
    state["x"] = 0.0
    if LEVEL <= i < LEVEL + 4:
        state["x"][LEVEL : LEVEL + 4] = 0.9 * bound  # linings that are alike
    state["x"][i] = bound + math.copysign(0.001, bound)
    state["free"] = 1
    x, P = state["x"].copy(), state["p"].copy()
    assert keep_within_bounds(state) == (i not in (PEAK, SLOPE))  # they are the road's
    np.testing.assert_allclose(state["x"], x + P[:, i] / P[i, i] * (bound - x[i]), rtol=1e-9, atol=1e-15)
    assert state["x"][i] == pytest.approx(bound)
    np.testing.assert_array_equal(state["p"], P)


@pytest.mark.parametrize("apart", [0.3, -0.3])
@pytest.mark.parametrize("axle", [0, 1])
def test_levels_of_an_axle_stay_alike_as_if_their_difference_was_measured(axle: int, apart: float) -> None:
    state = tied(10)
    state["x"], state["free"] = 0.0, 1
    left = LEVEL + 2 * axle
    state["x"][left], state["x"][left + 1] = 0.5 * apart, -0.5 * apart
    x, P = state["x"].copy(), state["p"].copy()
    assert keep_within_bounds(state)
    h = np.zeros(N)
    h[left], h[left + 1] = 1.0, -1.0
    kept = math.copysign(LEFT_RIGHT, apart)
    np.testing.assert_allclose(state["x"], x + P @ h / (h @ P @ h) * (kept - apart), rtol=1e-9, atol=1e-15)
    assert not keep_within_bounds(state)


@pytest.mark.parametrize("free", [[], [STIFFNESS], [STIFFNESS, MASS]])
def test_at_a_bound_only_what_is_free_follows(free) -> None:
    state = tied(8)
    state["x"] = 0.0
    state["x"][STIFFNESS], state["free"][free] = 3.0, 1
    assert keep_within_bounds(state)
    assert state["x"][STIFFNESS] == HIGHEST_VALUE[STIFFNESS]
    moved = {int(i) for i in np.flatnonzero(state["x"])}
    assert moved == {STIFFNESS} | ({MASS} if MASS in free else set())


def test_inside_the_bounds_nothing_happens() -> None:
    state = tied(9)
    state["x"], state["free"] = 0.001, 1
    before = state.copy()
    assert not keep_within_bounds(state)
    np.testing.assert_array_equal(state["x"], before["x"])
    np.testing.assert_array_equal(state["p"], before["p"])


def test_a_pushed_bound_does_not_drive_the_others_away() -> None:
    """A hundred measurements that only a peak beyond its bound would fit, friction tied to it."""
    state = np.zeros(1, JOINT_STATE)[0]
    state["p"][np.ix_([PEAK, LEVEL], [PEAK, LEVEL])] = [[0.04, 0.018], [0.018, 0.01]]
    state["free"] = 1
    furthest = 0.0
    for _ in range(100):
        state["x"][[PEAK, LEVEL]] += [0.05, 0.0225]
        keep_within_bounds(state)
        furthest = max(furthest, abs(float(state["x"][LEVEL])))
    assert furthest <= 0.45 * HIGHEST_VALUE[PEAK] + 0.0225


OF_AXLES = np.zeros(N)
OF_AXLES[LEVEL : LEVEL + 4], OF_AXLES[CHANGE : CHANGE + 2] = [0.5, 0.5, -0.5, -0.5], [1.0, -1.0]
PARTS = [
    # moved since the application began: levels, changes of front and rear; kept of front over rear
    ("front fades, as on a descent", [0.0] * 4, [-0.13, 0.0], -0.13),
    ("both fade", [0.0] * 4, [-0.3, -0.25], -0.05),
    ("the front seems to gain what the rear loses", [0.0] * 4, [0.3, -0.2], FRONT_REAR),
    ("the levels do", [-0.2, -0.2, 0.15, 0.15], [0.0, 0.0], -FRONT_REAR),
    ("both", [0.06, 0.06, -0.06, -0.06], [0.05, -0.05], FRONT_REAR),
]


@pytest.mark.parametrize("known", [0.0, 0.1])
@pytest.mark.parametrize(("case", "levels", "changes", "kept"), PARTS, ids=[p[0] for p in PARTS])
def test_the_axles_part_no_faster_than_linings_do(case, levels, changes, kept: float, known: float) -> None:
    """As if their ratio was measured; more, where it was not `known` as the application began."""
    state = tied(11)
    state["x"], state["free"] = 0.0, 1
    state["x"][LEVEL : LEVEL + 4] = state["before"] = [0.1, 0.1, -0.1, -0.1]
    state["x"][LEVEL : LEVEL + 4] += levels
    state["x"][CHANGE : CHANGE + 2], state["sigma_axles"] = changes, known
    x, P = state["x"].copy(), state["p"].copy()
    moved = OF_AXLES[LEVEL : LEVEL + 4] @ levels + changes[0] - changes[1]
    most = math.hypot(FRONT_REAR, PARTED * known)
    kept = moved if abs(moved) <= most else math.copysign(most, moved)
    keep_within_bounds(state)
    direction = P @ OF_AXLES / (OF_AXLES @ P @ OF_AXLES)
    np.testing.assert_allclose(state["x"], x + direction * (kept - moved), rtol=1e-9, atol=1e-15)


def test_what_the_axles_parted_by_is_counted_from_the_beginning_of_the_application() -> None:
    state = tied(12)
    state["x"] = 0.0
    state["x"][LEVEL : LEVEL + 4] = [0.3, 0.3, -0.3, -0.3]
    begin_application(state, np.zeros(4))
    np.testing.assert_array_equal(state["before"], state["x"][LEVEL : LEVEL + 4])
    half = 0.5 * np.array([1.0, 1.0, -1.0, -1.0])
    expected = half @ state["p"][LEVEL : LEVEL + 4, LEVEL : LEVEL + 4] @ half
    assert state["sigma_axles"] == pytest.approx(math.sqrt(expected))
    state["free"] = 1
    x = state["x"].copy()
    assert not keep_within_bounds(state)
    np.testing.assert_array_equal(state["x"], x)


def test_changes_take_what_a_level_at_its_bound_lacks() -> None:
    state = tied(13)
    state["x"], state["free"] = 0.0, 1
    state["x"][LEVEL : LEVEL + 4] = state["before"] = [HIGHEST_VALUE[LEVEL], HIGHEST_VALUE[LEVEL], 0.2, 0.2]
    state["x"][CHANGE : CHANGE + 2] = 0.4, 0.1
    x = state["x"].copy()
    assert not keep_within_bounds(state)
    np.testing.assert_array_equal(state["x"], x)
