"""The network: its gradient against finite differences, and that it learns what it can and no noise."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from brakelab.identify.friction.network import loss, train, train_best
from brakelab.identify.friction.static_candidates import trained_network
from brakelab.identify.friction.stops import Stops, block_inputs
from brakelab.plant.friction.law import RigBrake
from brakelab.plant.friction.laws import friction, law_row


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


def test_the_best_of_four_starts_is_taken(stops: Stops) -> None:
    inputs = block_inputs(stops)
    every = [train(inputs, stops.mu, stops.block_stop, 0, start) for start in range(4)]
    best, agreed = train_best(inputs, stops.mu, stops.block_stop, 0)
    assert best.aside == min(one.aside for one in every)
    assert len({one.aside for one in every}) == 4
    assert agreed == sum(one.aside <= 1.05 * best.aside for one in every)


def test_the_law_of_the_plant_is_the_trained_network(stops: Stops) -> None:
    """Within what it was trained on; beyond, what it is at the edge."""
    candidate = trained_network(1000.0)
    assert candidate.train is not None
    law = candidate.law(candidate.train(stops, 0).values)
    brake = RigBrake(piston_area=2.8e-3, pad_area=7e-3, effective_radius=0.15, tyre_radius=0.36)
    number, row = law_row(law, brake)
    inputs = block_inputs(stops)
    network, _ = train_best(inputs, stops.mu, stops.block_stop, 0)
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    tried = np.vstack([inputs[::97], low - 0.2 * (high - low), high + 0.2 * (high - low)])
    found = [friction(number, row, 0.3, p, v, 1.0, heat, 0.01) for v, p, heat in tried]
    assert [mu for _, mu in found] == pytest.approx(network(np.clip(tried, low, high)), rel=1e-9)
    assert {memory for memory, _ in found} == {0.3}
