"""Check of a trip against the rules for real driving emissions (Table 1.1), and its applications (Table 1.2).

Works on any trip: a reference to be driven, or a recorded one. Urban, rural and motorway operation are
distinguished by speed alone (up to 60, up to 90, above 90 km/h; EU 2016/427, annex IIIA), so no map is
needed.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.stretches import stretches

KMH: Final = 1.0 / 3.6  # m/s
STOPPED: Final = 1.0 * KMH
URBAN: Final = 60.0 * KMH
RURAL: Final = 90.0 * KMH
MOTORWAY: Final = 100.0 * KMH
"""The regulation counts the time on a motorway from here, though the distance from `RURAL`."""

BRAKING_FROM: Final = 0.5  # m/s^2, more than by rolling out. Assumption
SHORTEST_GAP: Final = 0.5  # s; events closer together are one brake application. Assumption
LEAST_LOSS: Final = 5.0 * KMH  # m/s, of speed. Assumption


class Row(NamedTuple):
    """A row of Table 1.1: the requirement is low < value < high."""

    name: str
    unit: str
    low: float
    high: float
    ilmenau: float
    """The value of the cycle of Ilmenau, as printed."""
    value: float

    @property
    def met(self) -> bool:
        """Return whether the trip meets this row."""
        return self.low < self.value < self.high


class Brakings(NamedTuple):
    """The brake applications of a trip in the order of time, each array of shape (brake applications,)."""

    start: Array
    """s"""
    duration: Array
    """s"""
    speed_in: Array
    """m/s"""
    speed_out: Array
    """m/s"""
    mean_decel: Array
    """Mean fully developed deceleration [m/s^2]."""


def distance_driven(t: Array, speed: Array) -> Array:
    """Return the distance [m] at each `t` [s], from 0, of a car at `speed` [m/s]."""
    return np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (speed[1:] + speed[:-1]))])


def height_gained(t: Array, speed: Array, grade: Array) -> Array:
    """Return the height [m] over the start at each `t` [s], on a road of `grade` [rad]."""
    climb = speed * np.sin(grade)
    return np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (climb[1:] + climb[:-1]))])


def trip_rows(t: Array, speed: Array, grade: Array) -> list[Row]:
    """Return the rows of Table 1.1 for a trip: `t` [s], `speed` [m/s] and `grade` [rad], all of shape (n,).

    Stop time is taken relative to the whole trip and the time on a motorway starts at 100 km/h; both are the
    stricter of two readings (the regulation takes stops as a share of the urban time, the table names no
    speed).
    """
    dt = np.diff(t)
    mean = 0.5 * (speed[1:] + speed[:-1])
    metres = mean * dt
    length, lasted = float(metres.sum()), float(t[-1] - t[0])
    urban, motorway = mean <= URBAN, mean > RURAL
    rural = ~urban & ~motorway
    parts = {
        name: float(metres[where].sum())
        for name, where in (("Urban", urban), ("Rural", rural), ("Motorway", motorway))
    }
    gain = float(np.maximum(np.diff(height_gained(t, speed, grade)), 0.0).sum())
    stopped = float(dt[mean < STOPPED].sum())
    fast = float(dt[mean > MOTORWAY].sum())

    some, free = np.inf, -np.inf
    distances = zip(parts.items(), (32.0, 31.0, 24.0), strict=True)
    shares = zip(parts.items(), ((29.0, 44.0, 37.0), (23.0, 43.0, 35.0), (23.0, 43.0, 27.0)), strict=True)
    urban_speed = parts["Urban"] / float(dt[urban].sum()) / KMH if urban.any() else np.nan
    return [
        Row("Duration", "min", 90.0, 120.0, 100.0, lasted / 60.0),
        *(
            Row(f"{n} trip distance", "km", 16.0, some, as_printed, m / 1e3)
            for (n, m), as_printed in distances
        ),
        *(Row(f"Share of {n.lower()}", "%", *three, 100.0 * m / length) for (n, m), three in shares),
        Row("Share of stop time", "%", 10.0, some, 12.0, 100.0 * stopped / lasted),
        Row("Time on motorway", "min", 5.0, some, 12.0, fast / 60.0),
        Row("Average urban speed", "km/h", 15.0, 40.0, 28.0, urban_speed),
        Row("Maximum speed", "km/h", free, 145.0, 120.0, float(speed.max()) / KMH),
        Row("Positive altitude gain", "m/100 km", free, 1200.0, 1062.0, gain / length * 1e5),
    ]


def brakings(t: Array, speed: Array, decel: Array) -> Brakings:
    """Return the brake applications in a trip: `t` [s], `speed` [m/s], `decel` [m/s^2], all of shape (n,).

    A braking decelerates by more than `BRAKING_FROM` and takes at least `LEAST_LOSS` of the speed. Its mean
    deceleration is that of ECE R13-H, (v_b^2 - v_e^2)/(2 (s_e - s_b)), with v_b and v_e where 80 % and 10 %
    of the loss are still to come; for a stop these are the regulation's 0.8 and 0.1 of the initial speed.
    """
    starts, ends = stretches(decel > BRAKING_FROM).T  # an end is the first sample after
    if len(starts):
        apart = t[starts[1:]] - t[ends[:-1] - 1] >= SHORTEST_GAP
        starts, ends = starts[np.append(True, apart)], ends[np.append(apart, True)]
    place = distance_driven(t, speed)
    found = []
    for first, end in zip(starts, ends - 1, strict=True):
        v_in, v_out = speed[first], speed[end]
        if v_in - v_out < LEAST_LOSS:
            continue
        falling = np.minimum.accumulate(speed[first : end + 1])[::-1]
        v_b, v_e = v_out + 0.8 * (v_in - v_out), v_out + 0.1 * (v_in - v_out)
        s_b, s_e = np.interp((v_b, v_e), falling, place[first : end + 1][::-1])
        found.append((t[first], t[end] - t[first], v_in, v_out, 0.5 * (v_b**2 - v_e**2) / (s_e - s_b)))
    return Brakings(*np.array(found, np.float64).reshape(-1, 5).T)
