"""Sensors that stand still while the car does not: clipped at the end of their range, or frozen.

A clipped signal repeats its extreme value to the last bit, while what it follows goes on beyond it; a frozen
one repeats any value. The rows in which an acceleration is clipped say nothing about its scale.
"""

from typing import Final

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.physics.line import RATE, ranked, smooth
from brakelab.logs.physics.samples import InputSeries, Rows
from brakelab.stretches import stretches
from ecu.contract.signals import CORNERS

CLIPPED: Final = int(0.3 * RATE)  # rows at the extreme
BEYOND: Final = 1.15  # of the extreme, that what it follows reaches there
LEAST_ACCEL: Final = 1.0  # m/s^2, of an extreme
HELD: Final = int(2.0 * RATE)  # rows
LOCKED: Final = int(10.0 * RATE)  # likewise, of a wheel that stands: it may be locked
CHANGED: Final = 1.5  # m/s, by which the other wheels change meanwhile
PRESSED: Final = int(0.2 * RATE)  # rows at the greatest pressure in one braking
LEAST_BAR: Final = 5.0
HARDER: Final = 1.2  # between decelerations at the same greatest pressure


def runs(at: Rows, least: int) -> list[slice]:
    """Return the stretches of at least `least` rows in which `at` holds, shape (n,)."""
    return [slice(begin, end) for begin, end in stretches(at).tolist() if end - begin >= least]


def clipped_accels(series: InputSeries, speed: Vector, rows: Rows) -> tuple[list[str], Rows]:
    """Return a line for each clipped acceleration, and those of the `rows` in which none is.

    `speed` [m/s] and the `rows` in which the car moves are of shape (n,).
    """
    expected = {"accel_x": np.gradient(speed, 1.0 / RATE)}
    if "yaw_rate" in series:
        expected["accel_y"] = speed * series["yaw_rate"]
    lines, clear = [], rows.copy()
    for name, by_motion in expected.items():
        if name in series:
            line, at = _clipped(series, name, by_motion, rows)
            lines += [line] if line else []
            clear &= ~at
    return lines, clear


def _clipped(series: InputSeries, name: str, expected: Vector, rows: Rows) -> tuple[str, Rows]:
    """Return a line if an acceleration is clipped, else an empty one, and the rows in which it is.

    `expected` [m/s^2] by the motion and `rows` in which it is known are of shape (n,).
    """
    values, none = series.raw(name), np.zeros(len(rows), np.bool_)
    for extreme in (values[rows].min(), values[rows].max()):
        at = rows & (values == extreme)
        if abs(extreme) < LEAST_ACCEL or sum(part.stop - part.start for part in runs(at, 3)) < CLIPPED:
            continue
        ahead = np.quantile(smooth(expected)[at] / extreme, 0.75)
        if ahead > BEYOND:
            stands = (
                f"{name}: stands at {extreme:+.2f} m/s^2 for {at.sum() / RATE:.1f} s while the car reaches"
            )
            remedy = "its range ends there; take a sensor or a signal of more range"
            both = np.isin(values, (values[rows].min(), values[rows].max()))
            return f"{stands} {ahead * extreme:+.1f}: {remedy}", smooth(both.astype(float)) > 0.01
    return "", none


def stuck_wheels(series: InputSeries, wheels: Vector, rows: Rows) -> tuple[list[str], Vector]:
    """Return a line for each wheel that stands still in its value while the others change.

    `wheels` [m/s], shape (n, 4), come back with the other wheels' mean where one is stuck.
    """
    lines, mended = [], wheels.copy()
    for i, corner in enumerate(CORNERS):
        values = series.raw(f"wheel_speed_{corner}")
        others = ranked(np.delete(wheels, i, axis=1))[1]
        constant = np.concatenate(([False], np.diff(values) == 0.0)) & rows
        stuck = np.zeros(len(rows), np.bool_)
        for part in runs(constant, HELD):
            long_enough = abs(values[part.start]) > 0.1 or part.stop - part.start >= LOCKED
            if long_enough and np.ptp(others[part]) > CHANGED:
                stuck[part] = True
        if not stuck.any():
            continue
        greatest = float(values[rows].max())
        near = smooth(stuck.astype(float)) > 0.0
        mended[near, i] = others[near]
        at_top = bool((values[stuck] == greatest).all())
        seconds = stuck.sum() / RATE
        message = f"wheel_speed_{corner}: stands at {values[stuck][0]:.1f} rad/s for {seconds:.0f} s"
        what = "its range ends there" if at_top and greatest > 0.1 else "the sensor or its gateway is frozen"
        lines.append(f"{message} while the others change: {what}; mend it, or leave that part out")
    return lines, mended


def stuck_pressures(series: InputSeries, change: Vector, rows: Rows) -> tuple[str, Rows]:
    """Return a line if pressures stand at one value while the car gains speed, else none; and the other rows.

    `change` [m/s^2] is that of the car's speed, shape (n,).
    """
    stands, seconds, clear = {}, 0.0, rows.copy()
    for corner in CORNERS:
        values = series.raw(f"calliper_pressure_{corner}")
        constant = np.concatenate(([False], np.diff(values) == 0.0)) & rows & (values > LEAST_BAR)
        for part in runs(constant, HELD):
            if np.maximum(change[part], 0.0).sum() / RATE > CHANGED:
                stands[corner], seconds = float(values[part.start]), (part.stop - part.start) / RATE
                clear[part] = False
    if not stands:
        return "", rows
    bar = " and ".join(f"{value:.1f}" for value in sorted(set(stands.values())))
    message = f"calliper_pressure_*: {' '.join(stands)} stand at {bar} bar for {seconds:.0f} s"
    remedy = "the sensor or its gateway is frozen; mend it, or leave that part out"
    return f"{message} while the car gains speed: {remedy}", clear


def clipped_pressures(series: InputSeries, change: Vector, rows: Rows) -> str:
    """Return a line if pressures stand at one greatest value in brakings of different strength, else none.

    `change` [m/s^2] is that of the car's speed, shape (n,).
    """
    ends: dict[str, float] = {}
    found = set()
    for corner in CORNERS:
        values = series.raw(f"calliper_pressure_{corner}")
        greatest = float(values[rows].max())
        brakings = runs(rows & (values == greatest), PRESSED)
        if greatest <= LEAST_BAR or not brakings:
            continue
        ends[corner] = greatest
        decels = [-float(change[part].mean()) for part in brakings]
        if max(decels) > HARDER * max(min(decels), 0.1):
            found.add(greatest)
    if not found:
        return ""
    corners = " ".join(corner for corner, greatest in ends.items() if greatest in found)
    bar = " and ".join(f"{greatest:.1f}" for greatest in sorted(found))
    message = f"calliper_pressure_*: {corners} stand at {bar} bar while the car brakes harder"
    return f"{message}: the range ends there; take a signal of more range, or leave such brakings out"
