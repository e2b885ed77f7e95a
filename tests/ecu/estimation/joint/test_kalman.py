"""Prediction and correction against matrices: F P F' + Q, and the update of Kalman and of Schmidt."""

import math

import numpy as np
import pytest

from ecu.estimation.joint.kalman import GATE, REJECT, correct, drift_speed, walk_friction
from ecu.estimation.joint.layout import BIAS, JOINT_STATE, MASS, MU, RATE, SLOPE, STIFFNESS, N, V
from ecu.estimation.joint.prior import (
    MU_COMMON,
    MU_WALK_AXLE,
    MU_WALK_COMMON,
    MU_WALK_HELD,
    MU_WALK_PRESSURE,
    MU_WALK_WHEEL,
    PRIOR,
    WALK,
    forget_rate,
    walk,
)

FRICTION = slice(MU, MU + 4)
FREE = {
    "all": range(N),
    "friction braking": [V, *range(MU, MU + 4), STIFFNESS, SLOPE, RATE],
    "sliding": [V, SLOPE],
    "none": [],
}


def scales() -> np.ndarray:
    """Return standard deviations of the size that the states have."""
    return np.maximum(PRIOR, 0.05)


def some_state(seed: int, free=range(N)):
    """Return a state with full covariance, scaled as the prior is."""
    random = np.random.default_rng(seed)
    root = scales()[:, None] * random.standard_normal((N, N)) / math.sqrt(N)
    state = np.zeros(1, JOINT_STATE)[0]
    state["x"] = random.standard_normal(N)
    state["p"] = root @ root.T
    state["h"] = random.standard_normal(N) / scales()
    state["free"][list(free)] = 1
    return state


def schmidt(x, P, h, free, innovation, variance):
    """Return state and covariance after the update of Schmidt: Joseph's form with the considered gains 0."""
    S = h @ P @ h + variance
    K = P @ h / S * free
    A = np.eye(N) - np.outer(K, h)
    return x + K * innovation, A @ P @ A.T + variance * np.outer(K, K)


def innovation_of(state, sigmas: float, variance: float) -> float:
    return sigmas * math.sqrt(state["h"] @ state["p"] @ state["h"] + variance)


def assert_covariance(P: np.ndarray) -> None:
    np.testing.assert_allclose(P, P.T, rtol=1e-9, atol=1e-12)
    sigma = np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh((P + P.T) / 2 / np.outer(sigma, sigma)).min() > -1e-9


@pytest.mark.parametrize("sigmas", [-2.9, 0.0, 1.0])
@pytest.mark.parametrize("free", FREE)
@pytest.mark.parametrize("seed", [1, 2])
def test_correction_is_that_of_kalman_and_of_schmidt(seed: int, free: str, sigmas: float) -> None:
    state, variance = some_state(seed, FREE[free]), 0.3
    innovation = innovation_of(state, sigmas, variance)
    before_x, before_P = state["x"].copy(), state["p"].copy()
    x, P = schmidt(before_x, before_P, state["h"], state["free"] != 0, innovation, variance)
    if free == "all":  # then Schmidt's form is the short textbook one
        h = state["h"]
        K = before_P @ h / (h @ before_P @ h + variance)
        np.testing.assert_allclose((np.eye(N) - np.outer(K, h)) @ before_P, P, atol=1e-12)
    assert correct(state, innovation, variance) == pytest.approx(sigmas**2)
    np.testing.assert_allclose(state["x"], x, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(state["p"], P, rtol=1e-8, atol=1e-12)
    held = [i for i in range(N) if i not in FREE[free]]
    np.testing.assert_array_equal(state["x"][held], before_x[held])
    np.testing.assert_array_equal(state["p"][np.ix_(held, held)], before_P[np.ix_(held, held)])


@pytest.mark.parametrize("free", FREE)
def test_covariance_stays_one_over_many_corrections(free: str) -> None:
    state, random = some_state(3, FREE[free]), np.random.default_rng(4)
    for _ in range(300):
        state["h"] = random.standard_normal(N) / scales() * (random.random(N) < 0.3)
        correct(state, 0.3 * random.standard_normal(), 10 ** random.uniform(-4, 1))
        assert_covariance(state["p"])


@pytest.mark.parametrize("free", ["all", "friction braking"])
@pytest.mark.parametrize("sigmas", [-11.9, -5.0, 3.1, 11.9])
def test_beyond_the_gate_it_counts_with_the_variance_that_puts_it_there(free: str, sigmas: float) -> None:
    state, variance = some_state(5, FREE[free]), 0.3
    innovation = innovation_of(state, sigmas, variance)
    spread = state["h"] @ state["p"] @ state["h"]
    wider = (innovation / GATE) ** 2 - spread
    assert wider > variance
    expected = schmidt(state["x"], state["p"], state["h"], state["free"] != 0, innovation, wider)
    assert correct(state, innovation, variance) == pytest.approx(sigmas**2)
    np.testing.assert_allclose(state["x"], expected[0], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(state["p"], expected[1], rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("far", [-REJECT - 0.1, REJECT + 0.1, 1e6, math.inf, math.nan])
def test_four_gates_off_or_not_finite_it_is_rejected(far: float) -> None:
    state = some_state(6)
    x, P = state["x"].copy(), state["p"].copy()
    ratio = correct(state, innovation_of(state, far, 0.3), 0.3)
    assert not ratio <= REJECT**2
    np.testing.assert_array_equal(state["x"], x)
    np.testing.assert_array_equal(state["p"], P)


def speed_matrix(time: float) -> np.ndarray:
    """Return F of v' = a - b - g sin(slope)."""
    F = np.eye(N)
    F[V, BIAS] = F[V, SLOPE] = -time
    return F


def friction_matrix(time: float) -> np.ndarray:
    """Return F of the four frictions' common rate."""
    F = np.eye(N)
    F[FRICTION, RATE] = time
    return F


def friction_noise(common: float, front: float, rear: float, wheel: float) -> np.ndarray:
    """Return Q as the sum of outer products of what acts together."""
    Q = np.zeros((N, N))
    for variance, wheels in [(common, range(4)), (front, (0, 1)), (rear, (2, 3))]:
        together = np.zeros(N)
        together[[MU + i for i in wheels]] = 1.0
        Q += variance * np.outer(together, together)
    Q[FRICTION, FRICTION] += wheel * np.eye(4)
    return Q


@pytest.mark.parametrize("time", [0.01, 0.05, 0.5])
def test_speed_drifts_with_bias_and_slope(time: float) -> None:
    state = some_state(7)
    F = speed_matrix(time)
    expected = F @ state["p"] @ F.T
    drift_speed(state, time)
    np.testing.assert_allclose(state["p"], expected, rtol=1e-10, atol=1e-14)


def test_friction_walks_together_by_axle_and_by_wheel() -> None:
    state = some_state(8)
    expected = state["p"] + friction_noise(1e-3, 2e-3, 3e-3, 4e-3)
    walk_friction(state, 1e-3, 2e-3, 3e-3, 4e-3)
    np.testing.assert_allclose(state["p"], expected, rtol=1e-12)


PRESSURES = [
    # pressures of the last window and of this, front and rear [bar]
    ("steady", (40.0, 30.0), (40.0, 30.0)),
    ("building up", (40.0, 30.0), (60.0, 35.0)),
    ("releasing", (40.0, 30.0), (20.0, 10.0)),
]


@pytest.mark.parametrize(("name", "last", "now"), PRESSURES, ids=[row[0] for row in PRESSURES])
@pytest.mark.parametrize("time", [0.05, 0.1])
def test_while_the_pads_rub_friction_moves_with_its_rate(name: str, last, now, time: float) -> None:
    state = some_state(9)
    state["last_pressure"] = np.repeat(last, 2)
    state["window"]["pressure"] = np.repeat(now, 2)
    # Relative change of an axle's mean, softened by 10 bar.
    rise = [max((n - b) / (0.5 * (n + b) + 10.0), 0.0) for n, b in zip(now, last, strict=True)]
    axle = [MU_WALK_AXLE**2 * time + (MU_WALK_PRESSURE * r) ** 2 for r in rise]
    F_v, F_mu = speed_matrix(time), friction_matrix(time)
    P = F_v @ state["p"] @ F_v.T + np.diag(WALK**2 * time)
    P = F_mu @ P @ F_mu.T + friction_noise(MU_WALK_COMMON**2 * time, *axle, MU_WALK_WHEEL**2 * time)
    x = friction_matrix(time) @ state["x"]
    walk(state, True, time)
    np.testing.assert_allclose(state["x"], x, rtol=1e-12)
    np.testing.assert_allclose(state["p"], P, rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize(("sigma_mu", "grows"), [(0.02, True), (2 * MU_COMMON, False)])
def test_while_nothing_rubs_friction_is_slowly_forgotten(sigma_mu: float, grows: bool) -> None:
    state, time = some_state(10), 0.05
    state["p"][FRICTION, :] = state["p"][:, FRICTION] = 0.0
    state["p"][FRICTION, FRICTION] = sigma_mu**2 * np.eye(4)
    F_v, held = speed_matrix(time), MU_WALK_HELD**2 * time
    P = F_v @ state["p"] @ F_v.T + np.diag(WALK**2 * time)
    P = P + friction_noise(held, held, held, 0.2 * held) * grows
    x = state["x"].copy()
    walk(state, False, time)
    np.testing.assert_array_equal(state["x"], x)
    np.testing.assert_allclose(state["p"], P, rtol=1e-9, atol=1e-13)


def test_a_rate_that_is_forgotten_is_the_priors_and_tied_to_nothing() -> None:
    state = some_state(11)
    others = [i for i in range(N) if i != RATE]
    P, x = state["p"][np.ix_(others, others)].copy(), state["x"][others].copy()
    forget_rate(state)
    np.testing.assert_array_equal(state["p"][np.ix_(others, others)], P)
    np.testing.assert_array_equal(state["x"][others], x)
    assert state["x"][RATE] == 0.0
    np.testing.assert_array_equal(state["p"][RATE], np.eye(N)[RATE] * PRIOR[RATE] ** 2)
    np.testing.assert_array_equal(state["p"][:, RATE], state["p"][RATE])


def test_a_measurement_of_friction_and_mass_together_ties_them() -> None:
    """What friction braking shows is friction less mass: the sum stays as unsure as it was."""
    state = some_state(12)
    state["p"] = np.diag(np.full(N, 0.1**2))
    state["h"] = np.zeros(N)
    state["h"][MU], state["h"][MASS] = 1.0, -1.0
    correct(state, 0.0, 1e-8)
    P = state["p"]
    assert P[MU, MU] + P[MASS, MASS] - 2 * P[MU, MASS] == pytest.approx(1e-8, rel=1e-3)
    assert P[MU, MU] + P[MASS, MASS] + 2 * P[MU, MASS] == pytest.approx(2 * 0.1**2)
