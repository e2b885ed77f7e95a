"""What is known before anything is learned, and how fast each state may wander from it."""

import numpy as np

from ecu.estimation.joint.kalman import drift_speed, forget, walk_friction
from ecu.estimation.joint.layout import (
    BIAS,
    DELAY,
    DRAG,
    DRIVE,
    LOAD,
    MASS,
    MOTOR,
    MU,
    OFFSET,
    PEAK,
    RADIUS,
    RATE,
    RATIO,
    ROLLING,
    SINKING,
    SLOPE,
    STIFFNESS,
    N,
    V,
)
from ecu.jit import Record, kernel

PRIOR = np.zeros(N)
"""Standard deviations before anything is learned; friction, motor scale and speed are set apart."""
PRIOR[STIFFNESS], PRIOR[RATIO] = 0.25, 0.06
PRIOR[BIAS], PRIOR[SLOPE] = 0.1, 0.3
PRIOR[MASS], PRIOR[PEAK], PRIOR[LOAD], PRIOR[SINKING] = 0.04, 0.25, 0.05, 0.06
PRIOR[DRAG] = 0.10
PRIOR[RADIUS : RADIUS + 4], PRIOR[ROLLING] = 0.0015, 0.004
PRIOR[OFFSET : OFFSET + 2] = 0.3
PRIOR[DELAY] = 0.005
PRIOR[RATE] = 0.1
PRIOR[DRIVE : DRIVE + 2] = 0.25  # drag and creep of an engine in gear

# Standard deviations of friction's prior, of its logarithm: all four together, per axle, per wheel.
MU_COMMON, MU_AXLE, MU_WHEEL = 0.13, 0.17, 0.06

# Random walks per square root of a second.
WALK = np.zeros(N)
WALK[V] = 0.02
WALK[STIFFNESS], WALK[RATIO] = 0.01, 0.0005
WALK[RADIUS : RADIUS + 4] = WALK[ROLLING] = 1e-5
WALK[BIAS], WALK[SLOPE] = 0.0005, 0.05
WALK[PEAK], WALK[LOAD], WALK[SINKING] = 0.01, 0.0005, 0.0005
WALK[MASS], WALK[MOTOR], WALK[DRAG] = 1e-5, 1e-5, 0.0005
WALK[DELAY] = 1e-4
WALK[RATE] = 0.1
MU_WALK_COMMON, MU_WALK_AXLE, MU_WALK_WHEEL = 0.08, 0.02, 0.005
MU_WALK_PRESSURE = 0.05  # of an axle's friction, per relative change of its pressure
MU_WALK_HELD = 0.003


@kernel
def set_prior(params: Record, state: Record) -> None:
    """Set the state before anything is learned."""
    x, p = state.x, state.p
    for i in range(N):
        x[i] = 0.0
        for j in range(N):
            p[i, j] = 0.0
        p[i, i] = PRIOR[i] ** 2
    p[V, V] = 0.25
    p[MOTOR, MOTOR] = params.sigma_motor_torque**2
    for i in range(4):
        for j in range(4):
            axle = MU_AXLE**2 if i // 2 == j // 2 else 0.0
            p[MU + i, MU + j] = MU_COMMON**2 + axle + (MU_WHEEL**2 if i == j else 0.0)


@kernel
def pressure_change(state: Record, left: int) -> float:
    """Return the relative change of an axle's pressure since the last window."""
    before = state.last_pressure[left] + state.last_pressure[left + 1]
    now = state.window.pressure[left] + state.window.pressure[left + 1]
    change: float = (now - before) / (0.5 * abs(now + before) + 20.0)
    return change


@kernel
def _change_friction(state: Record, time: float) -> None:
    """Move friction on by its rate."""
    x, p = state.x, state.p
    for i in range(MU, MU + 4):
        x[i] += time * x[RATE]
        for j in range(N):
            p[i, j] += time * p[RATE, j]
    for i in range(MU, MU + 4):
        for j in range(N):
            p[j, i] += time * p[j, RATE]


@kernel
def forget_rate(state: Record) -> None:
    """Let friction's rate be unknown."""
    state.x[RATE] = 0.0
    forget(state, RATE, PRIOR[RATE] ** 2)


@kernel
def walk(state: Record, rubbing: bool, time: float) -> None:
    """Add to the covariance what may have changed over `time` [s]; friction changes while the pads rub."""
    p = state.p
    drift_speed(state, time)
    for i in range(N):
        p[i, i] += WALK[i] ** 2 * time
    if rubbing:
        _change_friction(state, time)
        rise_front = max(pressure_change(state, 0), 0.0)
        rise_rear = max(pressure_change(state, 2), 0.0)
        front = MU_WALK_AXLE**2 * time + (MU_WALK_PRESSURE * rise_front) ** 2
        rear = MU_WALK_AXLE**2 * time + (MU_WALK_PRESSURE * rise_rear) ** 2
        walk_friction(state, MU_WALK_COMMON**2 * time, front, rear, MU_WALK_WHEEL**2 * time)
    elif p[MU, MU] < MU_COMMON**2 + MU_AXLE**2:
        held = MU_WALK_HELD**2 * time
        walk_friction(state, held, held, held, 0.2 * held)
