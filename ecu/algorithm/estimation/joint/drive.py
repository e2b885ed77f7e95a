"""Drives whose torque is uncertain: force and slip of the wheels, share of the torque that arrives.

A logged engine torque is that before gears and losses, known to about half. While no brake is applied, the
force along the car not explained by the other wheels is theirs, shared in proportion to the reported torques.

Reported torques count as long as they explain how the car is driven: what an engine's controller reports is
often that of the crankshaft, or a guess. Of those that do not counts the share that arrives.
"""

import math

from ecu.algorithm.estimation.joint.layout import V
from ecu.algorithm.estimation.joint.wheel import car_force, radius
from ecu.jit import Record, kernel

KNOWN = 0.5  # share of the drive above which its torque is trusted
DRIVES = 20.0  # N m per wheel
ACCELERATES = 0.5  # m/s^2, by reported torques, from which they are compared with the motion
DRIVE_MEMORY_S = 60.0
LEAST_DRIVEN = 10.0  # m^2/s^3, the integral of their square from which they are judged
LEAST_SHARE, GREATEST_SHARE, MOST_SHARE = 0.75, 1.33, 4.0  # of them that arrives: explained, at most
LEAST_SPEED = 5.0  # m/s


@kernel
def measure_drive(params: Record, state: Record) -> None:
    """Overwrite force [N] and slip of the driven wheels by this window's measurements.

    Args:
        params: `PARAMS`.
        state: `JOINT_STATE` at the end of a window without braking.
    """
    w = state.window
    if state.drive_known > KNOWN:
        return
    left, driving = car_force(params, state, w.accel), 0.0
    for i in range(4):
        if abs(w.motor[i]) > DRIVES:
            driving += w.motor[i]
        else:
            left -= state.force[i]
    if abs(driving) < DRIVES:
        return
    for i in range(4):
        if abs(w.motor[i]) > DRIVES:
            state.force[i] = left * w.motor[i] / driving
            rolled = w.omega[i] * params.wheel_radius[i]
            if w.omega_samples[i] > 0:
                state.slip[i] = (rolled - w.ground[i]) / max(rolled, w.ground[i], 1.0)


@kernel
def other_decel(params: Record, joint: Record, mass: float, share: float) -> float:
    """Return drag, rolling and a share of the torques over the mass, plus the specific force [m/s^2]."""
    w, speed = joint.window, joint.x[V]
    total = w.common_accel + (w.lateral + params.drag_area * speed * abs(speed)) / mass
    for i in range(4):
        r, _ = radius(params, joint, i, w.load[i])
        own = params.rolling_resistance * w.load[i] * r + params.wheel_inertia[i] * w.common_accel / r
        total += (w.motor[i] * share + own) / (r * mass)
    return total


@kernel
def compare_drive(params: Record, state: Record, joint: Record) -> None:
    """Compare reported torques with the motion in the last window, in which no brake was applied."""
    w, reported = joint.window, 0.0
    for i in range(4):
        reported += w.motor[i] / (params.wheel_radius[i] * params.mass)
    if abs(reported) < ACCELERATES or joint.x[V] < LEAST_SPEED or joint.unmeasured_s > 0.0:
        return
    keeps = math.exp(-w.time / DRIVE_MEMORY_S)
    state.driven = keeps * state.driven + w.time * reported * reported
    state.arrived = keeps * state.arrived - w.time * reported * other_decel(params, joint, params.mass, 0.0)


@kernel
def torque_share(state: Record) -> float:
    """Return the share of the reported torques that counts: all while they explain how the car is driven."""
    if state.driven < LEAST_DRIVEN:
        return 1.0
    share: float = state.arrived / state.driven
    return 1.0 if LEAST_SHARE < share < GREATEST_SHARE else min(max(share, 0.0), MOST_SHARE)
