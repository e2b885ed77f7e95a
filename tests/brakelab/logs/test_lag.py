"""Samples of inputs with a lag, moved to the time that they are of."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from brakelab.logs.column_map import read_column_map
from brakelab.logs.lag import without_lags
from brakelab.logs.log_quality import SignalQuality
from brakelab.logs.sample_block import SampleBlock
from brakelab.logs.signal_file import read_signals
from ecu.contract.signals import ACCEL_X, VEHICLE_SPEED, WHEEL_SPEED
from ecu.errors import UserError

PLACES = np.array([WHEEL_SPEED, ACCEL_X, VEHICLE_SPEED])


def blocks(size: int) -> Iterator[SampleBlock]:
    """Two seconds at 100 Hz, each sample its own number; the speed at 10 Hz."""
    number = np.arange(200.0)
    values = np.stack([number, number, np.where(number % 10 == 0, number, np.nan)], axis=1)
    t_ns = 10_000_000 * np.arange(200)
    for begin in range(0, 200, size):
        part = slice(begin, begin + size)
        yield SampleBlock(1e-9 * t_ns[part], t_ns[part], PLACES, values[part])


@pytest.mark.parametrize("size", [1, 7, 64, 200])
@pytest.mark.parametrize(
    "lags", [{VEHICLE_SPEED: 0.25}, {VEHICLE_SPEED: -0.25}, {ACCEL_X: 0.5, VEHICLE_SPEED: -0.5}], ids=str
)
def test_samples_are_moved_and_none_is_lost(size: int, lags: dict[int, float]) -> None:
    moved = list(without_lags(blocks(size), lags))
    t_ns = np.concatenate([block.t_ns for block in moved])
    values = np.concatenate([block.values for block in moved])
    assert (np.diff(t_ns) >= 0).all()
    assert (t_ns[0], t_ns[-1]) == (0, 1_990_000_000)
    np.testing.assert_allclose(np.concatenate([block.t for block in moved]), 1e-9 * t_ns, atol=1e-12)
    for column, place in enumerate(PLACES):
        there = np.flatnonzero(~np.isnan(values[:, column]))
        lag = round(100 * lags.get(int(place), 0.0))
        period = 10 if place == VEHICLE_SPEED else 1
        expected = np.arange(0, 200, period)
        expected = expected[(expected - lag >= 0) & (expected - lag < 200)]
        assert values[there, column].tolist() == expected.tolist()
        assert (t_ns[there] // 10_000_000).tolist() == (expected - lag).tolist()


def test_a_map_states_lags(tmp_path: Path) -> None:
    log, map = tmp_path / "log.csv", tmp_path / "map.toml"
    log.write_text("t,a,v\n" + "".join(f"{i / 100:.2f},{i},{i}\n" for i in range(100)))
    inputs = '[inputs]\naccel_x = { column = "a", unit = "m/s^2" }\n'
    map.write_text(inputs + 'vehicle_speed = { column = "v", unit = "m/s", lag = 0.2 }\n')
    mapped = read_column_map(map)
    rows = list(read_signals(log, SignalQuality(), mapped))
    places, t_ns = rows[0].places, np.concatenate([block.t_ns for block in rows])
    values = np.concatenate([block.values for block in rows])
    speed = values[:, list(places).index(VEHICLE_SPEED)]
    known = ~np.isnan(speed)
    np.testing.assert_allclose(speed[known], 1e-7 * t_ns[known] + 20)


@pytest.mark.parametrize("lag", [0.51, -0.6])
def test_a_lag_beyond_half_a_second_is_refused(tmp_path: Path, lag: float) -> None:
    map = tmp_path / "map.toml"
    map.write_text(f'[inputs]\nvehicle_speed = {{ column = "v", lag = {lag} }}\n')
    with pytest.raises(UserError, match=r"inputs\.vehicle_speed\.lag"):
        read_column_map(map)
