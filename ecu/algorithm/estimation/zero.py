"""Pressure zero of a sensor, learned while the brakes are released.

Many cars cannot report a pressure below zero. A reading N(z, s) truncated there has

    mean = s phi(a) + z Phi(a)        share at the floor = Phi(-a)        a = z / s

so its mean at rest is not the zero: with z = 0 and s = 1.8 bar it is 0.7 bar. Both equations give z and s
from mean and share, without any configured noise. A sensor is floored if it never reads less than zero and
reads zero often; where nearly all samples are at the floor, z is only known to be negative.
"""

import math

import numpy as np

from ecu.jit import Record, kernel

ZERO_STATE = np.dtype(
    [
        ("value", "f8", (4,)),  # bar
        ("variance", "f8", (4,)),  # bar^2
        ("mean", "f8", (4,)),  # of the readings at rest [bar]
        ("square", "f8", (4,)),  # of their squares [bar^2]
        ("at_floor", "f8", (4,)),  # share of the readings
        ("below", "u1", (4,)),  # a reading was negative
        ("samples", "i8", (4,)),
    ],
    align=True,
)

START, MEMORY = 100, 12_000  # samples: of the prior, and until older ones are forgotten
FREE = 0.4  # bar above push-out, mean of the wheels: the brakes are released
LIMIT = 8.0  # bar, more is neither zero nor noise
LARGEST_ZERO = 3.0  # bar, of a sound sensor
LEAST_SHARE = 0.05  # at the floor, of a floored sensor
NEARLY_ALL = 0.97
UNKNOWN = 0.7  # bar, standard deviation of an unknown zero
LEAST_SIGMA = 0.05  # bar, of a known zero


@kernel
def quantile(share: float) -> float:
    """Return the x below which a standard normal variable lies with probability `share`, to 5e-4.

    Abramowitz and Stegun, 26.2.23.
    """
    tail = min(share, 1.0 - share)
    t = math.sqrt(-2.0 * math.log(max(tail, 1e-12)))
    x = t - (2.515517 + t * (0.802853 + t * 0.010328)) / (
        1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308))
    )
    return -x if share < 0.5 else x


@kernel
def floored_zero(mean: float, at_floor: float) -> tuple[float, float]:
    """Return zero and standard deviation [bar] of readings cut off at zero, by their mean and share there."""
    a = -quantile(at_floor)
    density = math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi)
    sigma = mean / (density + a * (1.0 - at_floor))
    return a * sigma, sigma


@kernel
def note_rest(state: Record, i: int, reading: float) -> None:
    """Add a reading [bar] of a released brake."""
    if not abs(reading) < LIMIT:
        return
    state.samples[i] = min(state.samples[i] + 1, MEMORY)
    weight = 1.0 / state.samples[i]
    state.mean[i] += weight * (reading - state.mean[i])
    state.square[i] += weight * (reading * reading - state.square[i])
    state.at_floor[i] += weight * ((1.0 if reading == 0.0 else 0.0) - state.at_floor[i])
    if reading < 0.0:
        state.below[i] = 1


@kernel
def _is_floored(state: Record, i: int) -> bool:
    at_floor: bool = state.at_floor[i] > LEAST_SHARE
    return at_floor and not state.below[i]


@kernel
def settle_zero(state: Record, i: int) -> None:
    """Overwrite a sensor's zero and its variance from the readings added."""
    n = state.samples[i]
    zero, sigma = state.mean[i], math.sqrt(max(state.square[i] - state.mean[i] ** 2, 0.0))
    known = n / (n + START)
    if _is_floored(state, i):
        if state.at_floor[i] > NEARLY_ALL or not state.mean[i] > 0.0:
            state.value[i], state.variance[i] = -UNKNOWN, UNKNOWN * UNKNOWN
            return
        zero, sigma = floored_zero(state.mean[i], state.at_floor[i])
        ratio = zero / sigma
        sigma *= math.sqrt(1.0 + 0.5 * ratio * ratio)
        zero = max(zero, -2.0 * UNKNOWN)
    state.value[i] = min(max(known * zero, -LARGEST_ZERO), LARGEST_ZERO)
    state.variance[i] = sigma * sigma / max(n, 1) + ((1.0 - known) * UNKNOWN) ** 2 + LEAST_SIGMA**2


@kernel
def tell_zeros(state: Record, estimate: Record) -> None:
    """Overwrite in `ESTIMATE` the zeros, what released brakes read, and which sensors are floored."""
    for i in range(4):
        estimate.pressure_zero[i] = state.value[i]
        estimate.floored[i] = _is_floored(state, i)
        estimate.pressure_at_rest[i] = state.mean[i] if estimate.floored[i] else state.value[i]
