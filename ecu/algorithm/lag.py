"""First-order lags, of which every cycle has a dozen with a constant time.

Where the time since the last cycle is the nominal one, the compiler knows the result.
"""

import math
from typing import Final

from ecu.contract.signals import CYCLE_NS
from ecu.jit import kernel

PERIOD: Final = 1e-9 * CYCLE_NS
"""Nominal time between two cycles [s], as `step` computes it."""


@kernel
def lag_gain(dt: float, lag: float) -> float:
    """Return the share of a step that a lag of time `lag` [s] has followed after `dt` [s]."""
    # Before the branch: two calls of `exp` in its arms become one, whose argument the compiler does not know.
    nominal = 1.0 - math.exp(-PERIOD / lag)
    return nominal if dt == PERIOD else 1.0 - math.exp(-dt / lag)
