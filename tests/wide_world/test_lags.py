"""Lags of strangers' loggers: what was drawn, and what is added to it, is found to within 20 ms."""

import numpy as np
import pytest

from brakelab.logs.physics.lags import lags
from brakelab.logs.physics.samples import SAMPLED, Collector
from ecu.contract.signals import INPUT_SIGNALS

from .draw import Stranger, draw
from .logger import record
from .state import ROW
from .test_contradictions import grid

pytestmark = pytest.mark.study

COLUMN = {INPUT_SIGNALS[place].name: column for column, place in enumerate(SAMPLED)}
CARS = ((1, 7), (1, 8), (1, 11), (1, 14), (1, 19), (1, 20), (2, 14), (2, 21))
"""Seed and number: a late speed of several kinds, and four wheels beside a late accelerometer."""
ADDED = (-0.3, -0.2, 0.15, 0.2, 0.3)  # s: what remains below 0.03 s is not reported


@pytest.fixture(scope="module")
def logged() -> list[tuple[Stranger, np.ndarray]]:
    strangers = [draw(seed, range(number, number + 1))[0] for seed, number in CARS]
    return [(one, grid(record(one.drive(), one.logger, one.nominal.radius))) for one in strangers]


def found(samples: np.ndarray) -> dict[str, float]:
    collector = Collector()
    collector.add(samples)
    return {lag.name: lag.seconds for lag in lags(collector.series())}


def beside_accel(lag: dict[str, float], name: str) -> float:
    return lag.get(name, 0.0) - lag.get("accel_x", 0.0)


def reference(one: Stranger) -> str:
    return "vehicle_speed" if one.logger.speed.rate > 0.0 else "wheel_speed"


def test_the_lag_of_a_logger_is_found(logged: list[tuple[Stranger, np.ndarray]]) -> None:
    for one, samples in logged:
        logger, name = one.logger, reference(one)
        true = logger.speed.delay + logger.speed.lag - logger.accel.lag
        error = beside_accel(found(samples), name) - true
        print(f"{one.seed}-{one.number} {name} {true:+.3f} s, error {error:+.3f} s")
        assert abs(error) < 0.02


@pytest.mark.parametrize("added", ADDED)
def test_an_added_lag_is_found(logged: list[tuple[Stranger, np.ndarray]], added: float) -> None:
    for one, samples in logged:
        name = reference(one)
        columns = [column for known, column in COLUMN.items() if known.startswith(name)]
        moved = samples.copy()
        moved[:, columns] = np.roll(samples[:, columns], round(added / ROW), axis=0)
        if one.logger.speed_for_wheels:
            continue  # its wheels are the same speed
        before, after = found(samples), found(moved)
        error = beside_accel(after, name) - beside_accel(before, name) - added
        print(f"{one.seed}-{one.number} {name} {added:+.1f} s, error {error:+.3f} s")
        assert abs(error) < 0.02


@pytest.mark.parametrize(("seed", "number"), [(1, 0), (1, 3), (1, 10), (2, 18)])
def test_wheels_that_all_slip_tell_no_lag(seed: int, number: int) -> None:
    one = draw(seed, range(number, number + 1))[0]
    assert found(grid(record(one.drive(), one.logger, one.nominal.radius))) == {}
