"""Text of an input in a proposed map, for frames and columns alike: evidence, scale, unit, time-out."""

from brakelab.logs.physics.samples import Car
from brakelab.mapping.motion import Found
from brakelab.mapping.names import converts
from ecu.bus.units import spelled


def input_lines(
    one: Found, before: Found | None, source: str, after: float | None, unit_known: bool = True
) -> list[str]:
    """Return the lines of one input.

    Args:
        one: the signal found for it.
        before: the one above it, whose evidence is not repeated.
        source: keys that say where its values come from.
        after: its time-out [s]; None or 0: the usual one.
        unit_known: the map's reader knows the signal's own unit.
    """
    lines = [f"# {one.evidence}"] if before is None or one.evidence != before.evidence else []
    if one.warning and (before is None or one.warning != before.warning):
        lines.append(f"# CHECK: {one.warning}")
    entry = source
    if one.factor != 1.0:
        entry += f", factor = {one.factor:.6g}"
    if one.offset:
        entry += f", offset = {one.offset:.6g}"
    if one.unit != spelled(one.series.unit) or not unit_known:
        entry += f', unit = "{one.unit}"'
    if one.lag:
        entry += f", lag = {one.lag:.2f}"
    if after:
        entry += f", timeout = {after:g}"
    return [*lines, f"{one.target} = {{ {entry} }}"]


def needs_radius(found: list[Found]) -> bool:
    """Return whether there are wheel speeds, and they are speeds along the road."""
    return any(one.target == "wheel_speed_fl" and not converts(one.series.unit, "rad/s") for one in found)


def radius_line(car: Car) -> str:
    """Return the line that turns speeds of wheels into their rotation.

    The car made these speeds with a radius of its own; they are speeds over ground if CONFIG's wheels roll on
    the radius that turns them back.
    """
    origin = "that of CONFIG's wheels" if car.known else "assumed: give that of CONFIG's wheels"
    return f"rolling_radius = {float(car.radius.mean()):.4g}       # m, {origin}"
