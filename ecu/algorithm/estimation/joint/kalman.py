"""Prediction and correction of the joint observer's state; one scalar measurement at a time.

Correction after Schmidt: a state that is not free keeps its value and variance, but its covariances act, so
that the uncertainty it causes is accounted for. Innovations beyond `GATE` standard deviations count with a
variance that puts them on the gate and, while friction is not observed, correct speed and slope alone:
vehicle parameters learn only from consistent measurements. Beyond four gates they are rejected."""

import math

from ecu.algorithm.estimation.joint.layout import BIAS, LEVEL, SLOPE, N, V
from ecu.jit import Record, kernel

GATE = 3.0
REJECT = 4.0 * GATE
SPEED_VARIANCE = 0.25  # m^2/s^2, of a speed that is taken anew


@kernel
def forget(state: Record, i: int, variance: float) -> None:
    """Reset a state's variance and clear its covariances."""
    for j in range(N):
        state.p[i, j] = state.p[j, i] = 0.0
    state.p[i, i] = variance


@kernel
def forget_speed(state: Record) -> None:
    """Reset the variance of the car's speed to that of one taken anew, and clear its covariances."""
    forget(state, V, SPEED_VARIANCE)


@kernel
def clear_state(state: Record, i: int, variance: float) -> None:
    """Set a state to zero, with `variance` and no covariance."""
    state.x[i] = 0.0
    forget(state, i, variance)


@kernel
def clear_derivatives(state: Record) -> None:
    """Zero the derivatives of a measurement."""
    for j in range(N):
        state.h[j] = 0.0


@kernel
def drift_speed(state: Record, time: float) -> None:
    """Propagate bias and slope into the covariance of speed over `time` [s]: v' = a - b - g sin(slope)."""
    p = state.p
    for j in range(N):
        if j != V:
            p[V, j] -= time * (p[BIAS, j] + p[SLOPE, j])
            p[j, V] = p[V, j]
    both = p[BIAS, BIAS] + 2.0 * p[BIAS, SLOPE] + p[SLOPE, SLOPE]
    p[V, V] -= time * (2.0 * (p[V, BIAS] + p[V, SLOPE]) + time * both)


@kernel
def variance_by_derivatives(state: Record) -> float:
    """Return the variance of what has the derivatives `state.h`; overwrite `state.ph`, its covariances."""
    p, h, ph = state.p, state.h, state.ph
    variance = 0.0
    for j in range(N):
        ph[j] = 0.0
        for i in range(N):
            if h[i] != 0.0:
                ph[j] += h[i] * p[i, j]
    for j in range(N):
        variance += h[j] * ph[j]
    return variance


@kernel
def drift_by_derivatives(state: Record, time: float) -> None:
    """Propagate into the covariance of speed what `state.h`, derivatives of dv/dt [m/s^2], says of others."""
    p, ph = state.p, state.ph
    own = variance_by_derivatives(state)
    for j in range(N):
        if j != V:
            p[V, j] += time * ph[j]
            p[j, V] = p[V, j]
    p[V, V] += time * (2.0 * ph[V] + time * own)


@kernel
def _list_derived(h: Record, order: Record) -> int:
    """Write the states with a derivative, few have one, to the beginning of `order`; return their number."""
    count = 0
    for i in range(N):
        order[count] = i
        count += h[i] != 0.0  # no branch: processors predict it wrongly
    return count


@kernel
def _list_corrected(free: Record, order: Record, only_speed: bool) -> int:
    """Write the states that are corrected to the beginning of `order`, the others behind them.

    Return how many are.
    """
    count = 0
    for i in range(N):
        order[count] = order[N - 1 - i + count] = i
        count += free[i] & ((i == V) | (i == SLOPE)) if only_speed else free[i]
    return count


@kernel
def correct(
    state: Record, innovation: float, variance: float, gate: float = GATE, reject: float = REJECT
) -> float:
    """Fuse a measurement with derivatives `state.h` and noise `variance`; return its test ratio.

    `gate`, `reject`: standard deviations of the innovation beyond which it counts as if on the gate, and
    beyond which nothing is corrected.
    """
    p, h, ph, x, order = state.p, state.h, state.ph, state.x, state.order
    total = variance
    for i in range(N):
        ph[i] = 0.0
    count = _list_derived(h, order)
    for k in range(count):
        j = order[k]
        derivative = h[j]  # read once: the compiler cannot know that it is not in `ph`
        for i in range(N):
            ph[i] += p[j, i] * derivative
    for k in range(count):
        total += ph[order[k]] * h[order[k]]
    ratio = innovation * innovation / total
    if not math.isfinite(ratio) or ratio > reject * reject:
        return ratio
    outlier = ratio > gate * gate
    if outlier:
        total = innovation * innovation / (gate * gate)
    count = _list_corrected(state.free, order, outlier and not state.free[LEVEL])
    scale, inverse = innovation / total, 1.0 / total
    for k in range(count):
        i = order[k]
        x[i] += scale * ph[i]
        gain = ph[i] * inverse
        for j in range(N):
            p[i, j] -= gain * ph[j]
    for k in range(count, N):
        i = order[k]
        for corrected in range(count):
            j = order[corrected]
            p[i, j] = p[j, i]
    return ratio
