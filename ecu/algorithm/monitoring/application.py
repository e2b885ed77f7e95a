"""Brake applications: detection of their start and end.

An application starts when a calliper pressure has been 1 bar above the push-out pressure for 0.1 s, counted
from what its sensor reads at rest, and ends when all have been below for 0.1 s. With 1.8 bar of sensor noise
single samples of a released brake often cross the threshold, so "below for 0.1 s" is judged by the mean of
those 0.1 s. A pressure that is not usable neither starts nor prolongs an application.

A held sample is no new evidence: two samples of a sensor with 20 Hz fill 0.1 s, and noise would start an
application every second or so. So the samples above the threshold must also add up to ten times the least
excess: ten that are just above it, as at 100 Hz, or fewer of a greater pressure.
"""

import numpy as np

from ecu.algorithm.inputs import fresh, usable
from ecu.contract.params import BAR
from ecu.contract.signals import CALLIPER_PRESSURE
from ecu.jit import Record, kernel

WINDOW = 10  # cycles of 10 ms
MARGIN = 1e5  # Pa

APPLICATION_STATE = np.dtype(
    [
        ("braking", "u1"),
        ("started", "u1"),  # in this cycle
        ("ended", "u1"),  # in this cycle
        ("above", "i8", (4,)),  # cycles in a row above the threshold
        ("shown", "f8", (4,)),  # sum of the samples in that time [Pa]
        ("recent", "f8", (4, WINDOW)),  # pressure above push-out [Pa]
        ("place", "i8"),
        ("duration_s", "f8"),
    ],
    align=True,
)


@kernel
def update_application(params: Record, state: Record, inputs: Record, at_rest: Record, dt: float) -> None:
    """Overwrite whether the brakes are applied, from the measured pressures.

    Args:
        params: `PARAMS`.
        state: `APPLICATION_STATE`, overwritten.
        inputs: `INPUTS`.
        at_rest: what released brakes read [bar], shape (4,).
        dt: time since the last cycle [s].
    """
    long_enough, applied = False, False
    state.place = (state.place + 1) % WINDOW
    for i in range(4):
        place = CALLIPER_PRESSURE + i
        above = 0.0
        if usable(inputs, place):
            above = BAR * (inputs.value[place] - at_rest[i]) - params.push_out_pressure[i]
        state.above[i] = state.above[i] + 1 if above > MARGIN else 0
        if state.above[i] == 0:
            state.shown[i] = 0.0
        elif fresh(inputs, place):
            state.shown[i] += above
        state.recent[i, state.place] = above
        long_enough = long_enough or (state.above[i] >= WINDOW and state.shown[i] >= WINDOW * MARGIN)
        if state.braking and not applied:
            mean = 0.0
            for j in range(WINDOW):
                mean += state.recent[i, j] / WINDOW
            applied = mean > MARGIN
    state.started, state.ended = 0, 0
    if state.braking:
        state.duration_s += dt
        if not applied:
            state.braking, state.ended = 0, 1
    elif long_enough:
        state.braking, state.started, state.duration_s = 1, 1, 0.0
