"""Signals beside those proposed: other sources of an input, and candidates where none was decided on."""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.physics.line import MOVING, RATE, fit
from brakelab.logs.physics.samples import Car, Rows
from brakelab.mapping.candidates import BETTER, LEAST_CORRELATION, PER_WORD, STEPS
from brakelab.mapping.motion import Found, Motion, contract_unit
from brakelab.mapping.names import (
    CHECKING,
    COUNTING,
    converts,
    corner_of,
    counts,
    names_itself,
    score,
    tells_direction,
    words,
)
from brakelab.mapping.series import Series, coarseness, step

SAME: Final = 0.98  # correlation, from which two signals say the same
LISTED: Final = 3  # candidates of an input
ENOUGH: Final = 2.0 * RATE  # rows that tell anything


OVER_GROUND: Final = {"gps", "gnss", "gprmc", "ground"}
"""Words of a speed that is not counted at the wheels."""


class Source(NamedTuple):
    """A signal that is not proposed."""

    target: str
    series: Series
    evidence: str
    """What speaks for it and against it."""

    @property
    def name(self) -> str:
        """Its name, with that of its message if it has one."""
        return self.series.name.removeprefix(".")

    def __str__(self) -> str:
        unit = f" [{self.series.unit}]" if self.series.unit.strip() else ""
        return f"not proposed for {self.target}: {self.name}{unit}: {self.evidence}"


class Reference(NamedTuple):
    """What an input should follow."""

    values: Vector
    rows: Rows
    name: str
    sign: int = 0
    """Of the slope; 0: either."""


def other_sources(found: list[Found], series: list[Series], motion: Motion, car: Car) -> list[Source]:
    """Return what says the same as a proposed signal, and candidates of wanted inputs that are missing."""
    return alternatives(found, series, motion) + undecided(found, series, motion, car)


def alternatives(found: list[Found], series: list[Series], motion: Motion) -> list[Source]:
    """Return signals that say the same as a proposed one, wheels' by the front left, better ones first."""
    used = {one.series.name for one in found}
    sources = []
    for one in found:
        if one.series.flag or not one.sure or one.target[-3:] in ("_fr", "_rl", "_rr"):
            continue
        corner = corner_of(one.series.signal)[0]
        own = motion.smoothed(one.series)
        for other in series:
            if other.name in used or other.flag or corner_of(other.signal)[0] != corner:
                continue
            if not _same_quantity(one.series, other, contract_unit(one.target)):
                continue
            rows = motion.known & motion.near(other)
            correlation = abs(fit(motion.smoothed(other), own, rows).correlation)
            if correlation >= SAME:
                sources.append(Source(one.target, other, _compared(one.series, other, correlation)))
    return sorted(sources, key=lambda source: (source.target, coarseness(source.series)))


def _same_quantity(one: Series, other: Series, unit: str) -> bool:
    same = one.unit.strip() == other.unit.strip()
    speeds = [converts(each.unit, "rad/s") or converts(each.unit, "m/s") for each in (one, other)]
    return same or converts(other.unit, unit) or all(speeds)


def _compared(one: Series, other: Series, correlation: float) -> str:
    own, others = (
        f"{1.0 / each.mean_interval:.0f} Hz in steps of {step(each):.3g} {each.unit}".rstrip()
        for each in (one, other)
    )
    ratio = coarseness(other) / coarseness(one)
    verdict = "worse" if ratio > 1.0 / BETTER else "better" if ratio < BETTER else "as good"
    return f"says the same (correlation {correlation:.3f}), {verdict}: {others}, not {own}"


def undecided(found: list[Found], series: list[Series], motion: Motion, car: Car) -> list[Source]:
    """Return candidates of the wanted inputs for which nothing was found, the likeliest first."""
    targets, used = {one.target for one in found}, {one.series.name for one in found}
    other = COUNTING | CHECKING
    free = [
        one for one in series if one.name not in used and not one.sign and not other & {*words(one.signal)}
    ]
    sources = []
    for target, reference in references(motion, car).items():
        if target not in targets:
            looked = [each for one in free if (each := _looked_at(one, target, reference, motion))]
            likely = sorted(looked, key=lambda each: -each[0])[:LISTED]
            sources += [Source(target, one, evidence) for _, one, evidence in likely]
    if "vehicle_speed" not in targets and "wheel_speed_fl" in targets:
        ground = [one for one in free if converts(one.unit, "m/s") and OVER_GROUND & {*words(one.signal)}]
        sources += [Source("vehicle_speed", one, _over_ground(one, motion)) for one in ground[:LISTED]]
    if "abs_active" not in targets:
        named = [one for one in free if one.flag and names_itself(one.signal, "abs_active")]
        sources += [Source("abs_active", one, _how_often(one)) for one in named[:LISTED]]
    return sources


def _over_ground(one: Series, motion: Motion) -> str:
    correlation = fit(motion.smoothed(one), motion.speed, motion.known & motion.near(one)).correlation
    return f"correlation {correlation:+.2f} with the wheels; it shows slip if its scale and lag are known"


def _how_often(flag: Series) -> str:
    share = 100.0 * float(np.nanmean(flag.value != 0.0))
    return f"by its name, but on for {share:.0f} % of the drive"


def _looked_at(
    one: Series, target: str, reference: Reference, motion: Motion
) -> tuple[float, Series, str] | None:
    """Return how likely a signal is an input, and why it was not taken; None: nothing speaks for it."""
    points, unit = score(one.signal, target), contract_unit(target)
    if points > 0 and not tells_direction(one.signal, target):
        points = 0.0
    fits = converts(one.unit, unit)
    if one.flag or points < (unit == "%") or not (fits or points >= 2):
        return None
    values = len(np.unique(one.value[np.isfinite(one.value)]))
    likely = PER_WORD * points
    if values <= STEPS:
        if points < 2:
            return None
        return likely - 1.0, one, f"only {values} value{'s' if values > 1 else ''} in this drive"
    if not counts(one.unit, unit) and not fits:
        return likely, one, f"by its name, but {one.unit} does not turn into {unit}"
    rows = reference.rows & motion.near(one)
    if rows.sum() < ENOUGH:
        return (likely, one, "by its name, but the car hardly drives in this log") if points >= 1 else None
    correlation = fit(motion.smoothed(one), reference.values, rows).correlation
    strength = correlation * reference.sign if reference.sign else abs(correlation)
    if points < 1 and strength < LEAST_CORRELATION:
        return None
    return likely + strength, one, f"correlation {correlation:+.2f} with {reference.name}"


def references(motion: Motion, car: Car) -> dict[str, Reference]:
    """Return what inputs should follow, by their names."""
    fast, moves = motion.faster(MOVING), motion.faster(1.0)
    yaw = motion.yaw_rates[0]
    speed = np.maximum(motion.speed, MOVING)
    decel, gain = np.maximum(-motion.change, 0.0), np.maximum(motion.change, 0.0)
    curves = {
        "yaw_rate": Reference(yaw, fast, "right less left wheels"),
        "accel_y": Reference(motion.speed * yaw, fast, "speed times yaw rate"),
        "steering_angle": Reference(np.arctan(car.wheelbase * yaw / speed), fast, "the curvature"),
    }
    return {
        "accel_x": Reference(motion.change, fast, "dv/dt"),
        **(curves if yaw.any() else {}),
        "calliper_pressure_fl": Reference(decel, moves, "deceleration", 1),
        "pedal_position": Reference(decel, moves, "deceleration", 1),
        "accelerator_position": Reference(gain, moves, "dv/dt", 1),
        "motor_torque_fl": Reference(motion.change, fast, "dv/dt"),
    }
