"""Calliper pressure as a state driven by the ECU's own demand, wherever the car follows it.

The sensor's noise (Table 4.1: 1.8 bar) multiplies the unknown friction, and only averaging over time reduces
it. Where the hydraulics follow the demand, the pressure is predictable (A.17, A.18 to first order: a dead
time and a lag) and can be averaged; the variance grows with the change, which covers errors of lag and gain.
Where the sensor disagrees persistently (a shadow, a fallback, a recording of another controller) the raw
samples count until both agree again."""

import math

import numpy as np

from ecu.jit import Record, kernel

PRESSURE_STATE = np.dtype(
    [
        ("demand", "f8", (4, 4)),  # of the last cycles [bar], the newest in row 0
        ("model", "f8", (4,)),  # demand after dead time and lag [bar]
        ("value", "f8", (4,)),  # bar
        ("variance", "f8", (4,)),  # bar^2
        ("disagreement", "f8", (4,)),  # low-passed innovation [bar]
        ("agreed_s", "f8", (4,)),  # time for which model and sensor have agreed
    ],
    align=True,
)

DEAD_CYCLES = 3  # 26 ms (A.17)
LAG = 0.040  # s, between build-up (A.17) and release (A.18)
WALK = 0.1  # bar/sqrt(s)
SHARE = 0.15  # of a change, one standard deviation
AGREED_S = 0.3


@kernel
def follow_demand(state: Record, i: int, demand: float, dt: float) -> None:
    """Advance a wheel's modelled pressure by `dt` [s] towards the last `demand` [bar] sent."""
    row = state.demand
    for k in range(DEAD_CYCLES, 0, -1):
        row[k, i] = row[k - 1, i]
    row[0, i] = demand
    change = (1.0 - math.exp(-dt / LAG)) * (row[DEAD_CYCLES - 1, i] - state.model[i])
    state.model[i] += change
    state.value[i] += change
    state.variance[i] += WALK**2 * dt + (SHARE * change) ** 2


@kernel
def follows(state: Record, i: int) -> bool:
    """Return whether a wheel's pressure has followed the demand for some time."""
    return state.agreed_s[i] > AGREED_S
