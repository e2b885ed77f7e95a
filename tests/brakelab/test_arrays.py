"""Columns of Arrow made of numpy's memory, and read as that."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pytest

from brakelab.arrays import arrow_array, median, numpy_array

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


@pytest.mark.parametrize("chunks", [1, 2, 5])
@pytest.mark.parametrize(("kind", "numbers", "column"), COLUMNS, ids=[str(row[0]) for row in COLUMNS])
def test_a_column_is_read_as_pyarrow_reads_it(kind, numbers, column, chunks) -> None:
    """A slice of it too, whose memory begins before it."""
    whole = pa.array([None, *column], kind).slice(1)
    ends = np.linspace(0, len(whole), chunks + 1).astype(int)
    parts = pa.chunked_array([whole.slice(a, b - a) for a, b in pairwise(ends)], kind)
    known = parts if kind == pa.string() else parts.cast(pa.float64())
    np.testing.assert_array_equal(numpy_array(parts), known.to_numpy(zero_copy_only=False))
    assert numpy_array(parts).dtype == (object if kind == pa.string() else float)


def test_what_is_no_number_is_refused() -> None:
    with pytest.raises(pa.ArrowException):
        numpy_array(pa.chunked_array([[{"a": 1}]]))


def test_pandas_is_not_imported() -> None:
    script = (
        "import sys, numpy as np, pyarrow as pa\nfrom brakelab.arrays import arrow_array, numpy_array\n"
        "for one in (arrow_array(np.array([3.0, np.nan]), pa.int8()), arrow_array(['fl'], pa.string())):\n"
        "    numpy_array(pa.chunked_array([one]))\n"
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
