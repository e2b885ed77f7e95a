"""Friction by measured wheel torque, evaluated as in ECE R13-H, Annex 5, Appendix 2 (thesis, section 6.1).

A wheel force transducer reads the torque of lining and motor about the wheel's axis; the inertia of the hub
is neglected. Torque and pressure are smoothed by a five-point, on-centre moving average. Samples count while
the car brakes with 0.15 to 0.8 g.

- Brake factor c and hold-off pressure p_0: line T = c (p - p_0) of a brake application in which the pressure
  rises by half, by least squares; mean over the applications of an axle.
- Friction: recursive least squares of T over 2 A_k r_eff (p - p_po), p_po the push-out pressure of CONFIG:
  friction that falls with pressure moves p_0 by bars.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector, median
from brakelab.report.accuracy import AXLES
from brakelab.report.brakings import Braking, inside
from brakelab.report.drive import DriveResult
from brakelab.results.car import Car
from brakelab.results.torque_friction import friction_over_time
from ecu.contract.params import BAR, GRAVITY
from ecu.contract.signals import CORNERS

RANGE: Final = (0.15 * GRAVITY, 0.8 * GRAVITY)  # m/s^2
POINTS: Final = 5  # of the moving average
RISES: Final = 1.5  # greatest over least pressure of an application that gives a line
HELD_S: Final = 0.2  # each of them
LEAST_S: Final = 0.3  # of an application
PRESSED: Final = 3.0  # bar


class BrakeFactor(NamedTuple):
    """Brake factor and hold-off pressure of an axle, means over wheels and applications; NaN: no line."""

    factor: float
    """Torque of one brake over its pressure, N m/bar."""
    scatter: float
    """Its standard deviation, N m/bar."""
    hold_off: float
    """Pressure at which the torque begins, bar."""
    friction: float
    """The factor over the configured gain."""
    lines: int
    """Number of wheels and applications."""


class Reference(NamedTuple):
    """Friction and torque as measured, on the rows of the result, and the brake factors by axle."""

    drive: DriveResult
    factors: dict[str, BrakeFactor]


def reference_of(drive: DriveResult, car: Car, found: list[Braking]) -> Reference | None:
    """Return what the transducers of `drive` measured; None: it has none.

    A transducer that reads positive while the wheel is braked is turned.
    """
    if not any(drive.has(f"wheel_torque_y_{corner}") for corner in CORNERS):
        return None
    motors = np.nan_to_num(drive.corners("motor_torque"))
    torque = np.apply_along_axis(_smoothed, 0, -drive.corners("wheel_torque_y") - motors)
    pressure = np.apply_along_axis(
        _smoothed, 0, drive.corners("calliper_pressure") - np.nan_to_num(drive.corners("pressure_zero"))
    )
    pressed = np.where(pressure > PRESSED, torque, 0.0)
    torque = np.where(np.nansum(pressed, axis=0) < 0.0, -torque - 2.0 * motors, torque)
    decel = -drive.column("accel_x_road")
    counts = (decel >= RANGE[0]) & (decel <= RANGE[1])
    dt = median(np.diff(drive.t))
    held = max(round(HELD_S / dt), 1)
    stretches = [inside(drive, one) for one in found]
    stretches = [rows for rows in stretches if (rows.stop - rows.start) * dt >= LEAST_S]
    friction = np.full_like(torque, np.nan)
    factors = {}
    for (axle, wheels), gain, push_out in zip(AXLES.items(), car.gain, car.push_out, strict=True):
        corners = range(*wheels.indices(len(CORNERS)))
        factors[axle] = _factor(
            [
                line
                for rows in stretches
                for i in corners
                if (line := _line(torque[rows, i], pressure[rows, i], counts[rows], held))
            ],
            gain,
        )
        for rows in stretches:
            for i in corners:
                measured = np.isfinite(torque[rows, i] + pressure[rows, i])
                at, on = torque[rows, i], np.maximum(pressure[rows, i] - push_out, 0.0)
                curve = friction_over_time(
                    np.where(measured, at, 0.0), np.where(measured, BAR * on, 0.0), gain / BAR, dt
                )
                friction[rows, i] = np.where(measured & counts[rows] & (on > PRESSED), curve, np.nan)
    columns = {
        f"{stem}_{corner}": values[:, i]
        for stem, values in (("mu_b", friction), ("brake_torque", torque), ("motor_torque", motors))
        for i, corner in enumerate(CORNERS)
    }
    return Reference(DriveResult(drive.t, columns, {}), factors)


def _smoothed(values: Vector) -> Vector:
    """Return the five-point, on-centre moving average, NaN where a point is missing; shape kept."""
    padded = np.pad(values, POINTS // 2, constant_values=np.nan)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, POINTS).mean(axis=1))


def _line(
    torque: Vector, pressure: Vector, counts: NDArray[np.bool_], held: int
) -> tuple[float, float] | None:
    """Return brake factor [N m/bar] and hold-off pressure [bar] of an application; None: it shows no line.

    `held`: rows at the least and at the greatest pressure.
    """
    rows = counts & np.isfinite(torque + pressure) & (pressure > PRESSED)
    ordered = np.sort(pressure[rows])
    if len(ordered) < 2 * held or ordered[-held] < RISES * ordered[held - 1]:
        return None
    factor, offset = np.polyfit(pressure[rows], torque[rows], 1)
    return (float(factor), float(-offset / factor)) if factor > 0.0 else None


def _factor(lines: list[tuple[float, float]], gain: float) -> BrakeFactor:
    if not lines:
        nan = float("nan")
        return BrakeFactor(nan, nan, nan, nan, 0)
    factor, hold_off = np.array(lines).T
    mean = float(factor.mean())
    return BrakeFactor(mean, float(factor.std()), float(hold_off.mean()), mean / gain, len(lines))
