"""Virtual force sensor of Observer 2: total tyre force, shared out by the tyre model (4.16–4.24).

    F_X^(VS) = m a_x + F_drag                 corrected 4.16: plus, as in (A.1a); a_x in road axes holds the
                                              grade, so this is the sum of the tyre forces on any slope
    F_L,i^(TM) = F_L(lambda_i, F_Z,i, a_y)    Burckhardt's tyre, combined slip (section 5.4, `tyre.py`)
    K_f = F_X^(VS) / F_X^(TM)                 (4.18) by recursive least squares with forgetting (4.20–4.22)
    F_L,i^(VS) = K_f F_L,i^(TM)               (4.23)

From wheel to chassis (corrected 4.25: a rotation by delta for each front wheel, by nothing for a rear one)
F_X,f = F_L cos(delta) - F_S sin(delta), F_Y,f = F_L sin(delta) + F_S cos(delta). The balance of yaw moments
gives F_Y,f = m a_y l_r / L without a tyre model; F_S eliminated, F_X + F_Y,f tan(delta) = F_L,f / cos(delta)
+ F_L,r. So K_f compares longitudinal forces alone: the norms of (4.18) would dilute it by lateral forces.

Re-estimation of slip stiffness (4.34–4.36; corrected: denominator lambda_f + lambda_r F_Z,r / F_Z,f): a K_f
that stays outside its band in straight braking at small slip is an error of the tyre's stiffness. C_L,f =
F_X^(VS) / (lambda_f + lambda_r C_L,r / C_L,f), where (4.35) makes the ratio of stiffnesses that of loads, and
F_X^(VS) is the filtered K_f F_X^(TM), freed of the curve of the tyre. K_f restarts at 1. Forces are ISO
8855: negative while braking.
"""

import math

import numpy as np

from ecu.algorithm.estimation.thesis.tyre import initial_stiffness, linear_force, tyre_force
from ecu.algorithm.inputs import usable
from ecu.algorithm.vehicle import cos_steering
from ecu.contract.signals import WHEEL_FORCE_X
from ecu.jit import Record, kernel

FORCE_STATE = np.dtype(
    [
        ("total", "f8"),  # F_X^(VS) [N]
        ("k_f", "f8"),
        ("stiffness", "f8"),  # newly estimated slip stiffness, over the configured one
        ("outside_s", "f8"),  # time that k_f has been outside its band, stiffness observable [s]
        ("covariance", "f8"),  # of k_f, in units of the squared model force
        ("residual", "f8"),  # mean square of the relative residual
        ("model", "f8", (4,)),  # F_L^(TM) [N]
        ("virtual", "f8", (4,)),  # F_L^(VS) [N]
        ("measured", "u1", (4,)),  # Observer 1: a transducer replaces it
    ],
    align=True,
)

K_F_LOW, K_F_HIGH = 0.1, 4.0
K_F_BAND = 1.25  # k_f beyond it, or below its inverse, is an error of slip stiffness …
OUTSIDE = 0.1  # … when it lasts so long [s]
STIFFNESS_RANGE = 3.0  # of the configured one, and its inverse
# Slip stiffness is observable: small but measurable slip, straight driving.
LITTLE_SLIP, MEASURABLE_DECEL, STRAIGHT_ACCEL, STRAIGHT_STEERING = 0.04, 2.0, 0.5, 0.02
COVARIANCE_START = 1e-7  # 1/N^2: the first newtons of model force weigh little against k_f = 1
# Below this modelled total force the ratio is noise [N].
MIN_MODEL_FORCE = 300.0


@kernel
def reset_force(state: Record) -> None:
    """Restart the regression from the last k_f, as at the start of a brake application."""
    state.covariance = COVARIANCE_START
    state.residual = 0.0


@kernel
def _renew_stiffness(
    params: Record, state: Record, motion: Record, wheels: Record, load: Record, dt: float
) -> None:
    """Transfer a k_f outside its band to the slip stiffness of both axles (4.36)."""
    slip, found, assumed = 0.0, 0.0, 0.0
    for i in range(4):
        slip = max(slip, abs(wheels.slip[i]))
        found += linear_force(load[i], state.virtual[i])
        assumed += linear_force(load[i], state.model[i])
    observable = (
        slip < LITTLE_SLIP
        and -state.total > MEASURABLE_DECEL * params.mass
        and abs(assumed) > MIN_MODEL_FORCE
        and abs(motion.accel_y) < STRAIGHT_ACCEL
        and abs(motion.steering) < STRAIGHT_STEERING
    )
    outside = state.k_f > K_F_BAND or state.k_f * K_F_BAND < 1.0
    state.outside_s = state.outside_s + dt if observable and outside else 0.0
    if state.outside_s >= OUTSIDE:
        renewed = state.stiffness * found / assumed
        state.stiffness = min(max(renewed, 1.0 / STIFFNESS_RANGE), STIFFNESS_RANGE)
        state.k_f, state.outside_s = 1.0, 0.0


@kernel
def update_force(
    params: Record, state: Record, motion: Record, wheels: Record, load: Record, regress: bool, dt: float
) -> None:
    """Overwrite modelled and virtual forces and, where `regress`, correction factor and slip stiffness."""
    model_total = 0.0
    fresh = False
    for i in range(4):
        stiffness = state.stiffness * initial_stiffness(params, i, load[i])
        state.model[i] = tyre_force(stiffness, load[i], wheels.slip[i], motion.accel_y)
        model_total += state.model[i] / cos_steering(motion) if i < 2 else state.model[i]
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
    if regress:
        _renew_stiffness(params, state, motion, wheels, load, dt)


@kernel
def take_measured_force(state: Record, inputs: Record) -> None:
    """Replace the virtual sensor by measured wheel forces where available (Observer 1, 4.3)."""
    for i in range(4):
        state.measured[i] = 1 if usable(inputs, WHEEL_FORCE_X + i) else 0
        if state.measured[i]:
            state.virtual[i] = inputs.value[WHEEL_FORCE_X + i]
