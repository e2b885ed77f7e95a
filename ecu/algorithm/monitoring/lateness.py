"""How late a wheel speed or the vehicle speed is, by the braking of the car.

    y = L d + q v      what it reads above the others at the deceleration d and the speed v [m/s]

A reading that is late by L is too high by L d, whatever the speed is; slip, radius and scale are a share q of
it. Each input has a Kalman filter of the two states, while the car brakes by more than `SLOWS`; q begins anew
in every braking, and where an input is left out. The others are the fastest of median, dead reckoning and
vehicle speed, and the slip of the configured tyre at this deceleration is allowed for: wheels that slip
together make nobody late. Once a wheel slips by `SLIDES` more than that, the slip guard acts, or the car
brakes beyond `NEAR_LIMIT` of the road's ceiling, where one axle slips more than the other, nothing is said
until the next braking: what comes back from there looks late.

A vehicle speed may be late, as one by satellites is: it is not judged by that, its samples are older by L.

Assumption: all constants. On straight, split and sloping roads and in bends L of sound inputs stays below
0.04 s.
"""

import math

import numpy as np

from ecu.algorithm.lag import PERIOD
from ecu.algorithm.monitoring.witness import judge
from ecu.jit import Record, kernel

WHEELS, JUDGED = 4, 5  # with the vehicle speed
LATENESS_STATE = np.dtype(
    [
        ("lag", "f8", (JUDGED,)),  # L [s]
        ("share", "f8", (JUDGED,)),  # q
        ("p", "f8", (JUDGED, 3)),  # variances of both, covariance
        ("slowed_s", "f8"),  # since the braking began
        ("slid", "u1"),  # a wheel has, in this braking
        ("others", "i8"),  # mask of the inputs that are believed
    ],
    align=True,
)

SLOWS, SETTLED_S = 1.5, 0.5  # m/s^2, s
ACROSS = 1.0  # m/s^2, above which the wheels' distances differ by more than is known
LAG_START, SHARE_START = 0.1, 0.005  # s, -: standard deviations
WALK = 0.004  # s per root second
NOISE = 0.25  # m/s of a cycle's reading
SLIDES, LONGEST = 0.04, 0.35  # of the speed, s: what is beyond that is no lag
NEAR_LIMIT = 0.8
LATE, LATE_DOUBT, SIGMAS = 0.05, 0.03, 2.0  # s, s, -
DOUBTED = 3.5  # standard deviations: of one that has not braked yet, `LONGEST`
KNOWN = 0.1  # s of doubt, within which the vehicle speed says that wheels are late
REFERENCE = 4.0  # m/s^2, the deceleration at which an innovation is published
DOUBT_S = 0.3


@kernel
def begin_lateness(state: Record, others: int, accel: float, across: float, slides: bool, dt: float) -> bool:
    """Begin a cycle; return whether lags show in it.

    Args:
        state: `LATENESS_STATE`, overwritten.
        others: mask of the inputs that are believed.
        accel: of the car [m/s^2].
        across: lateral acceleration [m/s^2].
        slides: a wheel does, or may.
        dt: time since the last cycle [s].
    """
    slows = accel < -SLOWS
    state.slowed_s = state.slowed_s + dt if slows else 0.0
    for i in range(JUDGED):
        p = state.p[i]
        p[0] = min(p[0] + WALK * WALK * dt, LAG_START**2) if p[0] > 0.0 else LAG_START**2
        if not slows or others != state.others:
            state.share[i], p[1], p[2] = 0.0, SHARE_START**2, 0.0
    state.others = others
    state.slid = 1 if slows and (slides or state.slid) else 0
    shows: bool = state.slowed_s > SETTLED_S and abs(across) < ACROSS and not state.slid
    return shows


@kernel
def follow_lag(state: Record, i: int, above: float, accel: float, ground: float, dt: float) -> None:
    """Correct lag and share of input `i`, which reads `above` the others [m/s].

    Args:
        state: `LATENESS_STATE`, overwritten.
        i: index of the input.
        above: see the model [m/s].
        accel: of the car [m/s^2], negative.
        ground: speed of the car [m/s].
        dt: time since the last cycle [s].
    """
    if i < WHEELS and above < -SLIDES * ground:
        state.slid = 1
    if state.slid or above > SLIDES * ground - LONGEST * accel:
        return
    p = state.p[i]
    to_lag, to_share = ground * p[2] - accel * p[0], ground * p[1] - accel * p[2]
    variance = ground * to_share - accel * to_lag + NOISE * NOISE * PERIOD / dt
    innovation = above + accel * state.lag[i] - ground * state.share[i]
    state.lag[i] += to_lag / variance * innovation
    state.share[i] += to_share / variance * innovation
    p[0] -= to_lag * to_lag / variance
    p[1] -= to_share * to_share / variance
    p[2] -= to_lag * to_share / variance


@kernel
def _least_lag(state: Record, i: int) -> float:
    """Return the lag beyond which input `i` is late [s]."""
    return max(LATE, LATE_DOUBT + SIGMAS * math.sqrt(state.p[i, 0]))


@kernel
def reference_lag(state: Record) -> float:
    """Return how late the vehicle speed is found to be [s]; 0: it is not."""
    lag: float = state.lag[WHEELS]
    return lag if lag > _least_lag(state, WHEELS) else 0.0


@kernel
def doubted_lag(state: Record) -> float:
    """Return by how much later the vehicle speed may be than is found [s]."""
    doubted: float = DOUBTED * math.sqrt(state.p[WHEELS, 0])
    return doubted


@kernel
def judge_lag(state: Record, witness: Record, i: int, place: int, unit: float, dt: float) -> bool:
    """Judge input `i` if it is late; return whether it is.

    Args:
        state: `LATENESS_STATE`.
        witness: `WITNESS_STATE`; the input's fields are overwritten.
        i: index of the input.
        place: of the input in `inputs.value`.
        unit: of the input per m/s.
        dt: time since the last cycle [s].
    """
    least = _least_lag(state, i)
    late: bool = state.lag[i] > least
    if late:
        judge(witness, place, state.lag[i] * REFERENCE * unit, least * REFERENCE * unit, DOUBT_S, dt)
    return late
