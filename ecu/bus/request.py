"""Driver's request while its sender is in doubt: who brakes wins over who does not.

*In the sender's place.* While the request may have more than one sender (`sequence.in_doubt`), pedal
position, pedal switch and automated demand are the largest of the last 60 to 120 ms, longer than five lost
frames of the true sender. Every frame at the sender's sequence position counts. The pedal has priority: an
automated demand counts only if its own frame flags it valid, and can only add to the pedal's.

*A rival stream*, intact but at another count, counts by the standing of the sender (`sequence.standing`):

    ESTABLISHED   not at all; where it brakes and the sender does not, the request is in doubt
    EQUAL         like the sender, for a second
    UNKNOWN       after that; where either brakes, the request is in doubt

*Garbage* beside the sender, every 256th of which has the right checksum by chance: a demand counts once two
accepted frames in a row have it.

A request in doubt is not valid: the ECU flags its demand invalid, and the hydraulics follow the pedal itself.
"""

from typing import Any, Final

import numpy as np

from ecu.bus.sequence import EQUAL, ESTABLISHED
from ecu.contract.signals import DECEL_DEMAND, DECEL_DEMAND_VALID, PEDAL_POSITION, PEDAL_PRESSED
from ecu.jit import Record, kernel

FIRST, LAST = PEDAL_POSITION, DECEL_DEMAND_VALID
"""The places of the request lie side by side."""
HALF_NS: Final = 60_000_000
PEDAL_REST: Final = 5.0  # %
LEAST_DECEL: Final = 0.05  # m/s^2

REQUEST: Final = np.dtype(
    [
        ("since_ns", "i8"),  # start of `newer`
        ("sample", "f8", (4,)),  # of this frame, from FIRST on; 0: none, or not valid
        ("before", "f8", (4,)),  # of the frame before
        ("newer", "f8", (4,)),  # largest since then
        ("older", "f8", (4,)),  # largest of the preceding `HALF_NS`
        ("rival_ns", "i8"),  # stamp of the rival's last frame, 0: there was none
        ("rival_brakes", "u1"),
        ("standing", "u1"),  # of the sender, then
    ],
    align=True,
)


@kernel
def begin_request(state: Record) -> None:
    """Reset the samples of the previous frame."""
    for i in range(4):
        state.sample[i] = 0.0


@kernel
def _vouched(state: Record) -> None:
    """Drop a deceleration that its own frame does not flag valid."""
    if state.sample[DECEL_DEMAND_VALID - FIRST] < 0.5:
        state.sample[DECEL_DEMAND - FIRST] = 0.0


@kernel
def note_request(state: Record, stamp_ns: int, garbage: bool) -> None:
    """Update the largest values by a frame's samples; by what the frame before has too beside `garbage`."""
    age = stamp_ns - state.since_ns
    if not 0 <= age < HALF_NS:
        kept = 1.0 if HALF_NS <= age < 2 * HALF_NS else 0.0
        for i in range(4):
            state.older[i], state.newer[i] = kept * state.newer[i], 0.0
        state.since_ns = stamp_ns
    _vouched(state)
    for i in range(4):
        sample = state.sample[i]
        state.newer[i] = max(state.newer[i], min(sample, state.before[i]) if garbage else sample)
        state.before[i] = sample


@kernel
def _held(state: Record, place: int) -> float:
    """Return the largest value of the last frames."""
    return max(state.newer[place - FIRST], state.older[place - FIRST])


@kernel
def hold_request(state: Record, inputs: Record) -> None:
    """Overwrite the request in `inputs` by the largest of the last frames."""
    for place in range(FIRST, LAST + 1):
        inputs.value[place] = _held(state, place)


@kernel
def _brakes(position: float, pressed: float, decel: float) -> bool:
    return position > PEDAL_REST or pressed > 0.5 or decel > LEAST_DECEL


@kernel
def note_rival(state: Record, stamp_ns: int, standing: int) -> None:
    """Note a frame of the rival by its samples, and the sender's standing."""
    _vouched(state)
    position, pressed, decel, _ = state.sample
    state.rival_brakes = 1 if _brakes(position, pressed, decel) else 0
    state.rival_ns = stamp_ns
    state.standing = standing


@kernel
def settle_request(state: Record, freshness: Any, t_ns: int) -> None:
    """Mark the request invalid in `freshness` while it is in doubt whether anybody brakes."""
    if state.rival_ns == 0 or t_ns - state.rival_ns > 2 * HALF_NS or state.standing == EQUAL:
        return
    sender = _brakes(_held(state, PEDAL_POSITION), _held(state, PEDAL_PRESSED), _held(state, DECEL_DEMAND))
    if state.rival_brakes and not sender if state.standing == ESTABLISHED else state.rival_brakes or sender:
        for place in range(FIRST, LAST + 1):
            freshness[place].valid = 0
