"""Drives recorded once for many tunings: inputs, truth, and the counted rows.

A brake application counts from 0.5 s after its start down to 15 km/h. Its error is

    nRMSE = sqrt(mean((estimate - truth)^2)) / mean(truth)     over both wheels of an axle

and a session's is the mean over the applications of each drive, then over the drives: three long stops weigh
as much as twelve short ones, as in Table 6.1.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Array
from brakelab.simulation.accuracy import AXLES, LOWEST_SPEED, SETTLING_S, columns, estimate_errors
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.ecu_inputs import ecu_inputs, vehicle_frames
from brakelab.simulation.scenario import Scenario
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, CYCLE_NS
from ecu.settings.config import Config

PER_SECOND: Final = 1_000_000_000 // CYCLE_NS
AROUND_S: Final = 20.0
"""Of driving that is kept before and after the brake is used; what lies between teaches nothing new. The
speed needs some of it to settle after a cut: errors change by less than 0.1 of a per cent, with 5 s by 15.
"""
SHORTEST_S: Final = 0.5
"""An application of which less counts is none."""


class Recording(NamedTuple):
    """One drive of one car."""

    inputs: RecordArray
    """`INPUTS`, shape (n,)."""
    mu_b: Array
    """True friction, shape (n, 4)."""
    braking: NDArray[np.int64]
    """Number of the brake application that counts in a cycle, from 0; -1: none. Shape (n,)."""


class Errors(NamedTuple):
    """Errors over a session, in %: shape (front and rear,)."""

    nrmse: Array
    inside_2_sigma: Array
    """Share of the samples whose truth lies within ±2σ."""


def applications(drive: Drive) -> NDArray[np.int64]:
    """Return the number of the brake application counted in each row, -1: none; shape (n,)."""
    on = drive.outputs["braking"] > 0.5
    starts = np.flatnonzero(np.diff(on, prepend=False) & on)
    numbers = np.full(len(on), -1)
    for start in starts:
        length = np.argmin(np.append(on[start:], False))
        rows = np.arange(start + round(SETTLING_S * PER_SECOND), start + length)
        rows = rows[drive.truth["vehicle_speed"][rows] > LOWEST_SPEED]
        if len(rows) >= SHORTEST_S * PER_SECOND:
            numbers[rows] = numbers.max() + 1
    return numbers


class Application(NamedTuple):
    """Friction in one brake application: shape (front and rear,)."""

    nrmse: Array
    """%."""
    inside_2_sigma: Array
    """Share of the samples whose truth lies within ±2σ [%]."""
    true: Array
    """Mean of the true friction."""
    estimated: Array
    """Mean of the estimate."""


def application_errors(drive: Drive) -> list[Application]:
    """Return the ECU's own estimate in each brake application that counts."""
    number, found = applications(drive), []
    for rows in (number == each for each in range(number.max() + 1)):
        errors = np.array([estimate_errors(drive, rows, axle) for axle in AXLES])
        true, estimated = (
            np.array([columns(table, "mu_b", axle, rows).mean() for axle in AXLES])
            for table in (drive.truth, drive.outputs)
        )
        found.append(Application(errors[:, 0], 100.0 * errors[:, 1], true, estimated))
    return found


def drive_errors(drive: Drive) -> Errors:
    """Return the errors of the ECU's own estimate during the drive; NaN without an application."""
    found = application_errors(drive)
    if not found:
        return Errors(np.full(len(AXLES), np.nan), np.full(len(AXLES), np.nan))
    return mean_errors(Errors(each.nrmse, each.inside_2_sigma) for each in found)


def mean_errors(errors: Iterable[Errors]) -> Errors:
    """Return the mean over drives or brake applications."""
    nrmses, inside = zip(*errors, strict=True)
    return Errors(np.mean(nrmses, axis=0), np.mean(inside, axis=0))


def drive_once(scenario: Scenario, config: Config, seed: int) -> Drive:
    """Return a drive in closed loop, car and noise drawn from `seed`."""
    return run(new_loop(scenario, config, seed))


def recording(drive: Drive) -> Recording:
    """Return the part of a drive that is stepped through again."""
    braking = applications(drive)
    inputs = ecu_inputs(vehicle_frames(drive.frames), len(drive.t))
    mu_b = np.stack([drive.truth[f"mu_b_{corner}"] for corner in CORNERS], axis=1)
    rows, around = np.arange(len(drive.t)), round(AROUND_S * PER_SECOND)
    before = np.concatenate([[0.0], np.cumsum(drive.outputs["braking"])])
    kept = before[np.minimum(rows + around, len(rows))] > before[np.maximum(rows - around, 0)]
    return Recording(inputs[kept].copy(), mu_b[kept].copy(), braking[kept].copy())
