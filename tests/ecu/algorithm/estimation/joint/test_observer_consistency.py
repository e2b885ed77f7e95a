"""Where the filter's assumptions hold, the truth is as far off as it says.

Truth, noise and measurements are drawn here, linear in numpy; the observer's walk and correction see them.
"""

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.balance import predict_balance
from ecu.algorithm.estimation.joint.kalman import REJECT, correct
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    CHANGE,
    DRIVE,
    JOINT_STATE,
    LEVEL,
    MEAN,
    OVERRUN,
    PEAK,
    RADIUS,
    RATE,
    SLIP_ERROR,
    SLOPE,
    STIFFNESS,
    N,
    V,
)
from ecu.algorithm.estimation.joint.prior import (
    CHANGE_AXLE,
    CHANGE_COMMON,
    CHANGE_S,
    LEVEL_WALK,
    RATE_WALK,
    SLOPE_S,
    WALK,
    begin_application,
    end_application,
    note_change,
    set_prior,
    walk,
)
from ecu.algorithm.estimation.joint.wheel_speed import predict_wheel

STEP = 0.05  # s
SIGMA_WHEEL, SIGMA_BALANCE, SIGMA_REFERENCE = 0.1, 0.03, 0.03  # rad/s, m/s^2, m/s
LEVELS = list(range(LEVEL, LEVEL + 4))
CHANGES = [CHANGE, CHANGE + 1]
MEANS = [MEAN, MEAN + 1]
UNKNOWN_DRIVE = [DRIVE, DRIVE + 1, SLIP_ERROR, SLIP_ERROR + 1, OVERRUN]
RADII = list(range(RADIUS, RADIUS + 4))
BRAKING = [V, *LEVELS, STIFFNESS, PEAK, SLOPE, RATE, *CHANGES, *RADII]
POINTS = [(30.0, 38.0, 30.0), (24.0, 19.0, 15.0), (15.0, 55.0, 45.0)]  # m/s, bar front and rear


def derivatives(car, state, point) -> np.ndarray:
    """Return H of four wheels, balance and speed reference, shape (6, N)."""
    speed, front, rear = point
    w = state["window"]
    state["x"][:] = 0.0
    state["x"][V], w["load"], w["change"] = speed, car["static_load"], 0.0
    w["pressure"] = w["common_pressure"] = state["last_smooth"] = np.repeat([front, rear], 2)
    out = []
    for i in range(4):
        predict_wheel(car, state, i, speed)
        out.append(state["h"].copy())
    predict_balance(car, state, True)
    return np.array([*out, state["h"].copy(), np.eye(N)[V]])


def move(x: np.ndarray, random) -> np.ndarray:
    """Return the true deviation a step later, its walk drawn."""
    x = x.copy()
    x[V] -= STEP * (x[BIAS] + x[SLOPE])
    x[SLOPE] *= np.exp(-STEP / SLOPE_S)
    x += WALK * np.sqrt(STEP) * random.standard_normal(N)
    x[RATE] += RATE_WALK * np.sqrt(STEP) * random.standard_normal()
    stays = np.exp(-STEP / CHANGE_S)
    new = CHANGE_COMMON * random.standard_normal() + CHANGE_AXLE * random.standard_normal(2)
    x[CHANGES] = stays * x[CHANGES] + STEP * x[RATE] + np.sqrt(1 - stays**2) * new
    x[LEVELS] += np.sqrt(STEP) * LEVEL_WALK * random.standard_normal()
    return x


def draw(P: np.ndarray, random) -> np.ndarray:
    """Return a deviation with covariance `P`, which may have states that are known."""
    values, vectors = np.linalg.eigh(P)
    return vectors @ (np.sqrt(np.maximum(values, 0.0)) * random.standard_normal(N))


def begun(car) -> np.void:
    """Return the state at the beginning of the first application, with a drive that is known."""
    state = np.zeros(1, JOINT_STATE)[0]
    set_prior(car, state)
    state["drive_known"] = 1.0
    begin_application(state, np.zeros(4))
    return state


CASES = [
    # states that are corrected, the others are considered
    ("everything free", [i for i in range(N) if i not in MEANS]),
    ("friction braking", BRAKING),
    ("sliding", [V, SLOPE]),
]


@pytest.mark.parametrize(("name", "free"), CASES, ids=[row[0] for row in CASES])
def test_truth_is_inside_two_sigma(params, name: str, free) -> None:
    car, random = params[0], np.random.default_rng(11)
    state = np.zeros(1, JOINT_STATE)[0]
    H = [derivatives(car, state, point) for point in POINTS]
    noise = np.array([SIGMA_WHEEL] * 4 + [SIGMA_BALANCE, SIGMA_REFERENCE])
    inside, distance = [], []
    for _ in range(60):
        state = begun(car)
        state["free"] = np.isin(np.arange(N), free)
        truth = draw(state["p"], random)
        for k in range(60):
            state["last_pressure"] = state["window"]["pressure"] = 30.0
            walk(state, True, STEP)
            state["x"][V] -= STEP * (state["x"][BIAS] + state["x"][SLOPE])
            truth = move(truth, random)
            for h, sigma in zip(H[k // 20], noise, strict=True):
                state["h"] = h
                z = h @ truth + sigma * random.standard_normal()
                correct(state, z - h @ state["x"], sigma**2, REJECT, REJECT)
        error, P = truth - state["x"], state["p"]
        varies = [i for i in free if P[i, i] > 0.0]
        known = [i for i in range(N) if P[i, i] == 0.0]
        assert set(known) <= {*MEANS, *UNKNOWN_DRIVE}
        np.testing.assert_allclose(error[known], 0.0, atol=1e-9)
        sigma = np.sqrt(np.diag(P))
        inside.append(np.abs(error) <= 2 * sigma + 1e-9)
        own = np.ix_(varies, varies)
        distance.append(error[varies] @ np.linalg.solve(P[own], error[varies]) / len(varies))
    share = np.mean(inside, axis=0)
    print(f"{name}: {100 * share[varies].mean():.1f} % inside two sigma (90 … 99.5), least {share.min():.2f}")
    assert 0.90 < share[varies].mean() < 0.995
    assert 0.90 < share[LEVELS].mean() < 0.995
    assert share.min() > 0.80  # each of 34 alone, over 60 runs
    # The mean of normalised squares of so many errors scatters by this much.
    assert np.mean(distance) == pytest.approx(1.0, abs=3 * np.sqrt(2 / (len(distance) * len(varies))))


def test_the_level_after_an_application_is_the_mean_of_its_friction(params) -> None:
    """Truth: the mean over the application of level and change; it is as far off as the level says."""
    car, random = params[0], np.random.default_rng(12)
    H = [derivatives(car, np.zeros(1, JOINT_STATE)[0], point) for point in POINTS]
    noise = np.array([SIGMA_WHEEL] * 4 + [SIGMA_BALANCE, SIGMA_REFERENCE])
    errors = []
    for _ in range(60):
        state = begun(car)
        state["free"] = np.isin(np.arange(N), BRAKING)
        truth, trajectory = draw(state["p"], random), []
        for k in range(60):
            state["last_pressure"] = state["window"]["pressure"] = 30.0
            walk(state, True, STEP)
            state["x"][V] -= STEP * (state["x"][BIAS] + state["x"][SLOPE])
            truth = move(truth, random)
            for h, sigma in zip(H[k // 20], noise, strict=True):
                state["h"] = h
                innovation = h @ (truth - state["x"]) + sigma * random.standard_normal()
                correct(state, innovation, sigma**2, REJECT, REJECT)
            trajectory.append(truth[LEVELS] + truth[np.repeat(CHANGES, 2)])
            note_change(state, 120.0)
        end_application(state)
        P = state["p"][np.ix_(LEVELS, LEVELS)]
        off = np.mean(trajectory, axis=0) - state["x"][LEVELS]
        errors.append((*(off / np.sqrt(np.diag(P))), off @ np.linalg.solve(P, off) / 4))
    ratios = np.array(errors)
    print(
        f"mean friction over level: {np.round(ratios[:, :4].std(axis=0), 2)} sigma, {ratios[:, 4].mean():.2f}"
    )
    assert 0.90 < np.mean(np.abs(ratios[:, :4]) < 2) < 0.995
    # The level walks within an application, so its mean is a little off its last value.
    assert ratios[:, 4].mean() == pytest.approx(1.0, abs=0.3)
