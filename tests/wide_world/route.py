"""Road of a whole drive on a grid of one metre, and the speed at which a driver means to be at each point.

A lap is straights and corners (transition, arc, transition); a drive repeats it, each time with other grip,
other nerve and other taps. The speed is the one that corner, limit and stops allow, run backwards from each
with the deceleration that the driver dares there: what braking and turning share is an ellipse.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.jit import kernel

G = 9.81
Values = NDArray[np.float64]


class Lap(NamedTuple):
    """One lap, every metre."""

    curvature: Values  # 1/m, positive to the left
    grade: Values  # tangent, positive uphill
    kerb: Values  # 1 on a kerb
    limit: Values  # m/s, of the straight
    stop: Values  # s to stand here, 0: none
    zone: NDArray[np.int64]  # number of the corner that is next


class Route(NamedTuple):
    """A whole drive, every metre."""

    curvature: Values  # 1/m
    grade: Values
    grip: Values  # peak friction of tyre and road
    headwind: Values  # m/s
    kerb: Values
    tap: Values  # bar, by a driver who tries his pedal
    stop: Values  # s
    speed: Values  # m/s, meant
    decel: Values  # m/s^2, meant


class Straight(NamedTuple):
    """A straight and the corner at its end."""

    length: float  # m
    limit: float  # m/s
    radius: float  # m
    angle: float  # rad, positive to the left
    stop: float  # s to stand before the corner
    kerb: bool


def lay(straights: list[Straight], slope: float, rng: np.random.Generator) -> Lap:
    """Return a lap of straights and corners; its slopes have the root mean square `slope` (tangent)."""
    columns: list[list[Values]] = [[], [], [], [], []]
    for number, one in enumerate(straights):
        arc = max(abs(one.angle) * one.radius, 8.0)
        ease = max(0.35 * arc, 4.0)
        straight, transition, middle = round(one.length), round(ease), max(round(arc - ease), 2)
        rise = np.linspace(0.0, 1.0, transition)
        bend = np.concatenate([np.zeros(straight), rise, np.ones(middle), rise[::-1]])
        kerb = np.zeros(len(bend))
        if one.kerb:
            apex = straight + transition + middle // 2
            kerb[apex - 4 : apex + 4] = kerb[straight : straight + 6] = 1.0
        stop = np.zeros(len(bend))
        stop[straight - 3] = one.stop
        columns[0].append(bend * np.sign(one.angle) / one.radius)
        columns[1].append(kerb)
        columns[2].append(np.full(len(bend), one.limit))
        columns[3].append(stop)
        columns[4].append(np.full(len(bend), float(number)))
    curvature, kerb, limit, stop, zone = (np.concatenate(column) for column in columns)
    at = np.arange(len(curvature)) / len(curvature) * 2.0 * np.pi
    waves = rng.integers(1, 7, 3)
    grade = np.sum([np.sin(n * at + rng.uniform(0.0, 6.3)) for n in waves], axis=0) * slope / np.sqrt(1.5)
    return Lap(curvature, grade, kerb, limit, stop, zone.astype(np.int64))


@kernel
def meant_speed(
    curvature: Values, grip: Values, limit: Values, stop: Values, decel: Values, lateral: float, lift: float,
    daring: Values,
) -> Values:  # fmt: skip
    """Return the speed [m/s] a driver means to have, every metre.

    Args:
        curvature: 1/m.
        grip: peak friction.
        limit: m/s.
        stop: s to stand, 0: none.
        decel: greatest deceleration that he asks for [m/s^2].
        lateral: greatest lateral acceleration [m/s^2]; the road's may be less.
        lift: downforce over mass and speed squared [1/m].
        daring: share of the grip that he uses.
    """
    n = len(curvature)
    speed = np.empty(n)
    follower = 0.0
    for k in range(n - 1, -1, -1):
        bend, usable = abs(curvature[k]), daring[k] * grip[k]
        # v^2 bend = usable (G + lift v^2), at most `lateral` and what downforce adds to it
        held = max(bend - min(usable, 1.5) * lift, 1e-5)
        across = min(min(usable * G, lateral) / held, limit[k] ** 2)
        force = usable * (G + lift * follower)
        turning = min(follower * bend / force, 1.0)
        along = min(decel[k], force) * np.sqrt(max(1.0 - turning**2, 0.02))
        follower = 0.0 if stop[k] > 0.0 else min(across, follower + 2.0 * along)
        if k == n - 1:
            follower = across
        speed[k] = np.sqrt(follower)
    return speed


def drive_route(
    lap: Lap, laps: int, grip: Values, decel: Values, daring: Values, lateral: float, lift: float,
    wind: float, tap: Values,
) -> Route:  # fmt: skip
    """Return the route of several laps.

    Args:
        lap: the lap.
        laps: how many.
        grip: peak friction, shape (laps, zones).
        decel: greatest deceleration asked for [m/s^2], shape (laps, zones).
        daring: share of the grip used, shape (laps, zones).
        lateral: greatest lateral acceleration [m/s^2].
        lift: downforce over mass and speed squared [1/m].
        wind: m/s, against the first straight.
        tap: pressure [bar] of a tap in the middle of the straight before a corner, shape (laps, zones).
    """
    curvature, limit = np.tile(lap.curvature, laps), np.tile(lap.limit, laps)
    stop, zone = np.tile(lap.stop, laps), np.tile(lap.zone, laps)
    turn = np.repeat(np.arange(laps), len(lap.curvature))
    here = (turn, zone)
    taps = np.zeros(len(curvature))
    starts = np.flatnonzero(np.diff(zone, prepend=-1))
    for start, end in zip(starts, [*starts[1:], len(zone)], strict=True):
        pressure = tap[turn[start], zone[start]]
        straight = np.count_nonzero(curvature[start:end] == 0.0)
        middle = start + straight // 3
        taps[middle : middle + max(straight // 25, 3)] = pressure
    speed = meant_speed(curvature, grip[here], limit, stop, decel[here], lateral, lift, daring[here])
    meant = np.maximum(-0.5 * np.diff(speed**2, append=speed[-1] ** 2), 0.0)
    heading = np.cumsum(curvature)
    return Route(
        curvature, np.tile(lap.grade, laps), grip[here], wind * np.cos(heading), np.tile(lap.kerb, laps),
        taps, stop, speed, meant,
    )  # fmt: skip
