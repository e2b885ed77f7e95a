"""The bound of the friction: closed forms of small systems, the simulated car in its formulas, a stop."""

import numpy as np
import pytest

from brakelab.plant.records import GRAVITY, RecordArray
from brakelab.plant.tyre import magic_formula
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.scenario_car import with_draw
from brakelab.studies.accuracy import bound
from brakelab.studies.accuracy.bound import LEVELS, Bound, Limit, axle_errors, bound_table, bounds_of
from brakelab.studies.accuracy.bound_car import (
    MASS,
    MU,
    RADIUS,
    SLOPE,
    WINDOW_S,
    N,
    Trajectory,
    V,
    derivatives,
    shown,
    slip_of,
    trajectory_of,
)
from brakelab.studies.accuracy.bound_system import wander_of
from brakelab.studies.accuracy.linear_bound import System, filtered, sampled
from brakelab.studies.accuracy.observers import counted
from brakelab.studies.accuracy.observers_cases import ACCURACY
from ecu.contract.signals import CORNERS

pytestmark = pytest.mark.study


def _one_wheel(walk: float, noise: float, steps: int) -> System:
    """Friction of one wheel whose torque is seen."""
    one = np.ones((steps, 1, 1))
    return System(one, walk**2 * one, one / noise)


def test_constant_friction_seen_n_times_is_known_as_a_mean_is() -> None:
    steps = 30
    p = filtered(_one_wheel(0.0, 0.05, steps), np.array([[0.2**2]])).p[:, 0, 0]
    seen = np.arange(1, steps + 1)
    np.testing.assert_allclose(p, 1.0 / (1.0 / 0.2**2 + seen / 0.05**2), rtol=1e-12)


def test_wandering_friction_settles_where_riccati_has_it() -> None:
    q, r = 0.01**2, 0.05**2
    p = filtered(_one_wheel(0.01, 0.05, 200), np.array([[1.0]])).p[-1, 0, 0]
    assert p == pytest.approx(0.5 * (-q + np.sqrt(q * q + 4.0 * q * r)), rel=1e-9)


def test_draws_have_the_covariances_of_all_measurements_at_once() -> None:
    """Filter and smoother beside least squares over the whole drive, in one dense matrix."""
    random = np.random.default_rng(3)
    n, states, m = 6, 3, 2
    move = np.eye(states) + 0.2 * random.standard_normal((n, states, states))
    root = 0.3 * random.standard_normal((n, states, states))
    system = System(move, root @ root.transpose(0, 2, 1), random.standard_normal((n, m, states)))
    start = np.diag([0.5, 0.1, 2.0])
    known = filtered(system, start)
    now, later = sampled(system, known, start, 40_000, random)

    def batch(last: int) -> np.ndarray:
        """Covariance of the states of all steps, measured up to `last`."""
        information = np.zeros((n * states, n * states))
        before = start
        for k in range(n):
            here = slice(k * states, (k + 1) * states)
            step = np.zeros((states, n * states))
            step[:, here] = np.eye(states)
            if k == 0:
                inverse = np.linalg.inv(system.move[0] @ before @ system.move[0].T + system.walk[0])
            else:
                step[:, (k - 1) * states : k * states] = -system.move[k]
                inverse = np.linalg.inv(system.walk[k])
            information += step.T @ inverse @ step
            if k <= last:
                information[here, here] += system.see[k].T @ system.see[k]
        return np.linalg.inv(information)

    for k in range(n):
        here = slice(k * states, (k + 1) * states)
        filter_sigma = np.sqrt(np.diag(batch(k)[here, here]))
        smoother_sigma = np.sqrt(np.diag(batch(n - 1)[here, here]))
        np.testing.assert_allclose(np.sqrt(np.diag(known.p[k])), filter_sigma, rtol=1e-6)
        np.testing.assert_allclose(now[k].std(axis=1), filter_sigma, rtol=0.02)
        np.testing.assert_allclose(later[k].std(axis=1), smoother_sigma, rtol=0.02)
        assert np.all(smoother_sigma <= filter_sigma * (1.0 + 1e-9))
    np.testing.assert_allclose(now[-1], later[-1])


@pytest.mark.parametrize(("c", "e"), [(1.6, 0.2), (1.3, 0.0), (1.7, -1.0)])
def test_slip_is_the_inverse_of_the_plants_magic_formula(c: float, e: float) -> None:
    used = np.linspace(-1.0, 1.0, 9)
    slip = slip_of(used, np.full(9, 22.0), np.full(9, 1.1), c, e)
    back = [np.sign(s) * magic_formula(22.0 * abs(s), 1.1, c, e) for s in slip]
    np.testing.assert_allclose(back, used, atol=1e-9)


def _drive(name: str) -> tuple[Drive, RecordArray, Trajectory]:
    loop = new_loop(shipped(name), configured(), seed=1)
    drive = run(loop)
    car = loop.sides.vehicle.params[0]
    return drive, car, trajectory_of(drive, car, counted(drive))


@pytest.mark.parametrize("name", ["stop-1", "stop-2", "blending-40"])
def test_the_linearised_car_is_the_simulated_one(name: str) -> None:
    drive, car, trajectory = _drive(name)
    rows = trajectory.counted
    found = shown(car, trajectory, np.zeros(N))[rows]
    # Within a tenth of the sensor's noise; a slip of 2 % has to be known to a hundredth of it.
    np.testing.assert_allclose(found[:, :4], trajectory.omega[rows], rtol=3e-4, atol=0.01)
    np.testing.assert_allclose(found[:, 4], trajectory.force[rows], atol=0.002)
    by = derivatives(car, trajectory)[rows]
    brakes = np.zeros(len(drive.t))
    for corner in CORNERS:
        brakes += drive.truth[f"brake_torque_{corner}"] / drive.truth[f"rolling_radius_{corner}"]
    n = len(trajectory.speed)
    per_mass = brakes[: 5 * n].reshape(n, 5).mean(axis=1)[rows] / car["mass"]
    np.testing.assert_allclose(by[:, 4, MU : MU + 4].sum(axis=1), -per_mass, rtol=0.002)
    # Speed and radius scale a wheel's speed; more mass at the same torque: less deceleration.
    np.testing.assert_allclose(by[:, :4, V] * trajectory.speed[rows, None], trajectory.omega[rows], rtol=1e-3)
    own = by[:, range(4), range(RADIUS, RADIUS + 4)]
    np.testing.assert_allclose(own, -trajectory.omega[rows], rtol=0.06)
    rolling = GRAVITY * car["rolling_resistance"]  # grows with the mass
    np.testing.assert_allclose(by[:, 4, MASS], -trajectory.force[rows] - rolling, atol=0.003)
    assert np.all(by[:, :, SLOPE] == 0.0)


def _trajectory(mu: np.ndarray) -> Trajectory:
    n = len(mu)
    zero, wheels = np.zeros(n), np.zeros((n, 4))
    counts = np.ones(n, np.bool_)
    return Trajectory(zero, wheels, zero, wheels, wheels, wheels, mu, wheels, wheels, zero, counts)


def test_how_friction_wanders() -> None:
    t = WINDOW_S * np.arange(4001)
    front = np.exp(0.05 / 0.7 * np.sin(0.7 * t))  # its rate is 0.05 cos(0.7 t)
    rear = np.exp(-0.10 / 0.7 * np.sin(0.7 * t))
    wander = wander_of(_trajectory(np.stack([front, front, rear, rear], axis=1)))
    expected = 0.5 * np.array([[0.05**2, -0.05 * 0.10], [-0.05 * 0.10, 0.10**2]])
    np.testing.assert_allclose(wander.covariance, expected, rtol=0.02)
    assert np.exp(-0.5 / wander.time) == pytest.approx(np.cos(0.7 * 0.5), rel=0.02)


def test_errors_count_as_in_observers() -> None:
    trajectory = _trajectory(np.tile([0.4, 0.4, 0.5, 0.5], (10, 1)))
    errors = np.zeros((10, N, 1))
    errors[:, MU] = 0.02  # of one front wheel
    errors[:, MU + 2 : MU + 4] = 0.03
    np.testing.assert_allclose(axle_errors(trajectory, errors)[:, 0], [2.0 / np.sqrt(2.0), 3.0])


@pytest.fixture(scope="module")
def stop() -> Bound:
    """The bound's priors are those of cars that differ little."""
    case = ACCURACY["stop #1"]
    nominal = case._replace(scenario=with_draw(case.scenario, "nominal"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(bound.ACCURACY, "stop #1", nominal)
        (found,) = bounds_of(0, ("stop #1",))
    return found


def test_whoever_knows_more_errs_less(stop: Bound) -> None:
    filters = {level: np.median(stop.limits[level].filter, axis=1) for level in LEVELS}
    smoothers = {level: np.median(stop.limits[level].smoother, axis=1) for level in LEVELS}
    for axle in (0, 1):
        learned, minutes, car, trajectory = (filters[level][axle] for level in LEVELS)
        assert 0.1 < car < minutes < learned < 5.0
        assert 0.1 < trajectory < minutes
        for level in LEVELS:
            assert smoothers[level][axle] < 1.02 * filters[level][axle]
    for axle in (0, 1):  # the observer is a filter too, and not a bad one
        assert 0.5 < stop.joint[axle] / filters["ten minutes"][axle] < 3.0


def test_the_table_tells_what_a_goal_would_take(monkeypatch: pytest.MonkeyPatch) -> None:
    case = "stop #1"
    monkeypatch.setattr(bound, "ACCURACY", {case: ACCURACY[case]._replace(adapted=(0.8, 0.9))})

    def verdicts(joint: float, minutes: float, car: float, trajectory: float) -> tuple[str, str]:
        of = dict(zip(LEVELS, (9.0, minutes, car, trajectory), strict=True))
        limits = {level: Limit(*np.full((2, 2, 3), value)) for level, value in of.items()}
        (line,) = bound_table([[Bound(case, (joint, joint), limits)]]).rows
        return line[-2], line[-1]

    assert verdicts(0.84, 2.0, 2.0, 2.0) == ("met", "met")
    assert verdicts(0.86, 0.7, 2.0, 2.0) == ("yes", "met")
    assert verdicts(2.0, 0.9, 0.8, 2.0) == ("with the car known", "yes")
    assert verdicts(2.0, 1.0, 1.0, 0.7) == ("with the change known", "with the change known")
    assert verdicts(2.0, 1.0, 1.0, 0.9) == ("no", "with the change known")
