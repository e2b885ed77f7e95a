"""Trains the network of `plant/friction/network.py` (2.3, Figure 2.5).

Inputs and output are standardised. Trained by L-BFGS on the squared error; a fifth of the groups is kept
aside, and training ends when their error has not fallen for 20 iterations (early stopping). Of
several initialisations, with the same groups aside, the one of least error there is taken.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from brakelab.arrays import Matrix, Vector
from brakelab.plant.friction.network import HIDDEN

PATIENCE: Final = 20  # iterations
ITERATIONS: Final = 500
ASIDE: Final = 0.2
STARTS: Final = 4
AGREES: Final = 1.05  # of the least error aside, up to which another start agrees


class Network(NamedTuple):
    """A trained network."""

    weights: Vector
    shapes: tuple[tuple[int, int], ...]
    middle: Vector  # of inputs, then output
    scale: Vector
    aside: float
    """Root mean square of the error of those kept aside."""

    def __call__(self, inputs: Matrix) -> Vector:
        """Return the output, shape (rows,), at `inputs`, shape (rows, inputs)."""
        scaled = (inputs - self.middle[:-1]) / self.scale[:-1]
        out: Vector = _forward(_layers(self.weights, self.shapes), scaled)[-1][:, 0]
        back: Vector = out * self.scale[-1] + self.middle[-1]
        return back


def train_best(inputs: Matrix, output: Vector, group: NDArray[np.int64], seed: int) -> tuple[Network, int]:
    """Return the best of STARTS networks, see `train`, and how many are as good."""
    found = [train(inputs, output, group, seed, start) for start in range(STARTS)]
    best = min(found, key=lambda network: network.aside)
    return best, sum(network.aside <= AGREES * best.aside for network in found)


def train(
    inputs: Matrix, output: Vector, group: NDArray[np.int64], seed: int, initialisation: int = 0
) -> Network:
    """Return the network that gives `output`, shape (rows,), from `inputs`, shape (rows, inputs).

    `group`, shape (rows,): rows of one group are kept aside together, drawn by `seed`.
    """
    random = np.random.default_rng(seed)
    groups = np.unique(group)
    aside = np.isin(group, random.choice(groups, max(round(ASIDE * len(groups)), 1), replace=False))
    whole = np.column_stack([inputs, output])
    middle, scale = whole.mean(axis=0), np.maximum(whole.std(axis=0), 1e-12)
    scaled = (whole - middle) / scale
    x, y = scaled[~aside, :-1], scaled[~aside, -1]
    x_aside, y_aside = scaled[aside, :-1], scaled[aside, -1]
    sizes = (inputs.shape[1], *HIDDEN, 1)
    shapes = tuple((sizes[k] + 1, sizes[k + 1]) for k in range(len(sizes) - 1))
    if initialisation:
        random = np.random.default_rng([seed, initialisation])
    start = np.concatenate([random.standard_normal(a * b) / np.sqrt(a) for a, b in shapes])
    best, since, kept = np.inf, 0, start

    def watch(weights: Vector) -> None:
        nonlocal best, since, kept
        error = float(np.mean((_forward(_layers(weights, shapes), x_aside)[-1][:, 0] - y_aside) ** 2))
        if error < best:
            best, since, kept = error, 0, weights.copy()
        else:
            since += 1
        if since >= PATIENCE:
            raise StopIteration

    minimize(
        lambda w: loss(w, shapes, x, y),
        start,
        jac=True,
        method="L-BFGS-B",
        callback=watch,
        options={"maxiter": ITERATIONS},
    )
    return Network(kept, shapes, middle, scale, float(np.sqrt(best) * scale[-1]))


def loss(weights: Vector, shapes: tuple[tuple[int, int], ...], x: Matrix, y: Vector) -> tuple[float, Vector]:
    """Return the mean squared error and its gradient by back-propagation."""
    layers = _layers(weights, shapes)
    values = _forward(layers, x)
    off = values[-1][:, 0] - y
    back = (2.0 / len(y)) * off[:, None]
    gradients = []
    for place in range(len(layers) - 1, -1, -1):
        before = values[place]
        gradients.append(np.vstack([before.T @ back, back.sum(axis=0)]))
        if place:
            back = (back @ layers[place][:-1].T) * before * (1.0 - before)
    return float(np.mean(off**2)), np.concatenate([g.ravel() for g in reversed(gradients)])


def _layers(weights: Vector, shapes: tuple[tuple[int, int], ...]) -> list[Matrix]:
    ends = np.cumsum([a * b for a, b in shapes])
    return [part.reshape(shape) for part, shape in zip(np.split(weights, ends[:-1]), shapes, strict=True)]


def _forward(layers: list[Matrix], x: Matrix) -> list[Matrix]:
    """Return the values of all layers, the inputs first; the last row of a layer is its bias."""
    values = [x]
    for place, layer in enumerate(layers):
        total = values[-1] @ layer[:-1] + layer[-1]
        values.append(total if place == len(layers) - 1 else 1.0 / (1.0 + np.exp(-np.clip(total, -50, 50))))
    return values
