"""Errors of a simulated drive against its truth.

Counted from 0.5 s after the deceleration demand has its full value, down to 15 km/h:

friction      nRMSE = sqrt(mean((estimate - truth)^2)) / mean(truth) over both wheels of an axle
deceleration  sum over the wheels of (brake torque + motor torque) / rolling radius, over the mass, all true
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.simulation.closed_loop import Drive, Loop
from ecu.contract.signals import CORNERS

AXLES: Final = {"front": CORNERS[:2], "rear": CORNERS[2:]}
SETTLING_S: Final = 0.5
LOWEST_SPEED: Final = 15.0 / 3.6  # m/s
FULL: Final = 0.999  # of the demand


def achieved_decel(loop: Loop, drive: Drive) -> Vector:
    """Return the deceleration [m/s^2] by the torques of a drive and the mass of its car, shape (n,)."""
    truth = drive.truth
    force = sum(
        (truth[f"brake_torque_{c}"] + truth[f"motor_torque_{c}"]) / truth[f"rolling_radius_{c}"]
        for c in CORNERS
    )
    return np.asarray(force) / float(loop.sides.vehicle.params["mass"][0])


def window(drive: Drive) -> NDArray[np.bool_]:
    """Return the counted rows, shape (n,)."""
    demand, speed = drive.truth["decel_demand"], drive.truth["vehicle_speed"]
    reached = drive.t[np.argmax(demand >= FULL * demand.max())]
    rows: NDArray[np.bool_] = (drive.t >= reached + SETTLING_S) & (speed > LOWEST_SPEED)
    return rows


def nrmse(estimate: Vector, true: Vector) -> float:
    """Return the root mean square error over the mean of the truth [%]."""
    return float(100.0 * np.sqrt(np.mean((estimate - true) ** 2)) / np.mean(true))


def columns(table: dict[str, Vector], stem: str, axle: str, rows: NDArray[np.bool_]) -> Vector:
    """Return both wheels of an axle, shape (2, rows)."""
    return np.stack([table[f"{stem}_{corner}"][rows] for corner in AXLES[axle]])


def estimate_errors(drive: Drive, rows: NDArray[np.bool_], axle: str) -> tuple[float, float]:
    """Return nRMSE [%] and share inside 2σ of an axle's friction over `rows`."""
    true = columns(drive.truth, "mu_b", axle, rows)
    estimate = columns(drive.outputs, "mu_b", axle, rows)
    sigma = columns(drive.outputs, "sigma_mu_b", axle, rows)
    return nrmse(estimate, true), float(np.mean(np.abs(estimate - true) <= 2.0 * sigma))


def friction_errors(
    drive: Drive, rows: NDArray[np.bool_], axle: str, nominal: float
) -> tuple[float, float, float]:
    """Return nRMSE [%], share inside 2σ and nRMSE of the nominal friction [%] over `rows`."""
    true = columns(drive.truth, "mu_b", axle, rows)
    return *estimate_errors(drive, rows, axle), nrmse(np.full_like(true, nominal), true)
