"""Curves of a drive: wheels, yaw rate, lateral acceleration and steering angle against each other."""

from typing import Final

import numpy as np

from brakelab.logs.physics.relations import Relations
from brakelab.logs.physics.samples import Car
from brakelab.logs.physics.scales import (
    CHECK,
    CLEAN,
    SCALE,
    SIGNED,
    UNIT,
    is_apart,
    is_clean,
    is_in_degrees,
    sign_and_scale,
    times,
)

HAND_WHEEL: Final = 4.0


def lateral_lines(relations: Relations, car: Car) -> list[str]:
    """Return a line for each input of a curve that the others contradict.

    Signs are judged by the majority of wheels, yaw rate, lateral acceleration and steering, then scales.
    """
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
                "wheel_speed_*: left and right are exchanged: every other sensor turns in the other direction"
            )
        else:
            alone = ", unless yaw_rate is turned" if list(votes) == [name] else ""
            lines.append(f"{name}: turned against speed and yaw rate; factor = -1{alone}")
    if relations.swapped:
        return lines
    wheels = relations.yaw_rate
    if is_in_degrees(wheels):
        return [*lines, 'yaw_rate: reads some 57 times what the wheels turn; unit = "deg/s"']
    if wheels and abs(wheels.correlation) > CLEAN - 0.1 and abs(wheels.slope) < 2.0 / 57.3:
        return [*lines, 'yaw_rate: reads a 57th of what the wheels turn; unit = "rad/s"']
    if relations.accel_y and abs(relations.accel_y.correlation) > SIGNED:
        for slope, unit in ((np.pi / 180.0, "deg/s"), (180.0 / np.pi, "rad/s")):
            if not is_apart(abs(relations.accel_y.slope) / slope, UNIT):
                message = f"yaw_rate: reads {times(1.0 / abs(relations.accel_y.slope))} what accel_y says"
                return [*lines, f'{message}; unit = "{unit}"']
    if relations.accel_y and not any(line.startswith("accel_y") for line in lines):
        if _yaw_explains(relations, car):
            factor = 1.0 / abs(relations.accel_y.slope)
            message = f"yaw_rate: reads {times(factor)} what lateral acceleration and steering say"
            lines.append(f"{message}; check its factor")
        else:
            flat = relations.accel_y._replace(slope=abs(relations.accel_y.slope))
            flat = flat._replace(correlation=abs(flat.correlation))
            lines += sign_and_scale("accel_y", "speed times yaw rate", flat, car, CHECK)
    steering = relations.steering
    if steering and abs(steering.correlation) > SIGNED and abs(steering.slope) > HAND_WHEEL:
        ratio = f"factor = {1.0 / abs(steering.slope):.3g}"
        message = f"steering_angle: {abs(steering.slope):.0f} times that of the road wheels"
        lines.append(f"{message}; is it the hand wheel's, or in deg? {ratio}")
    return lines


def _yaw_explains(relations: Relations, car: Car) -> bool:
    """Return whether lateral acceleration and steering are both off as one wrong yaw rate would make them."""
    lateral, steering = relations.accel_y, relations.steering
    if not is_clean(lateral) or not is_clean(steering):
        return False
    tolerated = 1.0 + SCALE[car.known]
    alike = not is_apart(abs(lateral.slope) / abs(steering.slope), 1.15)
    return alike and is_apart(abs(lateral.slope), tolerated)
