"""First-order lags, of which every cycle has a dozen with a constant time.

Where the time since the last cycle is the nominal one, the compiler knows the result.
"""

import math
from typing import Final

from ecu.contract.signals import CYCLE_NS
from ecu.jit import kernel

PERIOD: Final = 1e-9 * CYCLE_NS
"""Nominal time between two cycles [s], as `step` computes it."""
NOTHING: Final = 1e-100
"""Below it a value counts as zero, in any unit."""


@kernel
def lag_gain(dt: float, lag: float) -> float:
    """Return the share of a step that a lag of time `lag` [s] has followed after `dt` [s]."""
    # Before the branch: two calls of `exp` in its arms become one, whose argument the compiler does not know.
    nominal = 1.0 - math.exp(-PERIOD / lag)
    return nominal if dt == PERIOD else 1.0 - math.exp(-dt / lag)


@kernel
def settled(value: float) -> float:
    """Return a value that may approach zero for ever, as zero once nothing is left of it.

    Below 1e-308 most processors take a hundred times as long for each operation.
    """
    return 0.0 if abs(value) < NOTHING else value
