"""Columns of Arrow made of numpy's memory."""

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest

from brakelab.arrays import arrow_array, median

NAN, INF = np.nan, np.inf
COLUMNS = [
    # kind, numbers, column
    (pa.float64(), np.array([1.5, NAN, INF, -2.0]), [1.5, None, INF, -2.0]),
    (pa.float32(), np.array([0.5, NAN]), [0.5, None]),
    (pa.int8(), np.array([1.0, NAN, INF, -2.0]), [1, None, None, -2]),
    (pa.uint32(), np.array([0.0, 4294967295.0]), [0, 4294967295]),
    (pa.float64(), np.arange(20.0)[::2], [*np.arange(20.0)[::2]]),
    (pa.float64(), np.array([]), []),
    (pa.float64(), [1, 2.5, NAN], [1.0, 2.5, None]),
    (pa.bool_(), np.arange(9) > 6, [False] * 7 + [True] * 2),
    (pa.string(), ["fl", None, "", "é"], ["fl", None, "", "é"]),
    (pa.string(), [], []),
]


@pytest.mark.parametrize(("kind", "numbers", "column"), COLUMNS, ids=[str(row[0]) for row in COLUMNS])
def test_what_is_not_a_number_is_null(kind, numbers, column) -> None:
    array = arrow_array(numbers, kind)
    array.validate(full=True)
    assert array.type == kind
    assert array.to_pylist() == column


def test_pandas_is_not_imported() -> None:
    script = (
        "import sys, numpy as np, pyarrow as pa\nfrom brakelab.arrays import arrow_array, median\n"
        "arrow_array(np.arange(3.0), pa.int8()), arrow_array(['fl'], pa.string())\n"
        "print('pandas' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], capture_output=True).stdout == b"False\n"


@pytest.mark.parametrize(
    "values", [[3.0], [2.0, 1.0, 0.1], [0.3, 0.1, 0.7, 0.2], [4, 9, 7, 8], [1.0, NAN, 2.0]]
)
def test_a_median_is_numpy_s_to_the_bit(values) -> None:
    assert repr(median(values)) == repr(float(np.median(values)))


def test_a_median_of_nothing_is_not_known() -> None:
    assert np.isnan(median(np.zeros(0)))
