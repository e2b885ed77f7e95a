"""State of a recording by an earlier version, converted to the present layout.

Version 0.1 before November 2026 kept two models of the hydraulics, one of which is now the only one.
"""

import numpy as np

from ecu.algorithm.step import INITIAL
from ecu.contract.records import RecordArray

RENAMED = {"hydraulics": "friction_torque"}  # present name: earlier one
ADDED = {"follows", "gain_variance", "shown", "automated", "gap_s"}  # begin at 0


def convert_initial(initial: RecordArray) -> RecordArray | None:
    """Return `INITIAL`, shape (1,), of an earlier one; None if it lacks a part or is of another shape."""
    converted = np.zeros(1, INITIAL)
    return converted if _copy(initial, converted) else None


def _copy(source: RecordArray, target: RecordArray) -> bool:
    """Copy the fields of `target` that `source` has by the same or the earlier name."""
    for name in target.dtype.names or ():
        earlier = name if name in (source.dtype.names or ()) else RENAMED.get(name, name)
        if earlier not in (source.dtype.names or ()):
            if name in ADDED:
                continue
            return False
        if target.dtype[name].names:
            if not source.dtype[earlier].names or not _copy(source[earlier], target[name]):
                return False
        elif source.dtype[earlier] != target.dtype[name]:
            return False
        else:
            target[name] = source[earlier]
    return True
