"""Steering: an angle by time, or a driver who follows a path by preview.

Model. The driver looks PREVIEW seconds ahead, takes the lateral offset of the path there from the car's
heading, and steers for the circle that leads there. Over the distance D an offset e takes the curvature 2 e /
D^2; a curvature k takes the angle (L + EG v^2) k, with the wheelbase L and the understeer gradient EG = m / L
(l_r / C_f - l_f / C_r) of the linear one-track model. Hands turn the wheel at a finite rate.

Signs: ISO 8855, left positive. Angles are those of the road wheel.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import GRAVITY
from brakelab.plant.road import value_at

PREVIEW: Final = 0.6  # s. Assumption
SHORTEST_PREVIEW: Final = 5.0  # m. Assumption
LARGEST_ANGLE: Final = 0.5  # rad. Assumption
LARGEST_RATE: Final = 0.8  # rad/s: 730 deg/s of the steering wheel at a ratio of 16. Assumption


class Steering(NamedTuple):
    """Steering by time; without rows: straight on."""

    angle: NDArray[np.float64]
    """Rows of time [s] and angle [rad], shape (n, 2)."""
    path: NDArray[np.float64]
    """Rows of x and y [m] over the ground, x rising, shape (n, 2)."""


HANDS_OFF: Final = Steering(np.empty((0, 2)), np.empty((0, 2)))


@kernel
def understeer_gradient(params: Record) -> float:
    """Return EG [rad per m/s^2]; the stiffnesses are per load, so masses and lengths cancel."""
    front, rear = params.cornering_stiffness[0], params.cornering_stiffness[2]
    return (1.0 / front - 1.0 / rear) / GRAVITY


@kernel
def steer(steering: Steering, params: Record, state: Record, angle: float, dt: float) -> float:
    """Return the angle [rad] for the coming `dt` [s], after `angle`."""
    if len(steering.angle) > 0:
        return value_at(steering.angle, state.t, 1)
    if len(steering.path) == 0:
        return 0.0
    ahead = max(PREVIEW * state.speed_x, SHORTEST_PREVIEW)
    course = state.heading + math.atan2(state.speed_y, max(state.speed_x, 1.0))
    offset = (
        value_at(steering.path, state.position_x + ahead, 1) - state.position_y - ahead * math.sin(course)
    )
    curvature = 2.0 * offset / ahead**2
    base = params.front_length + params.rear_length
    wanted: float = curvature * (base + understeer_gradient(params) * state.speed_x**2)
    wanted = min(max(wanted, -LARGEST_ANGLE), LARGEST_ANGLE)
    return angle + min(max(wanted - angle, -LARGEST_RATE * dt), LARGEST_RATE * dt)
