"""Observer 2 against a dense extended Kalman filter whose model is the differential equation itself.

The oracle integrates I domega/dt = -T_b - T_outer - r F, tau dF/dt = F_in - F with scipy and takes its
Jacobians by differences; nothing of the observer's discretisation is in it.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ecu.algorithm.estimation.friction import CUT_OFF, update_pressure
from ecu.algorithm.estimation.thesis.friction import FRICTION_STATE
from ecu.algorithm.estimation.thesis.observer2 import (
    OBSERVER_STATE,
    correct_force,
    correct_omega,
    observer_sound,
    predict_observer,
    process_noise,
    start_observer,
)

DT = 0.01
INERTIA, LENGTH, RADIUS, LOAD = 1.5, 0.25, 0.36, 5400.0  # config/suv.toml
BRAKES = {0: (0.060, 0.1205), 2: (0.034, 0.1288)}  # Table D.1: d_p, r_eff [m]
BAR = 1e5


def per_mu(corner: int, pressure: float) -> float:
    diameter, radius = BRAKES[corner]
    return 2 * math.pi * diameter**2 / 4 * pressure * radius


def flow(
    x: np.ndarray, corner: int, pressure: float, outer: float, force_in: float, speed: float
) -> np.ndarray:
    """Return the state (omega, F, mu) one step later."""

    def rhs(_: float, y: np.ndarray) -> list[float]:
        omega_dot = -(per_mu(corner, pressure) * y[2] + outer + RADIUS * y[1]) / INERTIA
        return [omega_dot, (force_in - y[1]) * speed / LENGTH, 0.0]

    return solve_ivp(rhs, (0, DT), x, rtol=1e-10, atol=1e-10).y[:, -1]


def jacobian(function, x: np.ndarray) -> np.ndarray:
    steps = np.array([1e-2, 1.0, 1e-3])
    columns = [(function(x + h) - function(x - h)) / (2 * h.sum()) for h in np.diag(steps)]
    return np.array(columns).T


def covariance(state, i: int) -> np.ndarray:
    ww, wf, wm, ff, fm, mm = state["p"][i]
    return np.array([[ww, wf, wm], [wf, ff, fm], [wm, fm, mm]])


def estimate(state, i: int) -> np.ndarray:
    return np.array([state["omega"][i], state["force"][i], state["mu"][i]])


def predict(params, state, i, pressure, outer, force_in, speed, drift=0.02, variance=0.0) -> None:
    predict_observer(
        params, state, i, pressure, outer, force_in, variance, RADIUS, LOAD, speed, drift, 1.0, DT
    )


def new(i: int, x, P=None):
    state = np.zeros(1, OBSERVER_STATE)[0]
    state["omega"][i], state["force"][i], state["mu"][i] = x
    if P is not None:
        state["p"][i] = [P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2]]
    return state


def some_covariance(seed: int) -> np.ndarray:
    scale = np.diag([0.5, 300.0, 0.05])
    root = scale @ np.random.default_rng(seed).standard_normal((3, 3))
    return root @ root.T


OPERATING = [
    # corner, pressure [bar], outer torque [N m], force before and force aimed at [N], speed [m/s]
    (0, 30.0, 0.0, -2000.0, -2000.0, 33.0),
    (0, 30.0, 0.0, -2000.0, -2600.0, 33.0),
    (0, 80.0, 40.0, -4500.0, -4000.0, 12.0),
    (2, 50.0, -100.0, -900.0, -1200.0, 25.0),
    (2, 10.0, 300.0, -1000.0, -900.0, 4.2),
    (0, 0.0, 0.0, -50.0, -50.0, 70.0),
    (0, 0.0, 0.0, -50.0, -700.0, 70.0),
]


@pytest.mark.parametrize("row", OPERATING, ids=[str(r) for r in OPERATING])
def test_prediction_follows_the_differential_equation(params, row) -> None:
    i, bar, outer, before, aimed, speed = row
    x, P = np.array([90.0, before, 0.42]), some_covariance(1)
    state = new(i, x, P)
    predict(params[0], state, i, bar * BAR, outer, aimed, speed)
    got, exact = estimate(state, i), flow(x, i, bar * BAR, outer, aimed, speed)
    # The mean of F over a step is taken as that of its ends; an exponential's is a little nearer its end.
    steps = DT * speed / LENGTH
    trapezoid = abs((1 + math.exp(-steps)) / 2 - (1 - math.exp(-steps)) / steps)
    omega_bound = DT * RADIUS / INERTIA * abs(aimed - before) * trapezoid
    assert got[1:] == pytest.approx(exact[1:], rel=1e-7)
    assert abs(got[0] - exact[0]) <= omega_bound + 1e-6

    def own(y: np.ndarray) -> np.ndarray:
        trial = new(i, y)
        predict(params[0], trial, i, bar * BAR, outer, aimed, speed)
        return estimate(trial, i)

    A = jacobian(lambda y: flow(y, i, bar * BAR, outer, aimed, speed), x)
    A_own = jacobian(own, x)
    tolerance = np.full((3, 3), 1e-6)
    tolerance[0, 1] = DT * RADIUS / INERTIA * trapezoid * 1.001 + 1e-9
    assert (np.abs(A_own - A) <= tolerance + 1e-5 * np.abs(A)).all()
    # Covariance: A P A' + Q with the function's own Jacobian
    car = params[0]
    noise_torque = 2 * car["piston_area"][i] * car["effective_radius"][i] * 0.42 * car["sigma_pressure"]
    walk = 2.0**2 * DT + (DT / INERTIA * noise_torque) ** 2
    Q = np.diag([walk, (0.10 * LOAD) ** 2 * DT, 0.02**2 * DT])
    expected = A_own @ P @ A_own.T + Q
    np.testing.assert_allclose(covariance(state, i), expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("i", [0, 3])
def test_correction_is_the_textbook_one(i: int) -> None:
    x, P = np.array([90.0, -2000.0, 0.42]), some_covariance(2)
    for H, z, variance, correct in (
        (np.array([[1.0, 0.0, 0.0]]), 90.3, 0.01, correct_omega),
        (np.array([[0.0, 1.0, 0.0]]), -2150.0, 4e4, correct_force),
    ):
        state = new(i, x, P)
        correct(state, i, z, variance)
        S = (H @ P @ H.T).item() + variance
        K = P @ H.T / S
        np.testing.assert_allclose(estimate(state, i), x + (K * (z - (H @ x).item())).ravel(), rtol=1e-10)
        np.testing.assert_allclose(covariance(state, i), (np.eye(3) - K @ H) @ P, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize(("correct", "place"), [(correct_omega, 0), (correct_force, 1)])
@pytest.mark.parametrize("far", [1e4, 1e6, 1e12])
def test_an_outlier_moves_the_state_by_at_most_four_standard_deviations(correct, place, far) -> None:
    x, P = np.array([90.0, -2000.0, 0.42]), some_covariance(2)
    moved = []
    for z in (x[place] + far, x[place] - far):
        state = new(0, x, P)
        correct(state, 0, z, 1.0)
        moved.append(estimate(state, 0) - x)
    limit = P[:, place] / math.sqrt(P[place, place] + 1.0) * 4.0
    np.testing.assert_allclose(moved[0], limit, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(moved[1], -limit, rtol=1e-6, atol=1e-8)


def system_matrices(params, corner: int, above: float, speed: float, mu: float):
    """Return (A, C) of the code by differences; of a correction with P = I and no noise, 1 - K C is seen."""
    x = np.array([speed / RADIUS, -2000.0, mu])

    def predicted(y: np.ndarray) -> np.ndarray:
        trial = new(corner, y)
        predict(params, trial, corner, above, 0.0, -2000.0, speed)
        return estimate(trial, corner)

    def measured(correct, z: float):
        def corrected(y: np.ndarray) -> np.ndarray:
            trial = new(corner, y, np.eye(3))
            correct(trial, corner, z, 0.0)
            return estimate(trial, corner)

        return (np.eye(3) - jacobian(corrected, x)).sum(axis=0)

    C = np.array([measured(correct_omega, x[0]), measured(correct_force, x[1])])
    return jacobian(predicted, x), C


@pytest.mark.parametrize("corner", [0, 2])
@pytest.mark.parametrize(("speed", "mu"), [(4.2, 0.45), (33.0, 0.45), (33.0, 0.1), (33.0, 0.0), (70.0, 0.9)])
@pytest.mark.parametrize(
    ("bar", "rank"), [(0.0, 2), (0.4, 2), (0.5, 2), (0.6, 3), (3.0, 3), (30.0, 3), (150.0, 3)]
)
def test_friction_is_observable_if_and_only_if_pressure_exceeds_push_out(
    params, feed, corner, speed, mu, bar, rank
) -> None:
    """(4.37, corrected): rank of [C; CA; CA^2], states in units of their usual uncertainty; any mu."""
    friction = np.zeros(1, FRICTION_STATE)[0]
    assert params[0]["push_out_pressure"][corner] == 0.5 * BAR
    bar_inputs = feed(calliper_pressure=bar)[0]
    update_pressure(
        params[0], friction, friction["mu"], np.zeros(4), bar_inputs, 1e3
    )  # long enough to settle
    A, C = system_matrices(params[0], corner, max(float(friction["pressure"][corner]), 0.0), speed, mu)
    scale = np.diag([1.0, 1000.0, 0.1])
    A, C = np.linalg.inv(scale) @ A @ scale, np.diag([1.0, 1e-3]) @ C @ scale
    np.testing.assert_allclose(C, [[1, 0, 0], [0, 1, 0]], atol=1e-6)
    matrix = np.vstack([C, C @ A, C @ A @ A])
    assert np.linalg.matrix_rank(matrix, tol=1e-6) == rank


@pytest.mark.parametrize(
    ("decel", "speed", "factor"),
    [
        (4.0, 25.0, 1.0),
        (2.0, 25.0, 1.0),
        (1.0, 25.0, 2.0),
        (0.0, 25.0, 3.0),
        (-3.0, 25.0, 3.0),
        (4.0, 30 / 3.6, 1.0),
        (4.0, 15 / 3.6, 2.0),
        (1.5, 15 / 3.6, 2.0),
    ],
)
def test_process_noise_grows_for_gentle_and_for_slow_braking(params, decel, speed, factor) -> None:
    """Section 4.4: more uncertainty below 2 m/s^2 and at low speed; friction's own walk stays."""
    noise = process_noise(decel, speed)
    assert noise == pytest.approx(factor)
    variances = []
    for each in (0.0, 1.0, noise):
        state = new(0, np.array([90.0, -2000.0, 0.42]))
        predict_observer(params[0], state, 0, 0.0, 0.0, -2000.0, 0.0, RADIUS, LOAD, 20.0, 0.02, each, DT)
        variances.append(covariance(state, 0))
    none, usual, scheduled = variances
    for k, share in ((0, factor**2), (1, factor**2)):
        assert scheduled[k, k] - none[k, k] == pytest.approx(share * (usual[k, k] - none[k, k]))
    assert scheduled[2, 2] == none[2, 2] == pytest.approx(0.02**2 * DT)


class Wheel:
    """A wheel that brakes: friction and force known to the test, measurements with noise."""

    def __init__(self, params, seed: int, i: int, speed: float, decel: float, mu: float, bar: float) -> None:
        self.params, self.random, self.i = params[0], np.random.default_rng(seed), i
        self.speed, self.decel, self.mu, self.pressure = speed, decel, mu, bar * BAR
        self.state = np.zeros(1, OBSERVER_STATE)[0]

    def truth(self) -> tuple[float, float]:
        """Return wheel speed and tyre force of a wheel that slips by 2 %."""
        omega = 0.98 * self.speed / RADIUS
        omega_dot = -0.98 * self.decel / RADIUS
        torque = per_mu(self.i, self.pressure) * self.mu
        return omega, -(torque + INERTIA * omega_dot) / RADIUS

    def run(self, seconds: float, start: float, sigma_mu: float, sigma_force: float = 250.0):
        """Return (estimate, covariance) of each cycle; the noise of the force is low-passed as slip is."""
        omega, force = self.truth()
        start_observer(self.state, self.i, omega, force, start, sigma_mu)
        rows, noise, gain = [], 0.0, 1 - math.exp(-2 * math.pi * CUT_OFF * DT)
        for _ in range(round(seconds / DT)):
            self.speed = max(self.speed - self.decel * DT, 3.0)
            omega, force = self.truth()
            noise += gain * (sigma_force * self.random.standard_normal() - noise)
            virtual = force + noise
            variance = sigma_force**2
            predict(
                self.params, self.state, self.i, self.pressure, 0.0, virtual, self.speed, variance=variance
            )
            correct_omega(self.state, self.i, omega + 0.1 * self.random.standard_normal(), 0.1**2)
            correct_force(self.state, self.i, virtual, self.params["time_correlation"] * variance)
            assert observer_sound(self.state, self.i)
            rows.append((estimate(self.state, self.i), covariance(self.state, self.i)))
        return rows


@pytest.mark.parametrize("corner", [0, 2])
@pytest.mark.parametrize("speed", [4.0, 8.0, 15.0, 25.0, 33.0, 50.0, 70.0])
def test_it_is_stable_at_every_speed(params, corner: int, speed: float) -> None:
    A, _ = system_matrices(params[0], corner, 50 * BAR, speed, 0.45)
    assert np.abs(np.linalg.eigvals(A)).max() <= 1.0 + 1e-9
    wheel = Wheel(params, 7, corner, speed, 0.0, 0.4, 40.0)
    rows = wheel.run(5.0, 0.5, 0.07)
    for x, P in rows:
        assert np.isfinite(x).all()
        assert np.linalg.eigvalsh(P / np.outer(*[np.sqrt(np.diag(P))] * 2)).min() > 0
    # Errors die away: a disturbed state comes back.
    assert rows[-1][0][2] == pytest.approx(0.4, rel=0.06)
    # The steady filter's error matrix (I - K C) A contracts.
    P, (A, C) = rows[-1][1], system_matrices(params[0], corner, 40 * BAR, speed, 0.45)
    R = np.diag([0.01, params[0]["time_correlation"] * 250.0**2])
    K = P @ C.T @ np.linalg.inv(R)
    assert np.abs(np.linalg.eigvals((np.eye(3) - K @ C) @ A)).max() < 1.0


CONVERGENCE = [
    # corner, start over truth, pressure [bar], error allowed after 1 s and after 3 s (rms over seeds)
    (0, 0.75, 35.0, 0.03, 0.03),
    (0, 1.25, 35.0, 0.03, 0.03),
    (2, 0.75, 40.0, 0.05, 0.04),
    (2, 1.25, 40.0, 0.05, 0.04),
]


@pytest.mark.parametrize(("corner", "start", "bar", "after_1_s", "after_3_s"), CONVERGENCE)
def test_it_converges_from_a_quarter_off(params, corner, start, bar, after_1_s, after_3_s) -> None:
    errors = []
    for seed in range(20):
        rows = Wheel(params, seed, corner, 33.0, 4.0, 0.4, bar).run(3.0, 0.4 * start, 0.10)
        errors.append([rows[99][0][2] / 0.4 - 1, rows[299][0][2] / 0.4 - 1])
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    print(f"corner {corner} from {start}: {100 * rms[0]:.2f} % after 1 s, {100 * rms[1]:.2f} % after 3 s")
    assert rms[0] < after_1_s
    assert rms[1] < after_3_s


@pytest.mark.parametrize("corner", [0, 2])
def test_its_standard_deviation_is_honest(params, corner: int) -> None:
    """Over seeds, with noise as the product has it, the error is about as large as the filter says."""
    ratios = []
    for seed in range(60):
        random = np.random.default_rng(1000 + seed)
        mu = 0.45 + 0.06 * random.standard_normal()
        x, P = Wheel(params, seed, corner, 33.0, 4.0, mu, 40.0).run(2.0, 0.45, 0.06)[-1]
        ratios.append((x[2] - mu) / math.sqrt(P[2, 2]))
    rms = float(np.sqrt(np.mean(np.square(ratios))))
    print(f"corner {corner}: error over sigma, rms {rms:.2f} (0.25 … 1.2 allowed)")
    assert 0.25 < rms < 1.2


@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize("field", ["omega", "force", "mu", "p"])
def test_a_state_that_is_not_finite_is_not_sound(field: str, value: float) -> None:
    state = new(1, [90.0, -2000.0, 0.45], some_covariance(3))
    assert observer_sound(state, 1)
    state[field][1] = value
    assert not observer_sound(state, 1)


@pytest.mark.parametrize("place", [0, 3, 5])
def test_a_variance_that_is_not_positive_is_not_sound(place: int) -> None:
    state = new(1, [90.0, -2000.0, 0.45], some_covariance(3))
    state["p"][1, place] = 0.0
    assert not observer_sound(state, 1)


def test_initial_state_upon_activation() -> None:
    """(4.13)"""
    state = np.zeros(1, OBSERVER_STATE)[0]
    start_observer(state, 2, 80.0, -1500.0, 0.41, 0.05)
    assert list(estimate(state, 2)) == [80.0, -1500.0, 0.41]
    P = covariance(state, 2)
    assert P[2, 2] == pytest.approx(0.05**2)
    assert (np.diag(P) > 0).all()
    assert np.count_nonzero(P - np.diag(np.diag(P))) == 0
