"""Error of the estimated friction, counted as in the thesis's Table 4.3.

nRMSE = sqrt(mean((estimate - truth)^2)) / mean(truth), over both wheels of an axle, in every brake
application from 0.5 s after the demand is reached down to 15 km/h.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector, median
from brakelab.report.brakings import Braking, inside
from brakelab.report.drive import DriveResult

AXLES = {"front": slice(0, 2), "rear": slice(2, 4)}

SETTLING_S = 0.5  # after the demand is reached: pressure and slip have settled
LOWEST_SPEED = 15.0 / 3.6  # m/s, the observers switch off below (thesis, 4.4)
# The demand counts as reached at this share: before compensation the friction may be 20 % low.
REACHED = 0.8
# Motors braking with more than this share of the brakes' torque, and not on the ECU's demand, mask it.
MOTORS = 0.1


class Accuracy(NamedTuple):
    """Errors of one axle's friction, as shares of the mean true friction; NaN without any sample."""

    nrmse: float
    bias: float
    """Mean of estimate minus truth."""
    inside: float
    """Share of the samples whose truth lies within ±2σ: 0.95 if σ is honest."""
    seconds: float
    """Driving time that was evaluated."""


def achieved_deceleration(drive: DriveResult, truth: DriveResult | None) -> Vector:
    """Return the true deceleration where it is known, else the measured one [m/s^2], shape (n,)."""
    return -(truth if truth and truth.has("accel_x_road") else drive).column("accel_x_road")


def evaluated(drive: DriveResult, truth: DriveResult | None, found: list[Braking]) -> NDArray[np.bool_]:
    """Return the rows evaluated, shape (n,); `truth` lies on the time axis of `drive`."""
    demand = drive.column("decel_demand_total")
    achieved = achieved_deceleration(drive, truth)
    speed = (truth if truth and truth.has("vehicle_speed") else drive).column("vehicle_speed")
    rows = np.zeros(len(drive.t), bool)
    for braking in found:
        within = inside(drive, braking)
        t, asked = drive.t[within], demand[within]
        reached = np.flatnonzero((asked > 0.0) & (achieved[within] >= REACHED * asked))
        if reached.size:
            settled = t >= t[reached[0]] + SETTLING_S
            rows[within] |= settled & (asked > 0.0) & (speed[within] >= LOWEST_SPEED)
    return rows


def tracking(drive: DriveResult, truth: DriveResult | None, found: list[Braking]) -> list[float]:
    """Return per brake application the relative excess of achieved over demanded deceleration.

    NaN: nothing to evaluate, or motors braked on another controller's demand.
    """
    rows = evaluated(drive, truth, found)
    demand, achieved = drive.column("decel_demand_total"), achieved_deceleration(drive, truth)
    motors, brakes, asked = (
        np.nan_to_num(drive.corners(name)).sum(axis=1)
        for name in ("motor_torque", "brake_torque", "motor_demand")
    )
    shares = []
    for braking in found:
        within = inside(drive, braking)
        mine = within.start + np.flatnonzero(rows[within])
        known = mine.size and not (motors - asked)[mine].sum() > MOTORS * brakes[mine].sum() > 0.0
        shares.append(float(achieved[mine].sum() / demand[mine].sum()) - 1.0 if known else float("nan"))
    return shares


def accuracy(estimate: Vector, sigma: Vector, true: Vector, dt: float) -> Accuracy:
    """Return the errors of an axle; all arrays of shape (rows, wheels), dt the time between rows [s]."""
    error = estimate - true
    known = np.isfinite(error)
    if not known.any():
        return Accuracy(np.nan, np.nan, np.nan, 0.0)
    mean = float(true[known].mean())
    within = np.abs(error[known]) <= 2.0 * sigma[known]
    return Accuracy(
        nrmse=float(np.sqrt(np.mean(error[known] ** 2))) / mean,
        bias=float(error[known].mean()) / mean,
        inside=float(within.mean()),
        seconds=float(known.any(axis=1).sum()) * dt,
    )


def accuracy_per_axle(drive: DriveResult, truth: DriveResult, found: list[Braking]) -> dict[str, Accuracy]:
    """Return the accuracy of the front and the rear axle over all brake applications."""
    rows = evaluated(drive, truth, found)
    dt = median(np.diff(drive.t))
    estimate, sigma, true = drive.corners("mu_b"), drive.corners("sigma_mu_b"), truth.corners("mu_b")
    return {
        axle: accuracy(estimate[rows, wheels], sigma[rows, wheels], true[rows, wheels], dt)
        for axle, wheels in AXLES.items()
    }


def error_at_end(drive: DriveResult, truth: DriveResult, found: list[Braking]) -> dict[str, float]:
    """Return by axle |estimate - truth| of friction over the truth in the last row evaluated; NaN: none."""
    rows = np.flatnonzero(evaluated(drive, truth, found))[-1:]
    if not len(rows):
        return dict.fromkeys(AXLES, float("nan"))
    estimate, true = drive.corners("mu_b")[rows], truth.corners("mu_b")[rows]
    return {
        axle: float(abs(estimate[:, wheels].mean() / true[:, wheels].mean() - 1.0))
        for axle, wheels in AXLES.items()
    }
