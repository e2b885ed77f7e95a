"""Emission models on board: kinds, features, number of parameters."""

from typing import Final

MODELS: Final = ("network", "table", "law")
NETWORK, TABLE, LAW = range(3)
NONE: Final = -1
FEATURES: Final = ("v_in", "v_end", "torque", "temperature", "duration", "pressure")
"""Of an application, while the car moves: speeds [m/s], means of torque [N m], disc [degC] and pressure above
push-out [bar], duration [s]; (8.2), and the pressure of the table [38]."""
INPUTS: Final = 5  # the first of them, used by network and law
HIDDEN: Final = 8
NODES: Final = 6  # of the table, in each direction
KNOTS: Final = (100.0, 120.0, 140.0, 160.0, 180.0, 200.0)
"""degC, at which the law may bend upwards."""
LAW_TERMS: Final = 4 + len(KNOTS)
NUMBERS: Final = (2 * INPUTS + 2 + HIDDEN * (INPUTS + 1) + HIDDEN + 1, 2 * NODES + NODES**2, 1 + LAW_TERMS)
"""How many each of `MODELS` has; their order: `monitoring/emission_factor.py`."""
MOST_NUMBERS: Final = max(NUMBERS)
