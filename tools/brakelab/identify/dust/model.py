"""Emission models of one brake: on board (table, static network, law) and in the laboratory (dynamic network,
gradient boosting).

Each is fitted to EF = log10 of the particles of an application. Applications with a large share of background
have less weight. Before a network is trained, applications are resampled so that every emission factor is as
frequent as the others (Figure 8.4).
"""

import warnings
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from brakelab.arrays import Array
from brakelab.identify.dust.features import Applications
from ecu.algorithm.monitoring.emission_factor import (
    PRESSURE,
    V_IN,
    emission_factors,
    law_term,
    network_input,
    node_below,
)
from ecu.contract.dust import HIDDEN, INPUTS, KNOTS, LAW, LAW_TERMS, NETWORK, NODES, TABLE

Predictor = Callable[[Array, Array], Array]
"""EF, shape (n,), of features, shape (n, 6), and sequences, shape (n, ·)."""

LEAST_PARTICLES: Final = 2e7  # particles: fewer are indistinguishable from the background
SCATTER: Final = 0.2  # of EF, application by application
BACKGROUND_ERROR: Final = 1e8  # particles, error of an application by the background
SMOOTH: Final = 0.3  # weight of the table's bends
EVENLY: Final = 0.4  # of EF: width of the classes made equally frequent
FEWEST_OF_CLASS: Final = 5  # of a class: a smaller one is not resampled
SHRINK: Final = 0.01  # of a network's weights, per application
SHRINK_DYNAMIC: Final = 0.03
HIDDEN_DYNAMIC: Final = 10
FEWEST_HOT: Final = 10  # applications above a knot


class Samples(NamedTuple):
    """Applications whose particles are known; n rows."""

    features: Array
    sequences: Array
    factor: Array
    weight: Array


class Model(NamedTuple):
    """A fitted model."""

    predict: Predictor
    size: int
    """Numbers to be stored (Table 8.3)."""
    on_board: int | None = None
    numbers: Array = np.empty(0)


def samples_of(trips: list[Applications]) -> Samples:
    """Return the applications of `trips` distinguishable from the background, with their weights."""
    features, sequences, particles, energy = (
        np.concatenate([getattr(trip, name) for trip in trips])
        for name in ("features", "sequences", "particles", "energy")
    )
    known = particles > LEAST_PARTICLES
    factor, work = np.log10(particles[known]), np.log10(energy[known])
    # By the count expected from work: weighting by the count itself would favour upward scatter.
    expected = 10.0 ** np.polyval(np.polyfit(work, factor, 1), work)
    weight = 1.0 / (SCATTER**2 + (BACKGROUND_ERROR / (np.log(10.0) * expected)) ** 2)
    return Samples(features[known], sequences[known], factor, weight / weight.mean())


def _on_board(model: int, numbers: Array) -> Model:
    def predict(features: Array, sequences: Array) -> Array:
        out = np.zeros(len(features))
        emission_factors(model, numbers, np.ascontiguousarray(features), out)
        return out

    return Model(predict, len(numbers), model, numbers)


def fit_law(samples: Samples, seed: int) -> Model:
    """Return the monotone law: least squares without negative coefficients."""
    terms = np.array([[law_term(row, k) for k in range(LAW_TERMS)] for row in samples.features])
    hot = [np.count_nonzero(samples.features[:, 3] > knot) >= FEWEST_HOT for knot in KNOTS]
    terms *= np.array([True] * (LAW_TERMS - len(KNOTS)) + hot)
    middle = np.average(terms, axis=0, weights=samples.weight)
    level = float(np.average(samples.factor, weights=samples.weight))
    root = np.sqrt(samples.weight)
    found, _ = nnls(root[:, None] * (terms - middle), root * (samples.factor - level))
    return _on_board(LAW, np.concatenate([[level - found @ middle], found]))


def fit_table(samples: Samples, seed: int) -> Model:
    """Return the map over speed and pressure [38], its nodes at quantiles, its bends regularised."""
    axes = [
        _rising(np.quantile(samples.features[:, i], np.linspace(0.0, 1.0, NODES))) for i in (V_IN, PRESSURE)
    ]
    nodes = np.concatenate(axes)
    rows = []
    for row in samples.features:
        (i, a), (j, b) = node_below(nodes, 0, row[V_IN]), node_below(nodes, NODES, row[PRESSURE])
        weights = np.zeros((NODES, NODES))
        weights[i : i + 2, j : j + 2] = np.outer((1.0 - a, a), (1.0 - b, b))
        rows.append(weights.ravel())
    bend = np.diff(np.eye(NODES), 2, axis=0)
    bends = np.concatenate([np.kron(bend, np.eye(NODES)), np.kron(np.eye(NODES), bend)])
    penalty = SMOOTH * np.sqrt(len(rows) / len(bends))
    left = np.concatenate([np.array(rows), penalty * bends])
    values = np.linalg.lstsq(left, np.concatenate([samples.factor, np.zeros(len(bends))]), rcond=None)[0]
    return _on_board(TABLE, np.concatenate([nodes, values]))


def _rising(nodes: Array) -> Array:
    return np.maximum.accumulate(nodes + 1e-6 * np.arange(len(nodes)))


def resample(factor: Array, seed: int) -> NDArray[np.int64]:
    """Return places, shape (n,), drawn so that all classes of EF are about as frequent (Figure 8.4)."""
    classes = np.floor((factor - factor.min()) / EVENLY).astype(int)
    share = 1.0 / np.maximum(np.bincount(classes)[classes], FEWEST_OF_CLASS)
    random = np.random.default_rng(seed)
    return random.choice(len(factor), len(factor), p=share / share.sum())


def _trained(inputs: Array, output: Array, hidden: int, shrink: float, seed: int) -> Any:
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPRegressor

    net = MLPRegressor(
        hidden_layer_sizes=(hidden,), activation="tanh", solver="lbfgs", alpha=shrink * len(output),
        max_iter=500, tol=1e-5, random_state=seed,
    )  # fmt: skip
    with warnings.catch_warnings():  # it is stopped early as regularisation; left-out trips judge it
        warnings.simplefilter("ignore", ConvergenceWarning)
        return net.fit(inputs, output)


def _scales(values: Array) -> tuple[Array, Array]:
    """Return offset and divisor that scale values to -1 to 1."""
    low, high = values.min(axis=0), values.max(axis=0)
    return 0.5 * (low + high), np.maximum(0.5 * (high - low), 1e-9)


def fit_network(samples: Samples, seed: int) -> Model:
    """Return the static network of (8.2)."""
    inputs = np.array([[network_input(row, i) for i in range(INPUTS)] for row in samples.features])
    centre, half = _scales(inputs)
    level, spread = float(samples.factor.mean()), float(samples.factor.std())
    some = resample(samples.factor, seed)
    net = _trained(
        (inputs[some] - centre) / half, (samples.factor[some] - level) / spread, HIDDEN, SHRINK, seed
    )
    hidden = np.column_stack([net.coefs_[0].T, net.intercepts_[0]]).ravel()
    out = np.append(net.coefs_[1].ravel(), net.intercepts_[1])
    return _on_board(NETWORK, np.concatenate([centre, half, [level, spread], hidden, out]))


def fit_dynamic(samples: Samples, seed: int) -> Model:
    """Return the dynamic network of (8.3)."""
    centre, half = _scales(samples.sequences)
    level, spread = float(samples.factor.mean()), float(samples.factor.std())
    some = resample(samples.factor, seed)
    net = _trained(
        (samples.sequences[some] - centre) / half, (samples.factor[some] - level) / spread,
        HIDDEN_DYNAMIC, SHRINK_DYNAMIC, seed,
    )  # fmt: skip

    def predict(features: Array, sequences: Array) -> Array:
        return np.asarray(level + spread * net.predict((sequences - centre) / half))

    size = sum(part.size for part in (*net.coefs_, *net.intercepts_)) + 2 * len(centre) + 2
    return Model(predict, size)


def fit_boosting(samples: Samples, seed: int) -> Model:
    """Return gradient boosted trees; more speed, torque, heat or time never emits less."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    trees = HistGradientBoostingRegressor(
        max_iter=200, learning_rate=0.05, max_leaf_nodes=8, min_samples_leaf=15, l2_regularization=1.0,
        monotonic_cst=[1, 0, 1, 1, 1], random_state=seed,
    )  # fmt: skip
    trees.fit(samples.features[:, :INPUTS], samples.factor)
    size = sum(3 * len(tree.nodes) for stage in trees._predictors for tree in stage)
    return Model(lambda features, sequences: np.asarray(trees.predict(features[:, :INPUTS])), size)


FITS: Final[dict[str, Callable[[Samples, int], Model]]] = {
    "LUT": fit_table,
    "static ANN": fit_network,
    "dynamic ANN": fit_dynamic,
    "gradient boosting": fit_boosting,
    "monotone law": fit_law,
}
