import numpy as np
import pytest

from brakelab.simulation.campaigns import instruments as own


def test_a_weighing_errs_by_noise_moisture_and_gain():
    random = np.random.default_rng(1)
    errors = np.array([own.weigh(np.full(2, 400.0), random) - 400.0 for _ in range(4000)])
    noise = np.hypot(own.BALANCE_NOISE, own.MOISTURE)
    assert np.std(errors[:, 0] - errors[:, 1]) == pytest.approx(np.sqrt(2.0) * noise, rel=0.05)
    assert np.std(errors.sum(axis=1)) == pytest.approx(
        np.hypot(np.sqrt(2.0) * noise, 800.0 * own.BALANCE_GAIN), rel=0.05
    )


def test_points_of_a_day_share_a_zero():
    random = np.random.default_rng(2)
    errors = np.array([own.measure_points(np.zeros((2, 6)), random) for _ in range(3000)])
    assert np.std(errors) == pytest.approx(np.hypot(own.POINT_NOISE, own.POINT_ZERO), rel=0.05)
    means = errors.mean(axis=2)
    assert np.std(means) == pytest.approx(np.hypot(own.POINT_NOISE / np.sqrt(6.0), own.POINT_ZERO), rel=0.05)
    assert abs(np.corrcoef(means.T)[0, 1]) < 0.06


def test_a_workshop_keeps_its_gauge():
    gauges = [own.workshop_gauge(np.random.default_rng(seed)) for seed in range(500)]
    means = np.array([np.mean([gauge(np.zeros(4)) for _ in range(100)]) for gauge in gauges])
    assert np.std(means) == pytest.approx(own.WORKSHOP_ZERO, rel=0.1)
