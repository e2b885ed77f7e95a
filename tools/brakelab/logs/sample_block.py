"""Rows of decoded samples, as the files of signals are read."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class SampleBlock(NamedTuple):
    """Rows of a signal file, in the order of time."""

    t: NDArray[np.float64]
    """As it stands in the file [s], less the lag of a row that was moved, shape (rows,)."""
    t_ns: NDArray[np.int64]
    places: NDArray[np.int64]
    """Place of each column in `inputs.value`, shape (columns,)."""
    values: NDArray[np.float64]
    """NaN: no sample, shape (rows, columns), units of the contract."""

    def rows(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> "SampleBlock":
        """Return some of the rows."""
        return SampleBlock(self.t[which], self.t_ns[which], self.places, self.values[which])
