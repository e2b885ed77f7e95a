"""Outcome of one scenario of a rig run, in figures."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.report.accuracy import accuracy_per_axle, achieved_deceleration, evaluated
from brakelab.report.brakings import brakings
from brakelab.report.drive import Drive, onto, read_drive, start_ns
from brakelab.report.sparkline import drive_sparkline
from brakelab.report.timing import Spread, read_timing, spread
from brakelab.rig.linings import OF_LININGS, beyond_compensation, tell_linings
from brakelab.rig.reaction import Reaction, raised_alone, reactions
from brakelab.rig.results import Frames, Written
from brakelab.simulation.faults import Fault
from ecu.contract.faults import FAULTS
from ecu.settings.config import Config

STANDSTILL = 0.2  # m/s
SETTLED_ROWS = 50  # 0.5 s
_REMEDY = "run the rig again"


class Outcome(NamedTuple):
    """Outcome of one scenario; NaN where not applicable."""

    scenario: str
    seconds: float
    brakings: int
    decel_error: float
    """Largest |achieved - demanded| [m/s^2] in the rows of `brakelab.report.accuracy.evaluated` whose demand
    has not moved for 0.5 s."""
    nrmse_front: float
    """Of friction, as a share."""
    nrmse_rear: float
    stopping_distance: float
    """From the demand of the last braking that ends at rest to rest [m]."""
    undisturbed: float
    """The same without the scenario's faults [m]."""
    unexplained: list[str]
    """Fault bits that neither an injected fault nor the car's linings account for."""
    of_linings: list[str]
    """Fault bits that the car's linings account for, with what is told by them."""
    reactions: list[Reaction]
    frames: Frames
    differing: int
    """Values that replay did not give again."""
    cycles: int
    missed: int
    lateness: Spread
    """µs"""
    curve: str
    """Demanded and achieved deceleration as SVG."""
    folder: Path


def _steady(demand: Vector) -> NDArray[np.bool_]:
    """Return the rows in whose last 0.5 s the demand [m/s^2] moved less than 0.05, shape (n,)."""
    padded = np.concatenate([np.full(SETTLED_ROWS, np.nan), demand])
    spread = np.ptp(np.lib.stride_tricks.sliding_window_view(padded, SETTLED_ROWS + 1), axis=1)
    return np.asarray(spread < 0.05)


def stopping_distance(truth: Drive) -> float:
    """Return the distance [m] from the demand to rest of the last braking that ends at rest, else NaN."""
    speed = truth.column("vehicle_speed")
    asked = (truth.column("decel_demand") > 0.0) | (truth.column("pedal_position") > 0.0)
    rests = np.flatnonzero((speed[1:] < STANDSTILL) & (speed[:-1] >= STANDSTILL) & asked[1:])
    if not len(rests):
        return math.nan
    end = int(rests[-1]) + 1
    free = np.flatnonzero(~asked[:end])
    begin = int(free[-1]) + 1 if len(free) else 0
    distance = truth.column("distance")
    return float(distance[end] - distance[begin])


class Undisturbed(NamedTuple):
    """The same drive without the faults of its scenario."""

    stopping_distance: float
    """m; NaN: no such drive."""
    faults: frozenset[str]
    """Names of the fault bits that it shows: of a car beyond what compensation may do, for one."""


def account_for(
    drive: Drive, truth: Drive, faults: list[Fault], vehicle: Config, usual: frozenset[str]
) -> tuple[list[str], list[str]]:
    """Return the fault bits that nothing accounts for, and those that the car's linings account for.

    `drive` are the ECU's results, `truth` the vehicle's on its own axis; `usual`: bits shown without the
    scenario's faults too.
    """
    rises = raised_alone(drive, truth, faults)
    beyond = beyond_compensation(truth, vehicle)
    at = np.clip(np.searchsorted(truth.t, drive.t, side="right") - 1, 0, len(truth.t) - 1)
    of_linings = np.where(beyond[at], rises & OF_LININGS, 0)
    rises &= ~of_linings
    alone = [fault.name for fault in FAULTS if (rises & fault.bit).any() and fault.name not in usual]
    why = tell_linings(truth, vehicle) if of_linings.any() else ""
    return alone, [f"{fault.name}: {why}" for fault in FAULTS if (of_linings & fault.bit).any()]


def outcome(
    name: str,
    written: Written,
    truth_path: Path,
    faults: list[Fault],
    vehicle: Config,
    undisturbed: Undisturbed,
    recordings: list[Path],
) -> Outcome:
    """Return the outcome by the files of one drive; fault bits shown without the faults too do not count."""
    drive = read_drive(written.result, ("vehicle_speed",), _REMEDY)
    own = read_drive(truth_path, ("vehicle_speed",), _REMEDY)
    truth = onto(drive, own, truth_path)
    found = brakings(drive, written.result)
    rows = evaluated(drive, truth, found)
    demand = drive.column("decel_demand_total")
    rows &= _steady(demand)
    error = np.abs(achieved_deceleration(drive, truth) - demand)[rows]
    accuracy = accuracy_per_axle(drive, truth, found)
    timings = [read_timing(folder) for folder in recordings]
    lateness = np.concatenate([timing.lateness for timing in timings]) if timings else np.array([np.nan])
    from_start = drive._replace(t=drive.t + 1e-9 * ((start_ns(drive) or 0) - (start_ns(own) or 0)))
    alone, of_linings = account_for(from_start, own, faults, vehicle, undisturbed.faults)
    return Outcome(
        scenario=name,
        seconds=float(own.t[-1]),
        brakings=len(found),
        decel_error=float(error.max()) if len(error) else math.nan,
        nrmse_front=accuracy["front"].nrmse,
        nrmse_rear=accuracy["rear"].nrmse,
        stopping_distance=stopping_distance(own),
        undisturbed=undisturbed.stopping_distance,
        unexplained=alone,
        of_linings=of_linings,
        reactions=reactions(from_start, own, faults),
        frames=written.frames,
        differing=written.differing,
        cycles=len(drive.t),
        missed=sum(timing.missed for timing in timings),
        lateness=spread(lateness),
        curve=drive_sparkline(drive),
        folder=written.result.parent,
    )
