"""Road by distance: friction and height under each side, grade and bank.

Friction has a left and a right value: a table describes a patch, a change of surface or a split road (dry
about 1.2, wet 0.7, ice 0.2). Each axle meets a place when it reaches it: the front axle is `front_length`
ahead of the centre of gravity.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.plant.jit import Record, kernel


class Road(NamedTuple):
    """Tables over distance [m], rising; a table without rows: not described by place."""

    friction: NDArray[np.float64]
    """Rows of distance, friction left, friction right, shape (n, 3)."""
    height: NDArray[np.float64]
    """Rows of distance, height left, height right [m], shape (n, 3)."""
    grade: NDArray[np.float64]
    """Rows of distance and grade [rad], uphill positive, shape (n, 2)."""
    bank: NDArray[np.float64]
    """Rows of distance and bank [rad], left side high positive, shape (n, 2)."""


LEVEL: Final = Road(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 2)), np.empty((0, 2)))
"""A road of which nothing is described by place."""


@kernel
def value_at(table: NDArray[np.float64], place: float, column: int) -> float:
    """Return a column's value at `place` of the rising first one: linear between rows, constant outside.

    The table, shape (n, columns), needs a row; the first column is a distance [m] or a time [s].
    """
    low, high = 0, len(table) - 1
    first: float = table[low, column]
    last: float = table[high, column]
    if place <= table[low, 0]:
        return first
    if place >= table[high, 0]:
        return last
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle, 0] <= place:
            low = middle
        else:
            high = middle
    part = (place - table[low, 0]) / (table[high, 0] - table[low, 0])
    return table[low, column] + part * (table[high, column] - table[low, column])


@kernel
def is_described(road: Road) -> bool:
    """Return whether the road is described by distance."""
    return len(road.friction) > 0 or len(road.height) > 0 or len(road.grade) > 0 or len(road.bank) > 0


@kernel
def set_road(road: Road, params: Record, state: Record, commands: Record) -> None:
    """Set the road under the car, as far as it is described by distance."""
    if len(road.friction) > 0 or len(road.height) > 0:
        for wheel in range(4):
            along = params.front_length if wheel < 2 else -params.rear_length
            place = state.distance + along
            column = 1 + wheel % 2
            if len(road.friction) > 0:
                commands.road_friction[wheel] = value_at(road.friction, place, column)
            if len(road.height) > 0:
                commands.road_height[wheel] = value_at(road.height, place, column)
    if len(road.grade) > 0:
        commands.grade = value_at(road.grade, state.distance, 1)
    if len(road.bank) > 0:
        commands.bank = value_at(road.bank, state.distance, 1)
