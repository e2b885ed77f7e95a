"""The genetic algorithm on a fitness whose best tuning is known."""

from collections.abc import Sequence

import numpy as np
import pytest

from brakelab.identify.tuning.recording import Errors
from brakelab.identify.tuning.search import RANGES, Best, fitness, genes, search, tuned
from ecu.settings.config import Config, Observer
from ecu.settings.resources import resource

GOAL = {
    "omega_walk": 5.0,
    "force_walk": 0.3,
    "mu_drift": 0.05,
    "time_correlation": 1.0,
    "rls_forgetting": 0.8,
}


def values(config: Config) -> list[float]:
    return [getattr(config.observer, key) for key in RANGES]


def judge(configs: Sequence[Config]) -> list[Errors]:
    """1 % at GOAL, and as much more as it is decades away."""
    away = [np.linalg.norm(genes(values(config)) - genes(list(GOAL.values()))) for config in configs]
    return [Errors(np.array([1.0 + d, 1.0 + 2.0 * d]), np.full(2, 95.0)) for d in away]


def found(manual: Config, seed: int, generations: int = 25) -> list[Best]:
    return list(search(Best(manual, judge([manual])[0]), judge, generations, 30, seed))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_best_tuning_is_found(manual: Config, seed: int) -> None:
    best = found(manual, seed)
    scores = [fitness(each.errors) for each in best]
    assert scores == sorted(scores, reverse=True), "no generation is worse than the one before"
    assert fitness(judge([manual])[0]) > 2.2
    assert scores[-1] < 1.3


def test_the_same_seed_finds_the_same_and_another_seed_another(manual: Config) -> None:
    one, again, other = (values(found(manual, seed, 3)[-1].config) for seed in (4, 4, 5))
    assert one == again
    assert one != other


def test_what_is_written_with_four_digits_is_what_was_tried(manual: Config) -> None:
    best = found(manual, 0, 3)[-1]
    assert [float(f"{value:.4g}") for value in values(best.config)] == values(best.config)
    assert judge([best.config])[0].nrmse == pytest.approx(best.errors.nrmse, rel=1e-12)


def test_only_the_searched_keys_change_and_stay_in_their_ranges(manual: Config) -> None:
    best = found(manual, 1, 3)[-1].config
    for key, (low, high) in RANGES.items():
        assert low <= getattr(best.observer, key) <= high
    rest = set(type(manual.observer).model_fields) - set(RANGES)
    assert all(getattr(best.observer, key) == getattr(manual.observer, key) for key in rest)


def test_a_start_that_nothing_beats_is_kept(manual: Config) -> None:
    perfect = manual.model_copy(update={"observer": manual.observer.model_copy(update=GOAL)})
    best = list(search(Best(perfect, judge([perfect])[0]), judge, 2, 10, 0))[-1]
    assert best.config == perfect


def test_what_is_shipped_can_be_found(manual: Config) -> None:
    for key, (low, high) in RANGES.items():
        assert low < getattr(manual.observer, key) < high
    assert values(tuned(manual, genes(values(manual)))) == pytest.approx(values(manual), rel=1e-3)


def test_the_page_shows_the_shipped_tuning_and_the_ranges() -> None:
    """docs/tuning.md, its first table: defaults of `[observer]`, which the SUV has, and `RANGES`."""
    page = resource("docs/tuning.md").read_text("utf-8")
    for key, (low, high) in RANGES.items():
        (row,) = [line for line in page.splitlines() if line.startswith(f"| `{key}` |")]
        _, _, manual, searched = (cell.strip() for cell in row.strip("|").split("|"))
        assert float(manual) == getattr(Observer(), key), key
        assert tuple(float(bound) for bound in searched.split("–")) == (low, high), key
