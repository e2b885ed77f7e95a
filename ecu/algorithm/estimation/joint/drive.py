"""Force and slip of driven wheels whose torque is known badly: by the accelerometer and by wheel speeds.

An engine's torque in a log is that before gears and losses, known to half. While nobody brakes, the force
along the car that the other wheels leave is theirs, shared as the reported torques are.
"""

from ecu.algorithm.estimation.joint.wheel import car_force
from ecu.jit import Record, kernel

KNOWN = 0.5  # share of the drive from which its torque is believed
DRIVES = 20.0  # N m of a wheel


@kernel
def measure_drive(params: Record, state: Record) -> None:
    """Overwrite force [N] and slip of the driven wheels by what this window measured.

    Args:
        params: `PARAMS`.
        state: `JOINT_STATE` at the end of a window in which nobody braked.
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
