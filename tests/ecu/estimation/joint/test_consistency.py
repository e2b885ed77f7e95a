"""Where the filter's assumptions hold, the truth is as far off as it says.

Truth, noise and measurements are drawn here, linear in numpy; the observer's walk and correction see them.
"""

import numpy as np
import pytest

from ecu.estimation.joint.kalman import correct
from ecu.estimation.joint.layout import BIAS, JOINT_STATE, MU, PEAK, RADIUS, RATE, SLOPE, STIFFNESS, N, V
from ecu.estimation.joint.prior import (
    MU_WALK_AXLE,
    MU_WALK_COMMON,
    MU_WALK_WHEEL,
    WALK,
    set_prior,
    walk,
)
from ecu.estimation.joint.wheel import predict_balance, predict_wheel

STEP = 0.05  # s
SIGMA_WHEEL, SIGMA_BALANCE, SIGMA_REFERENCE = 0.1, 0.03, 0.03  # rad/s, m/s^2, m/s
FRICTION = list(range(MU, MU + 4))
BRAKING = [V, *FRICTION, STIFFNESS, PEAK, SLOPE, RATE, *range(RADIUS, RADIUS + 4)]
LEVELS = [(30.0, 38.0, 30.0), (24.0, 19.0, 15.0), (15.0, 55.0, 45.0)]  # m/s, bar front and rear


def derivatives(car, state, point) -> np.ndarray:
    """Return H of four wheels, balance and speed reference, shape (6, N)."""
    speed, front, rear = point
    w = state["window"]
    state["x"][:] = 0.0
    state["x"][V], w["load"], w["motor_reported"] = speed, car["static_load"], 1
    w["pressure"] = state["smooth_pressure"] = state["last_smooth"] = np.repeat([front, rear], 2)
    out = []
    for i in range(4):
        predict_wheel(car, state, i, speed)
        out.append(state["h"].copy())
    predict_balance(car, state)
    return np.array([*out, state["h"].copy(), np.eye(N)[V]])


def move(x: np.ndarray, random) -> np.ndarray:
    """Return the true deviation a step later, its walk drawn."""
    x = x.copy()
    x[V] -= STEP * (x[BIAS] + x[SLOPE])
    x += WALK * np.sqrt(STEP) * random.standard_normal(N)
    x[FRICTION] += STEP * x[RATE]
    axle = np.repeat(random.standard_normal(2), 2)
    own = MU_WALK_COMMON * random.standard_normal() + MU_WALK_AXLE * axle
    x[FRICTION] += np.sqrt(STEP) * (own + MU_WALK_WHEEL * random.standard_normal(4))
    return x


CASES = [
    # states that are corrected, the others are considered
    ("everything free", list(range(N))),
    ("friction braking", BRAKING),
    ("sliding", [V, SLOPE]),
]


@pytest.mark.parametrize(("name", "free"), CASES, ids=[row[0] for row in CASES])
def test_truth_is_inside_two_sigma(params, name: str, free) -> None:
    car, random = params[0], np.random.default_rng(11)
    state = np.zeros(1, JOINT_STATE)[0]
    H = [derivatives(car, state, point) for point in LEVELS]
    noise = np.array([SIGMA_WHEEL] * 4 + [SIGMA_BALANCE, SIGMA_REFERENCE])
    inside, distance = [], []
    for _ in range(60):
        set_prior(car, state)
        state["free"] = np.isin(np.arange(N), free)
        truth = np.linalg.cholesky(state["p"] + 1e-15 * np.eye(N)) @ random.standard_normal(N)
        for k in range(60):
            state["last_pressure"] = state["window"]["pressure"] = 30.0
            walk(state, True, STEP)
            state["x"][V] -= STEP * (state["x"][BIAS] + state["x"][SLOPE])
            truth = move(truth, random)
            for h, sigma in zip(H[k // 20], noise, strict=True):
                state["h"] = h
                z = h @ truth + sigma * random.standard_normal()
                correct(state, z - h @ state["x"], sigma**2)
        error, P = truth - state["x"], state["p"]
        sigma = np.sqrt(np.diag(P))
        inside.append(np.abs(error) < 2 * sigma)
        distance.append(error[free] @ np.linalg.solve(P[np.ix_(free, free)], error[free]) / len(free))
    share = np.mean(inside, axis=0)
    print(f"{name}: {100 * share[free].mean():.1f} % inside two sigma (90 … 99.5), least {share.min():.2f}")
    assert 0.90 < share[free].mean() < 0.995
    assert 0.90 < share[FRICTION].mean() < 0.995
    assert share.min() > 0.80  # each of 26 alone, over 60 runs
    # The mean of normalised squares of so many errors scatters by this much.
    assert np.mean(distance) == pytest.approx(1.0, abs=3 * np.sqrt(2 / (len(distance) * len(free))))
