"""Virtual force sensor of Observer 2: the total tyre force, shared out by the tyre model (4.16–4.24).

    F_X^(VS) = m a_x + F_drag                 corrected 4.16: plus, as in (A.1a); a_x in road axes holds the
                                              grade, so this is the sum of the tyre forces on any slope
    F_L,i^(TM) = C_L,i(F_Z,i) lambda_i        (4.12, `tyre.py`)
    K_f = F_X^(VS) / F_X^(TM)                 (4.18) by recursive least squares with forgetting (4.20–4.22)
    F_L,i^(VS) = K_f F_L,i^(TM)               (4.23)

In a curve the lateral forces of the front wheels have a part -F_Y,f sin(delta) along the car; it is removed
from F_X^(VS) with F_Y,f = m a_y l_r / L, so K_f compares longitudinal forces only.
Forces are ISO 8855: negative while braking.
"""

import math

import numpy as np

from ecu.estimation.motion import usable
from ecu.estimation.tyre import slip_stiffness
from ecu.jit import Record, kernel
from ecu.signals import WHEEL_FORCE_X

FORCE_STATE = np.dtype(
    [
        ("total", "f8"),  # F_X^(VS) [N]
        ("k_f", "f8"),
        ("covariance", "f8"),  # of k_f, in units of the squared model force
        ("residual", "f8"),  # mean square of the relative residual
        ("model", "f8", (4,)),  # F_L^(TM) [N]
        ("virtual", "f8", (4,)),  # F_L^(VS) [N]
        ("measured", "u1", (4,)),  # Observer 1: a transducer stands in for it
    ],
    align=True,
)

K_F_LOW, K_F_HIGH = 0.25, 4.0
COVARIANCE_START = 1e-7  # 1/N^2: the first newtons of model force count little against k_f = 1
# Below this modelled total force the ratio is noise [N].
MIN_MODEL_FORCE = 300.0


@kernel
def total_tyre_force(params: Record, motion: Record, speed: float) -> float:
    """Return the sum of longitudinal tyre forces [N] in wheel axes from acceleration and drag (4.16)."""
    inertial: float = params.mass * motion.accel_x
    drag: float = params.drag_area * speed * abs(speed)
    front_lateral: float = params.mass * motion.accel_y * params.rear_axle / params.wheelbase
    return inertial + drag + front_lateral * math.sin(motion.steering)


@kernel
def reset_force(state: Record) -> None:
    """Begin the regression anew from the last k_f, as at the start of a braking."""
    state.covariance = COVARIANCE_START
    state.residual = 0.0


@kernel
def update_force(params: Record, state: Record, wheels: Record, load: Record, regress: bool) -> None:
    """Overwrite modelled and virtual forces and, where `regress`, the correction factor k_f."""
    model_total = 0.0
    fresh = False
    for i in range(4):
        state.model[i] = slip_stiffness(params, i, load[i], wheels.expected_force[i]) * wheels.slip[i]
        model_total += state.model[i]
        fresh = fresh or wheels.fresh[i] != 0
    if regress and fresh and abs(model_total) > MIN_MODEL_FORCE:
        x, y, p = model_total, state.total, state.covariance
        gain = p * x / (params.rls_forgetting + x * p * x)
        residual = y - x * state.k_f
        state.k_f += gain * residual
        state.covariance = min((1.0 - gain * x) * p / params.rls_forgetting, COVARIANCE_START)
        relative = residual / max(abs(y), MIN_MODEL_FORCE)
        state.residual += 0.05 * (relative * relative - state.residual)
    if not math.isfinite(state.k_f):
        state.k_f, state.covariance = 1.0, COVARIANCE_START
    state.k_f = min(max(state.k_f, K_F_LOW), K_F_HIGH)
    for i in range(4):
        state.virtual[i] = state.k_f * state.model[i]


@kernel
def take_measured_force(state: Record, inputs: Record) -> None:
    """Let measured wheel forces stand in for the virtual sensor where they are there (Observer 1, 4.3)."""
    for i in range(4):
        state.measured[i] = 1 if usable(inputs, WHEEL_FORCE_X + i) else 0
        if state.measured[i]:
            state.virtual[i] = inputs.value[WHEEL_FORCE_X + i]
