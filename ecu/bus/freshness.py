"""Freshness of inputs: value, `new`, age and three verdicts derived from samples.

Every target place has a time-out, a range of admissible sample intervals, and a physical range.
ALIVE: the last sample, valid or not, is younger than the time-out. RATE_OK: alive, and the mean interval of
its samples lies within the range. VALID: the last sample was available, within the physical range and
declared valid.
"""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from ecu.contract.records import RecordArray
from ecu.contract.signals import ALIVE, INPUT_SIGNALS, RATE_OK, VALID
from ecu.jit import Record, kernel

FRESHNESS: Final = np.dtype(
    [
        ("stamp_ns", "i8"),  # of the last sample
        ("timeout_ns", "i8"),
        ("least_timeout_ns", "i8"),
        ("patience_ns", "i8"),  # between samples of a signal whose time-out follows its rate
        ("shortest_ns", "f8"),  # mean intervals from here …
        ("longest_ns", "f8"),  # … to here count as rate ok
        ("interval_ns", "f8"),  # mean interval measured
        ("low", "f8"),
        ("high", "f8"),
        ("samples", "u4"),  # counted since the signal was last lost, at most `_AVERAGED`
        ("valid", "u1"),
        ("taken", "u4"),  # valid samples so far
        ("outside", "u4"),  # … outside the physical range
        ("invalid", "u4"),  # … not available, or declared invalid
    ],
    align=True,
)

NEVER: Final = -(2**62)
"""Stamp of a signal that has not come yet: its age is beyond any time-out."""
RATE_TOLERANCE: Final = 2.0
"""The mean interval may be off by this factor: a lost frame now and then is not a wrong rate."""
_AVERAGED: Final = 16  # intervals
PERIODS_UNTIL_LOST: Final = 3.0
"""Of a signal whose sender promises no rate."""


def new_freshness(
    timeout_s: ArrayLike, period_s: ArrayLike, slowest_s: ArrayLike, low: ArrayLike, high: ArrayLike
) -> RecordArray:
    """Return the expectation for each target place, nothing received yet, shape (places,).

    `period_s` to `slowest_s` is the range of the sender's admissible intervals.
    """
    freshness = np.zeros(len(np.atleast_1d(timeout_s)), FRESHNESS)
    freshness["stamp_ns"] = NEVER
    freshness["timeout_ns"] = np.rint(np.asarray(timeout_s) * 1e9)
    freshness["least_timeout_ns"] = freshness["patience_ns"] = freshness["timeout_ns"]
    freshness["shortest_ns"] = np.asarray(period_s) * 1e9 / RATE_TOLERANCE
    freshness["longest_ns"] = np.asarray(slowest_s) * 1e9 * RATE_TOLERANCE
    freshness["low"] = low
    freshness["high"] = high
    return freshness


def input_freshness(periods_s: dict[int, tuple[float, float]], timeouts_s: dict[int, float]) -> RecordArray:
    """Return the expectation for the contract's inputs: period ranges and special time-outs [s]."""
    places = range(len(INPUT_SIGNALS))
    return new_freshness(
        [timeouts_s.get(place, INPUT_SIGNALS[place].timeout_s) for place in places],
        [periods_s.get(place, (0.0, 0.0))[0] for place in places],
        [periods_s.get(place, (0.0, 0.0))[1] for place in places],
        [signal.low for signal in INPUT_SIGNALS],
        [signal.high for signal in INPUT_SIGNALS],
    )


def target_dtype(places: int) -> np.dtype[Any]:
    """Return the dtype of a record that kernels fill like `INPUTS`, with another number of places."""
    return np.dtype(
        [
            ("t_ns", "i8"),
            ("dt_ns", "i8"),
            ("value", "f8", (places,)),
            ("age_ns", "i8", (places,)),
            ("new", "u1", (places,)),
            ("verdict", "u1", (places,)),
            ("e2e_faults", "u4"),
            ("e2e_unsure", "u4"),
        ],
        align=True,
    )


@kernel
def begin_cycle(inputs: Record, t_ns: int, dt_ns: int) -> None:
    """Open the cycle that ends at `t_ns`: no sample is new yet."""
    inputs.t_ns = t_ns
    inputs.dt_ns = dt_ns
    for place in range(len(inputs.new)):
        inputs.new[place] = 0


@kernel
def accept(inputs: Record, freshness: Any, place: int, value: float, stamp_ns: int, valid: bool) -> None:
    """Take one sample.

    An invalid one (not `valid`, not finite or out of range) proves its sender alive, but leaves value and
    `new` unchanged. One older than the last is ignored, unless the clock was set back.
    """
    known = freshness[place]
    last = known.stamp_ns
    if stamp_ns < last <= inputs.t_ns:
        return
    interval = stamp_ns - last
    if known.samples == 0 or interval < 0 or interval > known.patience_ns:
        known.samples = 1
    else:
        change = interval - known.interval_ns
        # A power of two: the product has the quotient's bits and is there earlier.
        change = change * (1.0 / _AVERAGED) if known.samples == _AVERAGED else change / known.samples
        known.interval_ns += change
        known.samples = min(known.samples + 1, _AVERAGED)
        if known.patience_ns > known.least_timeout_ns:
            known.timeout_ns = max(known.least_timeout_ns, int(PERIODS_UNTIL_LOST * known.interval_ns))
    known.stamp_ns = stamp_ns
    if valid and known.low <= value <= known.high:
        known.valid = 1
        inputs.value[place] = value
        inputs.new[place] = 1
        known.taken += 1
        return
    known.valid = 0
    if valid and not math.isnan(value):
        known.outside += 1
    else:
        known.invalid += 1


@kernel
def end_cycle(inputs: Record, freshness: Any) -> None:
    """Write the ages and the three verdicts."""
    for place in range(len(inputs.new)):
        known = freshness[place]
        age = max(0, inputs.t_ns - known.stamp_ns)
        verdict = 0
        if age <= known.timeout_ns:
            verdict |= ALIVE
            if known.samples > 1 and known.shortest_ns <= known.interval_ns <= known.longest_ns:
                verdict |= RATE_OK
        if known.valid:
            verdict |= VALID
        inputs.age_ns[place] = age
        inputs.verdict[place] = verdict
