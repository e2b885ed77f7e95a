"""Prediction record: deceleration predicted with learned and with configured values, compared by application.

Each application is judged by specific force, which is free of slope. Over its windows

    measured     -(1 + sum I_i / (r_i^2 m)) (a - b) - overrun - (drag + rolling + sum M_i / r_i) / m
    predicted    sum 2 A_i r_eff mu_i (p_i - p_0) / r_i / m        mu_i as it was before the application

twice: with the learned friction, mass, bias and overrun, and with the configured ones. The relative errors of
the two means enter the record, with a memory of `MEMORY` applications. Where the error of the learned
friction significantly exceeds that of the configured one, it is discarded and learned anew.
"""

import math

import numpy as np

from ecu.algorithm.brake import brake_gain_per_bar
from ecu.algorithm.estimation.joint.layout import BIAS, DRAG, LEVEL, MASS, MOTOR, OVERRUN, V
from ecu.algorithm.inputs import driver_accelerates, others_brake
from ecu.contract.params import GRAVITY
from ecu.jit import Record, kernel

LEARNED, CONFIGURED = range(2)

PREDICTION_STATE = np.dtype(
    [
        ("mu", "f8", (2, 4)),  # before this application: learned, configured
        ("mass", "f8", (2,)),  # kg, likewise
        ("measured", "f8", (2,)),  # sums over the windows that count [m/s^2]
        ("predicted", "f8", (2,)),
        ("samples", "i8"),
        ("error", "f8", (2,)),  # relative, of the last application
        ("applications", "f8"),  # in the record
        ("worse", "f8"),  # mean of |learned| - |configured|
        ("spread", "f8"),  # variance of that
        ("reported_s", "f8"),  # remaining time of the fault bit [s]
    ],
    align=True,
)

LEAST_SPEED = 3.4  # m/s
LEAST_SAMPLES = 8  # windows
STEADY = 0.10  # relative change of a pressure in a window; force lags a change
LEAST_DECEL = 0.8  # m/s^2, of the linings
MEMORY = 10.0  # applications
LEAST_APPLICATIONS = 4.0
LEAST_WORSE = 0.02  # of the deceleration
BEYOND_DOUBT = 2.5  # standard errors
REPORTED_S = 60.0


@kernel
def begin_prediction(params: Record, state: Record, joint: Record) -> None:
    """Store the values with which an application is predicted."""
    state.mass[LEARNED] = params.mass * math.exp(joint.x[MASS])
    state.mass[CONFIGURED] = params.mass
    state.samples = 0
    for by in range(2):
        state.measured[by] = state.predicted[by] = 0.0
    for i in range(4):
        state.mu[LEARNED, i] = params.mu_nominal[i] * math.exp(joint.x[LEVEL + i])
        state.mu[CONFIGURED, i] = params.mu_nominal[i]


@kernel
def _counts(inputs: Record, joint: Record) -> bool:
    """Return whether the last window is suited to judge the prediction."""
    rolls = joint.x[V] > LEAST_SPEED and joint.sliding == 0
    counts: bool = joint.pressed < STEADY and rolls and joint.window.balanced != 0
    return counts and not others_brake(inputs) and not driver_accelerates(inputs)


@kernel
def add_window(params: Record, state: Record, joint: Record, inputs: Record) -> None:
    """Add the last window of an application: its measurements, all at one time."""
    if not _counts(inputs, joint):
        return
    state.samples += 1
    x, w = joint.x, joint.window
    speed = x[V]
    motors, learned, configured, wheels = 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        r = params.wheel_radius[i]
        motors += w.motor[i] / r
        wheels += params.wheel_inertia[i] / (r * r * params.mass)
        force = brake_gain_per_bar(params, i) * w.common_pressure[i] / r
        learned += force * state.mu[LEARNED, i]
        configured += force * state.mu[CONFIGURED, i]
    rolling, drag = params.rolling_resistance * GRAVITY, params.drag_area * speed * speed
    mass = state.mass[LEARNED]
    rest = rolling + (drag * math.exp(x[DRAG] + x[MASS]) + motors * math.exp(x[MOTOR])) / mass
    state.measured[LEARNED] += -(1.0 + wheels) * (w.common_accel - x[BIAS]) - x[OVERRUN] - rest
    state.predicted[LEARNED] += learned / mass
    mass = state.mass[CONFIGURED]
    state.measured[CONFIGURED] += -(1.0 + wheels) * w.common_accel - rolling - (drag + motors) / mass
    state.predicted[CONFIGURED] += configured / mass


@kernel
def end_prediction(state: Record) -> bool:
    """Record an application; return whether learned values predict significantly worse than configured."""
    n = state.samples
    if n < LEAST_SAMPLES or state.measured[CONFIGURED] < LEAST_DECEL * n:
        return False
    if state.measured[LEARNED] < 0.5 * LEAST_DECEL * n:
        return False
    for by in range(2):
        state.error[by] = state.predicted[by] / state.measured[by] - 1.0
    difference = abs(state.error[LEARNED]) - abs(state.error[CONFIGURED])
    state.applications = min(state.applications + 1.0, MEMORY)
    gain = 1.0 / state.applications
    before = state.worse
    state.worse += gain * (difference - before)
    state.spread += gain * ((difference - before) * (difference - state.worse) - state.spread)
    doubt = BEYOND_DOUBT * math.sqrt(state.spread / max(state.applications - 1.0, 1.0))
    worse: bool = state.worse > max(LEAST_WORSE, doubt)
    return worse and state.applications >= LEAST_APPLICATIONS


@kernel
def close_book(state: Record) -> None:
    """Reset the record: the values it judged were discarded."""
    state.applications = state.worse = state.spread = 0.0
    state.reported_s = REPORTED_S
