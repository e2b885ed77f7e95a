"""Calliper pressures of a drive against its deceleration.

    -dv/dt  ~  sum of the callipers of  2 A_k r_eff mu_nominal (p - p_0) / (m r)

Friction may be half or twice the nominal one, so that only a wrong unit shows, not a wrong scale; a wrong
scale of one calliper shows against the other side of its axle.
"""

from typing import Final

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.physics.line import BRAKING, RATE, fit
from brakelab.logs.physics.samples import Car, Drive, Rows
from brakelab.logs.physics.stuck import clipped_pressures
from ecu.bus.units import CONVERSIONS

LEAST_ROWS: Final = int(2 * RATE)
FRICTION: Final = 2.5  # by which friction and mass together may be off
SIDES: Final = 0.2  # by which the sides of an axle may differ
LEAST_BAR: Final = 3.0  # on the mean, from which sides are compared
REST: Final = 5.0  # bar, that a released brake may read
TURNED: Final = 0.6  # correlation with the deceleration
NOISE: Final = 4.0  # standard deviations of released brakes, that braking stands out by
OVERRUN: Final = 0.3  # m/s^2, drag and engine


def pressure_lines(drive: Drive, car: Car, speed: Vector, rows: Rows) -> tuple[list[str], list[str]]:
    """Return a line for each thing that the pressures cannot be, and which inputs were judged.

    `speed` [m/s] and the `rows` in which the car moves are of shape (n,).
    """
    pressures = drive.corners("calliper_pressure")
    if pressures is None:
        return [], []
    change = np.gradient(speed, 1.0 / RATE)
    lines: list[str] = []
    idle = rows & (change > 0.2)
    if idle.sum() > LEAST_ROWS:
        at_rest = np.median(pressures[idle], axis=0)
        if np.abs(at_rest).max() > REST:
            worst = float(at_rest[np.argmax(np.abs(at_rest))])
            lines.append(
                f"calliper_pressure_*: reads {worst:+.1f} bar while the car speeds up;"
                f" add {-worst:+.1f} bar to its offset"
            )
            return lines, ["calliper_pressure"]
    total = pressures.sum(axis=1)
    greatest = np.percentile(np.abs(total[rows]), 99)
    if idle.sum() > LEAST_ROWS:
        released = total[idle]
        if np.percentile(np.abs(total[rows] - np.median(released)), 99) < NOISE * released.std():
            return [], []
    brakes = rows & (change < -BRAKING)
    pressed = brakes & (np.abs(total) > 0.3 * greatest)
    if pressed.sum() < LEAST_ROWS:
        return [], []
    line = fit(total, np.maximum(-change, 0.0), rows)
    if line.correlation < -TURNED:
        return ["calliper_pressure_*: turned: falls as the car brakes; factor = -1"], ["calliper_pressure"]
    if line.correlation < 0.2:
        told = f"calliper_pressure_*: does not follow the deceleration (correlation {line.correlation:.2f})"
        return [f"{told}; is it another signal?"], ["calliper_pressure"]
    clipped = clipped_pressures(drive, change, rows)
    lines = [clipped] if clipped else _sides(pressures[pressed])
    return lines + _unit(drive, car, pressures, change, pressed), ["calliper_pressure"]


def _sides(pressures: Vector) -> list[str]:
    lines = []
    for axle, left, right in (("front", 0, 1), ("rear", 2, 3)):
        means = pressures.mean(axis=0)
        if min(means[left], means[right]) < LEAST_BAR:
            continue
        more = float(means[left] / means[right])
        if max(more, 1.0 / more) > 1.0 + SIDES:
            told = f"{100.0 * abs(more - 1.0):.0f} % {'more' if more > 1.0 else 'less'} than the right"
            lines.append(f"calliper_pressure_*: {axle} left reads {told}; check factor and signal of both")
    return lines


def scale_by_brakes(pressures: Vector, decel: Vector, per_bar: Vector) -> float:
    """Return the factor with which pressures make the brakes' deceleration; 1 if they make none.

    `pressures` [bar], shape (n, 4); `decel` by the brakes alone [m/s^2], shape (n,); `per_bar`: see `Car`.
    """
    expected = float((pressures @ per_bar).sum())
    return float(decel.sum()) / expected if expected > 0.0 else 1.0


def _unit(drive: Drive, car: Car, pressures: Vector, change: Vector, pressed: Rows) -> list[str]:
    if car.decel_per_bar is None or car.decel_per_torque is None:
        return []
    motors = drive.corners("motor_torque")
    others = OVERRUN if motors is None else OVERRUN + motors[pressed] @ car.decel_per_torque
    wanted = scale_by_brakes(pressures[pressed], -change[pressed] - others, car.decel_per_bar)
    if 1.0 / FRICTION <= wanted <= FRICTION:
        return []
    fitting = [
        unit
        for unit, (scale, _) in CONVERSIONS["bar"].items()
        if scale != 1.0 and 1.0 / FRICTION < wanted / scale < FRICTION
    ]
    remedy = f'unit = "{fitting[0]}"' if fitting else "check unit and factor, and brakes and mass of CONFIG"
    return [f"calliper_pressure_*: the car brakes {wanted:.2g} times what these pressures give; {remedy}"]
