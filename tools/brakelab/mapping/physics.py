"""Signals that behave like the inputs of the ECU.

Wheel speeds are known by their names and by going together; everything else is set against them:

    accel_x            dv/dt
    yaw_rate           (v_right - v_left) / track, both axles
    accel_y            v times yaw rate
    steering_angle     atan(L yaw rate / v)
    calliper_pressure  -dv/dt while the car decelerates
    pedals             their sign of dv/dt

A regression over the drive gives sign and scale, so swapped or inverted axes show (ISO 8855: x forward, y
left). Once a yaw rate is found it replaces that of the wheels, which their slip disturbs.
"""

import math
from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.log_physics.line import RATE, Fit, Vector, fit, smooth
from brakelab.mapping.names import converts, corner_of, names_itself, score
from brakelab.mapping.series import Series
from ecu.bus.units import CONVERSIONS, spelled
from ecu.contract.signals import CORNERS, INPUT, INPUT_SIGNALS

TRACK, WHEELBASE, RADIUS = 1.55, 2.7, 0.33  # m, of a car that is not known yet. Assumption
STEERING_RATIO: Final = 16.0  # likewise
MOVING: Final = 3.0  # m/s
BRAKING: Final = 0.7  # m/s^2
LEAST: Final = 0.5  # correlation that speaks for a signal
PER_WORD: Final = 0.1  # of correlation, that a word of the name is worth
NEAR: Final = 0.02  # of correlation, by which two signals follow equally well
FASTER: Final = 0.8  # of the interval, from which on the other of them is taken
UNIT_SLOPE: Final = 1.25  # and its inverse: beyond, neither sign nor unit explains it
LEAST_YAW: Final = 0.4  # of a yaw rate over that of the wheels: the outer tyre is pressed flat, turns faster
CLEAN: Final = 0.95  # correlation, below which noise of the reference alone makes a slope small
LEAST_ZERO: Final = 0.05  # m/s^2, a zero error worth a line
IN_DEGREES: Final = 10.0  # slope against radians, of a signal without a unit, from which it must be degrees


class Found(NamedTuple):
    """A signal proposed for an input."""

    target: str
    series: Series
    factor: float
    offset: float
    """In `unit`, as the value after the factor."""
    unit: str
    evidence: str
    sure: bool
    """Physics agrees; else the name alone speaks for it."""
    warning: str = ""


class Motion(NamedTuple):
    """Motion of the car by its wheels, on a grid of `RATE`."""

    t: Vector
    speed: Vector
    """m/s"""
    change: Vector
    """dv/dt [m/s^2]"""
    yaw_rates: tuple[Vector, ...]
    """rad/s, positive to the left; of both axles, the front and the rear one"""

    @property
    def drives(self) -> bool:
        """Whether the car drove far enough for physics to tell anything."""
        return bool(np.mean(self.speed > MOVING) > 0.02)


def contract_unit(target: str) -> str:
    """Return the contract's unit of an input."""
    return INPUT_SIGNALS[INPUT[target]].unit


def on_grid(series: Series, t: Vector) -> Vector:
    """Return the series on the grid `t` [s], straight lines between its samples."""
    known = np.isfinite(series.value)
    if not known.any():
        return np.full(len(t), np.nan)
    return np.interp(t, series.t[known], series.value[known])


def wheel_speeds(series: Iterable[Series]) -> dict[str, Series]:
    """Return the four wheel speeds by corner, empty if there are none.

    Four signals whose names differ by the corner alone, in a unit of speed or rotation, or named as wheels.
    """
    groups: dict[tuple[str, int], dict[str, Series]] = {}
    for one in series:
        corner, stem = corner_of(one.signal)
        fitting = converts(one.unit, "rad/s") or converts(one.unit, "m/s")
        if not corner or one.flag or not (fitting or score(one.signal, "wheel_speed") >= 2):
            continue
        groups.setdefault((stem, one.bus), {}).setdefault(corner, one)
    whole = [group for group in groups.values() if len(group) == len(CORNERS)]

    def worth(group: dict[str, Series]) -> tuple[bool, float, float]:
        means = np.array([np.nanmean(np.abs(one.value)) for one in group.values()])
        together = bool(means.max() <= 1.1 * means.min() + 0.5)
        return together, score(group["fl"].name, "wheel_speed"), -group["fl"].period

    best = max(whole, key=worth, default=None)
    return {} if best is None else {corner: best[corner] for corner in CORNERS}


def _metres_per_second(series: Series) -> Callable[[Vector], Vector]:
    unit = spelled(series.unit)
    if unit in CONVERSIONS["m/s"]:
        scale = CONVERSIONS["m/s"][unit][0]
    else:
        scale = CONVERSIONS["rad/s"].get(unit, (1.0, 0.0))[0] * RADIUS
    return lambda values: values * scale


def motion_of(wheels: dict[str, Series]) -> Motion:
    """Return how the car moved by its four wheel speeds."""
    start = max(one.t[0] for one in wheels.values())
    end = min(one.t[-1] for one in wheels.values())
    t = np.arange(start, end, 1.0 / RATE)
    metres = _metres_per_second(wheels["fl"])
    fl, fr, rl, rr = (smooth(np.abs(metres(on_grid(wheels[corner], t)))) for corner in CORNERS)
    speed = 0.25 * (fl + fr + rl + rr)
    front, rear = (fr - fl) / TRACK, (rr - rl) / TRACK
    return Motion(t, speed, np.gradient(speed, 1.0 / RATE), (0.5 * (front + rear), front, rear))


def _best(
    series: Iterable[Series],
    target: str,
    motion: Motion,
    reference: Vector,
    rows: NDArray[np.bool_],
    fixed_sign: int = 0,
) -> tuple[Series, Fit] | None:
    """Return the signal that follows `reference` best among those whose unit or name fits the input.

    `fixed_sign`: of the slope, where a signal of the other sign is another quantity; 0: either.
    """
    unit = contract_unit(target)
    fitting: list[tuple[float, Series, Fit]] = []
    for one in series:
        points = score(one.signal, target)
        if one.flag or points < 0 or not (converts(one.unit, unit) or (not one.unit and points >= 1)):
            continue
        if unit == "%" and points < 1:
            continue
        found = fit(smooth(on_grid(one, motion.t)), reference, rows)
        strength = found.correlation * fixed_sign if fixed_sign else abs(found.correlation)
        if strength < LEAST or not math.isfinite(strength):
            continue
        # Between signals that follow equally well the name decides, then the rate.
        fitting.append((strength + PER_WORD * points, one, found))
    if not fitting:
        return None
    best = max(fitting, key=lambda candidate: candidate[0])
    near = [candidate for candidate in fitting if candidate[0] > best[0] - NEAR]
    fastest = min(near, key=lambda candidate: candidate[1].mean_interval)
    return (fastest if fastest[1].mean_interval < FASTER * best[1].mean_interval else best)[1:]


def _by_name(series: Iterable[Series], target: str) -> Series | None:
    """Return the signal whose name speaks most for an input; a pressure only in a unit of pressure."""
    unit = contract_unit(target)

    def speaks(one: Series) -> bool:
        points = score(one.signal, target)
        if unit == "-":
            return one.flag and points >= 2 and names_itself(one.signal, target)
        fits = converts(one.unit, unit)
        return not one.flag and (points >= 1 if fits else points >= 2 and unit.startswith(("m/s", "rad")))

    fitting = [one for one in series if speaks(one)]
    return max(fitting, key=lambda one: score(one.signal, target), default=None)


def _unit(target: str, one: Series, slope: float = math.inf) -> str:
    """Return the unit of a signal; of one without, what its size or custom says."""
    unit = contract_unit(target)
    if one.unit.strip() or not unit.startswith("rad"):
        return spelled(one.unit) if converts(one.unit, unit) else unit
    return unit.replace("rad", "deg") if abs(slope) > IN_DEGREES else unit


def _slope_warning(slope: float, correlation: float, least: float) -> str:
    """Return what to look into where a slope is not 1 and noise of the reference does not make it small.

    `least` slope is usual.
    """
    size = abs(slope)
    if size <= UNIT_SLOPE and (size >= least or correlation < CLEAN):
        return ""
    looks = [
        f"; it would fit {unit}"
        for units in (CONVERSIONS["rad/s"], CONVERSIONS["m/s^2"])
        for unit, (scale, _) in units.items()
        if scale != 1.0 and least < size * scale < UNIT_SLOPE
    ]
    likely = looks[0] if looks else f"; or the wheels do not have the {RADIUS} m assumed"
    return f"slope {slope:+.2f} instead of {math.copysign(1.0, slope):+.0f}: check unit and scale{likely}"


def inertial(series: list[Series], motion: Motion) -> list[Found]:
    """Return accelerations, yaw rate and steering angle of a car that drives."""
    fast = motion.speed > MOVING
    found: list[Found] = []

    def take(target: str, reference: Vector, what: str) -> None:
        taken = {one.series.name for one in found}
        best = _best((one for one in series if one.name not in taken), target, motion, reference, fast)
        if best is None:
            return
        one, line = best
        unit = _unit(target, one, line.slope)
        slope = line.slope * CONVERSIONS[contract_unit(target)][unit][0]
        evidence = f"against {what}: correlation {abs(line.correlation):.2f}, slope {slope:+.2f}"
        factor, offset = math.copysign(1.0, slope), 0.0
        if target == "accel_x" and abs(line.intercept * CONVERSIONS["m/s^2"][unit][0]) > LEAST_ZERO:
            offset = -factor * line.intercept
            evidence += f"; {line.intercept:+.2f} {unit} at constant speed, with the slope of the road"
        least = LEAST_YAW if target == "yaw_rate" else 1.0 / UNIT_SLOPE
        warning = _slope_warning(slope, abs(line.correlation), least)
        found.append(Found(target, one, factor, offset, unit, evidence, True, warning))

    take("accel_x", motion.change, "dv/dt")
    yaw_rate = max(motion.yaw_rates, key=lambda wheels: _strength(series, motion, wheels, fast))
    take("yaw_rate", yaw_rate, "right less left wheels")
    for known in found:
        if known.target == "yaw_rate":
            scale = known.factor * CONVERSIONS["rad/s"][known.unit][0]
            yaw_rate = smooth(on_grid(known.series, motion.t)) * scale
    take("accel_y", motion.speed * yaw_rate, "speed times yaw rate")
    wanted = np.arctan(WHEELBASE * yaw_rate / np.maximum(motion.speed, MOVING))
    best = _best(series, "steering_angle", motion, wanted, fast)
    if best:
        one, line = best
        unit = _unit("steering_angle", one, line.slope)
        ratio = line.slope * CONVERSIONS["rad"][unit][0]
        evidence = (
            f"against atan({WHEELBASE} m · yaw rate / speed): correlation {abs(line.correlation):.2f}, "
            f"ratio {ratio:.1f}, {line.intercept:+.1f} {unit} straight ahead"
        )
        offset = -line.intercept / ratio
        found.append(Found("steering_angle", one, 1.0 / ratio, offset, unit, evidence, True))
    return found


def _strength(series: list[Series], motion: Motion, yaw_rate: Vector, rows: NDArray[np.bool_]) -> float:
    best = _best(series, "yaw_rate", motion, yaw_rate, rows)
    return abs(best[1].correlation) if best else 0.0


def brakes(series: list[Series], motion: Motion) -> list[Found]:
    """Return calliper pressures, one for all where there is one alone, and the pedals."""
    found = []
    slows = motion.drives and bool(np.any(motion.change < -BRAKING))
    decel = np.maximum(-motion.change, 0.0)
    fast = motion.speed > 1.0
    pressed = _best(series, "calliper_pressure_fl", motion, decel, fast, 1) if slows else None
    best = pressed[0] if pressed else _by_name(series, "calliper_pressure_fl")
    if best is not None and np.nanstd(best.value) > 0.0:
        evidence = "by its name; the drive shows no braking to check it by"
        if pressed:
            evidence = f"against deceleration: correlation {pressed[1].correlation:.2f}"
        _, stem = corner_of(best.signal)
        others = {corner_of(one.signal)[0]: one for one in series if corner_of(one.signal)[1] == stem}
        whole = set(CORNERS) <= set(others)
        for corner in CORNERS:
            one = others[corner] if whole else best
            told = evidence if whole else f"{evidence}; one pressure for all wheels"
            unit = _unit("calliper_pressure_fl", one)
            found.append(Found(f"calliper_pressure_{corner}", one, 1.0, 0.0, unit, told, pressed is not None))
    for target, sign, what in (("pedal_position", -1, "deceleration"), ("accelerator_position", 1, "dv/dt")):
        reference = np.maximum(sign * motion.change, 0.0)
        best_pedal = _best(series, target, motion, reference, fast, 1) if motion.drives else None
        if best_pedal:
            one, line = best_pedal
            evidence = f"against {what}: correlation {line.correlation:.2f}"
            found.append(Found(target, one, 1.0, 0.0, _unit(target, one), evidence, True))
    return found


def flags(series: list[Series], motion: Motion) -> list[Found]:
    """Return what says that the driver brakes, and by name alone what says that ABS or ESP acts."""
    found = []
    best: tuple[float, Series] | None = None
    for one in series:
        on = on_grid(one, motion.t) > 0.5
        if not one.flag or score(one.signal, "pedal_pressed") < 1 or not motion.drives:
            continue
        if 0.01 < np.mean(on) < 0.9:
            slower = float(np.mean(motion.change[~on]) - np.mean(motion.change[on]))
            if slower > 0.5 * BRAKING and (best is None or slower > best[0]):
                best = slower, one
    if best:
        evidence = f"while it is on the car slows by {best[0]:.1f} m/s² more"
        found.append(Found("pedal_pressed", best[1], 1.0, 0.0, "-", evidence, True))
    for target in ("abs_active", "esp_active"):
        named = _by_name(series, target)
        if named:
            found.append(Found(target, named, 1.0, 0.0, "-", "by its name", False))
    return found


def named_only(series: list[Series]) -> list[Found]:
    """Return what names alone say of inertial sensors and steering, for a car that stands."""
    found = []
    for target in ("accel_x", "accel_y", "yaw_rate", "steering_angle"):
        one = _by_name(series, target)
        if one:
            factor = 1.0 / STEERING_RATIO if target == "steering_angle" else 1.0
            evidence = "by its name; the car stands: check sign and unit"
            found.append(Found(target, one, factor, 0.0, _unit(target, one), evidence, False))
    return found


def propose(series: list[Series]) -> tuple[list[Found], bool]:
    """Return what is proposed, wheel speeds first, and whether the car drove; empty without wheel speeds.

    All of it comes from the bus that carries the wheel speeds.
    """
    wheels = wheel_speeds(series)
    if not wheels:
        return [], False
    motion = motion_of(wheels)
    here = [one for one in series if one.bus == wheels["fl"].bus]
    found = [
        Found(f"wheel_speed_{corner}", one, 1.0, 0.0, spelled(one.unit), "by their names", True)
        for corner, one in wheels.items()
    ]
    found += inertial(here, motion) if motion.drives else named_only(here)
    return found + brakes(here, motion) + flags(here, motion), motion.drives
