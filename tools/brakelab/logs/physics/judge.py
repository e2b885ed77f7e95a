"""Physics of a log: relations that its inputs must obey if the map is right; one line where they do not.

    wheels            against each other, and their speed v against the reference, which stands for them where
                      they are not measured
    accel_x           dv/dt
    curves            against each other: wheels, yaw rate, lateral acceleration, steering
    calliper_pressure the deceleration, by the brakes of the car

A wrong input breaks every relation it stands in, so the one that explains most of what is broken is reported,
and the others are not. What a drive does not show is not judged: a scale is wrong if it is so whichever side
has all of the noise, which with a correlation r leaves it open between s and s / r^2.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector, median
from brakelab.logs.physics.curves import lateral_lines
from brakelab.logs.physics.line import MOVING, RATE, Fit, ranked
from brakelab.logs.physics.pressures import judge_pressures
from brakelab.logs.physics.relations import LEAST_ROWS, Relations, relate, rescaled
from brakelab.logs.physics.samples import SAMPLED, Car, InputSeries, Rows
from brakelab.logs.physics.scales import (
    CHECK,
    SCALE,
    SIGNED,
    UNIT,
    is_apart,
    is_clean,
    sign_and_scale,
    times,
    unit_of,
)
from brakelab.logs.physics.stuck import clipped_accels, stuck_wheels
from ecu.contract.params import GRAVITY
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, INPUT_SIGNALS

LOST: Final = 0.3  # below which a signal is another one
WHEEL: Final = {True: 0.08, False: 0.12}  # tolerated of a wheel among the others, likewise
ALIKE: Final = 1.25  # two factors within it have one cause
RADII: Final = 0.02  # by which radii are off that no worn tyre explains
LATENESS: Final = int(0.5 * RATE)  # rows by which a speed may come late
STEADY: Final = 0.01  # by which a speed may change meanwhile for a late one to be the same
LEAST_ZERO: Final = 0.35  # m/s^2: a road that falls by less on the mean is usual
OUTSIDE: Final = 0.02  # of the samples


class Judged(NamedTuple):
    """Findings of a drive about its inputs, a line for each with the remedy."""

    contradictions: list[str]
    """Signs, scales and signals that cannot be what the map says: friction by them is none."""
    flaws: list[str]
    """Zeros that are off, ranges that end, sensors that stand still: such as no other map mends."""
    checked: list[str]
    """Names of the inputs that the drive shows enough of."""

    @property
    def lines(self) -> list[str]:
        """All findings, what forbids learning first."""
        return self.contradictions + self.flaws


def judge(series: InputSeries, car: Car) -> Judged:
    """Return the findings of a drive's physics about its inputs."""
    omega = series.corners("wheel_speed")
    measured = omega is not None
    if omega is not None:
        wheels = omega * car.radius
    elif "vehicle_speed" in series:
        wheels = np.tile(series["vehicle_speed"][:, None], 4)
    else:
        return Judged([], [], [])
    slower, faster = ranked(np.abs(wheels))[1:3]
    rows = series.known & (0.5 * (slower + faster) > MOVING)
    if rows.sum() < LEAST_ROWS:
        return Judged([], [], [])
    flaws: list[str] = []
    lines: list[str] = []
    if measured:
        flaws, wheels = stuck_wheels(series, wheels, rows)
        lines, wheels = _wheels(wheels, rows, car)
    speed = wheels.mean(axis=1)
    clipped, unclipped = clipped_accels(series, speed, rows)
    rows = unclipped if unclipped.sum() >= LEAST_ROWS else rows
    flaws += clipped
    checked = ["wheel_speed"] if measured else []
    relations = relate(series, car, wheels, rows)
    factor, speed_lines = _speed_scale(series, relations, speed, rows, car, measured)
    lines += speed_lines
    if measured and car.known and not speed_lines:
        flaws += _radii(series, speed, rows)
    relations = rescaled(relations, factor)
    checked += [name for name in ("accel_x", "yaw_rate", "accel_y") if getattr(relations, name)]
    checked += ["steering_angle"] if relations.steering else []
    checked += ["vehicle_speed"] if "vehicle_speed" in series else []
    if relations.swapped:
        lines.append("accel_x and accel_y are swapped: each follows what the other should; exchange them")
    else:
        alone = "vehicle_speed" not in series and not is_clean(relations.accel_y)
        lines += _longitudinal(relations.accel_x, car, alone)
        flaws += _zero(relations.accel_x, car)
    lines += lateral_lines(relations, car)
    third, fastest = ranked(wheels)[2:]  # the others may lock
    change = np.gradient(0.5 * (third + fastest) / factor, 1.0 / RATE)
    agrees = relations.accel_x is not None and relations.accel_x.correlation > SIGNED
    if agrees and not any("accel_x" in line for line in lines + flaws):
        change = series["accel_x"]  # slopes of the road and wheels that slip are no matter to it
    pressures = judge_pressures(series, car, change, rows)
    return Judged(lines + pressures.contradictions, flaws + pressures.flaws, checked + pressures.checked)


def range_lines(freshness: RecordArray) -> list[str]:
    """Return a line for each input with samples outside its range: a sign or a unit, where they are many.

    `freshness` is FRESHNESS of each input after the drive, shape (N_INPUTS,).
    """
    refused: dict[str, list[str]] = {}
    for place in SAMPLED:
        known, signal = freshness[place], INPUT_SIGNALS[place]
        outside = int(known["outside"])
        share = outside / max(outside + int(known["taken"]), 1)
        if share > OUTSIDE:
            span = f"{signal.low:g}…{signal.high:g} {signal.unit}"
            refused.setdefault(span, []).append(f"{signal.name} {100.0 * share:.0f} %")
    return [
        f"{', '.join(names)} of samples outside {span}: refused; check sign and unit"
        for span, names in refused.items()
    ]


def _wheels(wheels: Vector, rows: Rows, car: Car) -> tuple[list[str], Vector]:
    """Judge the wheels [m/s, shape (n, 4)] by each other; return them with a wrong one as its neighbour."""
    ratios = []
    moving = wheels[rows]
    for i in range(4):
        others = ranked(np.delete(moving, i, axis=1))[1]
        roll = np.abs(others) > 0.5
        ratios.append(median(moving[roll, i] / others[roll]))
    wrong = [i for i in range(4) if not abs(ratios[i] - 1.0) <= WHEEL[car.known]]
    if len(wrong) > 1:
        front, rear = float(np.mean(ratios[:2])), float(np.mean(ratios[2:]))
        message = f"wheel_speed_*: wheels differ, front {front:.2f} and rear {rear:.2f} of the others"
        return [f"{message}; check unit and factor of each"], wheels
    lines, mended = [], wheels.copy()
    for i in wrong:
        name = f"wheel_speed_{CORNERS[i]}"
        lines.append(f"{name}: reads {times(ratios[i])} the other wheels; check its unit and factor")
        mended[:, i] = wheels[:, i] / ratios[i]
    return lines, mended


def _speed_scale(
    series: InputSeries, relations: Relations, speed: Vector, rows: Rows, car: Car, measured: bool
) -> tuple[float, list[str]]:
    """Return by how much all wheels read too much, and the line about them or about the reference.

    `measured`: the wheels are; else the reference stands for them.
    """
    tolerated = 1.0 + SCALE[car.known]
    both = (relations.accel_x, relations.accel_y)
    by_accel = [1.0 / abs(line.slope) for line in both if is_clean(line) and line.slope]
    beyond = [line for line in both if line and abs(line.correlation) > SIGNED and line.is_beyond(tolerated)]
    if measured and "vehicle_speed" in series:
        reference = series["vehicle_speed"]
        there = rows & (np.abs(reference) > 0.5)
        if there.sum() >= LEAST_ROWS:
            by_reference = abs(median(speed[there] / reference[there]))
            if is_apart(by_reference, 1.0 + 0.6 * SCALE[car.known]):
                if not by_accel or any(not is_apart(one / by_reference, tolerated) for one in by_accel):
                    return by_reference, [_speed_line(by_reference, car, "vehicle_speed says")]
                reads = f"vehicle_speed: reads {times(1.0 / by_reference)} what wheels and accelerations say"
                return 1.0, [f"{reads}{unit_of('m/s', by_reference, CHECK)}"]
            return 1.0, []
    if len(beyond) == 2:
        one, other = (1.0 / float(np.sqrt(line.span[0] * line.span[1])) for line in beyond)
        mean = 1.0 / float(np.sqrt(abs(beyond[0].slope * beyond[1].slope)))
        in_g = not is_apart(mean / GRAVITY, UNIT) or not is_apart(mean * GRAVITY, UNIT)
        if not is_apart(one / other, ALIKE) and not in_g:
            if measured:
                return mean, [_speed_line(mean, car, "both accelerations say")]
            reads = f"vehicle_speed: reads {times(mean)} what both accelerations say"
            return mean, [f"{reads}{unit_of('m/s', 1.0 / mean, CHECK)}"]
    return 1.0, []


def _radii(series: InputSeries, speed: Vector, rows: Rows) -> list[str]:
    """Return the line about a reference that says other radii than CONFIG: learned forces follow it."""
    if "vehicle_speed" not in series:
        return []
    reference = series["vehicle_speed"]
    before, after = np.roll(speed, LATENESS), np.roll(speed, -LATENESS)
    change = np.maximum(np.abs(speed - before), np.abs(after - speed))
    there = rows & (reference > MOVING) & (change < STEADY * speed)
    if there.sum() < LEAST_ROWS:
        return []
    factor = median(speed[there] / reference[there])
    if abs(factor - 1.0) < RADII:
        return []
    reads = f"vehicle_speed: reads {times(1.0 / factor)} what wheels of CONFIG's radii roll"
    radii = f"multiply unloaded_radius by {1.0 / factor:.3f}"
    return [f"{reads}; {radii}, or give this speed factor = {factor:.3f} where it is the one that is off"]


def _speed_line(factor: float, car: Car, who: str) -> str:
    radius = float(car.radius.mean())
    units = {
        "km/h": 3.6 * radius,
        "mph": radius / 0.44704,
        "m/s": radius,
        "rpm": 30.0 / np.pi,
        "deg/s": 180.0 / np.pi,
    }
    near = [unit for unit, scale in units.items() if abs(factor / scale - 1.0) < 0.08]
    message = f"wheel_speed_*: all read {times(factor)} what {who}"
    if near:
        return f'{message}, as {near[0]} read as rad/s would; unit = "{near[0]}", or check rolling_radius'
    return f"{message}; check unit, factor and rolling_radius"


def _longitudinal(line: Fit | None, car: Car, alone: bool) -> list[str]:
    """Judge accel_x; `alone`: nothing else tells whether it or the wheels' speed is off."""
    if line is None:
        return []
    if abs(line.correlation) < LOST:
        return [f"accel_x: does not follow dv/dt (correlation {line.correlation:.2f}); is it another signal?"]
    remedy = f"{CHECK}, or those of the wheels and rolling_radius" if alone else CHECK
    return sign_and_scale("accel_x", "dv/dt", line, car, remedy)


def _zero(line: Fit | None, car: Car) -> list[str]:
    """Return the line about what accel_x reads at constant speed, where sign and scale are right."""
    if line is None or abs(line.correlation) < LOST or abs(line.intercept) < LEAST_ZERO:
        return []
    if _longitudinal(line, car, alone=False):
        return []
    zero = f"accel_x: reads {line.intercept:+.2f} m/s^2 at constant speed"
    return [f"{zero}; offset = {-line.intercept:+.2f}, unless the road falls or rises throughout"]
