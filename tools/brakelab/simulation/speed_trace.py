"""Speed traces to follow, from a file or from a generator: real driving, or a WLTP-Brake cycle.

A CSV file has the columns `t` [s] and `speed` [m/s]:
```
t,speed
0.0,0.0
2.5,4.0
```
"""

import csv
import math
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.simulation.trip.generate import real_driving
from brakelab.simulation.trip.wltp_brake import TRIPS, wltp_brake
from ecu.errors import UserError

HEADER = ["t", "speed"]
N_TRIPS = len(TRIPS)
"""Of the WLTP-Brake cycle."""


class SpeedTrace(NamedTuple):
    """A speed over time and the grade that belongs to it."""

    speed: NDArray[np.float64]
    """Rows of time [s] and speed [m/s], shape (n, 2)."""
    grade: NDArray[np.float64]
    """Rows of distance [m] and grade [rad], shape (m, 2); without rows: none belongs to it."""


def trace_of(rows: list[tuple[float, float]]) -> SpeedTrace:
    """Return the trace with these rows of time [s] and speed [m/s].

    Raises:
        ValueError: there are fewer than two rows, the time does not rise from 0, or a speed is below 0.
    """
    if len(rows) < 2 or rows[0][0] != 0.0 or any(b[0] <= a[0] for a, b in pairwise(rows)):
        raise ValueError("give rows of rising time from 0.0 on, two at least")
    if not all(math.isfinite(t) and math.isfinite(speed) and speed >= 0.0 for t, speed in rows):
        raise ValueError("give finite times and speeds of at least 0")
    return SpeedTrace(np.array(rows, dtype=np.float64), np.empty((0, 2)))


def read_trace(path: Path) -> SpeedTrace:
    """Read a CSV file.

    Raises:
        UserError: the file cannot be read, or a line is invalid.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise UserError(str(path), "", f"cannot be read ({reason}); give a CSV file with t,speed") from None
    if not lines or [name.strip() for name in lines[0]] != HEADER:
        raise UserError(str(path), "line 1", "start with the line t,speed")
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            t, speed = map(float, line)
        except ValueError:
            raise UserError(
                str(path), f"line {number}", f"give two numbers (found {','.join(line)})"
            ) from None
        rows.append((t, speed))
    try:
        return trace_of(rows)
    except ValueError as error:
        raise UserError(str(path), "", str(error)) from None


@cache
def generated_trace(seed: int) -> SpeedTrace:
    """Return the real-driving cycle of `seed`."""
    cycle = real_driving(seed)
    return SpeedTrace(np.column_stack([cycle.t, cycle.speed]), np.ascontiguousarray(cycle.grade))


def wltp_brake_trace(trip: int | None) -> SpeedTrace:
    """Return a trip of the WLTP-Brake cycle, 1 to `N_TRIPS`, or all in a row; the road is level."""
    return SpeedTrace(wltp_brake(trip), np.empty((0, 2)))
