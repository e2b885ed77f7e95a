"""Prediction and correction against matrices: F P F' + Q, and the update of Kalman and of Schmidt.

The gate is always given: once a kernel has been called with different arguments left out, numba takes a
hundred times as long to find its compiled form, at every call.
"""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.kalman import (
    GATE,
    REJECT,
    clear_derivatives,
    clear_state,
    correct,
    drift_by_derivatives,
    drift_speed,
    forget,
    forget_speed,
    variance_by_derivatives,
)
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    CHANGE,
    JOINT_STATE,
    LEVEL,
    MASS,
    RATE,
    SLIP_ERROR,
    SLOPE,
    STIFFNESS,
    N,
    V,
)
from ecu.algorithm.estimation.joint.prior import (
    CHANGE_AXLE,
    CHANGE_BY_PRESSURE,
    CHANGE_COMMON,
    CHANGE_S,
    LASTING,
    LEVEL_WALK,
    PRIOR,
    RATE_SIGMA,
    RATE_WALK,
    SLOPE_S,
    UNKNOWN_SLIP,
    UNKNOWN_SLIP_BY_ACCEL,
    UNKNOWN_SLIP_REST,
    UNKNOWN_SLIP_S,
    WALK,
    forget_rate,
    walk,
    widen_levels,
)

LEVELS = slice(LEVEL, LEVEL + 4)
CHANGES = [CHANGE, CHANGE + 1]
FREE = {
    "all": range(N),
    "friction braking": [V, *range(LEVEL, LEVEL + 4), *CHANGES, STIFFNESS, SLOPE, RATE],
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
    assert correct(state, innovation, variance, GATE) == pytest.approx(sigmas**2)
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
        correct(state, 0.3 * random.standard_normal(), 10 ** random.uniform(-4, 1), GATE)
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
    assert correct(state, innovation, variance, GATE) == pytest.approx(sigmas**2)
    np.testing.assert_allclose(state["x"], expected[0], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(state["p"], expected[1], rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("far", [-REJECT - 0.1, REJECT + 0.1, 1e6, math.inf, math.nan])
def test_four_gates_off_or_not_finite_it_is_rejected(far: float) -> None:
    state = some_state(6)
    x, P = state["x"].copy(), state["p"].copy()
    ratio = correct(state, innovation_of(state, far, 0.3), 0.3, GATE)
    assert not ratio <= REJECT**2
    np.testing.assert_array_equal(state["x"], x)
    np.testing.assert_array_equal(state["p"], P)


OUTLIERS = [
    # standard deviations; states that are free
    (-11.9, "rolling"),
    (3.1, "rolling"),
    (5.0, "rolling"),
]


@pytest.mark.parametrize(("sigmas", "name"), OUTLIERS)
def test_beyond_the_gate_without_braking_it_corrects_speed_and_slope_alone(sigmas: float, name: str) -> None:
    """What a car is learns from what fits."""
    free = [V, SLOPE, BIAS, MASS, STIFFNESS]
    state, variance = some_state(7, free), 0.3
    innovation = innovation_of(state, sigmas, variance)
    wider = (innovation / GATE) ** 2 - state["h"] @ state["p"] @ state["h"]
    only = np.isin(np.arange(N), [V, SLOPE])
    expected = schmidt(state["x"], state["p"], state["h"], only, innovation, wider)
    correct(state, innovation, variance, GATE)
    np.testing.assert_allclose(state["x"], expected[0], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(state["p"], expected[1], rtol=1e-8, atol=1e-12)


def speed_matrix(time: float) -> np.ndarray:
    """Return F of v' = a - b - g sin(slope)."""
    F = np.eye(N)
    F[V, BIAS] = F[V, SLOPE] = -time
    return F


def passing_matrix(time: float) -> np.ndarray:
    """Return F of slope and of the error of an unknown drive's slip, which are forgotten."""
    F = np.eye(N)
    F[SLOPE, SLOPE] = math.exp(-time / SLOPE_S)
    for axle in range(2):
        F[SLIP_ERROR + axle, SLIP_ERROR + axle] = math.exp(-time / UNKNOWN_SLIP_S)
    return F


def friction_matrix(time: float) -> np.ndarray:
    """Return F of both axles' change: it returns to zero and moves with the common rate."""
    F = np.eye(N)
    for i in CHANGES:
        F[i, i], F[i, RATE] = math.exp(-time / CHANGE_S), time
    return F


def together(states, variance: float) -> np.ndarray:
    """Return Q of states that change by the same."""
    ones = np.isin(np.arange(N), states).astype(float)
    return variance * np.outer(ones, ones)


@pytest.mark.parametrize("time", [0.01, 0.05, 0.5])
@pytest.mark.parametrize("drift", [drift_speed, drift_by_derivatives])
def test_speed_drifts_with_bias_and_slope_or_by_derivatives(drift, time: float) -> None:
    state = some_state(7)
    state["h"][[BIAS, MASS]] = 1.0, 0.0
    by_derivatives = np.eye(N) + time * np.outer(np.eye(N)[V], state["h"])
    F = speed_matrix(time) if drift is drift_speed else by_derivatives
    expected = F @ state["p"] @ F.T
    drift(state, time)
    np.testing.assert_allclose(state["p"], expected, rtol=1e-10, atol=1e-14)


def test_a_variance_is_h_p_h() -> None:
    state = some_state(8)
    state["h"][[BIAS, MASS]] = 1.0, 0.0
    assert variance_by_derivatives(state) == pytest.approx(state["h"] @ state["p"] @ state["h"])
    np.testing.assert_allclose(state["ph"], state["p"] @ state["h"], rtol=1e-10)


def test_a_speed_that_is_taken_anew_is_off_by_half_a_metre_a_second() -> None:
    state = some_state(13)
    forget_speed(state)
    assert state["p"][V].tolist() == state["p"][:, V].tolist() == [0.25 * (j == V) for j in range(N)]


def test_levels_widen_together_by_axle_and_by_wheel() -> None:
    state = some_state(8)
    expected = state["p"] + together(range(LEVEL, LEVEL + 4), 1e-3)
    for axle in ((LEVEL, LEVEL + 1), (LEVEL + 2, LEVEL + 3)):
        expected = expected + together(axle, 2e-3)
    for i in range(4):
        expected = expected + together([LEVEL + i], 3e-3)
    widen_levels(state, 1e-3, 2e-3, 3e-3)
    np.testing.assert_allclose(state["p"], expected, rtol=1e-12)


PRESSURES = [
    # pressures of the last window and of this, front and rear [bar]
    ("steady", (40.0, 30.0), (40.0, 30.0)),
    ("building up", (40.0, 30.0), (60.0, 35.0)),
    ("releasing", (40.0, 30.0), (20.0, 10.0)),
]
KNOWN = [
    # share of the drive that is reported, speed reference [s] ago, acceleration [m/s^2] and across [-]
    ("drive known", 1.0, 0.0, -4.0, 0.0),
    ("half known", 0.5, 0.3, -4.0, 0.0),
    ("unknown, with a reference", 0.0, 0.0, -4.0, 0.0),
    ("unknown, no reference for long", 0.0, 30.0, -4.0, 0.3),
]


def carried(state, known: float, reference_s: float, accel: float, across: float, speed: float):
    """Set what is known of the drive; return the variance that an axle's slip may have by it."""
    w, unknown = state["window"], 1.0 - known
    state["drive_known"], state["reference_s"], state["x"][V] = known, reference_s, speed
    state["x"][SLIP_ERROR : SLIP_ERROR + 2] = 0.0  # nothing corrects it
    w["accel"], w["across"] = accel, across
    held = math.hypot(accel / 9.81, across)
    rest = (UNKNOWN_SLIP_REST + UNKNOWN_SLIP_BY_ACCEL * held) * unknown * min(reference_s, 1.0)
    return ((UNKNOWN_SLIP + rest) * unknown) ** 2


@pytest.mark.parametrize("rubbing", [True, False], ids=["pads rub", "pads do not"])
@pytest.mark.parametrize("drive", KNOWN, ids=[row[0] for row in KNOWN])
@pytest.mark.parametrize(("name", "last", "now"), PRESSURES, ids=[row[0] for row in PRESSURES])
@pytest.mark.parametrize("time", [0.05, 0.1])
def test_a_walk_is_f_p_f_and_q(name: str, last, now, time: float, drive, rubbing: bool) -> None:
    state = some_state(9)
    slip, known = carried(state, *drive[1:], speed=20.0), drive[1]
    state["last_pressure"], state["window"]["pressure"] = np.repeat(last, 2), np.repeat(now, 2)
    # What passes is forgotten by exp(-t / T) and renewed by as much as keeps its variance.
    P = speed_matrix(time) @ state["p"] @ speed_matrix(time).T
    F = passing_matrix(time)
    P = F @ P @ F.T
    for axle in range(2):
        P = P + together([SLIP_ERROR + axle], slip * (1 - math.exp(-2 * time / UNKNOWN_SLIP_S)))
    other = np.arange(N) != RATE
    P = P + np.diag(WALK**2 * time * other)
    scale = np.ones(N)
    scale[LASTING] = np.minimum(1.0, PRIOR[LASTING] / np.sqrt(np.diag(P)[LASTING]))
    P = P * np.outer(scale, scale)  # no less sure than before anything was learned
    x = F @ state["x"]
    if rubbing:
        P = P + together([RATE], (RATE_WALK * known) ** 2 * time)
        P = friction_matrix(time) @ P @ friction_matrix(time).T
        x = friction_matrix(time) @ x
        new = 1 - math.exp(-2 * time / CHANGE_S)
        P = P + together(CHANGES, CHANGE_COMMON**2 * new)
        for i, n, before in zip(CHANGES, now, last, strict=True):
            # Relative change of an axle's mean, softened by 10 bar.
            rise = max((n - before) / (0.5 * (n + before) + 10.0), 0.0)
            P = P + together([i], CHANGE_AXLE**2 * new + (CHANGE_BY_PRESSURE * rise) ** 2)
        P = P + together(range(LEVEL, LEVEL + 4), LEVEL_WALK**2 * time)
    walk(state, rubbing, time)
    np.testing.assert_allclose(state["x"], x, rtol=1e-12)
    np.testing.assert_allclose(state["p"], P, rtol=1e-9, atol=1e-13)


def test_a_slope_is_kept_while_the_car_stands() -> None:
    state = some_state(10)
    state["drive_known"], state["x"][V] = 1.0, 0.5
    before = state["x"][SLOPE].copy()
    walk(state, False, 0.05)
    assert state["x"][SLOPE] == before


def test_an_axles_change_that_is_left_alone_keeps_its_variance() -> None:
    state = some_state(10)
    state["p"] = np.diag(np.full(N, 1e-4))
    state["drive_known"] = state["x"][V] = 0.0  # and its rate is zero
    state["p"][RATE, RATE] = 0.0
    for _ in range(2000):
        walk(state, True, 0.05)
    P = state["p"][np.ix_(CHANGES, CHANGES)]
    own = CHANGE_COMMON**2 + CHANGE_AXLE**2
    np.testing.assert_allclose(P, [[own, CHANGE_COMMON**2], [CHANGE_COMMON**2, own]], rtol=1e-6)


@pytest.mark.parametrize("clear", [False, True])
@pytest.mark.parametrize("i", [V, LEVEL + 2, SLIP_ERROR + 1])
def test_a_state_that_is_forgotten_is_tied_to_nothing(i: int, clear: bool) -> None:
    state = some_state(13)
    x, P = state["x"].copy(), state["p"].copy()
    (clear_state if clear else forget)(state, i, 0.04)
    x[i] *= not clear
    P[i] = P[:, i] = 0.0
    P[i, i] = 0.04
    np.testing.assert_array_equal(state["x"], x)
    np.testing.assert_array_equal(state["p"], P)


@pytest.mark.parametrize("known", [1.0, 0.5, 0.0])
def test_a_rate_that_is_forgotten_is_as_unknown_as_the_drive_allows(known: float) -> None:
    state = some_state(11)
    state["drive_known"] = known
    others = [i for i in range(N) if i != RATE]
    P, x = state["p"][np.ix_(others, others)].copy(), state["x"][others].copy()
    forget_rate(state)
    np.testing.assert_array_equal(state["p"][np.ix_(others, others)], P)
    np.testing.assert_array_equal(state["x"][others], x)
    assert state["x"][RATE] == 0.0
    np.testing.assert_array_equal(state["p"][RATE], np.eye(N)[RATE] * (RATE_SIGMA * known) ** 2)
    np.testing.assert_array_equal(state["p"][:, RATE], state["p"][RATE])


def test_a_measurement_of_friction_and_mass_together_ties_them() -> None:
    """What friction braking shows is friction less mass: the sum stays as unsure as it was."""
    state = some_state(12)
    state["p"] = np.diag(np.full(N, 0.1**2))
    state["h"] = np.zeros(N)
    state["h"][LEVEL], state["h"][MASS] = 1.0, -1.0
    correct(state, 0.0, 1e-8, GATE)
    P = state["p"]
    assert P[LEVEL, LEVEL] + P[MASS, MASS] - 2 * P[LEVEL, MASS] == pytest.approx(1e-8, rel=1e-3)
    assert P[LEVEL, LEVEL] + P[MASS, MASS] + 2 * P[LEVEL, MASS] == pytest.approx(2 * 0.1**2)


def test_a_measurement_begins_without_derivatives() -> None:
    state = some_state(1)
    clear_derivatives(state)
    assert state["h"].tolist() == [0.0] * N
