"""The fit that noise of the regressors does not attenuate: slopes, sigma, priors and outliers."""

import numpy as np
import pytest

from brakelab.identify.vehicle.fit import Prior, Residuals, fit

WIDE = Prior(np.zeros(2), np.full(2, 10.0))


def line(seed: int, noise_x: float, n: int = 400, per_cluster: int = 8, shared: float = 0.0):
    """Return residuals of y = 2 x + 1 with both halves of x and y noisy."""
    random = np.random.default_rng(seed)
    true = random.normal(0.0, 1.0, n)
    x = true + noise_x * random.standard_normal((2, n))
    cluster = np.arange(n) // per_cluster
    common = shared * random.standard_normal(cluster.max() + 1)[cluster]
    y = 2.0 * true + 1.0 + common + 0.3 * random.standard_normal((2, n))

    def of(theta, half):
        return y[half] - theta[0] * x[half] - theta[1]

    return Residuals(of, np.zeros(n, np.int64), cluster, np.full(n, 0.1)), x, y


@pytest.mark.parametrize("noise", [0.0, 0.3, 0.7, 1.0])
def test_noise_of_a_regressor_attenuates_no_slope(noise):
    found, usual = [], []
    for seed in range(30):
        residuals, x, y = line(seed, noise)
        found.append(fit(residuals, WIDE).theta[0])
        usual.append(np.polyfit(x.mean(axis=0), y.mean(axis=0), 1)[0])
    assert np.mean(found) == pytest.approx(2.0, abs=3.5 * np.std(found) / np.sqrt(30) + 0.01)
    assert np.mean(usual) == pytest.approx(2.0 / (1.0 + noise**2 / 2.0), abs=0.03)  # attenuation, closed form


@pytest.mark.parametrize("shared", [0.0, 0.8])
def test_sigma_holds_errors_that_a_manoeuvre_shares(shared):
    z = []
    for seed in range(60):
        found = fit(line(seed, 0.3, shared=shared)[0], WIDE)
        z.append((found.theta - [2.0, 1.0]) / found.sigma)
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert np.all((rms > 0.4) & (rms < 1.35)), rms  # rather too wide: it is never less than the weights say


def test_sigma_of_a_slope_that_few_manoeuvres_tell_is_that_of_the_jackknife():
    """Five brakings of unequal strength, each with a slope of its own: beside fits that leave one out."""
    own = 2.0 + 0.1 * np.array([-1.0, 0.9, -0.4, 0.6, -0.5])
    cluster = np.repeat(np.arange(5), 40)
    x = np.tile(np.linspace(-1.0, 1.0, 40), 5) * np.array([1.0, 1.2, 1.0, 1.5, 2.0])[cluster]
    y = own[cluster] * x + 1.0

    def of(theta, half):
        return y - theta[0] * x - theta[1]

    found = fit(Residuals(of, 0 * cluster, cluster, np.full(len(x), 0.01)), WIDE)
    whole = np.polyfit(x, y, 1)[0]
    without = [np.polyfit(x[cluster != g], y[cluster != g], 1)[0] for g in range(5)]
    assert found.theta[0] == pytest.approx(whole, abs=0.01)
    assert found.sigma[0] == pytest.approx(np.sqrt(0.8 * np.sum((np.array(without) - whole) ** 2)), rel=0.1)


def test_a_prior_holds_what_the_residuals_do_not_show():
    residuals, _, _ = line(1, 0.0)
    blind = Residuals(lambda theta, half: residuals.of(theta[:2], half), *residuals[1:])
    found = fit(blind, Prior(np.array([0.0, 0.0, 3.0, 4.0]), np.array([10.0, 10.0, 0.5, 0.0])))
    assert found.theta[2:] == pytest.approx([3.0, 4.0])
    assert found.sigma[2:] == pytest.approx([0.5, 0.0])
    assert found.theta[0] == pytest.approx(2.0, abs=0.05)


def test_outliers_hardly_count():
    residuals, _, y = line(2, 0.0)
    y[:, ::25] += 20.0
    assert fit(residuals, WIDE).theta == pytest.approx([2.0, 1.0], abs=0.12)


def test_a_curve_is_fitted_too():
    random = np.random.default_rng(3)
    x = np.linspace(0.0, 3.0, 200)
    y = 4.0 * np.exp(-0.7 * x) + 0.05 * random.standard_normal((2, 200))
    cluster = np.arange(200) // 5
    residuals = Residuals(
        lambda theta, half: y[half] - np.exp(theta[0] - np.exp(theta[1]) * x),
        0 * cluster,
        cluster,
        np.full(200, 0.01),
    )
    found = fit(residuals, Prior(np.zeros(2), np.ones(2)))
    assert np.exp(found.theta) == pytest.approx([4.0, 0.7], rel=0.02)
