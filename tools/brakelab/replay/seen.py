"""Statistics of each input's samples: gaps, extremes, ends of the range, implausible jumps.

Looked at once a cycle, after the samples of these 10 ms: a faster input counts with its last one.
"""

import math
from typing import Final

import numpy as np

from ecu.bus.freshness import NEVER
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, INPUT_SIGNALS
from ecu.jit import Record, kernel

SEEN: Final = np.dtype(
    [
        ("stamp_ns", "i8"),  # of the last sample, valid or not
        ("gap_ns", "i8"),  # longest time without any
        ("value", "f8"),  # last valid one …
        ("value_ns", "i8"),  # … and its stamp
        ("values", "u4"),  # cycles with a valid sample
        ("least", "f8"),
        ("greatest", "f8"),
        ("bottom", "f8"),  # the sender can say no less, infinite: that is no clipping
        ("top", "f8"),
        ("clipped", "u4"),  # cycles at `bottom` or `top`
        ("step", "f8"),  # between two samples it changes by no more than `step` + `rate` · time
        ("rate", "f8"),
        ("jumps", "u4"),
    ],
    align=True,
)

# Most that is plausible from one sample to the next: a step (noise, a kerb) and a rate [1/s].
# Assumption: brakes of 3 kN m at 1 kg m^2, valves of 2000 bar/s, a foot in 0.1 s, a disc of some kg.
# Requests may step: demands, limits, and an accelerator that cruise control moves.
PLAUSIBLE: Final = {
    "wheel_speed": (3.0, 3000.0),
    "accel_x": (15.0, 500.0),
    "accel_y": (15.0, 500.0),
    "yaw_rate": (0.3, 20.0),
    "calliper_pressure": (12.0, 2000.0),
    "pedal_position": (5.0, 1500.0),
    "steering_angle": (0.1, 4.0),
    "motor_torque": (500.0, 100_000.0),
    "vehicle_speed": (1.0, 30.0),
    "accumulator_pressure": (10.0, 1000.0),
    "ambient_temperature": (2.0, 1.0),
    "disc_temperature_measured": (20.0, 300.0),
}
_NATURAL: Final = ("%", "-")
"""Units whose ends are where the quantity ends."""


def new_seen() -> RecordArray:
    """Return SEEN per input with the ends of the physical ranges, nothing received yet."""
    seen = np.zeros(len(INPUT_SIGNALS), SEEN)
    seen["stamp_ns"] = NEVER
    seen["least"], seen["greatest"] = np.inf, -np.inf
    for place, signal in enumerate(INPUT_SIGNALS):
        stem = signal.name[:-3] if signal.name[-2:] in CORNERS else signal.name
        seen[place]["step"], seen[place]["rate"] = PLAUSIBLE.get(stem, (np.inf, np.inf))
        _set_ends(seen, place, signal.low, signal.high)
    return seen


def _set_ends(seen: RecordArray, place: int, low: float, high: float) -> None:
    natural = INPUT_SIGNALS[place].unit in _NATURAL
    seen[place]["bottom"] = low if low and not natural else -np.inf
    seen[place]["top"] = high if high and not natural else np.inf


def set_raw_ends(seen: RecordArray, signals: RecordArray) -> None:
    """Put the ends of the raw ranges of `signals` (SIGNAL, shape (n,)) in place of the physical ones.

    A value within half a raw step of an end is at it. A magnitude at 0 is no clipping.
    """
    for signal in signals[(signals["place"] >= 0) & (signals["raw_low"] < signals["raw_high"])]:
        low, high = sorted(
            signal["scale"] * signal[end] + signal["offset"] for end in ("raw_low", "raw_high")
        )
        half = 0.5 * abs(signal["scale"])
        _set_ends(seen, int(signal["place"]), low + half if low else 0.0, high - half if high else 0.0)


@kernel
def look_at(inputs: Record, seen: RecordArray) -> None:
    """Note the inputs of a cycle that has ended."""
    for place in range(len(seen)):
        known = seen[place]
        age = inputs.age_ns[place]
        stamp = inputs.t_ns - age
        if stamp == NEVER:
            continue
        if known.stamp_ns != NEVER:
            known.gap_ns = max(known.gap_ns, age, stamp - known.stamp_ns)
        known.stamp_ns = stamp
        if not inputs.new[place]:
            continue
        value = inputs.value[place]
        if known.values:
            passed_s = 1e-9 * (stamp - known.value_ns)
            known.jumps += math.fabs(value - known.value) > known.step + known.rate * passed_s
        known.values += 1
        known.value, known.value_ns = value, stamp
        known.least = min(known.least, value)
        known.greatest = max(known.greatest, value)
        known.clipped += value <= known.bottom or value >= known.top
