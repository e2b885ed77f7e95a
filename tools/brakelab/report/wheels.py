"""Linked plots over a drive: slip and speeds of the wheels, torques, pedals, what the car does across."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from bokeh.models import ColumnDataSource, Range1d

from brakelab.arrays import Vector, median
from brakelab.report.downsample import Buckets, drawn
from brakelab.report.drive import DriveResult
from brakelab.report.look import (
    DEMAND,
    ESTIMATE,
    INK,
    LEFT,
    QUIET,
    RIGHT,
    STAGE_COLOURS,
    draw_line,
    time_figure,
)
from ecu.contract.signals import CORNERS

LEAST_TORQUE: Final = 100.0
"""N m of brakes and motors together, below which a share is noise."""
ROLLS: Final = 10.0  # rad/s
_LEAST_SLIP, _LEAST_KMH, _LEAST_TORQUE, _LEAST_PERCENT = 2.0, 10.0, 200.0, 20.0
_LEAST_ACROSS, _LEAST_YAW = 1.0, 0.1
_SIDES: Final = (("left", LEFT, "dashed"), ("right", RIGHT, "dotted"))
# Label, colour, dash of each wheel's speed.
_WHEELS: Final = {
    "fl": ("FL", LEFT, "solid"),
    "fr": ("FR", RIGHT, "solid"),
    "rl": ("RL", LEFT, "dashed"),
    "rr": ("RR", RIGHT, "dashed"),
}
# Column, label, colour: of a plot.
_TORQUES: Final = (
    ("brakes", "brakes", ESTIMATE),
    ("motors_front", "motors front", STAGE_COLOURS[3]),
    ("motors_rear", "motors rear", STAGE_COLOURS[1]),
)
_ACROSS: Final = (("accel_y", "measured", ESTIMATE), ("accel_y_true", "true", INK))
_YAW: Final = (
    ("yaw_rate", "yaw rate [rad/s]", ESTIMATE),
    ("yaw_rate_true", "true", INK),
    ("steering_angle", "road wheels [rad]", DEMAND),
)
_PEDALS: Final = (("pedal", "brake", DEMAND), ("accelerator", "accelerator", STAGE_COLOURS[1]))


def plots_of_wheels(
    drive: DriveResult, truth: DriveResult | None, grid: Buckets, span: Range1d
) -> dict[str, Any]:
    """Return the figures by name in reading order, all over the range `span`; those without a line, too."""
    source = ColumnDataSource(drawn(grid, drive.t, _lines(drive, truth)))
    return {
        "slip-front": _slip(source, span, "front", ("fl", "fr")),
        "slip-rear": _slip(source, span, "rear", ("rl", "rr")),
        "wheel-speed": _speeds(source, span),
        "torques": _few(source, span, "Braking torque [N m]", _LEAST_TORQUE, _TORQUES),
        "motor-share": _few(
            source, span, "Motors' share [%]", _LEAST_PERCENT, (("share", "of the braking torque", ESTIMATE),)
        ),
        "across": _few(source, span, "Lateral acceleration [m/s²]", _LEAST_ACROSS, _ACROSS),
        "yaw": _few(source, span, "Yaw rate, steering", _LEAST_YAW, _YAW),
        "pedals": _few(source, span, "Pedals [%]", _LEAST_PERCENT, _PEDALS),
    }


def motors_share(drive: DriveResult) -> Vector:
    """Return the motors' part of the braking torque [%], shape (n,); NaN where nothing brakes."""
    if not any(drive.has(f"motor_torque_{corner}") for corner in CORNERS):
        return np.full(len(drive.t), np.nan)
    motors = np.nan_to_num(drive.corners("motor_torque")).sum(axis=1).clip(min=0.0)
    brakes = np.nan_to_num(drive.corners("brake_torque")).sum(axis=1).clip(min=0.0)
    both = brakes + motors
    brakes_now = (drive.column("braking") == 1.0) & (both > LEAST_TORQUE)
    return np.where(brakes_now, 100.0 * motors / np.maximum(both, LEAST_TORQUE), np.nan)


def _lines(drive: DriveResult, truth: DriveResult | None) -> Iterator[tuple[str, Vector]]:
    speed = 3.6 * np.abs(drive.column("vehicle_speed"))
    yield "speed", speed
    for corner in CORNERS:
        slip = drive.column(f"slip_{corner}")
        yield f"slip_{corner}", 100.0 * slip
        yield f"speed_{corner}", road_speed(drive.column(f"wheel_speed_{corner}"), speed * (1.0 + slip))
        if truth is not None:
            # Standing and creeping wheels slip by anything; the ECU reports none there.
            yield (
                f"slip_true_{corner}",
                100.0 * np.where(np.isfinite(slip), truth.column(f"slip_{corner}"), np.nan),
            )
    motors = drive.corners("motor_torque")
    if np.isfinite(motors).any() and (motors != 0.0).any():
        for axle, wheels in (("front", slice(0, 2)), ("rear", slice(2, 4))):
            if np.nan_to_num(motors[:, wheels]).any():
                yield f"motors_{axle}", motors[:, wheels].sum(axis=1)
        yield "share", motors_share(drive)
        yield "brakes", drive.corners("brake_torque").sum(axis=1)
    for name in ("accel_y", "yaw_rate", "steering_angle"):
        yield name, drive.column(name)
    if truth is not None:
        for name in ("accel_y", "yaw_rate"):
            yield f"{name}_true", truth.column(name)
    pedal = drive if drive.has("pedal_position") or truth is None else truth
    for name, values in (
        ("pedal", pedal.column("pedal_position")),
        ("accelerator", drive.column("accelerator_position")),
    ):
        if np.nan_to_num(values).any():
            yield name, values


def road_speed(turned: Vector, by_slip: Vector) -> Vector:
    """Return a wheel's speed over the road [km/h]: measured [rad/s] if the result has it, else by its slip.

    Its rolling radius is the one that its slip was computed with.
    """
    both = np.isfinite(by_slip) & (turned > ROLLS)
    return turned * median(by_slip[both] / turned[both]) if both.any() else by_slip


def _slip(source: ColumnDataSource, span: Range1d, axle: str, corners: tuple[str, str]) -> Any:
    plot = time_figure(f"Slip {axle} [%]", span, _LEAST_SLIP)
    for corner, (side, colour, _) in zip(corners, _SIDES, strict=True):
        draw_line(plot, source, f"slip_{corner}", side, colour, line_width=1.4)
    for corner, (side, _, dash) in zip(corners, _SIDES, strict=True):
        draw_line(plot, source, f"slip_true_{corner}", f"{side}, true", INK, line_dash=dash, line_width=1.2)
    return plot


def _speeds(source: ColumnDataSource, span: Range1d) -> Any:
    plot = time_figure("Wheels [km/h]", span, _LEAST_KMH)
    if not any(f"speed_{corner}" in source.column_names for corner in _WHEELS):
        return plot
    draw_line(plot, source, "speed", "car", QUIET, line_width=3.0, line_alpha=0.5)
    for corner, (label, colour, dash) in _WHEELS.items():
        draw_line(plot, source, f"speed_{corner}", label, colour, line_dash=dash, line_width=1.2)
    return plot


def _few(
    source: ColumnDataSource,
    span: Range1d,
    label: str,
    least_span: float,
    lines: tuple[tuple[str, str, str], ...],
) -> Any:
    plot = time_figure(label, span, least_span)
    if label.endswith("[%]"):
        plot.y_range.start = 0.0
    for name, of, colour in lines:
        dash = "dashed" if name.endswith("_true") else "solid"
        draw_line(plot, source, name, of, colour, line_width=1.4, line_dash=dash)
    return plot
