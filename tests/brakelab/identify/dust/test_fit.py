"""Judging emission models: intervals that hold what they say, sums that are not medians, KPIs by hand."""

import numpy as np
import pytest

pytest.importorskip("sklearn", reason="needs scikit-learn (extra learn)")

from brakelab.arrays import Array
from brakelab.identify.dust.features import Applications, Background
from brakelab.identify.dust.fit import (
    Judged,
    choose,
    conformal,
    inside_of,
    judge,
    judge_all,
    kpis,
    ranges,
    spearman,
)
from brakelab.identify.dust.model import Model, Samples, fit_law

pytestmark = pytest.mark.study

SCATTER = 0.25  # of EF
NONE = Background(0.0, 0.0, np.empty(0), np.empty(0), np.empty(0))


def trips(seed: int, count: int = 8, n: int = 100, scatter: float = SCATTER) -> list[Applications]:
    random = np.random.default_rng(seed)
    made = []
    for number in range(count):
        v_in, torque = random.uniform(5, 33, n), random.uniform(60, 700, n)
        heat, duration = random.uniform(10, 130, n), random.uniform(1, 15, n)
        features = np.column_stack([v_in, 0.5 * v_in, torque, heat, duration, torque / 30])
        work = torque * 0.75 * v_in * duration
        factor = 5.0 + 0.9 * np.log10(work) + 0.5 * np.log10(0.75 * v_in) + scatter * random.normal(size=n)
        made.append(
            Applications(
                str(number), number == count - 1, 90.0, np.arange(n), features, np.zeros((n, 37)),
                10.0**factor, work / 0.33, np.ones(n), NONE, 2.0,
            )
        )  # fmt: skip
    return made


def test_a_winter_trip_is_within_what_it_was_trained_on():
    """Discs below 0 °C are in the range of a model that has seen them; other features are never below 0."""
    made = trips(3)[:2]
    made[0].features[:, 3] -= 25.0
    low, high = ranges(made)
    assert low[3] < made[0].features[:, 3].min() < 0.0
    assert (low[[0, 1, 2, 4, 5]] > 0.0).all()
    assert inside_of(made[0].features, (low, high)).all()


def test_models_are_trained_by_one_thread(monkeypatch: pytest.MonkeyPatch):
    """Threads that wait for each other beside four other programs took 136 s for 14 s."""
    from threadpoolctl import threadpool_info

    threads: list[int] = []

    def fit(samples: Samples, seed: int) -> Model:
        threads.extend(pool["num_threads"] for pool in threadpool_info())
        return fit_law(samples, seed)

    monkeypatch.setattr("brakelab.identify.dust.fit.FITS", {"law": fit})
    judge_all(trips(1)[:4], [])
    assert set(threads) == {1}


def test_conformal_intervals_hold_95_percent():
    """Of a skewed residual; over seeds, the mean share within four standard errors."""
    shares = []
    for seed in range(200):
        random = np.random.default_rng(seed)
        low, high = conformal(random.gumbel(0.0, 0.3, 300))
        fresh = random.gumbel(0.0, 0.3, 300)
        shares.append(np.mean((fresh >= low) & (fresh <= high)))
    error = np.std(shares) / np.sqrt(len(shares))
    print(np.mean(shares), error)
    assert abs(np.mean(shares) - 0.95) < 4 * error + 0.003


def test_the_factor_is_the_mean_over_the_median():
    """Of a log-normal number: exp(sigma^2 / 2)."""
    factors = [judge("monotone law", trips(seed)[:7], []).factor for seed in range(6)]
    expected = np.exp(0.5 * (np.log(10.0) * SCATTER) ** 2)
    assert np.mean(factors) == pytest.approx(expected, rel=0.03)


def test_a_sum_of_medians_is_too_small():
    """Which is how Table 8.2 looks; with the factor it is right on the mean."""
    with_factor, without = [], []
    for seed in range(20):
        made = trips(seed)
        one = judge("monotone law", made[:7], made[7:])
        assert one.test is not None
        with_factor.append(one.test.sum_error)
        without.append((1.0 + one.test.sum_error) / one.factor - 1.0)
    error = np.std(with_factor) / np.sqrt(len(with_factor))
    print(np.mean(with_factor), np.mean(without), error)
    assert np.mean(without) < -0.10
    assert abs(np.mean(with_factor)) < 4 * error


def test_kpis_are_those_of_table_8_3():
    made = trips(1, 2)[1:]
    trip = made[0]
    ef = np.log10(trip.particles) - 0.1
    found = kpis(made, Model(lambda features, sequences: ef, 0), 1.0, (0.05, 0.15), ranges(made))
    said = 10.0**ef
    assert found.sum_error == pytest.approx(10**-0.1 - 1.0)
    assert found.vaf == pytest.approx(1.0 - np.var(trip.particles - said) / np.var(trip.particles))
    assert found.nrmse == pytest.approx(0.1 / np.mean(np.log10(trip.particles)))
    assert (found.covered, found.known) == (1.0, 1.0)


def test_what_lies_outside_is_stated_by_its_work():
    made = trips(2, 2)
    features = made[1].features.copy()
    features[:10, 3] = 400.0  # degC
    test = [made[1]._replace(features=features)]
    model = Model(lambda features, sequences: np.log10(test[0].particles), 0)
    found = kpis(test, model, 1.0, (-1.0, 1.0), ranges(made[:1]))
    assert found.known <= 1.0 - test[0].energy[:10].sum() / test[0].energy.sum() + 1e-9


def test_the_best_on_trips_left_out_that_runs_on_board_is_chosen():
    def judged(name: str, root: float, on_board: int | None) -> Judged:
        return Judged(name, Model(lambda f, s: f, 0, on_board), 0.0, 1.0, -1.0, 1.0, 0.1, 0.1, root, None)

    found = choose([judged("a", 0.3, 1), judged("b", 0.2, None), judged("c", 0.25, 2)])
    assert found.name == "c"


def test_a_model_of_the_dirtiest_applications_comes_before_one_of_the_others(monkeypatch: pytest.MonkeyPatch):
    """The tenth that emits most makes a third of the particles; a mean of EF hardly sees it."""
    made = trips(5, scatter=0.0)[:4]
    border = np.quantile(np.concatenate([trip.factor for trip in made]), 0.9)

    def off(clean: float, dirty: float) -> Model:
        def predict(features: Array, sequences: Array) -> Array:
            v_in, _, torque, _, duration, _ = features.T
            factor = 5.0 + 0.9 * np.log10(torque * 0.75 * v_in * duration) + 0.5 * np.log10(0.75 * v_in)
            return factor + np.where(factor < border, clean, dirty)

        return Model(predict, 0, 0)

    models = {"right when dirty": off(0.15, 0.0), "right when clean": off(0.0, -0.4)}
    fits = {name: lambda samples, seed, model=model: model for name, model in models.items()}
    monkeypatch.setattr("brakelab.identify.dust.fit.FITS", fits)
    dirty, clean = judge_all(made, [])
    assert clean.left_out_rms < dirty.left_out_rms
    assert choose([clean, dirty]) is dirty


def test_rank_correlations_do_not_depend_on_scale():
    names, matrix = spearman(trips(3, scatter=0.0))
    energy, ef = names.index("E_b"), names.index("EF")
    assert matrix[energy, ef] > 0.9
    assert np.diag(matrix) == pytest.approx(np.ones(len(names)))
    assert abs(matrix[names.index("τ"), ef]) < 0.15
