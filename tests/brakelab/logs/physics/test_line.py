"""Values of a few columns by their rank, row by row."""

import numpy as np
import pytest

from brakelab.logs.physics.line import ranked


@pytest.mark.parametrize("columns", [1, 2, 3, 4])
def test_each_row_is_sorted_as_numpy_sorts_it(columns: int) -> None:
    values = np.random.default_rng(1).integers(0, 4, (500, columns)).astype(float)
    np.testing.assert_array_equal(np.stack(ranked(values), axis=1), np.sort(values, axis=1))
    np.testing.assert_array_equal(
        np.stack(ranked(np.asfortranarray(values)), axis=1), np.sort(values, axis=1)
    )
