"""Prior of the joint observer, its values at the start of a brake application, and the random walks of its
states."""

import math

import numpy as np

from ecu.algorithm.estimation.joint.kalman import (
    SPEED_VARIANCE,
    clear_derivatives,
    clear_state,
    correct,
    drift_speed,
    forget,
    variance_by_derivatives,
)
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    CHANGE,
    DEFLECTION_GAIN,
    DELAY,
    DRAG,
    DRIVE,
    LEVEL,
    LOAD,
    MASS,
    MEAN,
    MOTOR,
    OFFSET,
    OVERRUN,
    PEAK,
    PEAK_LOAD,
    RADIUS,
    RATE,
    RATIO,
    ROLLING,
    SIDE,
    SLIP_ERROR,
    SLOPE,
    STIFFNESS,
    N,
    V,
)
from ecu.contract.params import GRAVITY
from ecu.jit import Record, kernel

PRIOR = np.zeros(N)
"""Unadapted standard deviations; friction, motor scale and speed are set apart."""
PRIOR[STIFFNESS], PRIOR[RATIO] = 0.25, 0.06
PRIOR[BIAS], PRIOR[SLOPE] = 0.1, 0.3
PRIOR[MASS], PRIOR[PEAK], PRIOR[LOAD], PRIOR[DEFLECTION_GAIN] = 0.03, 0.25, 0.05, 0.10
PRIOR[DRAG] = 0.10
PRIOR[RADIUS : RADIUS + 4], PRIOR[ROLLING] = 0.0025, 0.004
PRIOR[OFFSET : OFFSET + 2] = 0.3
PRIOR[DELAY] = 0.005
PRIOR[SIDE], PRIOR[PEAK_LOAD] = 0.02, 0.08

# Standard deviations of friction's prior, of its logarithm: all four together, per axle, per wheel. UN R90
# lets a replacement lining brake by 15 % more or less than the original.
LEVEL_COMMON, LEVEL_AXLE, LEVEL_WHEEL = 0.13, 0.15, 0.04
# Difference between the levels of successive applications; linings that are driven in rise by 5 % in one.
STEP_COMMON, STEP_AXLE, STEP_WHEEL = 0.05, 0.02, 0.005
# Deviation of friction from its level within an application, and time constant of its return.
CHANGE_COMMON, CHANGE_AXLE, CHANGE_S = 0.08, 0.03, 4.0
CHANGE_BY_PRESSURE = 0.05  # of an axle's friction, per relative change of its pressure
MEAN_ZERO = 0.003  # the mean of changes within an application
RATE_SIGMA = 0.1  # 1/s, where the drive is known; torque steps of an engine resemble a rate
SCALE_ONLY = 0.03  # relative error of a motor torque up to which it is a constant scale; the excess varies
UNKNOWN_PER_ERROR = 2.0  # an engine's torque known to half only counts as unknown
OVERRUN_MEAN, OVERRUN_SIGMA = 0.2, 0.3  # m/s^2, drag of an engine in gear
UNKNOWN_DRIVE = 0.1  # m/s^2 per axle, drag of an engine in this application
UNKNOWN_KICKS = 1.5  # m/s^2, white from window to window: stands for 0.2 that last 1.5 s (down-shifts)
# Of an axle's slip by it: with a speed reference, and more without one, per acceleration over gravity.
UNKNOWN_SLIP, UNKNOWN_SLIP_REST, UNKNOWN_SLIP_BY_ACCEL = 0.003, 0.005, 0.1
UNKNOWN_SLIP_S = 2.0  # after which its value is independent

LASTING = np.array(
    [STIFFNESS, RATIO, BIAS, MASS, PEAK, LOAD, DEFLECTION_GAIN, DRAG, ROLLING, DELAY, PEAK_LOAD]
)
"""States whose variance never grows with time beyond that of the prior."""

# Random walks per square root of a second.
WALK = np.zeros(N)
WALK[V] = 0.02
WALK[STIFFNESS], WALK[RATIO] = 0.01, 0.0005
WALK[RADIUS : RADIUS + 4] = WALK[ROLLING] = 1e-5
WALK[BIAS], WALK[SLOPE] = 0.001, 0.05
SLOPE_S = 100.0  # after which a slope is forgotten: no road climbs for ever
WALK[PEAK], WALK[LOAD], WALK[DEFLECTION_GAIN] = 0.01, 0.0005, 0.0005
WALK[MASS], WALK[MOTOR], WALK[DRAG] = 1e-5, 1e-5, 0.005
WALK[DELAY] = 1e-4
RATE_WALK = 0.05
LEVEL_WALK = 0.01  # common to all levels while the pads rub


@kernel
def limit_variance(state: Record, i: int, most: float) -> None:
    """Raise no state's variance above `most`: its covariances shrink with it."""
    p = state.p
    if p[i, i] > most:
        scale = math.sqrt(most / p[i, i])
        for j in range(N):
            p[i, j] *= scale
            p[j, i] = p[i, j] if j != i else scale * p[i, i]


@kernel
def widen_levels(state: Record, common: float, axle: float, wheel: float) -> None:
    """Add to the variance of the four levels: common, per axle, per wheel."""
    p = state.p
    for i in range(4):
        for j in range(4):
            add = common
            if i // 2 == j // 2:
                add += axle
            if i == j:
                add += wheel
            p[LEVEL + i, LEVEL + j] += add


@kernel
def set_prior(params: Record, state: Record) -> None:
    """Set the unadapted state."""
    x, p = state.x, state.p
    for i in range(N):
        x[i] = 0.0
        for j in range(N):
            p[i, j] = 0.0
        p[i, i] = PRIOR[i] ** 2
    p[V, V] = SPEED_VARIANCE
    p[MOTOR, MOTOR] = params.sigma_motor_torque**2
    widen_levels(state, LEVEL_COMMON**2, LEVEL_AXLE**2, LEVEL_WHEEL**2)


@kernel
def forget_levels(state: Record) -> None:
    """Reset friction to the configured one, as uncertain as before learning."""
    for i in range(LEVEL, LEVEL + 4):
        clear_state(state, i, 0.0)
    widen_levels(state, LEVEL_COMMON**2, LEVEL_AXLE**2, LEVEL_WHEEL**2)


@kernel
def derive_axles(state: Record) -> None:
    """Overwrite the derivatives by those of the front levels' mean less the rear ones'."""
    clear_derivatives(state)
    for i in range(4):
        state.h[LEVEL + i] = 0.5 if i < 2 else -0.5


@kernel
def _forget_road(state: Record) -> None:
    """Reset what a road takes from the tyres of one side: the next one is another."""
    if state.x[SIDE] != 0.0:
        clear_state(state, SIDE, PRIOR[SIDE] ** 2)


@kernel
def begin_application(state: Record, heat: Record) -> None:
    """Widen the levels by their change since the last application, and start with friction at its level.

    Args:
        state: `JOINT_STATE`, overwritten.
        heat: relative standard deviation that each friction has gained by its disc's temperature, shape (4,).
    """
    p, unknown = state.p, 1.0 - state.drive_known
    for axle in range(2):
        zeros = 0.25 * (state.zero.variance[2 * axle] + state.zero.variance[2 * axle + 1])
        i = OFFSET + axle
        p[i, i] = max(p[i, i], PRIOR[i] ** 2 + zeros)
    widen_levels(state, STEP_COMMON**2, STEP_AXLE**2, STEP_WHEEL**2)
    for i in range(4):
        state.before[i] = state.x[LEVEL + i]
        for j in range(4):
            p[LEVEL + i, LEVEL + j] += heat[i] * heat[j]
    derive_axles(state)
    state.sigma_axles = math.sqrt(max(variance_by_derivatives(state), 0.0))
    for axle in range(2):
        clear_state(state, CHANGE + axle, CHANGE_COMMON**2 + CHANGE_AXLE**2)
        clear_state(state, MEAN + axle, 0.0)
    p[CHANGE, CHANGE + 1] = p[CHANGE + 1, CHANGE] = CHANGE_COMMON**2
    state.weight = 0.0
    _forget_road(state)
    forget_rate(state)
    if unknown <= 0.0:
        clear_state(state, OVERRUN, 0.0)
    elif p[OVERRUN, OVERRUN] == 0.0 or unknown < 1.0:  # an engine's torque error differs each time
        clear_state(state, OVERRUN, (OVERRUN_SIGMA * unknown) ** 2)
        state.x[OVERRUN] = OVERRUN_MEAN if unknown >= 1.0 else 0.0
    for axle in range(2):
        clear_state(state, DRIVE + axle, (UNKNOWN_DRIVE * unknown) ** 2)


@kernel
def end_application(state: Record) -> None:
    """Set the level to the mean friction of this application, from which the next begins.

    Changes are relative to that mean: where they were observed, their mean is now known to be zero.
    """
    free = state.free
    for i in range(N):
        free[i] = 0
    for i in range(LEVEL, LEVEL + 4):
        free[i] = 1
    free[RATE] = free[CHANGE] = free[CHANGE + 1] = free[MEAN] = free[MEAN + 1] = 1
    for axle in range(2):
        if state.weight > 0.0:
            clear_derivatives(state)
            state.h[MEAN + axle] = 1.0
            correct(state, -state.x[MEAN + axle], MEAN_ZERO**2)
    for axle in range(2):
        clear_state(state, CHANGE + axle, 0.0)
        clear_state(state, MEAN + axle, 0.0)
    clear_state(state, RATE, 0.0)
    _forget_road(state)


@kernel
def note_change(state: Record, weight: float) -> None:
    """Update the mean of friction changes by the present one, with `weight` [bar]."""
    x, p = state.x, state.p
    state.weight += weight
    share = weight / state.weight
    for axle in range(2):
        m, c = MEAN + axle, CHANGE + axle
        x[m] += share * (x[c] - x[m])
        for j in range(N):
            p[m, j] += share * (p[c, j] - p[m, j])
    for axle in range(2):
        m, c = MEAN + axle, CHANGE + axle
        for j in range(N):
            p[j, m] += share * (p[j, c] - p[j, m])


@kernel
def forget_rate(state: Record) -> None:
    """Reset friction's rate to unknown."""
    state.x[RATE] = 0.0
    forget(state, RATE, (RATE_SIGMA * state.drive_known) ** 2)


@kernel
def pressure_change(state: Record, left: int) -> float:
    """Return the relative change of an axle's pressure since the last window."""
    before = state.last_pressure[left] + state.last_pressure[left + 1]
    now = state.window.pressure[left] + state.window.pressure[left + 1]
    return (now - before) / (0.5 * abs(now + before) + 20.0)


@kernel
def _change_friction(state: Record, time: float) -> None:
    """Propagate friction: it returns to its level, driven by its rate and by process noise."""
    x, p = state.x, state.p
    stays = math.exp(-time / CHANGE_S)
    for axle in range(2):
        i = CHANGE + axle
        x[i] = stays * x[i] + time * x[RATE]
        for j in range(N):
            p[i, j] = stays * p[i, j] + time * p[RATE, j]
    for axle in range(2):
        i = CHANGE + axle
        for j in range(N):
            p[j, i] = stays * p[j, i] + time * p[j, RATE]
    new = 1.0 - stays * stays
    for i in range(2):
        rise = CHANGE_BY_PRESSURE * max(pressure_change(state, 2 * i), 0.0)
        p[CHANGE + i, CHANGE + i] += new * (CHANGE_COMMON**2 + CHANGE_AXLE**2) + rise * rise
    p[CHANGE, CHANGE + 1] += new * CHANGE_COMMON**2
    p[CHANGE + 1, CHANGE] += new * CHANGE_COMMON**2


@kernel
def _change_slip(state: Record, time: float) -> None:
    """Propagate the slip error of an axle by unreported drive: it grows with the force on the tyres."""
    p, w, unknown = state.p, state.window, 1.0 - state.drive_known
    held = math.hypot(w.accel / GRAVITY, w.across)
    without = (UNKNOWN_SLIP_REST + UNKNOWN_SLIP_BY_ACCEL * held) * unknown * min(state.reference_s, 1.0)
    sigma = (UNKNOWN_SLIP + without) * unknown
    stays = math.exp(-time / UNKNOWN_SLIP_S)
    for i in range(SLIP_ERROR, SLIP_ERROR + 2):
        for j in range(N):
            p[i, j] *= stays
            p[j, i] = p[i, j] if j != i else stays * p[i, j]
        p[i, i] += (1.0 - stays * stays) * sigma * sigma


@kernel
def _forget_slope(state: Record, stays: float) -> None:
    state.x[SLOPE] *= stays
    for j in range(N):
        state.p[SLOPE, j] *= stays
    for j in range(N):
        state.p[j, SLOPE] *= stays


@kernel
def walk(state: Record, rubbing: bool, time: float) -> None:
    """Add the process noise of `time` [s] to the covariance; friction changes while the pads rub."""
    p = state.p
    drift_speed(state, time)
    if state.x[V] > 1.0:
        _forget_slope(state, math.exp(-time / SLOPE_S))
    _change_slip(state, time)
    for i in range(N):
        if i != RATE:
            p[i, i] += WALK[i] ** 2 * time
    for i in LASTING:
        limit_variance(state, i, PRIOR[i] ** 2)
    if rubbing:
        p[RATE, RATE] += (RATE_WALK * state.drive_known) ** 2 * time
        _change_friction(state, time)
        widen_levels(state, LEVEL_WALK**2 * time, 0.0, 0.0)
