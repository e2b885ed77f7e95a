"""Is braking predicted better with what was learned than with what is configured? A book of it.

Each application is judged by specific force, which no slope is in. Over its samples

    measured     -(a - b) - overrun - (drag + rolling + sum M_i / r_i) / m
    predicted    sum 2 A_i r_eff mu_i (p_i - p_0) / r_i / m        mu_i as it was before the application

twice: with the learned friction, mass, bias and overrun, and with the configured ones. The relative errors
of the two means go into the book, where an application counts by a memory of `MEMORY` of them. Where the
learned friction is off by more than the configured one beyond doubt, it is given up and learned anew.
"""

import math

import numpy as np

from ecu.estimation.joint.layout import BIAS, DRAG, LEVEL, MASS, MOTOR, OVERRUN, V
from ecu.estimation.joint.wheel import brake_lever
from ecu.estimation.friction import driver_accelerates
from ecu.estimation.motion import motor_torque, usable
from ecu.jit import Record, kernel
from ecu.params import BAR, GRAVITY
from ecu.signals import ABS_ACTIVE, ACCEL_X, CALLIPER_PRESSURE, ESP_ACTIVE

LEARNED_WAY, CONFIGURED_WAY = range(2)

PREDICTION_STATE = np.dtype(
    [
        ("mu", "f8", (2, 4)),  # before this application: learned, configured
        ("mass", "f8", (2,)),  # kg, likewise
        ("measured", "f8", (2,)),  # sums over the samples that count [m/s^2]
        ("predicted", "f8", (2,)),
        ("samples", "i8"),
        ("error", "f8", (2,)),  # relative, of the last application
        ("applications", "f8"),  # in the book
        ("worse", "f8"),  # mean of |learned| - |configured|
        ("spread", "f8"),  # variance of that
        ("told_s", "f8"),  # the fault bit is shown for this much longer [s]
    ],
    align=True,
)

LEAST_SPEED = 3.4  # m/s
LEAST_SAMPLES = 50
LEAST_DECEL = 0.8  # m/s^2, of the linings
MEMORY = 10.0  # applications
LEAST_APPLICATIONS = 4.0
LEAST_WORSE = 0.02  # of the deceleration
BEYOND_DOUBT = 2.5  # standard errors
TOLD_S = 60.0


@kernel
def begin_prediction(params: Record, state: Record, joint: Record) -> None:
    """Note what an application is predicted with."""
    state.mass[LEARNED_WAY] = params.mass * math.exp(joint.x[MASS])
    state.mass[CONFIGURED_WAY] = params.mass
    state.samples = 0
    for way in range(2):
        state.measured[way] = state.predicted[way] = 0.0
    for i in range(4):
        state.mu[LEARNED_WAY, i] = params.mu_nominal[i] * math.exp(joint.x[LEVEL + i])
        state.mu[CONFIGURED_WAY, i] = params.mu_nominal[i]


@kernel
def _counts(inputs: Record, joint: Record) -> bool:
    works = inputs.value[ABS_ACTIVE] > 0.5 or inputs.value[ESP_ACTIVE] > 0.5
    counts = joint.x[V] > LEAST_SPEED and joint.sliding == 0 and not works
    for i in range(4):
        counts = counts and usable(inputs, CALLIPER_PRESSURE + i)
    return counts and usable(inputs, ACCEL_X) and not driver_accelerates(inputs)


@kernel
def add_sample(params: Record, state: Record, joint: Record, inputs: Record, accel: float) -> None:
    """Take this cycle of an application in; `accel`: specific force in road axes [m/s^2]."""
    if not _counts(inputs, joint):
        return
    state.samples += 1
    x = joint.x
    speed = x[V]
    motors, learned, configured = 0.0, 0.0, 0.0
    for i in range(4):
        r = params.wheel_radius[i]
        motors += motor_torque(inputs, i) / r
        above = inputs.value[CALLIPER_PRESSURE + i] - joint.zero.value[i] - params.push_out_pressure[i] / BAR
        force = brake_lever(params, i) * above / r
        learned += force * state.mu[LEARNED_WAY, i]
        configured += force * state.mu[CONFIGURED_WAY, i]
    rolling, drag = params.rolling_resistance * GRAVITY, params.drag_area * speed * speed
    mass = state.mass[LEARNED_WAY]
    rest = rolling + (drag * math.exp(x[DRAG] + x[MASS]) + motors * math.exp(x[MOTOR])) / mass
    state.measured[LEARNED_WAY] += -(accel - x[BIAS]) - x[OVERRUN] - rest
    state.predicted[LEARNED_WAY] += learned / mass
    mass = state.mass[CONFIGURED_WAY]
    state.measured[CONFIGURED_WAY] += -accel - rolling - (drag + motors) / mass
    state.predicted[CONFIGURED_WAY] += configured / mass


@kernel
def end_prediction(state: Record) -> bool:
    """Book an application; return whether learning is worse than not learning, beyond doubt."""
    n = state.samples
    if n < LEAST_SAMPLES or state.measured[CONFIGURED_WAY] < LEAST_DECEL * n:
        return False
    if state.measured[LEARNED_WAY] < 0.5 * LEAST_DECEL * n:
        return False
    for way in range(2):
        state.error[way] = state.predicted[way] / state.measured[way] - 1.0
    difference = abs(state.error[LEARNED_WAY]) - abs(state.error[CONFIGURED_WAY])
    state.applications = min(state.applications + 1.0, MEMORY)
    gain = 1.0 / state.applications
    before = state.worse
    state.worse += gain * (difference - before)
    state.spread += gain * ((difference - before) * (difference - state.worse) - state.spread)
    doubt = BEYOND_DOUBT * math.sqrt(state.spread / state.applications)
    known = state.applications >= LEAST_APPLICATIONS
    return known and state.worse > LEAST_WORSE and state.worse > doubt


@kernel
def close_book(state: Record) -> None:
    """Begin the book anew: what it judged was given up."""
    state.applications = state.worse = state.spread = 0.0
    state.told_s = TOLD_S
