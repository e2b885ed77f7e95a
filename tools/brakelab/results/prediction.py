"""Prediction of a brake application's deceleration, from its pressures and the values known before it.

Without a friction sensor an estimate can only be judged by its prediction:

    f = [sum (2 A_i r_eff mu_i (p_i - z_i - p_0)+ + M_i) / r_i + drag v^2 + rolling g m]
        / (m + sum I_i / r_i^2) + overrun + overrun_power (1/v - 1/V)

mu_i, mass m, overrun (unreported engine drag) and the pressure zeros z_i are those known before the
application; pressures p_i, motor torques M_i (positive brakes) and the speed v are its own, I_i is a wheel's
inertia. f is a specific force, the reading of an accelerometer, so it is free of slope. In a car that others
brake the linings' part is what road and tyres give of it (`bent`).

    specific_force_predicted   mean of f            over the rows in which the vehicle moves and the driver
    specific_force_mean        mean of b - a_x      does not drive against the brakes
    decel_predicted            mean of f over all rows; of a vehicle that stands it is 0

b is the accelerometer's zero as known before; where no accelerometer is mapped the change of speed stands for
the measurement, the slope of the road in it. `specific_force_configured` is the first with the configured
friction and mass and without overrun: the prediction of an ECU without learning.

The standard deviation is that of the force of all linings at equal pressures and of the motor torque, and at
least that of the overrun, which is no smaller in a light application.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import median
from ecu.algorithm.estimation.friction import DRIVEN
from ecu.algorithm.estimation.joint.whole_filter import FULL_TORQUE, USUAL_SPEED
from ecu.contract.params import BAR, GRAVITY
from ecu.contract.records import RecordArray
from ecu.contract.signals import ACCEL_X, N_OUTPUTS, OUTPUT

Vector = NDArray[np.float64]

PERIOD: Final = 0.01  # s, one row
STANDING: Final = 0.3  # m/s, below: standstill
ROLLING: Final = 5.0  # m/s, from which the balance of a car that others brake is judged
SHORT: Final = 0.5  # s, shorter: a tap on the pedal
WEAK: Final = 0.5  # m/s^2, below: its relative error is meaningless
PRESSED: Final = 2.0  # %, of the accelerator; the ECU learns nothing above it either
LEAST_ROWS: Final = 40
"""That count, of an application that is judged."""


class Prediction(NamedTuple):
    """Expected and measured deceleration of a brake application, all [m/s^2]."""

    decel: float
    """Mean over all of it."""
    force: float
    """Mean over the rows that count, as everything below."""
    sigma: float
    configured: float
    """With the configured friction."""
    rest: float
    """Part of `force` that is not the linings'."""
    configured_rest: float
    measured: float
    """Mean specific force, positive braking, without an accelerometer deceleration; NaN: input lost."""
    too_few: str
    """Why too few rows count, empty where enough do."""


def corners(rows: Vector, name: str) -> Vector:
    """Return the four columns of a corner output of `rows`, shape (..., N_ROW) to (..., 4)."""
    first = OUTPUT[f"{name}_fl"]
    return rows[..., first : first + 4]


def mean(values: Vector, weights: Vector | None = None) -> float:
    """Return the mean of the known values, NaN without any; `weights` of the shape of `values`."""
    known = np.isfinite(values)
    weights = np.ones_like(values) if weights is None else weights
    total = float(weights[known].sum())
    return float(values[known] @ weights[known]) / total if total > 0.0 else float("nan")


def power_drag(speed: Vector) -> Vector:
    """Return the drag of a constant power at a speed [m/s], per W/kg, beyond that at `USUAL_SPEED`."""
    return np.asarray(1.0 / np.maximum(speed, FULL_TORQUE) - 1.0 / USUAL_SPEED)


def bent(linings: Vector, limit: float, knee: float, fall: float) -> Vector:
    """Return what road and tyres give of the linings' deceleration [m/s^2].

    Args:
        linings: deceleration that they ask for [m/s^2].
        limit: `grip_limit` [m/s^2], midway between the peak and what is left beyond it.
        knee: `grip_knee`.
        fall: `grip_fall`.
    """
    asked = (linings * (1.0 - 0.5 * fall) / limit) ** knee
    left = 1.0 - fall * asked**3 / (1.0 + asked**3)
    return np.asarray(linings * (1.0 + asked) ** (-1.0 / knee) * left)


def _motor_torques(rows: Vector) -> Vector:
    return np.nan_to_num(rows[:, N_OUTPUTS : N_OUTPUTS + 4])


def _linings(rows: Vector, before: Vector, params: RecordArray) -> Vector:
    """Return the force of each lining over its friction [N], shape (n, 4)."""
    p = params[0]
    zero = np.nan_to_num(corners(before, "pressure_zero")) * BAR
    acts = np.maximum(corners(rows, "calliper_pressure") * BAR - zero - p["push_out_pressure"], 0.0)
    return np.asarray(2.0 * p["piston_area"] * p["effective_radius"] / p["wheel_radius"] * acts)


def that_count(rows: Vector, before: Vector, params: RecordArray) -> NDArray[np.bool_]:
    """Return the rows of an application that count: moving, driver not accelerating, shape (n,)."""
    brakes = _linings(rows, before, params) @ corners(before, "mu_b")
    motors = (_motor_torques(rows) / params[0]["wheel_radius"]).sum(axis=1)
    moves = rows[:, OUTPUT["vehicle_speed"]] > STANDING
    accelerates = rows[:, N_OUTPUTS + 4] > PRESSED
    felt = np.isfinite(rows[:, OUTPUT["accel_x_road"]])
    if np.isfinite(before[OUTPUT["grip_knee"]]):  # what a car that others brake is learned from
        accelerates, motors = np.zeros_like(accelerates), motors * before[OUTPUT["motor_torque_share"]]
        moves = rows[:, OUTPUT["vehicle_speed"]] > ROLLING
    return np.asarray(moves & ~accelerates & ~(-motors > DRIVEN * brakes) & (felt | ~felt.any()))


def _too_few(speed: Vector, count: int) -> str:
    """Return the reason why too few rows count; `speed` [m/s] of all rows, `count` of counted ones."""
    if count >= LEAST_ROWS:
        return ""
    if np.isnan(speed).sum() > len(speed) - LEAST_ROWS:
        return "inputs lost"
    return "stands" if (speed > STANDING).sum() < LEAST_ROWS else "driven against the brakes"


class _Car(NamedTuple):
    """The car as a prediction assumes it."""

    mu_b: Vector
    mass: float
    overrun: float
    power: float = 0.0  # of the unreported drag, over mass [W/kg]
    ceiling: float = float("inf")  # m/s^2, towards which the linings' deceleration bends
    knee: float = 1.0  # exponent of that bend
    fall: float = 0.0  # share lost beyond it
    motors: float = 1.0  # share of the reported torques that counts


def _forces(rows: Vector, before: Vector, car: _Car, params: RecordArray) -> tuple[Vector, Vector]:
    """Return the specific force of the linings and the rest of it [m/s^2], shape (n,)."""
    p = params[0]
    inert = car.mass + (p["wheel_inertia"] / p["wheel_radius"] ** 2).sum()
    motors = car.motors * (_motor_torques(rows) / p["wheel_radius"]).sum(axis=1)
    resistance = p["drag_area"] * rows[:, OUTPUT["vehicle_speed"]] ** 2
    resistance += p["rolling_resistance"] * GRAVITY * car.mass
    linings = _linings(rows, before, params) @ car.mu_b / inert
    linings = bent(linings, car.ceiling, car.knee, car.fall)
    power = car.power * power_drag(rows[:, OUTPUT["vehicle_speed"]])
    return linings, (motors + resistance) / inert + car.overrun + power


def predict(rows: Vector, before: Vector, params: RecordArray) -> Prediction:
    """Return the prediction of an application.

    Args:
        rows: of the application, shape (n, N_ROW).
        before: the preceding row, shape (N_ROW,), with the values known then.
        params: `PARAMS`, shape (1,).
    """
    p = params[0]
    mass, overrun = float(before[OUTPUT["vehicle_mass"]]), float(np.nan_to_num(before[OUTPUT["overrun"]]))
    mass = mass if np.isfinite(mass) else float(p["mass"])
    power = float(np.nan_to_num(before[OUTPUT["overrun_power"]]))
    learned = _Car(corners(before, "mu_b"), mass, overrun, power)
    if np.isfinite(before[OUTPUT["grip_knee"]]):
        bend = [OUTPUT["grip_limit"], OUTPUT["grip_knee"], OUTPUT["grip_fall"]]
        ceiling, knee, fall = np.nan_to_num(before[bend])
        motors = before[OUTPUT["motor_torque_share"]]
        learned = learned._replace(ceiling=ceiling, knee=knee, fall=fall, motors=motors)
    configured = _Car(p["mu_nominal"], float(p["mass"]), 0.0)
    speed = rows[:, OUTPUT["vehicle_speed"]]
    decel = mean(np.where(speed > STANDING, sum(_forces(rows, before, learned, params)), 0.0))
    felt = np.nan_to_num(before[OUTPUT["accel_x_zero"]]) - rows[:, OUTPUT["accel_x_road"]]
    if not p["mapped"][ACCEL_X] and len(speed) > 1:
        felt = -np.gradient(speed, PERIOD)
    counted = that_count(rows, before, params)
    measured, rows = mean(felt[counted]), rows[counted]
    brakes, rest = map(mean, _forces(rows, before, learned, params))
    configured_brakes, configured_rest = map(mean, _forces(rows, before, configured, params))
    motors = learned.motors * mean((_motor_torques(rows) / p["wheel_radius"]).sum(axis=1)) / mass
    relative = before[OUTPUT["sigma_brake_force"]]
    if np.isnan(relative):  # of one wheel's observers: taken as one error common to all
        relative = float(np.mean(corners(before, "sigma_mu_b") / corners(before, "mu_b")))
    sigma = float(np.hypot(relative * brakes, p["sigma_motor_torque"] * motors))
    sigma = max(sigma, float(np.nan_to_num(before[OUTPUT["sigma_overrun"]])))
    return Prediction(
        decel, brakes + rest, sigma, configured_brakes + configured_rest, rest, configured_rest,
        measured, _too_few(speed, len(rows)),
    )  # fmt: skip


def left_out(duration: float, measured: float, predicted: float, too_few: str = "") -> str:
    """Return why the prediction of an application is excluded, empty if it counts."""
    if duration < SHORT:
        return f"shorter than {SHORT} s"
    if too_few:
        return too_few
    if not np.isfinite([measured, predicted]).all():
        return "inputs lost"
    return f"below {WEAK} m/s²" if measured < WEAK else ""


def running_average(measured: Sequence[float], configured: Sequence[float], rest: Sequence[float]) -> Vector:
    """Return the prediction by a running average of the friction's scale, shape (n,).

    Each application is predicted with the mean of 1 and the scales of the earlier ones; a scale is the lining
    force over that by configured friction. All three [m/s^2]; `rest` excludes the linings.
    """
    linings = np.asarray(configured) - np.asarray(rest)
    scales = (np.asarray(measured) - np.asarray(rest)) / linings
    known = np.concatenate(([1.0], scales[:-1])) if len(scales) else np.empty(0)
    return np.asarray(np.cumsum(known) / np.arange(1, len(known) + 1) * linings + np.asarray(rest))


def one_scale(measured: Sequence[float], configured: Sequence[float], rest: Sequence[float]) -> Vector:
    """Return the prediction by one friction scale, chosen in hindsight, shape (n,)."""
    linings = np.asarray(configured) - np.asarray(rest)
    scales = (np.asarray(measured) - np.asarray(rest)) / linings
    off = [np.abs((scale * linings + rest) / measured - 1.0).mean() for scale in scales]
    return np.asarray(scales[int(np.argmin(off))] * linings + rest) if len(scales) else np.empty(0)


class Errors(NamedTuple):
    """Errors of predictions as shares of the measured values; NaN where none counts."""

    counted: int
    mean: float
    """Of the magnitude."""
    median: float
    """Of the magnitude."""
    worst: float
    """Of the magnitude."""
    bias: float
    """Mean; positive: more was predicted than came."""


def errors(measured: Sequence[float], predicted: Sequence[float] | Vector) -> Errors:
    """Return the errors of counted predictions, one element each; decelerations in m/s^2."""
    if not len(measured):
        return Errors(0, *[float("nan")] * 4)
    shares = np.asarray(predicted) / np.asarray(measured) - 1.0
    off = np.abs(shares)
    return Errors(len(shares), float(off.mean()), median(off), float(off.max()), float(shares.mean()))
