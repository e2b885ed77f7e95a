"""Everything that drives show of a car, from windows to parameters: forces, wheels, sensors in turn.

Kinematics (dive, zero of the accelerometer, deflection of the tyres) need the wheels' slip, forces need the
kinematics: three rounds, each with the other's result as its prior.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.vehicle.fit import Fit, Prior, Residuals, fit
from brakelab.identify.vehicle.model import (
    Place,
    Signals,
    motion,
    prior_of,
    residuals_of,
    seen,
    signals_of,
)
from brakelab.identify.vehicle.reader import DriveSamples
from brakelab.identify.vehicle.sensors import (
    Steps,
    accel_zero,
    dive_of,
    lateral_zero,
    steps_of,
    yaw_zero,
)
from brakelab.identify.vehicle.wheels import Pairs, pairs_of
from brakelab.identify.vehicle.windows import SECONDS, Windows, cut, pressure_zeros
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

ROUNDS: Final = 3
RATE: Final = 100.0  # Hz, of samples at most
FEWEST_WINDOWS: Final = 6  # windows of forces or wheels
DEFLECTION_MODEL: Final = 0.04  # relative, of two axles that differ


class Zeros(NamedTuple):
    """Zeros of sensors with their standard deviations; None: not to be seen."""

    accel_x: tuple[float, float]
    accel_y: tuple[float, float] | None
    yaw_rate: tuple[float, float] | None
    pressure: list[tuple[str, float, float]]
    """bar, by drive and corner."""


class Identified(NamedTuple):
    """What drives show of a car."""

    signals: Signals
    prior: Prior
    """START's, of `Place`."""
    known: Prior
    """The same with what kinematics say."""
    fit: Fit
    residuals: Residuals
    windows: Windows
    pairs: Pairs | None
    dive: tuple[float, float, int] | None
    zeros: Zeros
    steps: Steps


def identify(drives: Sequence[DriveSamples], start: RecordArray, closed: bool) -> Identified:
    """Return what `drives` show of the car that `start`, `PARAMS` of shape (1,), describes about.

    `closed`: each drive ends at the height where it began.

    Raises:
        UserError: too little in them can be used.
    """
    params: Any = start[0]
    zeros = [pressure_zeros(drive) for drive in drives]
    windows = cut(drives, zeros, float(np.mean(params["wheel_radius"])))
    signals = signals_of(windows, params)
    prior = prior_of(params, signals)
    noise = _noise(drives, params)
    residuals = residuals_of(windows, params, signals, noise)
    if len(residuals.kind) < FEWEST_WINDOWS:
        raise UserError(
            drives[0].name,
            "",
            "hardly a steady stretch on a straight road; give a longer drive with brake applications",
        )
    found, known = fit(residuals, prior), prior
    still = yaw_zero(windows)
    for _ in range(ROUNDS):
        moving = motion(found.theta, seen(windows, 0), params)
        radius = np.exp(found.theta[[Place.RADIUS_F, Place.RADIUS_R]])
        pairs = pairs_of(windows, radius, moving.slip, still, params)
        steps = steps_of(windows, _speed(found.theta, windows, params))
        start_dive = float(prior.mean[Place.PITCH]), float(prior.sigma[Place.PITCH])
        dive = dive_of(steps, start_dive) if signals.speed else None
        gradient = dive[0] if dive else start_dive[0]
        zero = accel_zero(windows, steps, gradient, closed)
        known = _with(prior, pairs, dive, zero)
        found = fit(residuals, known, found.theta)
    yaw = still or (pairs.yaw_zero if pairs else None)
    across = lateral_zero(windows, float(radius.mean()), yaw) if yaw else None
    sensors = Zeros(zero, across, yaw, _pressures(drives, zeros, windows))
    return Identified(signals, prior, known, found, residuals, windows, pairs, dive, sensors, steps)


def _noise(drives: Sequence[DriveSamples], params: Any) -> tuple[float, float]:
    """Return what sensors alone scatter in a window: accelerometer [m/s^2], speed of an axle [m/s]."""
    root = np.sqrt(RATE * SECONDS)
    accel = max(drive.spread["accel_x"] for drive in drives) / root
    wheel = max(drive.spread[f"wheel_speed_{corner}"] for drive in drives for corner in CORNERS)
    wheel *= float(np.mean(params["wheel_radius"])) / np.sqrt(2.0) / root
    reference = max(drive.spread.get("vehicle_speed", 0.0) for drive in drives) / root
    return max(accel, 1e-3), max(float(np.hypot(wheel, reference)), 2e-3)


def _speed(theta: Vector, windows: Windows, params: Any) -> Vector:
    """Return the speed by all wheels [m/s] by halves, shape (2, n), NaN: not known."""
    known = windows.free | windows.braking
    by_half = [motion(theta, seen(windows, half), params).axle.mean(axis=0) for half in range(2)]
    return np.where(known, np.stack(by_half), np.where(windows.standing, 0.0, np.nan))


def _with(
    prior: Prior, pairs: Pairs | None, dive: tuple[float, float, int] | None, zero: tuple[float, float]
) -> Prior:
    """Return START's prior with what kinematics say."""
    mean, sigma = prior.mean.copy(), prior.sigma.copy()
    mean[Place.ZERO], sigma[Place.ZERO] = zero
    if dive:
        mean[Place.PITCH], sigma[Place.PITCH] = dive[:2]
    if pairs and 0.0 < 2.0 * pairs.deflection[1] < pairs.deflection[0]:
        value, spread = pairs.deflection
        mean[Place.DEFLECTION] = np.log(value)
        sigma[Place.DEFLECTION] = float(np.hypot(spread / value, DEFLECTION_MODEL))
    return Prior(mean, sigma)


def _pressures(
    drives: Sequence[DriveSamples], zeros: Sequence[Vector], windows: Windows
) -> list[tuple[str, float, float]]:
    rows = []
    for place, (drive, zero) in enumerate(zip(drives, zeros, strict=True)):
        if not drive.has("calliper_pressure"):
            continue
        free = int(np.count_nonzero(windows.free & (windows.drive == place)))
        for corner, value in zip(CORNERS, zero.tolist(), strict=True):
            noise = drive.spread[f"calliper_pressure_{corner}"]
            sigma = float(np.hypot(noise / np.sqrt(max(free, 1) * SECONDS * RATE), 0.02))
            rows.append((f"calliper_pressure_{corner}", value, sigma))
    return rows
