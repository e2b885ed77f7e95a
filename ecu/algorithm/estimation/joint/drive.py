"""Force and slip of driven wheels with uncertain torque, from accelerometer and wheel speeds.

A logged engine torque is that before gears and losses, known to about half. While no brake is applied, the
force along the car not explained by the other wheels is theirs, shared in proportion to the reported torques.
"""

from ecu.algorithm.estimation.joint.wheel import car_force
from ecu.jit import Record, kernel

KNOWN = 0.5  # share of the drive above which its torque is trusted
DRIVES = 20.0  # N m per wheel


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
