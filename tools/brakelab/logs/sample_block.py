"""Rows of decoded samples, as the files of signals are read."""

from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.errors import UserError

FEW_ROWS: Final = 10  # too few to judge their distance


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


def refuse_one_instant(path: Path, place: str, t: NDArray[Any], values: NDArray[np.float64]) -> None:
    """Refuse rows of which most share their time with the one before and differ from it: one would count.

    Args:
        path: of the file.
        place: of the rows in it.
        t: of the rows, shape (rows,).
        values: of their cells, NaN where there is none, shape (rows, columns).

    Raises:
        UserError: they do.
    """
    before, here = values[:-1], values[1:]
    differ = ((here < before) | (here > before)).any(axis=1)
    lost = int(np.count_nonzero(differ & (np.diff(t) == 0)))
    if len(t) > FEW_ROWS and 2 * lost > len(t):
        found = f"from here on {lost} of {len(t)} rows have the time of the row before and other values"
        raise UserError(str(path), place, f"{found}; give time in steps as fine as the rows, in ms")
