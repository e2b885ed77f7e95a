"""A record is the same to a kernel of numba's, wherever it lies and whoever holds it."""

import numpy as np
import pytest

from ecu.jit import compiler

pytestmark = pytest.mark.compiled
ROW = np.dtype([("flag", "u1"), ("gain", "f8"), ("values", "f8", (3,))])
PLACES = [
    ("of an array", lambda: np.zeros(3, ROW)[1]),
    ("of every second row", lambda: np.zeros(6, ROW)[::2][1]),
    ("of its own", lambda: np.zeros((), ROW)[()]),
    ("a copy", lambda: np.zeros(2, ROW)[1].copy()),
    ("a field of a record", lambda: np.zeros(1, np.dtype([("before", "i4"), ("row", ROW)]))[0]["row"]),
    ("in a record array", lambda: np.zeros(2, ROW).view(np.recarray)[1]),
]


def _added(row, gain):
    row.values[1] += gain
    row.gain = row.values[1] + row.flag
    return row.gain


added = compiler().njit(_added)


@pytest.mark.parametrize(("where", "place"), PLACES, ids=[row[0] for row in PLACES])
def test_a_kernel_reads_and_writes_the_record_itself(where: str, place) -> None:
    row = place()
    row["flag"] = 1
    assert added(row, 2.0) == 3.0
    assert added(row, 0.5) == 3.5
    assert row.tolist()[:2] == (1, 3.5)
    assert list(row["values"]) == [0.0, 2.5, 0.0]
