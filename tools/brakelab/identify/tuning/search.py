"""The genetic algorithm of section 6.2.1 over the noise of Observer 2 (thesis, reference [90]).

Genes, as in the thesis: the three components of the process covariance and the variance of the virtual force
sensor; the wheel encoder's variance stays that of its white noise. Beyond the thesis the forgetting factor of
K_f (4.20), as 1 - factor. All are searched on logarithmic axes, a decade or more to either side of the
shipped values. The relaxation length belongs to the tyre and is not searched.

Fitness is the mean nRMSE of front and rear. The first population contains the initial tuning, and the best
half of parents and children survives: no generation is worse than the one before.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.evaluator import Evaluator
from pymoo.core.problem import Problem
from pymoo.problems.static import StaticProblem

from brakelab.identify.tuning.recording import Errors
from brakelab.simulation.configured import with_observer
from ecu.settings.config import Config

RANGES: Final = {
    "omega_walk": (0.2, 20.0),
    "force_walk": (0.01, 10.0),
    "mu_drift": (0.002, 0.2),
    "time_correlation": (0.1, 100.0),
    "rls_forgetting": (0.1, 0.995),
}
"""Where each key of [observer] is searched."""
DIGITS: Final = 4
"""Significant digits of a tuned value, so that a file can hold exactly the value tried."""


class Best(NamedTuple):
    """The best tuning so far."""

    config: Config
    errors: Errors


Judge = Callable[[Sequence[Config]], Sequence[Errors]]


def fitness(errors: Errors) -> float:
    """Return the mean nRMSE of front and rear [%]."""
    return float(np.mean(errors.nrmse))


def genes(values: Sequence[float]) -> NDArray[np.float64]:
    """Return the positions of values of `RANGES` on the logarithmic axes, shape (5,)."""
    return np.log10(
        [1.0 - x if key == "rls_forgetting" else x for key, x in zip(RANGES, values, strict=True)]
    )


def tuned(config: Config, place: NDArray[np.float64]) -> Config:
    """Return `config` with the tuning at a position on the logarithmic axes, shape (5,)."""
    values = dict(zip(RANGES, 10.0**place, strict=True))
    values["rls_forgetting"] = 1.0 - values["rls_forgetting"]
    rounded = {key: float(f"{value:.{DIGITS}g}") for key, value in values.items()}
    return with_observer(config, None, **rounded)


def search(best: Best, judge: Judge, generations: int, population: int, seed: int) -> Iterator[Best]:
    """Yield the best tuning after each generation, starting with `best`."""
    limits = np.array([genes(limit) for limit in zip(*RANGES.values(), strict=True)])
    low, high = limits.min(axis=0), limits.max(axis=0)
    random = np.random.default_rng(seed)
    start = genes([getattr(best.config.observer, key) for key in RANGES])
    first = random.uniform(low, high, (population, len(RANGES)))
    first[0] = np.clip(start, low, high)
    problem = Problem(n_var=len(RANGES), n_obj=1, xl=low, xu=high)
    algorithm = GA(pop_size=population, sampling=first)
    algorithm.setup(problem, termination=("n_gen", generations), seed=seed)
    while algorithm.has_next():
        trials = algorithm.ask()
        configs = [tuned(best.config, place) for place in trials.get("X")]
        errors = judge(configs)
        scores = np.array([fitness(each) for each in errors])
        Evaluator().eval(StaticProblem(problem, F=scores[:, None]), trials)
        algorithm.tell(infills=trials)
        leader = int(np.argmin(scores))
        if scores[leader] < fitness(best.errors):
            best = Best(configs[leader], errors[leader])
        yield best
