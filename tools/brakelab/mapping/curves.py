"""Yaw rate, lateral acceleration and steering angle of a car, by what its curves say.

Right less left wheels over the track is the yaw rate only at walking speed: the outer tyre is pressed flat by
the load that moves to it, turns faster, and the load is in proportion to v times the yaw rate psi:

    (v_right - v_left) / track  =  psi (1 + c v^2)  +  e v          e: radii that differ from side to side

Understeer bends the steering angle over the curvature alike. So a line is fitted with the square of speed and
its value at rest taken: the scale of a yaw rate, of a lateral acceleration, the ratio of a steering.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector, median
from brakelab.logs.physics.line import LAGS, MOVING, RATE
from brakelab.logs.physics.samples import Car, Rows
from brakelab.mapping.candidates import best_of, unit_of
from brakelab.mapping.motion import STANDING, Found, Motion, contract_unit
from brakelab.mapping.scale import scale_of
from brakelab.mapping.series import Series
from ecu.bus.units import CONVERSIONS

TYPICAL: Final = 20.0  # m/s, that the terms are scaled by
INDEPENDENT: Final = 1.0  # s between samples that count as such
CERTAIN: Final = 0.08  # standard deviation over slope, below which the slope at rest is used
LEAST_STOOD: Final = int(2.0 * RATE)
LEAST_ZERO: Final = {
    "yaw_rate": 0.02,
    "accel_y": 0.35,
}  # rad/s, m/s^2: what a sensor's zero is usually within

RATIOS: Final = (0.3, 60.0)  # of steerings: the road wheels' own angle, a lorry's hand wheel


class AtRest(NamedTuple):
    """A line whose slope changes with the square of speed."""

    slope: float
    """At speed zero."""
    sigma: float
    """Standard deviation of it."""


def at_rest(signal: Vector, reference: Vector, speed: Vector, rows: Rows) -> AtRest | None:
    """Return the slope of `signal` over `reference` at speed zero, None: the drive does not tell it."""
    best: tuple[float, AtRest] | None = None
    fast = speed[rows] / TYPICAL
    if len(fast) < 10 * RATE or reference[rows].std() == 0.0:
        return None
    count = len(fast) / (RATE * INDEPENDENT)
    for lag in LAGS:
        x = np.roll(reference, lag)[rows]
        terms = np.stack([x, x * fast**2, np.ones_like(fast), fast, fast**2], axis=1)
        normal = terms.T @ terms / len(fast)
        if np.linalg.cond(normal) > 1e12:
            return None
        found = np.linalg.solve(normal, terms.T @ signal[rows] / len(fast))
        error = float(np.mean((signal[rows] - terms @ found) ** 2))
        if best is None or error < best[0]:
            sigma = float(np.sqrt(error * np.linalg.inv(normal)[0, 0] / count))
            best = error, AtRest(float(found[0]), sigma)
    if best is None or best[1].sigma > CERTAIN * abs(best[1].slope):
        return None
    return best[1]


def curves(series: list[Series], motion: Motion, car: Car, taken: set[str]) -> list[Found]:
    """Return yaw rate, lateral acceleration and steering angle; `taken`: names of signals already used."""
    fast = motion.faster(MOVING)
    found: list[Found] = []
    wheels = motion.yaw_rates[0]
    yaw_rate = _yaw_rate(series, motion, fast, taken)
    if yaw_rate is not None:
        found.append(yaw_rate)
        wheels = _values(yaw_rate, motion)
    lateral = _accel_y(series, motion, wheels, fast, taken | {one.series.name for one in found})
    if lateral is not None:
        found.append(lateral)
        if yaw_rate is None:
            wheels = _values(lateral, motion) / np.maximum(motion.speed, MOVING)
    if not found:
        wheels = motion.yaw_rates[2]
    power = 1 if yaw_rate else 2 if lateral else 0
    steering = _steering(series, motion, wheels, fast, car, power)
    return [*found, steering] if steering else found


def _values(one: Found, motion: Motion) -> Vector:
    """Return a found input in the contract's unit on the grid."""
    scale = CONVERSIONS[contract_unit(one.target)][one.unit][0]
    return (motion.smoothed(one.series) * one.factor + one.offset) * scale


def _yaw_rate(series: list[Series], motion: Motion, fast: Rows, taken: set[str]) -> Found | None:
    free = [one for one in series if one.name not in taken]
    lines = ((best_of(free, "yaw_rate", motion, wheels, fast), wheels) for wheels in motion.yaw_rates)
    known = [(best, wheels) for best, wheels in lines if best]
    if not known:
        return None
    (one, line), wheels = max(known, key=lambda each: abs(each[0][1].correlation))
    signal = motion.smoothed(one)
    slow = at_rest(wheels, signal, motion.speed, fast & motion.near(one))
    slope = 1.0 / slow.slope if slow else line.slope
    where = " at low speed" if slow else ""
    unit = unit_of("yaw_rate", one, slope)
    slope *= CONVERSIONS["rad/s"][unit][0]
    scale = scale_of(one, slope, line.correlation, in_curves=slow is None)
    evidence = (
        f"against right less left wheels: correlation {abs(line.correlation):.2f}, slope {slope:+.2f}{where}"
    )
    stood = (motion.speed < STANDING) & motion.known & motion.near(one)
    zero = median(signal[stood]) if stood.sum() > LEAST_STOOD else line.intercept
    return _with_zero("yaw_rate", one, scale.factor, unit, zero, evidence, scale.warning)


def _accel_y(
    series: list[Series], motion: Motion, yaw_rate: Vector, fast: Rows, taken: set[str]
) -> Found | None:
    free = [one for one in series if one.name not in taken]
    best = best_of(free, "accel_y", motion, motion.speed * yaw_rate, fast)
    if best is None:
        return None
    one, line = best
    signal = motion.smoothed(one)
    slope, where, slow = line.slope, "", None
    if yaw_rate is motion.yaw_rates[0]:  # the wheels', which tyres pressed flat disturb
        turns = (signal - line.intercept) / np.maximum(motion.speed, MOVING)
        slow = at_rest(yaw_rate, turns, motion.speed, fast & motion.near(one))
        if slow:
            slope, where = 1.0 / slow.slope, " at low speed"
    unit = unit_of("accel_y", one, slope)
    slope *= CONVERSIONS["m/s^2"][unit][0]
    disturbed = yaw_rate is motion.yaw_rates[0] and slow is None
    scale = scale_of(one, slope, line.correlation, in_curves=disturbed)
    evidence = (
        f"against speed times yaw rate: correlation {abs(line.correlation):.2f}, slope {slope:+.2f}{where}"
    )
    return _with_zero("accel_y", one, scale.factor, unit, line.intercept, evidence, scale.warning)


def _with_zero(
    target: str, one: Series, factor: float, unit: str, zero: float, evidence: str, warning: str
) -> Found:
    """Return an input with what it reads straight ahead, `zero` of the signal, taken off where it is much."""
    offset = 0.0
    if abs(factor * zero) * CONVERSIONS[contract_unit(target)][unit][0] > LEAST_ZERO[target]:
        offset = -factor * zero
        evidence += f"; {zero:+.4g} straight ahead"
    return Found(target, one, factor, offset, unit, evidence, True, warning)


def _steering(
    series: list[Series], motion: Motion, yaw_rate: Vector, fast: Rows, car: Car, power: int
) -> Found | None:
    """`power` of speed that makes a clean measurement of `yaw_rate`: 1 of a yaw rate, 2 of an accel_y.

    0: `yaw_rate` is that of the rear wheels, which tyres pressed flat disturb.
    """
    speed = np.maximum(motion.speed, MOVING)
    best = best_of(series, "steering_angle", motion, np.arctan(car.wheelbase * yaw_rate / speed), fast)
    if best is None:
        return None
    one, line = best
    signal, fast = motion.smoothed(one), fast & motion.near(one)
    unit = unit_of("steering_angle", one, line.slope)
    if power:
        turns = yaw_rate * speed ** (power - 1)
        slow = at_rest(signal * speed**power / car.wheelbase, turns, motion.speed, fast)
        slope = slow.slope if slow else line.slope
    else:
        slow = at_rest(yaw_rate, (signal - line.intercept) * speed / car.wheelbase, motion.speed, fast)
        slope = 1.0 / slow.slope if slow else line.slope
    ratio = slope * CONVERSIONS["rad"][unit][0]
    if not RATIOS[0] < abs(ratio) < RATIOS[1]:
        return None
    evidence = (
        f"against atan({car.wheelbase:g} m · yaw rate / speed): correlation {abs(line.correlation):.2f}, "
        f"ratio {ratio:.1f}{' at low speed' if slow else ''}, {line.intercept:+.1f} {unit} straight ahead"
    )
    return Found("steering_angle", one, 1.0 / ratio, -line.intercept / ratio, unit, evidence, True)
