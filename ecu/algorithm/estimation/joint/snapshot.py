"""Snapshots of the state: of 0.2 to 0.4 s ago, for when a wheel is about to lock; of the last time at which
all inputs agreed, for when one of them is named: what it has taught since is taken back."""

from ecu.algorithm.estimation.joint.kalman import forget_speed
from ecu.algorithm.estimation.joint.layout import N, V
from ecu.jit import Record, kernel

OLDEST_S = 30.0


@kernel
def save_snapshot(state: Record, row: int) -> None:
    """Save the present state and covariance over snapshot `row`."""
    for i in range(N):
        state.kept_x[row, i] = state.x[i]
        for j in range(N):
            state.kept_p[row, i, j] = state.p[i, j]


@kernel
def _copy(state: Record, row: int, to: int) -> None:
    for i in range(N):
        state.kept_x[to, i] = state.kept_x[row, i]
        for j in range(N):
            state.kept_p[to, i, j] = state.kept_p[row, i, j]


@kernel
def keep_calm_snapshot(state: Record) -> None:
    """Keep the older snapshot: all inputs agree."""
    state.calm_s = 0.0
    for i in range(N):
        state.calm_x[i] = state.kept_x[1, i]
        for j in range(N):
            state.calm_p[i, j] = state.kept_p[1, i, j]


@kernel
def take_calm_snapshot(state: Record) -> None:
    """Make it the older snapshot, which is restored next, unless the linings may have changed since."""
    if state.calm_s > OLDEST_S:
        return
    for i in range(N):
        state.kept_x[1, i] = state.calm_x[i]
        for j in range(N):
            state.kept_p[1, i, j] = state.calm_p[i, j]


@kernel
def restore_snapshot(state: Record) -> None:
    """Restore the older snapshot except the speed, which becomes uncertain."""
    for i in range(N):
        if i != V:
            state.x[i] = state.kept_x[1, i]
        for j in range(N):
            state.p[i, j] = state.kept_p[1, i, j]
    forget_speed(state)
    _copy(state, 1, 0)
    state.kept_s = 0.0


@kernel
def save_snapshots(state: Record) -> None:
    """Save the present state and covariance over all snapshots."""
    save_snapshot(state, 0)
    save_snapshot(state, 1)
    keep_calm_snapshot(state)


@kernel
def save_newer_snapshot(state: Record) -> None:
    """Make the newer snapshot the older one and save a new one."""
    _copy(state, 0, 1)
    save_snapshot(state, 0)
    state.kept_s = 0.0
