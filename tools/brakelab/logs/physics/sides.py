"""Left and right pressures of an axle against each other, and against the slip of their wheels.

    (v_left - v_right + yaw rate · track) / v  ~  -(p_left - p_right)        while no wheel slips much

Beyond, an ABS lets go the wheel that slips, and the sign turns.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.physics.line import MOVING, RATE
from brakelab.logs.physics.samples import Car, InputSeries, Rows

AXLES: Final = (("front", 0, 1), ("rear", 2, 3))
DIFFERS: Final = 0.2  # share by which the sides of an axle may differ
LEAST_BAR: Final = 3.0  # on the mean, from which sides are compared
APART: Final = 5.0  # bar between the sides, from which slip tells them apart
LEAST_ROWS: Final = int(1.0 * RATE)
LITTLE: Final = 0.08  # slip
TELLS: Final = 0.8  # correlation


class Sides(NamedTuple):
    """Lines about the sides of the axles."""

    contradictions: list[str]
    flaws: list[str]
    """The brakes themselves differ: their wheels slip as the pressures are."""

    @property
    def differ(self) -> bool:
        """Whether an axle has two pressures."""
        return bool(self.contradictions or self.flaws)


def judge_sides(series: InputSeries, car: Car, pressures: Vector, pressed: Rows) -> Sides:
    """Compare the pressures [bar], shape (n, 4), of a drive's sides in the rows `pressed`, shape (n,)."""
    found = Sides([], [])
    means = pressures[pressed].mean(axis=0)
    for axle, left, right in AXLES:
        slip = _slip(series, car, pressures, left, right)
        if slip is not None and slip > TELLS:
            reason = "the wheel with more pressure slips less; exchange them"
            found.contradictions.append(f"calliper_pressure_*: {axle} left and right are exchanged: {reason}")
            continue
        greater, lesser = max(means[left], means[right]), min(means[left], means[right])
        confirmed = slip is not None and slip < -TELLS
        if greater < (1.0 + DIFFERS) * lesser or (lesser < LEAST_BAR and not confirmed):
            continue
        more = float(means[left] / max(means[right], 0.1))
        share = f"{100.0 * abs(more - 1.0):.0f} % {'more' if more > 1.0 else 'less'} than the right"
        reading = f"calliper_pressure_*: {axle} left reads {share}"
        if confirmed:
            found.flaws.append(f"{reading}, and the wheels slip so: one of these brakes gives less")
        else:
            found.contradictions.append(f"{reading}; check factor and signal of both")
    return found


def _slip(series: InputSeries, car: Car, pressures: Vector, left: int, right: int) -> float | None:
    """Return the correlation of the sides' pressures with the slip of their wheels.

    None: the drive shows too little.
    """
    omega = series.corners("wheel_speed")
    if omega is None or "yaw_rate" not in series:
        return None
    wheels, apart = omega * car.radius, pressures[:, left] - pressures[:, right]
    fastest = wheels.max(axis=1)
    calm = series.known & (wheels.min(axis=1) > np.maximum((1.0 - LITTLE) * fastest, MOVING))
    if (calm & (np.abs(apart) > APART)).sum() < LEAST_ROWS:
        return None
    faster = wheels[:, left] - wheels[:, right] + series["yaw_rate"] * car.track
    return float(np.corrcoef(apart[calm], (faster / np.maximum(fastest, MOVING))[calm])[0, 1])
