"""Which of two speeds the accelerometer confirms: that of the wheels together, or the vehicle speed.

All wheel speeds come from one unit, so one lie may be in all four. Each of the two speeds s carries a dead
reckoning v of its own,

    i = s - v        v' = a - c + 2 w i        c' = -w^2 i

slow enough (w = `MEMORY`, faster while it begins) that a speed that jumps, sticks, drifts or is late leaves
it behind by i. A slope that begins, or an accelerometer that drifts, leaves both behind. The one whose i is
less than `CONFIRMED` of the other's is confirmed: two of three witnesses.

The wheels' speed is their mean without the slip of the configured tyres. Where some of a car that is driven
turn faster than the slowest by more than `SPINS`, they spin: they stay as far behind as they were.
"""

import math

import numpy as np

from ecu.algorithm.vehicle import tyre_slip
from ecu.jit import Record, kernel

WHEELS, OVER_GROUND = 0, 1
CARRIED_STATE = np.dtype(
    [
        ("speed", "f8", (2,)),  # v [m/s], carried on
        ("slope", "f8", (2,)),  # c [m/s^2]
        ("behind", "f8", (2,)),  # i [m/s]
        ("age_s", "f8", (2,)),  # since it began
    ],
    align=True,
)

MEMORY = 0.15  # rad/s
BEGINS, LEAST_AGE_S = 1.5, 0.5  # over the time since it began; s
CONFIRMED = 0.4
KNOWN_S = 5.0  # after which its slope is known
SPINS, SPINS_BY = 0.08, 0.5  # of the speed, m/s: beyond the slip at which a tyre on a dry road gives most
LEAST_BEHIND = 0.1  # m/s: slip and radii that differ from the configured ones


@kernel
def follow_carried(state: Record, k: int, speed: float, accel: float, dt: float) -> None:
    """Advance the dead reckoning of a speed; one that is silent begins anew.

    Args:
        state: `CARRIED_STATE`, overwritten.
        k: `WHEELS` or `OVER_GROUND`.
        speed: s [m/s], NaN: silent.
        accel: a [m/s^2].
        dt: time since the last cycle [s].
    """
    if not math.isfinite(speed):
        state.age_s[k] = state.behind[k] = 0.0
        return
    if state.age_s[k] == 0.0:
        state.speed[k] = speed
    state.age_s[k] += dt
    memory = max(BEGINS / max(state.age_s[k], LEAST_AGE_S), MEMORY)
    behind = speed - state.speed[k]
    state.slope[k] -= memory * memory * dt * behind
    state.speed[k] += (accel - state.slope[k] + 2.0 * memory * behind) * dt
    state.behind[k] = behind


@kernel
def carry_speeds(
    params: Record, state: Record, implied: Record, accel: float, known: bool, driven: bool, dt: float
) -> None:
    """Let the accelerometer carry the wheels' speed and the vehicle speed on, where it is `known`.

    Args:
        params: `PARAMS`.
        state: `CARRIED_STATE`, overwritten.
        implied: car's speed by the four wheels and the vehicle speed [m/s]; NaN: silent.
        accel: of the car [m/s^2].
        known: it is.
        driven: the car is.
        dt: time since the last cycle [s].
    """
    total, wheels, slowest, fastest = 0.0, 0, math.inf, 0.0
    for i in range(4):
        if math.isfinite(implied[i]):
            total, wheels = total + implied[i], wheels + 1
            slowest, fastest = min(slowest, implied[i]), max(fastest, implied[i])
    spin = driven and fastest > (1.0 + SPINS) * slowest + SPINS_BY
    rolled = total / max(wheels, 1) * (1.0 + tyre_slip(params, accel))
    if spin and state.age_s[WHEELS] > 0.0:
        rolled = state.speed[WHEELS] + state.behind[WHEELS]
    rolled = rolled if known and wheels > 2 else math.nan
    over_ground = implied[4] if known else math.nan
    follow_carried(state, WHEELS, rolled, accel, dt)
    follow_carried(state, OVER_GROUND, over_ground, accel, dt)


@kernel
def _confirmed(state: Record, k: int, other: int) -> bool:
    mine, its = abs(state.behind[k]), abs(state.behind[other])
    known = state.age_s[k] > KNOWN_S and its > LEAST_BEHIND
    confirmed: bool = known and mine < CONFIRMED * its
    return confirmed


@kernel
def over_ground_confirmed(state: Record) -> bool:
    """Return whether the accelerometer confirms the vehicle speed, and not the wheels."""
    return _confirmed(state, OVER_GROUND, WHEELS)


@kernel
def wheels_confirmed(state: Record) -> bool:
    """Return whether the accelerometer confirms the wheels, and not the vehicle speed."""
    return _confirmed(state, WHEELS, OVER_GROUND)
