"""Snapshots of the state: of 0.2 to 0.4 s ago, for when a wheel is about to lock; of the last time at which
all inputs agreed, for when one of them is named: what it has taught since is taken back."""

from ecu.algorithm.estimation.joint.kalman import forget_speed
from ecu.algorithm.estimation.joint.layout import N, V
from ecu.jit import Record, kernel

OLDEST_S = 30.0


@kernel
def _copy(x: Record, p: Record, to_x: Record, to_p: Record) -> None:
    for i in range(N):
        to_x[i] = x[i]
        for j in range(N):
            to_p[i, j] = p[i, j]


@kernel
def save_snapshot(state: Record, row: int) -> None:
    """Save the present state and covariance over snapshot `row`."""
    _copy(state.x, state.p, state.kept_x[row], state.kept_p[row])


@kernel
def keep_calm_snapshot(state: Record) -> None:
    """Keep the older snapshot: all inputs agree."""
    state.calm_s = 0.0
    _copy(state.kept_x[1], state.kept_p[1], state.calm_x, state.calm_p)


@kernel
def take_calm_snapshot(state: Record) -> None:
    """Make it the older snapshot, which is restored next, unless the linings may have changed since."""
    if state.calm_s <= OLDEST_S:
        _copy(state.calm_x, state.calm_p, state.kept_x[1], state.kept_p[1])


@kernel
def restore_snapshot(state: Record) -> None:
    """Restore the older snapshot except the speed, which becomes uncertain."""
    for i in range(N):
        if i != V:
            state.x[i] = state.kept_x[1, i]
        for j in range(N):
            state.p[i, j] = state.kept_p[1, i, j]
    forget_speed(state)
    _copy(state.kept_x[1], state.kept_p[1], state.kept_x[0], state.kept_p[0])
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
    _copy(state.kept_x[0], state.kept_p[0], state.kept_x[1], state.kept_p[1])
    save_snapshot(state, 0)
    state.kept_s = 0.0
