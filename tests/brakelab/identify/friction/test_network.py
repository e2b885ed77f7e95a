"""The network: its gradient against finite differences, and that it learns what it can and no noise."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from brakelab.identify.friction.network import loss, train


def test_back_propagation_is_the_derivative() -> None:
    random = np.random.default_rng(0)
    x, y = random.standard_normal((30, 3)), random.standard_normal(30)
    shapes = ((4, 8), (9, 6), (7, 1))
    weights = random.standard_normal(sum(a * b for a, b in shapes))
    _, gradient = loss(weights, shapes, x, y)
    numeric = approx_fprime(weights, lambda w: loss(w, shapes, x, y)[0], 1e-7)
    assert gradient == pytest.approx(numeric, abs=1e-5)


def test_a_curved_surface_is_learned() -> None:
    random = np.random.default_rng(1)
    inputs = random.uniform((2.0, 10e5, 50.0), (15.0, 80e5, 300.0), (3000, 3))
    speed, pressure, temperature = inputs.T
    truth = 0.4 + 0.05 * np.sin(temperature / 60.0) + 2e-9 * pressure - 0.002 * speed
    group = np.repeat(np.arange(60), 50)
    network = train(inputs, truth + 0.01 * random.standard_normal(3000), group, 0)
    other = random.uniform((3.0, 15e5, 60.0), (14.0, 75e5, 290.0), (500, 3))
    expected = 0.4 + 0.05 * np.sin(other[:, 2] / 60.0) + 2e-9 * other[:, 1] - 0.002 * other[:, 0]
    assert float(np.sqrt(np.mean((network(other) - expected) ** 2))) < 0.004


def test_noise_is_not_learned() -> None:
    random = np.random.default_rng(2)
    inputs, output = random.standard_normal((400, 3)), random.standard_normal(400)
    network = train(inputs, output, np.repeat(np.arange(40), 10), 0)
    assert np.std(network(inputs)) < 0.6
