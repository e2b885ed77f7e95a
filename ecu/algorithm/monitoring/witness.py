"""Verdict on an input by its innovation against other inputs: the test that every watched input passes.

    ratio = (innovation / tolerance)^2        tolerance = `GATE` sigma

Beyond 1 the doubt grows with time, the faster the further the input is off; an input doubted for longer than
its limit is rejected, and accepted again after it agreed within half of its tolerance for `AGAIN_S`.

What every comparison found is published, also of those that decide elsewhere (`INPUT_WATCH`).
"""

import math

import numpy as np

from ecu.algorithm.inputs import usable
from ecu.contract.faults import IMPLAUSIBLE
from ecu.contract.records import INPUT_WATCH, WATCHED
from ecu.contract.signals import INPUT_SIGNALS, N_INPUTS
from ecu.jit import Record, kernel

WITNESS_STATE = np.dtype(
    [
        ("published", INPUT_WATCH),
        ("doubted_s", "f8", (N_INPUTS,)),
        ("agreed_s", "f8", (N_INPUTS,)),
        ("rejected", "u1", (N_INPUTS,)),
        ("named", "i8"),  # mask of the faults of sensors in the last cycle
        ("calm", "u1"),  # each input agreed with the others when it was last compared
    ],
    align=True,
)

BITS = np.array([IMPLAUSIBLE.get(signal.name, 0) for signal in INPUT_SIGNALS], dtype=np.int64)
GATE = 3.0  # standard deviations
FASTEST_DOUBT = 5.0  # times as fast as at the tolerance
AGREES = 0.25  # test ratio
AGAIN_S = 1.0


@kernel
def begin_watch(state: Record, dt: float) -> None:
    """Begin a cycle, `dt` [s] after the last: nothing is compared in it yet, nothing left out."""
    published = state.published
    for place in WATCHED:
        published.judged_s[place] += dt
        published.rejected[place] = 0


@kernel
def compare(state: Record, place: int, innovation: float, tolerance: float) -> float:
    """Publish what an input differs from others by; return its test ratio.

    Of several comparisons in a cycle the one with the greatest ratio is published.
    """
    published, ratio = state.published, (innovation / tolerance) ** 2
    if math.isfinite(ratio) and (published.judged_s[place] > 0.0 or ratio > published.ratio[place]):
        published.innovation[place], published.sigma[place] = innovation, tolerance / GATE
        published.ratio[place], published.judged_s[place] = ratio, 0.0
    return ratio


@kernel
def compare_both(
    state: Record, place: int, first: float, tolerance: float, second: float, other_tolerance: float
) -> None:
    """Publish of two innovations that count together the lesser one; none if their signs differ."""
    if first * second <= 0.0:
        compare(state, place, 0.0, tolerance)
    elif abs(first / tolerance) < abs(second / other_tolerance):
        compare(state, place, first, tolerance)
    else:
        compare(state, place, second, other_tolerance)


@kernel
def leave_out(state: Record, place: int) -> None:
    """Note that an input is left out, or replaced, in this cycle."""
    state.published.rejected[place] = 1


@kernel
def end_watch(state: Record, received: Record, trusted: Record, dt: float) -> None:
    """End a cycle: publish the watched inputs as `received`, and which of them were used.

    Args:
        state: `WITNESS_STATE`, overwritten.
        received: `INPUTS`.
        trusted: `INPUTS` with implausible ones masked out.
        dt: time since the last cycle [s].
    """
    published = state.published
    for place in WATCHED:
        published.value[place] = received.value[place] if usable(received, place) else math.nan
        used = usable(trusted, place) and published.rejected[place] == 0
        published.unused_s[place] = 0.0 if used else published.unused_s[place] + dt


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
    ratio = compare(state, place, innovation, tolerance)
    if ratio > 1.0:
        state.doubted_s[place] += dt * min(math.sqrt(ratio), FASTEST_DOUBT)
    else:
        state.doubted_s[place] = max(state.doubted_s[place] - dt, 0.0)
    state.agreed_s[place] = state.agreed_s[place] + dt if ratio < AGREES else 0.0
    if state.doubted_s[place] > doubt_s:
        state.rejected[place], state.doubted_s[place] = 1, doubt_s
    if state.rejected[place] and state.agreed_s[place] > AGAIN_S:
        believe(state, place)


@kernel
def believe(state: Record, place: int) -> None:
    """Accept an input again."""
    state.rejected[place], state.doubted_s[place] = 0, 0.0


@kernel
def note_named(state: Record, named: int) -> bool:
    """Note the faults of sensors in this cycle, and whether all inputs agree; return whether one is new."""
    new = named & ~state.named
    state.named, state.calm = named, 1
    for place in WATCHED:
        if state.published.ratio[place] > AGREES:
            state.calm = 0
    return new != 0


@kernel
def rejected_faults(state: Record) -> int:
    """Return the fault bits of the inputs that are rejected."""
    faults = 0
    for place in WATCHED:
        if state.rejected[place]:
            faults |= BITS[place]
    return faults
