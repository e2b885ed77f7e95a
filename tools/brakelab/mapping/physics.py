"""Signals that behave like the inputs of the ECU.

Wheel speeds are known by their names and by going together, the car's speed by its name where these lack;
everything else is set against them, but curves only against wheel speeds:

    accel_x            dv/dt
    yaw_rate           (v_right - v_left) / track, both axles
    accel_y            v times yaw rate
    steering_angle     atan(L yaw rate / v)
    calliper_pressure  -dv/dt while the car decelerates
    pedals             their sign of dv/dt

A regression over the drive gives sign and scale, so swapped or inverted axes show (ISO 8855: x forward, y
left). Once a yaw rate is found it replaces that of the wheels, which their slip disturbs.
"""

from collections.abc import Iterable
from typing import Final

from brakelab.logs.physics.line import MOVING
from brakelab.logs.physics.samples import ANY_CAR, Car
from brakelab.mapping.brakes import brakes, flags
from brakelab.mapping.candidates import best_of, by_name, unit_of
from brakelab.mapping.curves import curves
from brakelab.mapping.motion import Found, Motion, contract_unit, motion_of, speeds
from brakelab.mapping.scale import scale_of
from brakelab.mapping.series import Series
from ecu.bus.units import CONVERSIONS, spelled
from ecu.contract.signals import CORNERS, INPUT

STEERING_RATIO: Final = 16.0  # of a car that is not known. Assumption
CURVES: Final = ("yaw_rate", "accel_y", "steering_angle")
LEAST_CURVES: Final = 0.3  # m/s^2, standard deviation of v times yaw rate
LEAST_ZERO: Final = 0.05  # m/s^2, a zero error worth a line


def accel_x(series: list[Series], motion: Motion) -> list[Found]:
    """Return the longitudinal acceleration of a car that drives, its zero error taken off, or nothing."""
    best = best_of(series, "accel_x", motion, motion.change, motion.faster(MOVING))
    if best is None:
        return []
    one, line = best
    unit = unit_of("accel_x", one, line.slope)
    in_unit = CONVERSIONS[contract_unit("accel_x")][unit][0]
    slope = line.slope * in_unit
    scale = scale_of(one, slope, line.correlation)
    evidence = f"against dv/dt: correlation {abs(line.correlation):.2f}, slope {slope:+.2f}"
    offset = 0.0
    if abs(scale.factor * line.intercept * in_unit) > LEAST_ZERO:
        offset = -scale.factor * line.intercept
        evidence += f"; {line.intercept:+.2f} {unit} at constant speed, with the slope of the road"
    return [Found("accel_x", one, scale.factor, offset, unit, evidence, True, scale.warning)]


def named_only(series: list[Series], targets: Iterable[str], because: str) -> list[Found]:
    """Return what names alone say of inertial sensors and steering, `because` the drive says nothing."""
    found: list[Found] = []
    for target in targets:
        one = by_name([one for one in series if not one.sign], target)
        if one:
            factor = 1.0 / STEERING_RATIO if target == "steering_angle" else 1.0
            evidence = f"by its name; {because}"
            warning = f"its name alone speaks for it, {because}: check sign and unit"
            found.append(Found(target, one, factor, 0.0, unit_of(target, one), evidence, False, warning))
    return found


def _named_as_inputs(series: list[Series]) -> list[Found]:
    """Return what has an input's own name and unit, where the wheel speeds have theirs too."""
    own = {one.signal: one for one in series if one.signal in INPUT and not one.sign}
    if not all(f"wheel_speed_{corner}" in own for corner in CORNERS):
        return []
    return [
        Found(name, one, 1.0, 0.0, contract_unit(name), "named as the ECU's input", True)
        for name, one in own.items()
        if spelled(one.unit) in (contract_unit(name), "")
    ]


def _curved(motion: Motion) -> bool:
    """Return whether the drive has curves enough to tell what follows them."""
    fast = motion.faster(MOVING)
    return bool((motion.speed * motion.yaw_rates[0])[fast].std() > LEAST_CURVES)


def propose(series: list[Series], car: Car = ANY_CAR) -> tuple[list[Found], Motion | None]:
    """Return what is proposed, speeds first, and the car's motion; nothing without wheel speeds and speed.

    All of it comes from the bus that carries the speeds. `car` gives lengths and brakes, where known.
    """
    sent = speeds(series)
    if not sent:
        return [], None
    motion = motion_of(sent, car)
    bus = next(iter(sent.values())).bus
    here = [one for one in series if one.bus == bus]
    alone = len(sent) == 1
    evidence = "by its name; the log has no four wheel speeds" if alone else "by their names"
    found = [Found(name, one, 1.0, 0.0, spelled(one.unit), evidence, True) for name, one in sent.items()]
    if motion.drives:
        found += accel_x(here, motion)
        taken = {one.series.name for one in found}
        if not alone:
            found += curves(here, motion, car, taken)
        if not _curved(motion):
            open_ = [name for name in CURVES if name not in {one.target for one in found}]
            why = "no wheel speeds show the curves" if alone else "the drive has hardly a curve"
            found += named_only([one for one in here if one.name not in taken], open_, why)
    else:
        found += named_only(here, ("accel_x", *CURVES), "the car stands")
    found += brakes(here, motion, car) + flags(here, motion)
    own = {one.target: one for one in _named_as_inputs(here)}
    sure = {one.target for one in found if one.sure}
    kept = [one for one in found if one.sure or one.target not in own]
    return kept + [one for target, one in own.items() if target not in sure], motion
