"""Strangers' logs with zeros of 2 bar, one circuit or no accelerometer predict nearly as the whole log."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.api import replay

from .brakings import find, read
from .draw import Stranger, draw
from .judge import LEAST_DECEL, published
from .logger import CORNERS, record, write
from .route import Values

pytestmark = pytest.mark.study

Columns = dict[str, Values]
CARS = ((1, 7), (1, 9))
"""Seed and number: one speed for all wheels, and four wheel speeds at 20 Hz."""
PRESSURE = [f"calliper_pressure_{corner}" for corner in CORNERS]


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Stranger, Columns, float]]:
    """Return strangers, their logs, and the mean error [%] of what the whole log predicts."""
    rows, folder = [], tmp_path_factory.mktemp("whole")
    for seed, number in CARS:
        one = draw(seed, range(number, number + 1))[0]
        whole = record(one.drive(), one.logger, one.nominal.radius)
        rows.append((one, whole, error(one, whole, [], folder)))
    return rows


def error(one: Stranger, columns: Columns, lost: list[str], folder: Path) -> float:
    """Return the mean error [%] of what a log without the `lost` columns predicts of all brakings."""
    write({name: column for name, column in columns.items() if name not in lost}, folder / "log.parquet")
    (folder / "car.toml").write_text(one.nominal.toml("car"), "utf-8")
    result = replay(folder / "log.parquet", config=folder / "car.toml")
    signals = read(columns, one.nominal)
    brakings = [braking for braking in find(signals, one.nominal) if braking.measured > LEAST_DECEL]
    said = published(result, signals, brakings, one.nominal).decel
    return float(100.0 * np.mean([abs(d / b.measured - 1.0) for d, b in zip(said, brakings, strict=True)]))


@pytest.mark.parametrize(
    ("case", "bar", "taken", "lost", "more"),
    [
        ("all pressures read too much", 2.0, (0, 1, 2, 3), [], 0.5),
        ("all pressures read too little", -2.0, (0, 1, 2, 3), [], 0.5),
        ("the front circuit alone", 0.0, (0, 1, 0, 1), PRESSURE[2:], 1.0),
        ("the rear circuit alone", 0.0, (2, 3, 2, 3), PRESSURE[:2], 1.5),
        ("one diagonal circuit", 0.0, (0, 0, 3, 3), PRESSURE[1:3], 0.1),
        ("no accelerometer: the slope is missing", 0.0, (0, 1, 2, 3), ["accel_x"], 5.0),
    ],
)
def test_a_poorer_log_predicts_nearly_as_well(
    logged: list[tuple[Stranger, Columns, float]],
    tmp_path: Path,
    case: str,
    bar: float,
    taken: tuple[int, ...],
    lost: list[str],
    more: float,
) -> None:
    for one, whole, before in logged:
        poor = whole | {name: whole[PRESSURE[i]] + bar for name, i in zip(PRESSURE, taken, strict=True)}
        after = error(one, poor, lost, tmp_path)
        print(f"{one.seed}-{one.number}, {case}: {before:.2f} -> {after:.2f} %")
        assert after < before + more
