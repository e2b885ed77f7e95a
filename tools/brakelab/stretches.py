"""Stretches of rows in which something holds, such as brake applications."""

import numpy as np
from numpy.typing import NDArray


def stretches(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the first row and the one after the last of each stretch in which `holds`, shape (n,), is true.

    Shape (k, 2).
    """
    return np.flatnonzero(np.diff(holds, prepend=False, append=False)).reshape(-1, 2)
