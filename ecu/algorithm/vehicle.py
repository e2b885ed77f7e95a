"""Geometry and forces of the car that estimation, control and monitoring share.

Rolling radius (A.4; corrected: the printed form lacks the factor r_0, without which F_Z -> 0 gives 1)

    r_w = r_0 sin(theta) / theta,   theta = arccos(1 - F_Z / (r_0 K_Z))

so that the radius falls by about F_Z / (3 K_Z): 1.2 mm under the load transfer of 4 m/s^2, where slip is 2 %.

Ground speed of a wheel in its rolling direction (A.5), of a rigid body (x forward, y left)

    rear    v_x -+ psi_dot b / 2                                             left -, right +
    front   (v_x -+ psi_dot b / 2) cos(delta) + (v_y + psi_dot l_f) sin(delta)

Sum of the tyres' forces along the car (corrected 4.16), see `estimation/thesis/force.py`.

`motion` is any record with the fields that a function reads: `MOTION_STATE` or `ESTIMATE`. Cosine and sine of
the steering angle, which a dozen places of a cycle need, are computed once (`set_steering`).
"""

import math

from ecu.contract.params import GRAVITY
from ecu.jit import Record, kernel


@kernel
def tyre_slip(params: Record, accel: float) -> float:
    """Return the slip of the configured tyres of a car that brakes by -`accel` [m/s^2], negative: driven."""
    return -accel / (GRAVITY * params.slip_stiffness[0])


@kernel
def rolling_radius(load: float, unloaded_radius: float, vertical_stiffness: float) -> float:
    """Return the effective rolling radius [m] for a wheel load [N] (A.4, corrected); r_0 without load."""
    deflection = max(load, 0.0) / (unloaded_radius * vertical_stiffness)
    if deflection < 1e-9:
        return unloaded_radius
    theta = math.acos(1.0 - min(deflection, 0.5))
    return unloaded_radius * math.sin(theta) / theta


@kernel
def set_steering(motion: Record, angle: float) -> None:
    """Overwrite the steering angle [rad at the road wheel], its cosine and its sine."""
    motion.steering, motion.cos_steering, motion.sin_steering = angle, math.cos(angle), math.sin(angle)


@kernel
def cos_steering(motion: Record) -> float:
    """Return the cosine of the steering angle; where nobody has set it, it is 0."""
    cosine: float = motion.cos_steering
    return cosine if cosine != 0.0 else math.cos(motion.steering)


@kernel
def sin_steering(motion: Record) -> float:
    """Return the sine of the steering angle, likewise."""
    sine: float = motion.sin_steering
    return sine if motion.cos_steering != 0.0 else math.sin(motion.steering)


@kernel
def corner_speed(params: Record, motion: Record, speed: float, corner: int) -> float:
    """Return the ground speed [m/s] of a wheel in its rolling direction (A.5) at vehicle speed `speed`."""
    half_track = 0.5 * params.track * (1.0 if corner % 2 == 1 else -1.0)
    along: float = speed + motion.yaw_rate * half_track
    if corner >= 2:
        return along
    across: float = motion.lateral_speed + motion.yaw_rate * params.front_axle
    return along * cos_steering(motion) + across * sin_steering(motion)


@kernel
def total_tyre_force(params: Record, motion: Record, speed: float) -> float:
    """Return the sum of longitudinal tyre forces [N] in wheel axes from acceleration and drag (4.16)."""
    inertial: float = params.mass * motion.accel_x
    drag: float = params.drag_area * speed * abs(speed)
    front_lateral: float = params.mass * motion.accel_y * params.rear_axle / params.wheelbase
    return inertial + drag + front_lateral * sin_steering(motion)
