"""Figures of one drive, from the ECU's results and the truth: what outcome and verdicts are about."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.report.accuracy import (
    Accuracy,
    accuracy_per_axle,
    achieved_deceleration,
    error_at_end,
    evaluated,
)
from brakelab.report.brakings import Braking
from brakelab.report.drive import DriveResult, onto, start_ns
from brakelab.rig.reaction import Reaction, reactions
from brakelab.simulation.faults import Fault

STANDSTILL = 0.2  # m/s
SETTLED_ROWS = 50  # 0.5 s


class Stop(NamedTuple):
    """The last brake application that ends at rest, from the demand to rest; NaN: there is none."""

    distance: float = math.nan
    """m"""
    seconds: float = math.nan


class Figures(NamedTuple):
    """Figures of one drive; NaN where not applicable."""

    drive: DriveResult
    """The ECU's results; time since the car set off, as that of `truth`."""
    truth: DriveResult
    decel_error: float
    """Largest |achieved - demanded| [m/s^2] in the rows of `brakelab.report.accuracy.evaluated` whose demand
    has not moved for 0.5 s."""
    accuracy: dict[str, Accuracy]
    """Of friction, by axle."""
    friction_error: dict[str, float]
    """By axle, at the end of the last brake application, as a share."""
    stop: Stop
    reactions: list[Reaction]


def _steady(demand: Vector) -> NDArray[np.bool_]:
    """Return the rows in whose last 0.5 s the demand [m/s^2] moved less than 0.05, shape (n,)."""
    padded = np.concatenate([np.full(SETTLED_ROWS, np.nan), demand])
    spread = np.ptp(np.lib.stride_tricks.sliding_window_view(padded, SETTLED_ROWS + 1), axis=1)
    return np.asarray(spread < 0.05)


def last_stop(truth: DriveResult) -> Stop:
    """Return the last brake application that ends at rest."""
    speed = truth.column("vehicle_speed")
    asked = (truth.column("decel_demand") > 0.0) | (truth.column("pedal_position") > 0.0)
    rests = np.flatnonzero((speed[1:] < STANDSTILL) & (speed[:-1] >= STANDSTILL) & asked[1:])
    if not len(rests):
        return Stop()
    end = int(rests[-1]) + 1
    free = np.flatnonzero(~asked[:end])
    begin = int(free[-1]) + 1 if len(free) else 0
    distance = truth.column("distance")
    return Stop(float(distance[end] - distance[begin]), float(truth.t[end] - truth.t[begin]))


def figures(
    drive: DriveResult, own: DriveResult, truth_path: Path, found: list[Braking], faults: list[Fault]
) -> Figures:
    """Return the figures of a drive with the brake applications `found`; `own`: truth on its own time axis.

    Raises:
        UserError: results and truth are not of one drive.
    """
    truth = onto(drive, own, truth_path)
    demand = drive.column("decel_demand_total")
    rows = evaluated(drive, truth, found) & _steady(demand)
    error = np.abs(achieved_deceleration(drive, truth) - demand)[rows]
    from_start = drive._replace(t=drive.t + 1e-9 * ((start_ns(drive) or 0) - (start_ns(own) or 0)))
    return Figures(
        drive=from_start,
        truth=own,
        decel_error=float(error.max()) if len(error) else math.nan,
        accuracy=accuracy_per_axle(drive, truth, found),
        friction_error=error_at_end(drive, truth, found),
        stop=last_stop(own),
        reactions=reactions(from_start, own, faults),
    )
