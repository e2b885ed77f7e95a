"""Filter of a car that others brake: friction, ceiling of grip and unreported drag, by means of applications.

    f = L' (1 + (L' / c)^n)^(-1/n) (1 - h g) + o + P (1/v - 1/V)        L' = s L
    g = (L' / c)^3n / (1 + (L' / c)^3n)

L is the deceleration that the linings would give, f the specific force less drag, rolling and reported
torques. The bend stands for wheels that reach their limit one after the other. Beyond it tyres slide, and
what eases the brakes, a control that reports nothing or a driver's foot, holds them below their limit: the
share h is lost, which a ceiling alone would take for a poorer road. States are the logarithm of s, that of
the ceiling c over `CEILING`, h, and drag that nobody reports by its signatures: o is the same at every speed
and contains the accelerometer's zero; P is a constant power, of motors at their limit or of an engine that
gears keep at its speed, v no less than `FULL_TORQUE`, where gears and power end; and of o the part d that
comes and goes with the brake pedal. Where neither pedal is pressed the car shows o - d + P (1/v - 1/V), so
the engine of the next application is known before it.

An extended Kalman filter. An innovation beyond `GATE` standard deviations counts with a variance that puts it
there. The law is not quite the car's: the error of a mean is a share of it, and what the drive does unseen.
How much that is differs from car to car, so it is measured: the expectation of innovation times residual is
the variance of a mean, and their average over the last applications counts. What the states move by between
applications grows and falls with it.
"""

import math

import numpy as np

from ecu.jit import Record, kernel

SCALE, GRIP, OVERRUN, PEDAL, POWER, FALL = range(6)
STATES = 6
CEILING = 14.0  # m/s^2: a first braking at 12 must be possible before any was seen
FULL_TORQUE, USUAL_SPEED = 7.0, 10.0  # m/s, below which power falls with speed; V
# The drags in m/s^2, the power in W/kg; of sliding tyres' grip a tenth to a quarter is lost.
PRIOR_MEAN = np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.2])
PRIOR = np.array([0.3, 0.5, 0.65, 0.5, 3.0, 0.2])  # standard deviations: an engine drags by 0.1 to 1 m/s^2
STEP = np.array([0.04, 0.03, 0.05, 0.1, 0.1, 0.02])  # between applications, of a car with the usual noise
# Priors of scale, drag [m/s^2] and power [W/kg] beside windows, which teach nearly all; their step.
BESIDE, BESIDE_DRAG, BESIDE_POWER, BESIDE_STEP = 0.03, 0.05, 0.5, 0.006
# Of unknown length: rain, another road, another day; a full battery blends less.
PAUSE = np.array([0.03, 0.15, 0.1, 0.3, 1.0, 0.05])
LOWEST_STATE = np.array([-0.8, math.log(3.0 / CEILING), -1.0, 0.0, -20.0, 0.0])
# Motors with the accelerator released brake by 2.5 m/s^2, blended ones take 30 kW of a car of 1.5 t.
HIGHEST_STATE = np.array([0.8, math.log(30.0 / CEILING), 2.5, 2.5, 20.0, 0.7])
NOISE, NOISE_SHARE = 0.15, 0.09  # m/s^2, of the mean of an application, and of the linings' part of it
COASTING_NOISE, COASTING_WALK = 0.25, 0.05  # m/s^2, of a second without a pedal; of the drag, per root second
LEAST_NOISE, GREATEST_NOISE = 0.5, 4.0  # times that variance, as measured
BEFORE, MEMORY = 4.0, 10.0  # applications that the prior of this ratio is worth; that are remembered
GATE = 2.5
KNEE = 3.0  # n

FILTER_STATE = np.dtype(
    [
        ("value", "f8", (STATES,)),  # ln scale, ln ceiling over `CEILING`, drags [m/s^2], power [W/kg]
        ("covariance", "f8", (STATES, STATES)),
        ("h", "f8", (STATES,)),  # derivatives of one measurement
        ("ph", "f8", (STATES,)),
        ("noise_ratio", "f8"),  # variance of an application's mean over the usual one
        ("noise_count", "f8"),  # applications in that, and what its prior is worth
        ("at_bound", "u1"),  # a value would have been learned that no car has
    ],
    align=True,
)


@kernel
def restore_filter(state: Record, learned: Record) -> None:
    """Restore learned states, less certain by a pause; use the prior where nothing was learned."""
    forget_filter(state)
    if learned.whole_covariance[0] == 0.0:
        return
    place = 0
    for i in range(STATES):
        state.value[i] = learned.whole[i]
        for j in range(i + 1):
            state.covariance[i, j] = state.covariance[j, i] = learned.whole_covariance[place]
            place += 1
        state.covariance[i, i] = min(state.covariance[i, i] + PAUSE[i] ** 2, PRIOR[i] ** 2)


@kernel
def forget_filter(state: Record) -> None:
    """Reset to the prior."""
    state.noise_ratio, state.noise_count, state.at_bound = 1.0, BEFORE, 0
    for i in range(STATES):
        state.value[i] = PRIOR_MEAN[i]
        for j in range(STATES):
            state.covariance[i, j] = PRIOR[i] ** 2 if i == j else 0.0


@kernel
def keep_filter(state: Record, learned: Record) -> None:
    """Write the present states into `learned`."""
    place = 0
    for i in range(STATES):
        learned.whole[i] = state.value[i]
        for j in range(i + 1):
            learned.whole_covariance[place] = state.covariance[i, j]
            place += 1


@kernel
def bend(linings: float, ceiling: float, fall: float) -> tuple[float, float, float, float]:
    """Return the deceleration f of linings below a ceiling, and its derivatives by ln L, ln c and h."""
    asked = (linings / ceiling) ** KNEE
    base = 1.0 + asked
    decel = linings * base ** (-1.0 / KNEE)
    steep = decel / base
    beyond = asked**3 / (1.0 + asked**3)
    left, falls = 1.0 - fall * beyond, 3.0 * KNEE * fall * beyond * (1.0 - beyond) * decel
    return decel * left, steep * left - falls, (decel - steep) * left + falls, -beyond * decel


@kernel
def per_power(speed: float) -> float:
    """Return the drag of a constant power at a speed [m/s], per W/kg, beyond that at `USUAL_SPEED`."""
    return 1.0 / max(speed, FULL_TORQUE) - 1.0 / USUAL_SPEED


@kernel
def ceiling_of(state: Record) -> float:
    """Return the ceiling of grip [m/s^2]."""
    return CEILING * math.exp(state.value[GRIP])


@kernel
def published_ceiling(state: Record) -> tuple[float, float]:
    """Return the ceiling midway between its peak and what is left beyond, and its sigma [m/s^2]."""
    p, left = state.covariance, 1.0 - 0.5 * state.value[FALL]
    variance = p[GRIP, GRIP] + (0.25 * p[FALL, FALL] / left - p[GRIP, FALL]) / left
    ceiling = ceiling_of(state) * left
    return ceiling, ceiling * math.sqrt(variance)


@kernel
def usual_noise(expected: float) -> float:
    """Return the variance of an application's mean [m^2/s^4], `expected` of the linings [m/s^2]."""
    return NOISE**2 + (NOISE_SHARE * expected) ** 2


@kernel
def variance_of_mean(
    state: Record, expected: float, by_scale: float, by_grip: float, by_fall: float
) -> float:
    """Return the variance [m^2/s^4] with which the mean of an application at `USUAL_SPEED` is predicted."""
    p, h = state.covariance, (by_scale, by_grip, 1.0, 0.0, 0.0, by_fall)
    variance: float = state.noise_ratio * usual_noise(expected)
    for i in range(STATES):
        for j in range(STATES):
            variance += h[i] * h[j] * p[i, j]
    return variance


@kernel
def believe_windows(state: Record) -> None:
    """Limit the variances of scale and drag to what windows leave of them."""
    x, p = state.value, state.covariance
    for i, sigma in ((SCALE, BESIDE), (OVERRUN, BESIDE_DRAG), (POWER, BESIDE_POWER)):
        most, variance = sigma * sigma, p[i, i]
        if variance > most:
            if i != SCALE:
                x[i] *= most / variance  # around nothing
            for j in range(STATES):
                p[i, j] *= math.sqrt(most / variance)
                p[j, i] = p[i, j]
            p[i, i] = most


@kernel
def _keep_within_bounds(state: Record) -> bool:
    """Return states to their bounds; return whether one had left them that no car and no road explains.

    A ceiling and its fall belong to the road, a pedal that brings no drag is one: what coasting shows is then
    the drag, and the others follow.
    """
    x, p, found = state.value, state.covariance, False
    for i in range(STATES - 1, -1, -1):
        back = min(max(x[i], LOWEST_STATE[i]), HIGHEST_STATE[i]) - x[i]
        if back == 0.0:
            continue
        if i == PEDAL and p[i, i] > 0.0:
            for j in range(PEDAL):
                x[j] += p[j, i] / p[i, i] * back
        x[i] += back
        found = found or not (i in (GRIP, FALL) or (i == PEDAL and back > 0.0))
    return found


@kernel
def _correct(state: Record, measured: float, expected: float, noise: float) -> tuple[float, float, float]:
    """Correct the states by a measurement of derivatives `h`, `expected` less what the drags add to it.

    Returns the innovation, its variance, and the share of it that the states do not follow.
    """
    x, p, h, ph = state.value, state.covariance, state.h, state.ph
    innovation, likely = measured - expected, noise
    for i in range(OVERRUN, FALL):
        innovation -= h[i] * x[i]
    for i in range(STATES):
        ph[i] = 0.0
        for j in range(STATES):
            ph[i] += p[i, j] * h[j]
        likely += h[i] * ph[i]
    total, left = max(likely, (innovation / GATE) ** 2), 1.0
    for i in range(STATES):
        x[i] += ph[i] / total * innovation
        left -= h[i] * ph[i] / total
        for j in range(STATES):
            p[i, j] -= ph[i] * ph[j] / total
    return innovation, likely, left


@kernel
def correct_by_mean(
    state: Record,
    measured: float,
    expected: float,
    by_scale: float,
    by_grip: float,
    by_power: float,
    by_fall: float,
    alone: bool,
) -> None:
    """Correct the states by the mean of an application [m/s^2], by its derivatives.

    Where not `alone`, windows teach friction.
    """
    state.h[SCALE], state.h[GRIP], state.h[OVERRUN] = by_scale, by_grip, 1.0
    state.h[PEDAL], state.h[POWER], state.h[FALL] = 0.0, by_power, by_fall
    usual = usual_noise(expected)
    innovation, likely, left = _correct(state, measured, expected, state.noise_ratio * usual)
    state.at_bound = 1 if _keep_within_bounds(state) else 0
    for i in range(STATES):
        step = STEP[i] if alone or i in (GRIP, FALL) else BESIDE_STEP
        if state.covariance[i, i] < PRIOR[i] ** 2:
            state.covariance[i, i] += state.noise_ratio * step * step
    product = min(innovation * innovation * left, GATE * GATE * likely)
    state.noise_count = min(state.noise_count + 1.0, MEMORY)
    state.noise_ratio += (product / usual - state.noise_ratio) / state.noise_count
    state.noise_ratio = min(max(state.noise_ratio, LEAST_NOISE), GREATEST_NOISE)


@kernel
def correct_by_coasting(state: Record, measured: float, speed: float, time: float) -> None:
    """Correct the drag by what it was in a `time` [s] in which neither pedal was pressed [m/s^2]."""
    state.h[SCALE] = state.h[GRIP] = state.h[FALL] = 0.0
    state.h[OVERRUN], state.h[PEDAL], state.h[POWER] = 1.0, -1.0, per_power(speed)
    state.covariance[OVERRUN, OVERRUN] += COASTING_WALK**2 * time
    _correct(state, measured, 0.0, COASTING_NOISE**2 / time)
    if _keep_within_bounds(state):
        state.at_bound = 1
