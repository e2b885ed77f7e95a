"""Sensor models of a car, linearised about the true drive: for the bound of `bound.py`.

Written for the simulated car's own structure and apart from the observers of the ECU: tyres by the inverse
Magic Formula with its curvature, degressions in proportion to the load, radii by deflection, and derivatives
by central differences. Means over windows of five cycles:

    f = (sum F_i - drag) / m          F_i = -(T_b + T_m + f_r r F_z + I domega/dt) / r
    a = f + bias          v' = f - slope          omega_i = v_i (1 + slip_i) / r_i
    T_b = 2 mu A r_eff (p - p_0)

Lateral forces and angles are taken as known and without effect on longitudinal slip, which overstates the
information in a curve: the bound is on the safe side.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.simulation.closed_loop import Drive
from ecu.contract.signals import CORNERS

CYCLES: Final = 5
WINDOW_S: Final = 0.01 * CYCLES

V: Final = 0  # m/s
SLOPE: Final = 1  # gravity along the road [m/s^2]
BIAS: Final = 2  # of the accelerometer [m/s^2]
MASS: Final = 3  # from here on logarithms unless a unit is given
DRAG: Final = 4
MOTOR: Final = 5  # torque over reported
ROLLING: Final = 6  # rolling resistance
STIFFNESS: Final = 7
RATIO: Final = 8  # stiffness rear over front
DEGRESSION: Final = 9  # of stiffness, added
PEAK: Final = 10  # adhesion
DEFLECTION_GAIN: Final = 11  # change of the radius with load
TRANSFER: Final = 12  # of load
RADIUS: Final = 13  # four
PUSH_OUT: Final = 17  # two: pressure lost before the pads [bar]
FOLLOWING: Final = 19  # two: pressure beyond the response to the demand [bar]
MU: Final = 21  # four
RATE: Final = 25  # two: change of friction of an axle [1/s]
N: Final = 27

SPEED_REFERENCE: Final = 5  # measurements: four wheel speeds, accelerometer, reference, pressure of two axles
PRESSURE: Final = 6
M: Final = 8
NOISE: Final = np.array([0.1, 0.1, 0.1, 0.1, 0.01, 0.027, 1.8 / 2**0.5, 1.8 / 2**0.5]) / CYCLES**0.5
"""Standard deviations of a window's means (Table 4.1); an axle's pressure is measured twice."""

RUBBING: Final = 1.0  # bar above push-out
LOWEST_SPEED: Final = 3.4  # m/s
STEP: Final = 1e-4
NEAR_PEAK: Final = 0.98


class Trajectory(NamedTuple):
    """A true drive in windows of `WINDOW_S`; four wheels where there is a second axis."""

    speed: Vector
    """m/s"""
    over_ground: Vector
    """Speed of a wheel over that of the car, shape (n, 4)."""
    adhesion: Vector
    load: Vector
    """N"""
    motor: Vector
    """N m, positive regenerates."""
    pressure: Vector
    """bar above push-out"""
    mu: Vector
    spin_change: Vector
    """rad/s^2"""
    omega: Vector
    """rad/s"""
    force: Vector
    """Specific force along the road [m/s^2], shape (n,)."""
    counted: NDArray[np.bool_]


def trajectory_of(drive: Drive, car: Any, counted: NDArray[np.bool_]) -> Trajectory:
    """Return the windows of a drive of `car` (a row of the plant's PARAMS); `counted`: rows, shape (n,)."""
    n = len(drive.t) // CYCLES
    truth = drive.truth

    def mean(values: Vector) -> Vector:
        means: Vector = values[: n * CYCLES].reshape(n, CYCLES, -1).mean(axis=1)
        return means

    def wheels(name: str) -> Vector:
        return np.stack([truth[f"{name}_{corner}"] for corner in CORNERS], axis=1)

    omega, slip = wheels("wheel_speed"), wheels("slip")
    rolled = omega * wheels("rolling_radius")
    ground = np.where(slip < 0.0, rolled / np.maximum(1.0 + slip, 0.1), rolled * (1.0 - slip))
    speed = truth["vehicle_speed"]
    push_out = 1e-5 * np.asarray(car["push_out_pressure"])
    return Trajectory(
        mean(speed)[:, 0],
        mean(ground / np.maximum(speed, 1.0)[:, None]),
        mean(truth["road_friction"])[:, 0],
        mean(wheels("wheel_force_z")),
        mean(wheels("motor_torque")),
        mean(np.maximum(wheels("calliper_pressure") - push_out, 0.0)),
        mean(wheels("mu_b")),
        mean(np.gradient(omega, 0.01, axis=0)),
        mean(omega),
        mean(truth["accel_x_road"])[:, 0],
        mean(counted.astype(np.float64))[:, 0] > 0.5,
    )


def slip_of(used: Vector, stiffness: Vector, peak: Vector, c: float, e: float) -> Vector:
    """Return the slip at which a tyre carries `used` of its load; `stiffness` and `peak` over load too.

    By Newton's method from u = sin{c arctan[x - e (x - arctan x)]} (Magic Formula), slip = c D x / C.
    """
    y = np.tan(np.arcsin(np.clip(used / peak, -NEAR_PEAK, NEAR_PEAK)) / c)
    x = y.copy()
    for _ in range(6):
        x -= ((1.0 - e) * x + e * np.arctan(x) - y) / (1.0 - e + e / (1.0 + x * x))
    return np.asarray(c * peak * x / stiffness)


def shown(car: Any, trajectory: Trajectory, error: Vector) -> Vector:
    """Return wheel speeds [rad/s] and specific force [m/s^2] of all windows, shape (n, 5).

    `error`: deviation of car and drive from the truth, shape (N,).
    """
    d = error
    at_rest = np.asarray(car["nominal_load"])
    load = at_rest + np.exp(d[TRANSFER]) * (trajectory.load - at_rest)
    deflection = trajectory.load / (3.0 * np.asarray(car["vertical_stiffness"]))
    rest = at_rest / (3.0 * np.asarray(car["vertical_stiffness"]))
    radius = np.asarray(car["free_radius"]) - rest - np.exp(d[DEFLECTION_GAIN]) * (deflection - rest)
    radius = radius * np.exp(d[RADIUS : RADIUS + 4])
    axle = np.repeat(d[PUSH_OUT : PUSH_OUT + 2] - d[FOLLOWING : FOLLOWING + 2], 2)
    pressure = np.where(trajectory.pressure > RUBBING, trajectory.pressure - axle, trajectory.pressure)
    lever = 2e5 * np.asarray(car["piston_area"]) * np.asarray(car["effective_radius"])
    heavier = np.exp(d[MASS])
    torque = lever * trajectory.mu * np.exp(d[MU : MU + 4]) * pressure
    torque = torque + np.exp(d[MOTOR]) * trajectory.motor
    torque = torque + np.exp(d[ROLLING]) * car["rolling_resistance"] * heavier * load * radius
    force = -(torque + np.asarray(car["wheel_inertia"]) * trajectory.spin_change) / radius
    speed = trajectory.speed + d[V]
    drag = car["drag_factor"] * np.exp(d[DRAG]) * speed * speed
    specific = (force.sum(axis=1) - drag) / (car["mass"] * heavier)
    relative = load / np.asarray(car["nominal_load"]) - 1.0
    stiffness = np.asarray(car["slip_stiffness"]) * np.exp(d[STIFFNESS] + d[RATIO] * np.array([0, 0, 1, 1]))
    stiffness = stiffness * (1.0 - (car["stiffness_degression"] + d[DEGRESSION]) * relative)
    peak = trajectory.adhesion[:, None] * np.exp(d[PEAK]) * (1.0 - car["friction_degression"] * relative)
    slip = slip_of(force / (heavier * load), stiffness, peak, car["magic_c"], car["magic_e"])
    ground = speed[:, None] * trajectory.over_ground
    rolled = np.where(slip < 0.0, ground * (1.0 + slip), ground / (1.0 - slip))
    return np.column_stack([rolled / radius, specific])


def derivatives(car: Any, trajectory: Trajectory) -> Vector:
    """Return those of `shown` by all states, shape (n, 5, N)."""
    parts = []
    for state in range(N):
        error = np.zeros(N)
        error[state] = STEP
        parts.append((shown(car, trajectory, error) - shown(car, trajectory, -error)) / (2.0 * STEP))
    return np.stack(parts, axis=2)
