"""Relations of a drive's motion: each input as a line over its value by the others.

accel_x         dv/dt
yaw_rate        (v_right - v_left) / track, for its sign and unit alone: the outer tyre is pressed flat and
                turns faster, which at 25 m/s is as much as the curve itself
accel_y         v times yaw rate
steering_angle  atan(L yaw rate / v)
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.physics.line import MOVING, RATE, Fit, fit
from brakelab.logs.physics.samples import Car, InputSeries, Rows
from brakelab.logs.physics.scales import CLEAN, is_in_degrees

LEAST_ROWS: Final = int(8 * RATE)
LEAST_CURVED: Final = int(20 * RATE)  # of a lateral acceleration: a car also drifts sideways for a while
LEAST_CHANGE: Final = 0.3  # m/s^2, standard deviation of dv/dt and of v times yaw rate
LEAST_TURN: Final = 0.008  # rad/s, standard deviation


class Relations(NamedTuple):
    """Lines through an input over its value by the others; None: not observable in this drive."""

    accel_x: Fit | None
    swapped: bool
    yaw_rate: Fit | None
    accel_y: Fit | None
    steering: Fit | None


def relate(series: InputSeries, car: Car, wheels: Vector, rows: Rows) -> Relations:
    """Return the lines that a drive shows in the `rows` where it moves; `wheels` [m/s] of shape (n, 4)."""
    speed = wheels.mean(axis=1)

    def line(name: str, reference: Vector, least: float, where: Rows = rows) -> Fit | None:
        if name not in series or where.sum() < LEAST_ROWS or reference[where].std() < least:
            return None
        return fit(series[name], reference, where)

    def cleanest(name: str, references: Iterable[Vector], least: float) -> Fit | None:
        """Of all wheels and of each axle: one that slips or is pressed flat tells less."""
        lines = (line(name, reference, least) for reference in references)
        return max(filter(None, lines), key=lambda one: abs(one.correlation), default=None)

    changes = [
        np.gradient(wheels[:, axle].mean(axis=1), 1.0 / RATE) for axle in (slice(4), slice(2), slice(2, 4))
    ]
    accel_x = cleanest("accel_x", changes, LEAST_CHANGE)
    across = cleanest("accel_y", changes, LEAST_CHANGE)
    swapped = bool(
        accel_x
        and across
        and abs(across.correlation) > CLEAN - 0.1
        and abs(accel_x.correlation) < abs(across.correlation) - 0.3
    )
    turns = (wheels[:, 1] - wheels[:, 0]) / car.track, (wheels[:, 3] - wheels[:, 2]) / car.track
    yaw_rate = cleanest("yaw_rate", (0.5 * (turns[0] + turns[1]), *turns), LEAST_TURN)
    if "yaw_rate" not in series:
        return Relations(accel_x, swapped, None, None, None)
    yaw = series["yaw_rate"]
    scale = np.pi / 180.0 if is_in_degrees(yaw_rate) else 1.0
    curved = rows if rows.sum() >= LEAST_CURVED else np.zeros_like(rows)
    accel_y = line("accel_y", scale * speed * yaw, LEAST_CHANGE, curved)
    curve = np.arctan(car.wheelbase * scale * yaw / np.maximum(np.abs(speed), MOVING))
    steering = line("steering_angle", curve, 0.004)
    return Relations(accel_x, swapped, yaw_rate, None if swapped else accel_y, steering)


def rescaled(relations: Relations, factor: float) -> Relations:
    """Return the lines as they would be with wheels that read `factor` less."""

    def rescale(line: Fit | None) -> Fit | None:
        return line._replace(slope=line.slope * factor) if line else None

    return relations._replace(
        accel_x=rescale(relations.accel_x),
        accel_y=rescale(relations.accel_y),
        yaw_rate=rescale(relations.yaw_rate),
        steering=relations.steering._replace(slope=relations.steering.slope / factor)
        if relations.steering
        else None,
    )
