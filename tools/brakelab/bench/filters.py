"""The four filters of `ecu/algorithm/estimation/thesis/observer2.py` in three forms: ours, numpy, filterpy.

All get the same inputs (`FILTER_INPUT`, as `update_friction` forms them) and start alike; plain Kalman
algebra, without our gates, must give the same friction.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.estimation.thesis.observer2 import (
    OBSERVER_STATE,
    correct_force,
    correct_omega,
    predict_observer,
    start_observer,
)
from ecu.algorithm.estimation.thesis.tyre import slip_stiffness
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS, MOTOR_TORQUE, WHEEL_SPEED
from ecu.jit import Record, kernel

DT: Final = 1e-9 * CYCLE_NS

# Inputs of one filter in one cycle.
FILTER_INPUT: Final = np.dtype(
    [
        ("pressure", "f8"),  # above push-out, Pa
        ("outer_torque", "f8"),  # motor and rolling resistance, N m
        ("force", "f8"),  # virtual sensor, N
        ("radius", "f8"),  # m
        ("load", "f8"),  # N
        ("speed", "f8"),  # m/s
        ("omega", "f8"),  # measured, rad/s
        ("force_variance", "f8"),  # N^2
    ],
    align=True,
)


class Constants(NamedTuple):
    """Constants of all cycles; arrays of shape (4,)."""

    torque_per_mu: NDArray[np.float64]
    """Per pressure, m^3."""
    inertia: NDArray[np.float64]
    relaxation_length: float
    omega_variance: float
    sigma_pressure: float
    """Pa."""
    drift: float
    omega_walk: float
    force_walk: float
    time_correlation: float
    mu: NDArray[np.float64]
    sigma_mu: NDArray[np.float64]


def constants(params: RecordArray) -> Constants:
    """Return the constants of all four filters."""
    row = params[0]
    return Constants(
        2.0 * row["piston_area"] * row["effective_radius"],
        row["wheel_inertia"].copy(),
        float(row["relaxation_length"]),
        float(row["sigma_wheel_speed"]) ** 2,
        float(row["sigma_pressure"]),
        float(row["mu_drift"]),
        float(row["omega_walk"]),
        float(row["force_walk"]),
        float(row["time_correlation"]),
        row["mu_nominal"].copy(),
        row["sigma_mu_initial"] * row["mu_nominal"],
    )


@kernel
def note_inputs(params: Record, state: Record, inputs: Record, row: Any) -> None:
    """Write the inputs of the four filters in the step just done, `row` of shape (4,)."""
    for i in range(4):
        load, radius = state.estimate.load[i], state.wheels.radius[i]
        stiffness = state.estimate.k_f * slip_stiffness(params, i, load, state.wheels.expected_force[i])
        noise = params.sigma_wheel_speed * radius / max(state.estimate.speed, 1.0)
        given = row[i]
        given.pressure = max(state.friction.pressure[i], 0.0)
        given.outer_torque = inputs.value[MOTOR_TORQUE + i] + params.rolling_resistance * load * radius
        given.force = state.estimate.force[i]
        given.radius = radius
        given.load = load
        given.speed = state.estimate.speed
        given.omega = inputs.value[WHEEL_SPEED + i]
        given.force_variance = (stiffness * noise) ** 2


@kernel
def start_filters(params: Record, observer: Record, row: Any) -> None:
    """Start all four of ours from the first inputs."""
    for i in range(4):
        mu = params.mu_nominal[i]
        start_observer(observer, i, row[i].omega, row[i].force, mu, params.sigma_mu_initial * mu)


@kernel
def filter_cycle(params: RecordArray, observer: RecordArray, table: RecordArray, k: int) -> None:
    """Run all four of ours for cycle `k` of `table`, shape (cycles, 4); the others of shape (1,)."""
    car, state = params[0], observer[0]
    for i in range(4):
        given = table[k, i]
        predict_observer(
            car, state, i, given.pressure, given.outer_torque, given.force, given.force_variance,
            given.radius, given.load, given.speed, car.mu_drift, 1.0, DT,
        )  # fmt: skip
        correct_omega(state, i, given.omega, car.sigma_wheel_speed**2)
        correct_force(state, i, given.force, car.time_correlation * given.force_variance)


@kernel
def filter_cycles(params: RecordArray, observer: RecordArray, table: RecordArray) -> None:
    """Run all four of ours over `table`."""
    for k in range(len(table)):
        filter_cycle(params, observer, table, k)


def new_observer(params: RecordArray, table: RecordArray) -> RecordArray:
    """Return the state of our four filters before the first cycle of `table`."""
    observer = np.zeros(1, OBSERVER_STATE)
    start_filters(params[0], observer[0], table[0])
    return observer


class NumpyFilters:
    """All four wheels in stacked numpy matrices."""

    def __init__(self, const: Constants, first: RecordArray) -> None:
        self.const = const
        self.x = np.stack([first["omega"], first["force"], const.mu], axis=1)
        self.p = np.zeros((4, 3, 3))
        self.p[:, 0, 0] = 1.0
        self.p[:, 1, 1] = (0.5 * first["force"]) ** 2 + 1e4
        self.p[:, 2, 2] = const.sigma_mu**2
        self._a = np.broadcast_to(np.eye(3), (4, 3, 3)).copy()
        self._q, self._r = np.zeros((4, 3, 3)), np.zeros((4, 2, 2))
        self._q[:, 2, 2] = const.drift**2 * DT
        self._r[:, 0, 0] = const.omega_variance

    def cycle(self, row: RecordArray) -> None:
        """Predict and correct, `row` of shape (4,)."""
        const, a = self.const, self._a
        keep = np.exp(-DT * np.maximum(row["speed"], 1.0) / const.relaxation_length)
        lever = -DT * row["radius"] / const.inertia * 0.5
        a[:, 0, 1] = lever * (1.0 + keep)
        a[:, 0, 2] = -DT * const.torque_per_mu * row["pressure"] / const.inertia
        a[:, 1, 1] = keep
        torque_noise = const.torque_per_mu * self.x[:, 2] * const.sigma_pressure
        self._q[:, 0, 0] = const.omega_walk**2 * DT + (DT / const.inertia * torque_noise) ** 2
        gained = (1.0 - keep) * row["force"]
        self.x = (a @ self.x[:, :, None])[:, :, 0]
        self.x[:, 0] += lever * gained - DT * row["outer_torque"] / const.inertia
        self.x[:, 1] += gained
        force_walk = (const.force_walk * row["load"]) ** 2 * DT
        self._q[:, 1, 1] = force_walk + (1.0 - keep) ** 2 * row["force_variance"]
        p = a @ self.p @ a.transpose(0, 2, 1) + self._q
        self._r[:, 1, 1] = const.time_correlation * row["force_variance"]
        gain = p[:, :, :2] @ np.linalg.inv(p[:, :2, :2] + self._r)
        innovation = np.stack([row["omega"], row["force"]], axis=1) - self.x[:, :2]
        self.x += (gain @ innovation[:, :, None])[:, :, 0]
        self.p = p - gain @ p[:, :2, :]


class FilterpyFilters:
    """Four filterpy filters, as its documentation shows them. ImportError without filterpy."""

    def __init__(self, const: Constants, first: RecordArray) -> None:
        from filterpy.kalman import ExtendedKalmanFilter

        self.const = const
        self.wheels: list[tuple[Any, float, float]] = []
        self._h = np.eye(2, 3)
        for i, start in enumerate(first):
            ekf = ExtendedKalmanFilter(dim_x=3, dim_z=2)
            ekf.x = np.array([[start["omega"]], [start["force"]], [const.mu[i]]])
            ekf.P = np.diag([1.0, (0.5 * start["force"]) ** 2 + 1e4, const.sigma_mu[i] ** 2])
            ekf.F, ekf.B = np.eye(3), np.zeros((3, 2))
            ekf.Q = np.diag([0.0, 0.0, const.drift**2 * DT])
            ekf.R = np.diag([const.omega_variance, 0.0])
            self.wheels.append((ekf, DT / float(const.inertia[i]), float(const.torque_per_mu[i])))

    def _jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._h

    def _measured(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return x[:2]

    def cycle(self, row: RecordArray) -> None:
        """Predict and correct, `row` of shape (4,)."""
        for (ekf, per_inertia, torque_per_mu), given in zip(self.wheels, row.tolist(), strict=True):
            pressure, outer, force, radius, load, speed, omega, variance = given
            keep = math.exp(-DT * max(speed, 1.0) / self.const.relaxation_length)
            lever = -0.5 * per_inertia * radius
            ekf.F[0, 1] = lever * (1.0 + keep)
            ekf.F[0, 2] = -per_inertia * torque_per_mu * pressure
            ekf.F[1, 1] = keep
            ekf.B[0, 0] = -per_inertia
            ekf.B[0, 1] = lever * (1.0 - keep)
            ekf.B[1, 1] = 1.0 - keep
            torque_noise = torque_per_mu * float(ekf.x[2, 0]) * self.const.sigma_pressure
            ekf.Q[0, 0] = self.const.omega_walk**2 * DT + (per_inertia * torque_noise) ** 2
            ekf.Q[1, 1] = (self.const.force_walk * load) ** 2 * DT + (1.0 - keep) ** 2 * variance
            ekf.R[1, 1] = self.const.time_correlation * variance
            ekf.predict(np.array([[outer], [force]]))
            ekf.update(np.array([[omega], [force]]), self._jacobian, self._measured)
