"""A car's motion in windows, as residuals of its parameters: balance of forces, and the speed of each axle.

    a_x,m = b + kappa (F_f + F_r - D v^2) / m - o         kappa = 1 + g pitch gradient
    F_a   = -(s T_a + K_a max(p_a - p_0a, 0) + I omega_a') / r_a - f F_Z,a
    r_a (1 +- Lambda a) omega_a / (1 + slip_a) = v_ref + tau v'
    slip_a = F_a / (C_a (F_Z,a / F_Z0,a)^(1-e)) (1 + c (F_a / F_Z,a)^2)
    F_Z,a / F_Z0,a = 1 -+ chi_a a                         upper sign: front, a = (a_x,m - b) / kappa

a_x,m is the accelerometer's reading, specific force in the axes of a body that dives, so slopes of the road
are in no equation. T_a, p_a: motor torque of an axle (positive brakes), mean pressure over its zero. o is the
drag of a drive that nobody reports (of an engine, while braking). Without a reference the front axle is the
measure of v. Mass, torque scale, stiffness and brakes are logarithms: scaling all of them is not to be seen.
"""

from enum import IntEnum, auto
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.identify.vehicle.fit import Places, Prior, Residuals
from brakelab.identify.vehicle.windows import Windows
from ecu.contract.params import BAR, GRAVITY
from ecu.settings.config import torque_per_bar

GENTLE: Final = 0.6  # of the weight: no stronger braking is used
COASTING: Final = 0.3  # m/s^2, where a drive that nobody reports pulls or drags little
UNBRAKED: Final = -0.45  # m/s^2, above: hardly a brake acts, where no pressure shows it
KNOWN_TORQUE: Final = 0.1  # relative, of motor torque that identifies mass


class Place(IntEnum):
    """Parameters in the order of theta; "ln" are logarithms of the quantity."""

    MASS = 0
    """ln kg"""
    MOTOR = auto()
    """ln of the motor torque's scale."""
    DRAG = auto()
    """ln kg/m, half the density times area and coefficient."""
    ROLLING = auto()
    PITCH = auto()
    """rad per m/s^2"""
    ZERO = auto()
    """m/s^2, of the accelerometer."""
    RADIUS_F = auto()
    """ln m"""
    RADIUS_R = auto()
    STIFFNESS = auto()
    """ln N per slip, geometric mean of the axles."""
    STIFFNESS_RATIO = auto()
    """ln rear over front"""
    CURVE = auto()
    LOAD_F = auto()
    """ln of the change of load by acceleration, over load [s^2/m]."""
    LOAD_R = auto()
    DEGRESSION = auto()
    DEFLECTION = auto()
    """ln of the radius' relative change by acceleration [s^2/m]."""
    BRAKES = auto()
    """ln N m/bar, of both axles at equal pressures."""
    BRAKE_RATIO = auto()
    """ln rear over front"""
    PUSH_OUT_F = auto()
    """bar"""
    PUSH_OUT_R = auto()
    INERTIA = auto()
    """ln of its scale."""
    DELAY = auto()
    """s, of the reference."""
    OVERRUN = auto()
    """m/s^2"""


class Signals(NamedTuple):
    """Which signals there are."""

    speed: bool
    motor: bool
    """Motor torque as a car by wire reports it."""
    torque: bool
    """Any torque of the drive."""
    pressure: bool


def signals_of(windows: Windows, params: Any) -> Signals:
    """Return which signals the drives have."""
    torque = bool(np.isfinite(windows.motor).all(axis=(0, 1)).any())
    return Signals(
        bool(np.isfinite(windows.speed).any()),
        torque and float(params["sigma_motor_torque"]) <= KNOWN_TORQUE,
        torque,
        bool(np.isfinite(windows.pressure).all(axis=(0, 1)).any()),
    )


def prior_of(params: Any, signals: Signals) -> Prior:
    """Return what START, one `PARAMS`, says, and how far it may be off; what cannot be identified is held."""
    p, off = params, 0.25
    base, gravity = float(p["wheelbase"]), GRAVITY
    height = float(p["cog_height"])
    load = np.asarray(p["static_load"])
    per_bar = torque_per_bar(p)
    stiffness = p["slip_stiffness"] * load
    sink = float(p["mass"]) * height / (2.0 * base) / (3.0 * float(np.mean(p["vertical_stiffness"])))
    rows = {
        Place.MASS: (np.log(p["mass"]), off if signals.motor else 0.0),
        Place.MOTOR: (0.0, max(float(p["sigma_motor_torque"]), 1e-3) if signals.torque else 0.0),
        Place.DRAG: (np.log(p["drag_area"]), off if signals.torque else 0.0),
        Place.ROLLING: (p["rolling_resistance"], 0.005 if signals.torque else 0.0),
        Place.PITCH: (p["pitch_gradient"], 0.001),
        Place.ZERO: (0.0, 0.15),
        Place.RADIUS_F: (np.log(p["wheel_radius"][0]), off if signals.speed else 0.0),
        Place.RADIUS_R: (np.log(p["wheel_radius"][2]), off if signals.speed else 0.03),
        Place.STIFFNESS: (0.5 * np.log(stiffness[:2].sum() * stiffness[2:].sum()), 0.3),
        Place.STIFFNESS_RATIO: (np.log(stiffness[2:].sum() / stiffness[:2].sum()), 0.3),
        Place.CURVE: (0.3, 0.2),
        Place.LOAD_F: (np.log(height / (gravity * p["rear_axle"])), 0.3),
        Place.LOAD_R: (np.log(height / (gravity * p["front_axle"])), 0.3),
        Place.DEGRESSION: (p["stiffness_degression"][0], 0.05),
        Place.DEFLECTION: (np.log(sink / np.mean(p["wheel_radius"])), 0.4),
        Place.BRAKES: (np.log(per_bar.sum()), 0.7 if signals.pressure else 0.0),
        Place.BRAKE_RATIO: (np.log(per_bar[2:].sum() / per_bar[:2].sum()), 0.5 if signals.pressure else 0.0),
        Place.PUSH_OUT_F: (p["push_out_pressure"][0] / BAR, 0.3 if signals.pressure else 0.0),
        Place.PUSH_OUT_R: (p["push_out_pressure"][2] / BAR, 0.3 if signals.pressure else 0.0),
        Place.INERTIA: (0.0, 0.2),
        Place.DELAY: (p["vehicle_speed_delay"], 0.1 if signals.speed else 0.0),
        Place.OVERRUN: ((0.0 if signals.torque else 0.2), (0.0 if signals.torque else 0.3)),
    }
    mean, sigma = (np.array([float(rows[place][k]) for place in Place]) for k in range(2))
    return Prior(mean, sigma)


def stiffness_of(theta: Vector) -> Vector:
    """Return the slip stiffness of front and rear axle [N] at rest, shape (2,)."""
    half = 0.5 * theta[Place.STIFFNESS_RATIO]
    return np.exp(theta[Place.STIFFNESS] + np.array([-half, half]))


def brakes_of(theta: Vector) -> Vector:
    """Return the brake torque of front and rear axle per pressure [N m/bar], shape (2,)."""
    ratio = np.exp(theta[Place.BRAKE_RATIO])
    return np.asarray(np.exp(theta[Place.BRAKES]) * np.array([1.0, ratio]) / (1.0 + ratio))


class Seen(NamedTuple):
    """Windows by axle for one half of the samples, shape (n,) or (2, n); 0: not sent."""

    accel: Vector
    omega: Vector
    spin_up: Vector
    motor: Vector
    pressure: Vector
    speed: Vector
    speed_rate: Vector
    braking: NDArray[np.bool_]


def seen(windows: Windows, half: int) -> Seen:
    """Return what `motion` takes of the windows, which is the same for all parameters."""
    pairs = [np.nan_to_num(values[:, half]).reshape(2, 2, -1) for values in (windows.motor, windows.pressure)]
    return Seen(
        windows.accel[half],
        windows.omega[:, half].reshape(2, 2, -1).mean(axis=1),
        windows.spin_up[:, half],
        pairs[0].sum(1),
        pairs[1].mean(axis=1),
        windows.speed[half],
        windows.speed_rate[half],
        windows.braking,
    )


class Motion(NamedTuple):
    """What the model says of windows for one half of the samples."""

    balance: Vector
    """Residual of the accelerometer [m/s^2], shape (n,)."""
    axle: Vector
    """Speed by front and rear axle [m/s], shape (2, n)."""
    reference: Vector
    """m/s, shape (n,)."""
    force: Vector
    """N, of the axles, shape (2, n)."""
    slip: Vector


def motion(theta: Vector, windows: Seen, params: Any) -> Motion:
    """Return the model's account of windows; `params` is one `PARAMS`: wheel inertia, axle loads."""
    x = dict(zip(Place, theta, strict=True))
    mass = np.exp(x[Place.MASS])
    kappa = 1.0 + GRAVITY * x[Place.PITCH]
    accel = (windows.accel - x[Place.ZERO]) / kappa
    load = np.stack([1.0 - np.exp(x[Place.LOAD_F]) * accel, 1.0 + np.exp(x[Place.LOAD_R]) * accel])
    load = np.maximum(load, 0.2)
    share = np.array([params["rear_axle"], params["front_axle"]]) / params["wheelbase"]
    weight = share[:, None] * mass * GRAVITY * load
    sink = np.exp(x[Place.DEFLECTION]) * accel * np.array([[1.0], [-1.0]])
    radius = np.exp([[x[Place.RADIUS_F]], [x[Place.RADIUS_R]]]) * (1.0 + sink)
    inertia = np.exp(x[Place.INERTIA]) * np.asarray(params["wheel_inertia"]).reshape(2, 2).sum(axis=1)
    torque = inertia[:, None] * windows.spin_up + np.exp(x[Place.MOTOR]) * windows.motor
    over = np.maximum(windows.pressure - np.array([[x[Place.PUSH_OUT_F]], [x[Place.PUSH_OUT_R]]]), 0.0)
    brakes = brakes_of(theta)[:, None] * over
    torque = torque + np.where(windows.braking, brakes, 0.0)
    force = -torque / radius - x[Place.ROLLING] * weight
    stiffness = stiffness_of(theta)[:, None] * load ** (1.0 - x[Place.DEGRESSION])
    used = np.clip(force / weight, -1.0, 1.0)
    slip = force / stiffness * (1.0 + x[Place.CURVE] * used**2)
    axle = radius * windows.omega / (1.0 + slip)
    referenced = np.isfinite(windows.speed)
    later = windows.speed + x[Place.DELAY] * windows.speed_rate
    reference = np.where(referenced, later, axle[0])
    drag = np.exp(x[Place.DRAG]) * reference * np.abs(reference)
    overrun = np.where(windows.braking, x[Place.OVERRUN], 0.0)
    balance = windows.accel - x[Place.ZERO] - kappa * ((force.sum(axis=0) - drag) / mass - overrun)
    return Motion(balance, axle, reference, force, slip)


def residuals_of(windows: Windows, params: Any, signals: Signals, least: tuple[float, float]) -> Residuals:
    """Return the residuals of steady, straight windows; `least` noise of balance [m/s^2] and speed [m/s]."""
    steady = windows.steady & windows.straight
    if not signals.pressure:
        steady = steady & (windows.accel.mean(axis=0) > UNBRAKED)
    gentle = np.abs(windows.accel.mean(axis=0)) < GENTLE * GRAVITY
    braking = np.flatnonzero(steady & windows.braking & gentle & signals.pressure)
    free = np.flatnonzero(steady & windows.free & gentle & signals.torque)
    coasting = (
        windows.free if signals.torque else windows.free & (np.abs(windows.accel.mean(axis=0)) < COASTING)
    )
    rolling = np.flatnonzero(steady & coasting & gentle)
    parts = [(free, 0, 0), (braking, 0, 1)]
    axles = (0, 1) if signals.speed else (1,)
    parts += [
        (rows, 1 + axle, 2 + 2 * axle + kind)
        for axle in axles
        for kind, rows in enumerate((rolling, braking))
    ]
    used = np.unique(np.concatenate([rows for rows, _, _ in parts]))
    own = select(windows, used)
    halves = [seen(own, half) for half in range(2)]
    places = [np.searchsorted(used, rows) for rows, _, _ in parts]

    def of(theta: Vector, half: int) -> Vector:
        found = motion(theta, halves[half], params)
        speeds = found.axle - found.reference
        values = (found.balance, speeds[0], speeds[1])
        return np.concatenate([values[what][at] for (_, what, _), at in zip(parts, places, strict=True)])

    kind = np.concatenate([np.full(len(rows), number) for rows, _, number in parts])
    cluster = np.concatenate([windows.cluster[rows] for rows, _, _ in parts])
    noise = np.concatenate([np.full(len(rows), least[min(what, 1)]) for rows, what, _ in parts])
    return Residuals(of, kind, cluster, noise)


def select(windows: Windows, rows: Places) -> Windows:
    """Return the windows with these numbers."""
    columns: list[Any] = [column[..., rows] for column in windows]
    return Windows(*columns)
