import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from brakelab.report.downsample import buckets, extremes, times, worst


@given(
    hnp.arrays(np.float64, st.integers(2, 400), elements=st.floats(-1e3, 1e3) | st.just(np.nan)),
    st.integers(4, 500),
    st.data(),
)
def test_extremes_survive_and_the_limit_holds(values: np.ndarray, limit: int, data: st.DataObject) -> None:
    busy = data.draw(hnp.arrays(np.bool_, len(values)))
    grid = buckets(busy, limit)
    drawn = extremes(grid, values)
    assert len(drawn) == len(times(grid, np.arange(len(values), dtype=float))) <= max(limit, 2)
    if np.isfinite(values).any():
        assert np.nanmin(drawn) == np.nanmin(values)
        assert np.nanmax(drawn) == np.nanmax(values)
    else:
        assert np.isnan(drawn).all()


def test_few_rows_stay_as_they_are() -> None:
    values = np.array([1.0, np.nan, 3.0])
    assert extremes(buckets(np.zeros(3, bool), 10), values) == pytest.approx(values, nan_ok=True)


def test_order_of_occurrence() -> None:
    grid = buckets(np.zeros(8, bool), 4)  # two buckets of four rows
    values = np.array([0.0, 5.0, -5.0, 0.0, 1.0, -2.0, 2.0, 1.0])
    assert extremes(grid, values).tolist() == [5.0, -5.0, -2.0, 2.0]
    assert times(grid, np.arange(8.0)).tolist() == [0.0, 3.0, 4.0, 7.0]


def test_brakings_get_finer_buckets() -> None:
    busy = np.zeros(10_000, bool)
    busy[4000:6000] = True
    grid = buckets(busy, 1000)
    assert (busy[grid.first]).sum() > 0.5 * len(grid.first)


def test_worst_mode_of_a_bucket_counts() -> None:
    grid = buckets(np.zeros(8, bool), 4)
    assert worst(grid, np.array([1.0, 3.0, 1.0, 1.0, 0.0, 2.0, np.nan, 0.0])).tolist() == [3.0, 2.0]
