"""Physics of a log: relations that its inputs must obey if the map is right; one line where they do not.

    wheels            against each other, and their speed v against the reference
    accel_x           dv/dt
    yaw_rate          (v_right - v_left) / track, for its sign and unit alone: the outer tyre is pressed flat
                      and turns faster, which at 25 m/s is as much as the curve itself
    accel_y           v times yaw rate
    steering_angle    atan(L yaw rate / v)
    calliper_pressure the deceleration, by the brakes of the car

A wrong input breaks every relation it stands in, so the one that explains most of what is broken is told, and
the others are not. What a drive does not show is not judged: a scale wants a correlation of `CLEAN`.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple, TypeGuard

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.physics.line import MOVING, RATE, Fit, fit
from brakelab.logs.physics.pressures import pressure_lines
from brakelab.logs.physics.samples import SAMPLED, Car, Drive, Rows
from brakelab.logs.physics.stuck import clipped_accels, stuck_wheels
from ecu.bus.units import CONVERSIONS
from ecu.contract.params import GRAVITY
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, INPUT_SIGNALS

LEAST_ROWS: Final = int(8 * RATE)
CLEAN: Final = 0.93  # correlation from which a slope is a scale
SIGNED: Final = 0.6  # from which it has a sign
LOST: Final = 0.3  # below which a signal is another one
SCALE: Final = {True: 0.15, False: 0.22}  # tolerated, of a car that is known, and of any
WHEEL: Final = {True: 0.08, False: 0.12}  # likewise, of a wheel among the others
UNIT: Final = 1.45  # a factor within it of that of a unit is that unit
LEAST_CHANGE: Final = 0.3  # m/s^2, standard deviation of dv/dt and of v times yaw rate
LEAST_ZERO: Final = 0.35  # m/s^2: a road that falls by less on the mean is usual
LEAST_TURN: Final = 0.008  # rad/s, standard deviation
HAND_WHEEL: Final = 4.0
OUTSIDE: Final = 0.02  # of the samples
CHECK: Final = "check unit and factor"


class Judged(NamedTuple):
    """Findings of a drive about its inputs."""

    lines: list[str]
    """One for each input that cannot be what the map says, with the remedy."""
    checked: list[str]
    """Names of the inputs that the drive shows enough of."""


class _Relations(NamedTuple):
    """Lines through an input over its value by the others; None: not observable in this drive."""

    accel_x: Fit | None
    swapped: bool
    yaw_rate: Fit | None
    accel_y: Fit | None
    steering: Fit | None


def judge(drive: Drive, car: Car) -> Judged:
    """Return the findings of a drive's physics about its inputs."""
    omega = drive.corners("wheel_speed")
    if omega is None or not len(drive.known):
        return Judged([], [])
    wheels = omega * car.radius
    rows = drive.known & (np.median(np.abs(wheels), axis=1) > MOVING)
    if rows.sum() < LEAST_ROWS:
        return Judged([], [])
    stuck, wheels = stuck_wheels(drive, wheels, rows)
    lines, wheels = _wheels(wheels, rows, car)
    speed = wheels.mean(axis=1)
    clipped, unclipped = clipped_accels(drive, speed, rows)
    rows = unclipped if unclipped.sum() >= LEAST_ROWS else rows
    lines = stuck + lines + clipped
    checked = ["wheel_speed"]
    relations = _relate(drive, car, wheels, rows)
    factor, told = _speed_scale(drive, relations, speed, rows, car)
    lines += told
    relations = _rescaled(relations, factor)
    checked += [name for name in ("accel_x", "yaw_rate", "accel_y") if getattr(relations, name)]
    checked += ["steering_angle"] if relations.steering else []
    checked += ["vehicle_speed"] if "vehicle_speed" in drive else []
    if relations.swapped:
        lines.append("accel_x and accel_y are swapped: each follows what the other should; exchange them")
    else:
        alone = "vehicle_speed" not in drive and not _is_clean(relations.accel_y)
        lines += _longitudinal(relations.accel_x, car, alone)
    lines += _lateral(relations, car)
    pressures, seen = pressure_lines(drive, car, speed / factor, rows)
    return Judged(lines + pressures, checked + seen)


def range_lines(freshness: RecordArray) -> list[str]:
    """Return a line for each input with samples outside its range: a sign or a unit, where they are many.

    `freshness` is FRESHNESS of each input after the drive, shape (N_INPUTS,).
    """
    told: dict[str, list[str]] = {}
    for place in SAMPLED:
        known, signal = freshness[place], INPUT_SIGNALS[place]
        outside = int(known["outside"])
        share = outside / max(outside + int(known["taken"]), 1)
        if share > OUTSIDE:
            span = f"{signal.low:g}…{signal.high:g} {signal.unit}"
            told.setdefault(span, []).append(f"{signal.name} {100.0 * share:.0f} %")
    return [
        f"{', '.join(names)} of samples outside {span}: refused; check sign and unit"
        for span, names in told.items()
    ]


def _wheels(wheels: Vector, rows: Rows, car: Car) -> tuple[list[str], Vector]:
    """Judge the wheels [m/s, shape (n, 4)] by each other; return them with a wrong one as its neighbour."""
    ratios = []
    for i in range(4):
        others = np.median(np.delete(wheels[rows], i, axis=1), axis=1)
        ratios.append(float(np.median(wheels[rows, i] / np.where(np.abs(others) > 0.5, others, np.nan))))
    wrong = [i for i in range(4) if not abs(ratios[i] - 1.0) <= WHEEL[car.known]]
    if len(wrong) > 1:
        front, rear = float(np.mean(ratios[:2])), float(np.mean(ratios[2:]))
        told = f"wheel_speed_*: wheels differ, front {front:.2f} and rear {rear:.2f} of the others"
        return [f"{told}; check unit and factor of each"], wheels
    lines, mended = [], wheels.copy()
    for i in wrong:
        name = f"wheel_speed_{CORNERS[i]}"
        lines.append(f"{name}: reads {_times(ratios[i])} the other wheels; check its unit and factor")
        mended[:, i] = wheels[:, i] / ratios[i]
    return lines, mended


def _relate(drive: Drive, car: Car, wheels: Vector, rows: Rows) -> _Relations:
    speed = wheels.mean(axis=1)

    def line(name: str, reference: Vector, least: float, where: Rows = rows) -> Fit | None:
        if name not in drive or where.sum() < LEAST_ROWS or reference[where].std() < least:
            return None
        return fit(drive[name], reference, where)

    def cleanest(name: str, references: Iterable[Vector], least: float) -> Fit | None:
        """Of all wheels and of each axle: one that slips or is pressed flat tells less."""
        lines = (line(name, reference, least) for reference in references)
        return max(filter(None, lines), key=lambda one: abs(one.correlation), default=None)

    changes = [
        np.gradient(wheels[:, axle].mean(axis=1), 1.0 / RATE) for axle in (slice(4), slice(2), slice(2, 4))
    ]
    accel_x = cleanest("accel_x", changes, LEAST_CHANGE)
    across = cleanest("accel_y", changes, LEAST_CHANGE)
    swapped = bool(
        accel_x
        and across
        and abs(across.correlation) > CLEAN - 0.1
        and abs(accel_x.correlation) < abs(across.correlation) - 0.3
    )
    turns = (wheels[:, 1] - wheels[:, 0]) / car.track, (wheels[:, 3] - wheels[:, 2]) / car.track
    yaw_rate = cleanest("yaw_rate", (0.5 * (turns[0] + turns[1]), *turns), LEAST_TURN)
    if "yaw_rate" not in drive:
        return _Relations(accel_x, swapped, None, None, None)
    yaw = drive["yaw_rate"]
    in_degrees = (
        yaw_rate is not None and abs(yaw_rate.slope) > 57.3 * 0.3 and abs(yaw_rate.correlation) > SIGNED
    )
    scale = np.pi / 180.0 if in_degrees else 1.0
    accel_y = line("accel_y", scale * speed * yaw, LEAST_CHANGE)
    curve = np.arctan(car.wheelbase * scale * yaw / np.maximum(np.abs(speed), MOVING))
    steering = line("steering_angle", curve, 0.004)
    return _Relations(accel_x, swapped, yaw_rate, None if swapped else accel_y, steering)


def _speed_scale(
    drive: Drive, relations: _Relations, speed: Vector, rows: Rows, car: Car
) -> tuple[float, list[str]]:
    """Return by how much all wheels read too much, and the line about them or about the reference."""
    tolerated = 1.0 + SCALE[car.known]
    by_accel = [
        1.0 / abs(line.slope)
        for line in (relations.accel_x, relations.accel_y)
        if _is_clean(line) and line.slope
    ]
    if "vehicle_speed" in drive:
        reference = drive["vehicle_speed"]
        there = rows & (np.abs(reference) > 0.5)
        if there.sum() >= LEAST_ROWS:
            by_reference = abs(float(np.median(speed[there] / reference[there])))
            if _beyond(by_reference, 1.0 + 0.6 * SCALE[car.known]):
                if not by_accel or any(not _beyond(one / by_reference, tolerated) for one in by_accel):
                    return by_reference, [_speed_line(by_reference, car, "vehicle_speed says")]
                told = f"vehicle_speed: reads {_times(1.0 / by_reference)} what wheels and accelerations say"
                return 1.0, [f"{told}{_unit_of('m/s', by_reference, CHECK)}"]
            return 1.0, []
    if len(by_accel) == 2 and all(_beyond(one, tolerated) for one in by_accel):
        both = float(np.sqrt(by_accel[0] * by_accel[1]))
        in_g = not _beyond(both / GRAVITY, UNIT) or not _beyond(both * GRAVITY, UNIT)
        if not _beyond(by_accel[0] / by_accel[1], 1.15) and not in_g:
            return both, [_speed_line(both, car, "both accelerations say")]
    return 1.0, []


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
    told = f"wheel_speed_*: all read {_times(factor)} what {who}"
    if near:
        return f'{told}, as {near[0]} read as rad/s would; unit = "{near[0]}", or check rolling_radius'
    return f"{told}; check unit, factor and rolling_radius"


def _rescaled(relations: _Relations, factor: float) -> _Relations:
    """Return the lines as they would be with wheels that read `factor` less."""

    def times(line: Fit | None) -> Fit | None:
        return line._replace(slope=line.slope * factor) if line else None

    return relations._replace(
        accel_x=times(relations.accel_x),
        accel_y=times(relations.accel_y),
        yaw_rate=times(relations.yaw_rate),
        steering=relations.steering._replace(slope=relations.steering.slope / factor)
        if relations.steering
        else None,
    )


def _longitudinal(line: Fit | None, car: Car, alone: bool) -> list[str]:
    """Judge accel_x; `alone`: nothing else tells whether it or the wheels' speed is off."""
    if line is None:
        return []
    if abs(line.correlation) < LOST:
        return [f"accel_x: does not follow dv/dt (correlation {line.correlation:.2f}); is it another signal?"]
    remedy = f"{CHECK}, or those of the wheels and rolling_radius" if alone else CHECK
    told = _sign_and_scale("accel_x", "dv/dt", line, car, remedy)
    if told or abs(line.intercept) < LEAST_ZERO:
        return told
    zero = f"accel_x: reads {line.intercept:+.2f} m/s^2 at constant speed"
    return [f"{zero}; offset = {-line.intercept:+.2f}, unless the road falls or rises all the way"]


def _lateral(relations: _Relations, car: Car) -> list[str]:
    """Judge signs by the majority of wheels, yaw rate, lateral acceleration and steering, then scales."""
    lines: list[str] = []
    fits = {
        "wheels": relations.yaw_rate,
        "accel_y": relations.accel_y,
        "steering_angle": relations.steering,
    }
    votes = {name: np.sign(f.correlation) for name, f in fits.items() if f and abs(f.correlation) > SIGNED}
    against = [name for name, sign in votes.items() if sign < 0]
    for_yaw = 1 + len(votes) - len(against)
    yaw_is_wrong = len(against) > for_yaw or (len(against) == for_yaw and "wheels" in against)
    if yaw_is_wrong:
        alone = ", unless left and right wheels are exchanged" if list(votes) == ["wheels"] else ""
        lines.append(f"yaw_rate: turned against the wheels, or what else tells curves; factor = -1{alone}")
        against = [name for name in votes if name not in against]
    for name in against:
        if name == "wheels":
            lines.append(
                "wheel_speed_*: left and right are exchanged: every other sensor turns the other way"
            )
        else:
            lines.append(f"{name}: turned against speed and yaw rate; factor = -1")
    if relations.swapped:
        return lines
    wheels = relations.yaw_rate
    if wheels and abs(wheels.correlation) > SIGNED and abs(wheels.slope) > 57.3 * 0.3:
        return [*lines, 'yaw_rate: reads some 57 times what the wheels turn; unit = "deg/s"']
    if wheels and abs(wheels.correlation) > CLEAN - 0.1 and abs(wheels.slope) < 2.0 / 57.3:
        return [*lines, 'yaw_rate: reads a 57th of what the wheels turn; unit = "rad/s"']
    if relations.accel_y and abs(relations.accel_y.correlation) > SIGNED:
        for slope, unit in ((np.pi / 180.0, "deg/s"), (180.0 / np.pi, "rad/s")):
            if not _beyond(abs(relations.accel_y.slope) / slope, UNIT):
                told = f"yaw_rate: reads {_times(1.0 / abs(relations.accel_y.slope))} what accel_y says"
                return [*lines, f'{told}; unit = "{unit}"']
    if relations.accel_y and not any(line.startswith("accel_y") for line in lines):
        if _yaw_explains(relations, car):
            factor = 1.0 / abs(relations.accel_y.slope)
            told = f"yaw_rate: reads {_times(factor)} what lateral acceleration and steering say"
            lines.append(f"{told}; check its factor")
        else:
            flat = relations.accel_y._replace(slope=abs(relations.accel_y.slope))
            flat = flat._replace(correlation=abs(flat.correlation))
            lines += _sign_and_scale("accel_y", "speed times yaw rate", flat, car, CHECK)
    steering = relations.steering
    if steering and abs(steering.correlation) > SIGNED and abs(steering.slope) > HAND_WHEEL:
        ratio = f"factor = {1.0 / abs(steering.slope):.3g}"
        told = f"steering_angle: {abs(steering.slope):.0f} times that of the road wheels"
        lines.append(f"{told}; is it the hand wheel's, or in deg? {ratio}")
    return lines


def _yaw_explains(relations: _Relations, car: Car) -> bool:
    """Return whether lateral acceleration and steering are both off as one wrong yaw rate would make them."""
    lateral, steering = relations.accel_y, relations.steering
    if not _is_clean(lateral) or not _is_clean(steering):
        return False
    tolerated = 1.0 + SCALE[car.known]
    alike = not _beyond(abs(lateral.slope) / abs(steering.slope), 1.15)
    return alike and _beyond(abs(lateral.slope), tolerated)


def _sign_and_scale(name: str, what: str, line: Fit, car: Car, remedy: str) -> list[str]:
    size, problems = abs(line.slope), []
    if line.correlation < -SIGNED:
        problems.append(f"turned against {what}; factor = -1")
    scaled = _is_clean(line) and _beyond(size, 1.0 + SCALE[car.known])
    if scaled or _beyond(size, 3.0):
        problems.append(f"reads {_times(size)} {what}{_unit_of('m/s^2', 1.0 / size, remedy)}")
    return [f"{name}: {'; '.join(problems)}"] if problems else []


def _unit_of(target: str, wanted: float, otherwise: str) -> str:
    """Return the unit whose factor is about `wanted`, as a remedy; without one `otherwise`."""
    for unit, (scale, _) in CONVERSIONS[target].items():
        for factor, name in ((scale, unit), (1.0 / scale, target)):
            if scale != 1.0 and 1.0 / UNIT < wanted / factor < UNIT and _beyond(wanted, 1.8):
                return f'; unit = "{name}"'
    return f"; {otherwise}"


def _is_clean(line: Fit | None) -> TypeGuard[Fit]:
    return line is not None and abs(line.correlation) > CLEAN


def _beyond(ratio: float, tolerated: float) -> bool:
    return not 1.0 / tolerated <= ratio <= tolerated


def _times(ratio: float) -> str:
    return f"{ratio:.2f} times"
