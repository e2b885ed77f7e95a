"""Calliper pressures, pedals and flags of the brakes, by the deceleration of the car."""

from typing import Final

import numpy as np

from brakelab.arrays import Vector, median
from brakelab.logs.physics.line import BRAKING, MOVING, Fit
from brakelab.logs.physics.samples import Car
from brakelab.mapping.candidates import best_of, by_name, unit_of
from brakelab.mapping.motion import Found, Motion
from brakelab.mapping.names import axle_of, converts, corner_of, score, tells_brake, tells_pressure
from brakelab.mapping.series import Series
from ecu.algorithm.estimation.zero import LARGEST_ZERO
from ecu.contract.signals import CORNERS

READS_AS_BAR: Final = 1.25  # and its inverse: of a scale that friction explains
PARTS: Final = 12  # of the braking, by pressure
GAINS: Final = 0.2  # m/s^2, of a car whose brakes are released
BACKWARDS: Final = 8.0  # m/s; nobody reverses faster. Assumption
SELDOM: Final = 0.1  # of a drive, that ABS or ESP may act
FULL: Final = 100.0  # %


def brakes(series: list[Series], motion: Motion, car: Car) -> list[Found]:
    """Return calliper pressures, one for all where there is one alone, and the pedals."""
    slows = motion.drives and bool(np.any(motion.change < -BRAKING))
    decel = np.maximum(-motion.change, 0.0)
    fast = motion.faster(1.0)
    pressed = best_of(series, "calliper_pressure_fl", motion, decel, fast, 1) if slows else None
    best = pressed[0] if pressed else by_name(series, "calliper_pressure_fl")
    if not pressed and best is not None and not tells_brake(best.message, best.signal):
        best = None
    found = []
    if best is not None and np.nanstd(best.value) > 0.0:
        found = _pressures(best, pressed[1] if pressed else None, series, motion, car)
    taken = {one.series.name for one in found}
    for target, sign, what in (("pedal_position", -1, "deceleration"), ("accelerator_position", 1, "dv/dt")):
        reference = np.maximum(sign * motion.change, 0.0)
        free = [one for one in series if one.name not in taken]
        best_pedal = best_of(free, target, motion, reference, fast, 1) if motion.drives else None
        if best_pedal:
            one, line = best_pedal
            evidence = f"against {what}: correlation {line.correlation:.2f}"
            factor = _percent(one)
            if factor != 1.0:
                evidence += f"; no unit: its largest value, {FULL / factor:g}, taken for {FULL:g} %"
            found.append(Found(target, one, factor, 0.0, unit_of(target, one), evidence, True))
    return found


def _percent(one: Series) -> float:
    """Return the factor of a pedal: of one without a unit, that of its largest value in this drive."""
    largest = float(np.nanmax(one.value))
    counts = not one.unit.strip() and (largest > FULL or largest <= 1.0) and largest > 0.0
    return FULL / largest if counts else 1.0


def _pressures(best: Series, line: Fit | None, series: list[Series], motion: Motion, car: Car) -> list[Found]:
    evidence = "by its name; the drive shows no brake application to check it by"
    if line:
        evidence = f"against deceleration: correlation {line.correlation:.2f}"
    each, whole = _of_wheels(best, series)
    factor, zeros, warning = 1.0, np.zeros(len(CORNERS)), ""
    if not converts(best.unit, "bar"):
        zeros = _at_rest(each, motion)
        factor, warning = _without_unit(each, zeros, motion, car)
        if not tells_pressure(best.message, best.signal):
            warning += "; nor does its name say that it is a pressure"
    found = []
    for corner, one, zero in zip(CORNERS, each, factor * zeros, strict=True):
        shown, offset = f"{evidence}{whole}", 0.0
        if abs(zero) > LARGEST_ZERO:
            shown, offset = f"{shown}; {zero / factor:+.3g} while released", -float(f"{zero:.4g}")
        unit = unit_of("calliper_pressure_fl", one)
        name = f"calliper_pressure_{corner}"
        found.append(Found(name, one, factor, offset, unit, shown, line is not None, warning))
    return found


def _of_wheels(best: Series, series: list[Series]) -> tuple[list[Series], str]:
    """Return the signal of each wheel, and what to say where one stands for several."""
    for part_of, parts in ((corner_of, CORNERS), (axle_of, ("front", "front", "rear", "rear"))):
        stem = part_of(best.signal)[1]
        alike = [one for one in series if one.unit == best.unit and part_of(one.signal)[1] == stem]
        others = {part_of(one.signal)[0]: one for one in alike}
        if set(parts) <= set(others):
            return [others[part] for part in parts], "" if part_of is corner_of else "; one for each axle"
    return [best] * len(CORNERS), "; one pressure for all wheels"


def _at_rest(each: list[Series], motion: Motion) -> Vector:
    """Return what the signals read while the car gains speed: the brakes are released."""
    released = motion.faster(MOVING) & (motion.change > GAINS)
    if not released.any():
        return np.zeros(len(each))
    return np.array([median(motion.smoothed(one)[released]) for one in each])


def _without_unit(each: list[Series], zeros: Vector, motion: Motion, car: Car) -> tuple[float, str]:
    """Return factor and warning of pressures without a unit: what the brakes of CONFIG need."""
    unitless = "no unit of pressure is stated"
    if car.brakes is None:
        return 1.0, f"{unitless}, taken for bar: friction is off by its scale; --config CONFIG shows more"
    pressures = np.stack([motion.smoothed(one) for one in each], axis=1) - zeros
    braking = motion.faster(MOVING) & (motion.change < -BRAKING)
    braking &= pressures.sum(axis=1) > 0.0
    factor = _slope(pressures[braking] @ car.brakes.decel_per_bar, -motion.change[braking])
    if 1.0 / READS_AS_BAR < factor < READS_AS_BAR:
        return 1.0, f"{unitless}, taken for bar, as which it fits CONFIG's brakes"
    factor = float(f"{factor:.3g}")
    return factor, f"{unitless}; factor {factor:g} is what CONFIG's brakes need: friction is relative to it"


def _slope(expected: Vector, decel: Vector) -> float:
    """Return the deceleration over the `expected` one, 1 where the drive does not tell it.

    The median of the slopes between parts of the drive: motors add to the lightest of them, grip is missing
    in the hardest.
    """
    if len(expected) < PARTS:
        return 1.0
    parts = np.array_split(np.argsort(expected), PARTS)
    x, y = (np.array([median(values[part]) for part in parts]) for values in (expected, decel))
    low, high = np.triu_indices(PARTS, 1)
    apart = x[high] - x[low]
    slopes = (y[high] - y[low])[apart > 0.0] / apart[apart > 0.0]
    factor = median(slopes) if len(slopes) else 1.0
    return factor if factor > 0.0 else 1.0


def flags(series: list[Series], motion: Motion) -> list[Found]:
    """Return what says that the driver brakes, and by name alone what says that ABS or ESP acts."""
    found = []
    best: tuple[float, Series] | None = None
    for one in series:
        on, known = motion.values(one) > 0.5, motion.known & motion.near(one)
        if not one.flag or score(one.signal, "pedal_pressed") < 1 or not motion.drives:
            continue
        if known.any() and 0.01 < np.mean(on[known]) < 0.9:
            slower = float(np.mean(motion.change[known & ~on]) - np.mean(motion.change[known & on]))
            if slower > 0.5 * BRAKING and (best is None or slower > best[0]):
                best = slower, one
    if best:
        evidence = f"while it is on the car slows by {best[0]:.1f} m/s² more"
        found.append(Found("pedal_pressed", best[1], 1.0, 0.0, "-", evidence, True))
    seldom = [one for one in series if one.flag and np.nanmean(one.value != 0.0) < SELDOM]
    for target in ("abs_active", "esp_active"):
        named = by_name(seldom, target)
        if named:
            evidence = "by its name, and it is seldom on"
            found.append(Found(target, named, 1.0, 0.0, "-", evidence, False))
    backwards = [one for one in seldom if score(one.signal, "reverse") >= 1 and _is_slow(one, motion)]
    if backwards:
        named = max(backwards, key=lambda one: score(one.signal, "reverse"))
        evidence = f"by its name, seldom on and never above {3.6 * BACKWARDS:.0f} km/h"
        warning = "its name alone speaks for it: check that it is on while the car backs"
        found.append(Found("reverse", named, 1.0, 0.0, "-", evidence, False, warning))
    return found


def _is_slow(flag: Series, motion: Motion) -> bool:
    """Return whether the car is never faster than it reverses while the flag is on."""
    on = (motion.values(flag) > 0.5) & motion.known & motion.near(flag)
    return bool(motion.speed[on].max(initial=0.0) < BACKWARDS)
