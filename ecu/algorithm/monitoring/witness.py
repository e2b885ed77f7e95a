"""Verdict on an input by its innovation against other inputs: the test that every watched input passes.

    ratio = (innovation / tolerance)^2

Beyond 1 the doubt grows with time, the faster the further the input is off; an input doubted for longer than
its limit is rejected, and accepted again after it agreed within half of its tolerance for `AGAIN_S`.
"""

import math

import numpy as np

from ecu.contract.faults import IMPLAUSIBLE
from ecu.contract.signals import INPUT_SIGNALS, N_INPUTS
from ecu.jit import Record, kernel

WITNESS_STATE = np.dtype(
    [
        ("innovation", "f8", (N_INPUTS,)),  # of the last judgement, in the input's unit
        ("tolerance", "f8", (N_INPUTS,)),  # of it
        ("ratio", "f8", (N_INPUTS,)),
        ("doubted_s", "f8", (N_INPUTS,)),
        ("agreed_s", "f8", (N_INPUTS,)),
        ("rejected", "u1", (N_INPUTS,)),
    ],
    align=True,
)

BITS = np.array([IMPLAUSIBLE.get(signal.name, 0) for signal in INPUT_SIGNALS], dtype=np.int64)
FASTEST_DOUBT = 5.0  # times as fast as at the tolerance
AGREES = 0.25  # test ratio
AGAIN_S = 1.0


@kernel
def judge(state: Record, place: int, innovation: float, tolerance: float, doubt_s: float, dt: float) -> None:
    """Judge one input; an innovation that is NaN says nothing.

    Args:
        state: `WITNESS_STATE`, overwritten.
        place: of the input in `inputs.value`.
        innovation: what the input differs from the others by, in its unit.
        tolerance: what it may differ by, in its unit.
        doubt_s: time at the tolerance after which it is rejected [s].
        dt: time since the last cycle [s].
    """
    if not math.isfinite(innovation):
        return
    ratio = (innovation / tolerance) ** 2
    state.innovation[place], state.tolerance[place], state.ratio[place] = innovation, tolerance, ratio
    if ratio > 1.0:
        state.doubted_s[place] += dt * min(math.sqrt(ratio), FASTEST_DOUBT)
    else:
        state.doubted_s[place] = max(state.doubted_s[place] - dt, 0.0)
    state.agreed_s[place] = state.agreed_s[place] + dt if ratio < AGREES else 0.0
    if state.doubted_s[place] > doubt_s:
        state.rejected[place], state.doubted_s[place] = 1, doubt_s
    if state.rejected[place] and state.agreed_s[place] > AGAIN_S:
        state.rejected[place], state.doubted_s[place] = 0, 0.0


@kernel
def rejected_faults(state: Record) -> int:
    """Return the fault bits of the inputs that are rejected."""
    faults = 0
    for place in range(N_INPUTS):
        if state.rejected[place]:
            faults |= BITS[place]
    return faults
