"""Driver's request while its sender is in doubt: a doubtful stream cannot lower it.

While the request may have more than one sender (`e2e.in_doubt`), pedal position, pedal switch and automated
demand are the largest of the last 60 to 120 ms, longer than five lost frames of the true sender. Every frame
at the sender's sequence position counts; one out of sequence does not. The pedal has priority: an automated
demand counts only if its own frame flags it valid, and can only add to the pedal's.
"""

from typing import Final

import numpy as np

from ecu.contract.signals import DECEL_DEMAND, DECEL_DEMAND_VALID, PEDAL_POSITION, PEDAL_PRESSED
from ecu.jit import Record, kernel

FIRST, LAST = PEDAL_POSITION, DECEL_DEMAND_VALID
"""The places of the request lie side by side."""
HALF_NS: Final = 60_000_000

REQUEST: Final = np.dtype(
    [
        ("since_ns", "i8"),  # start of `newer`
        ("sample", "f8", (4,)),  # of this frame, from FIRST on; 0: none, or not valid
        ("newer", "f8", (4,)),  # largest since then
        ("older", "f8", (4,)),  # largest of the preceding `HALF_NS`
    ],
    align=True,
)


@kernel
def begin_request(state: Record) -> None:
    """Reset the samples of the previous frame."""
    for i in range(4):
        state.sample[i] = 0.0


@kernel
def note_request(state: Record, stamp_ns: int) -> None:
    """Update the largest values by a frame's samples."""
    age = stamp_ns - state.since_ns
    if not 0 <= age < HALF_NS:
        kept = 1.0 if HALF_NS <= age < 2 * HALF_NS else 0.0
        for i in range(4):
            state.older[i], state.newer[i] = kept * state.newer[i], 0.0
        state.since_ns = stamp_ns
    if state.sample[DECEL_DEMAND_VALID - FIRST] < 0.5:
        state.sample[DECEL_DEMAND - FIRST] = 0.0
    for i in range(4):
        state.newer[i] = max(state.newer[i], state.sample[i])


@kernel
def hold_request(state: Record, inputs: Record) -> None:
    """Overwrite the request in `inputs` by the largest of the last frames."""
    for place in (PEDAL_POSITION, PEDAL_PRESSED):
        inputs.value[place] = max(state.newer[place - FIRST], state.older[place - FIRST])
    decel = max(state.newer[DECEL_DEMAND - FIRST], state.older[DECEL_DEMAND - FIRST])
    if decel > 0.0:
        inputs.value[DECEL_DEMAND], inputs.value[DECEL_DEMAND_VALID] = decel, 1.0
