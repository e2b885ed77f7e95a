"""What a brake application is expected to do, from its pressures and what was known before it.

Where no sensor tells the friction, an estimate can only be judged by what it predicts:

    decel_predicted = mean of [Σ (2 A_i r_eff mu_i (p_i − p_0)⁺ + M_i) / r_i + drag v² + (rolling g + s) m]
                      / (m + Σ I_i / r_i²)

mu_i is the friction known before the application and s gravity along the road as the accelerometer felt it
in the 2 s before; the pressures p_i, the motor torques M_i (positive brakes) and the speed v are its own, I_i
is a wheel's inertia. A vehicle that stands decelerates no further: such rows count with 0, as they do in the
measured (v_in − v_end) / duration.

The standard deviation is that of the friction, taken as one error common to all four linings (the most that
it can be), and that of the motor torque.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.estimation.friction import DRIVEN
from ecu.params import BAR, GRAVITY
from ecu.records import RecordArray
from ecu.signals import N_OUTPUTS, OUTPUT

Vector = NDArray[np.float64]

STANDING: Final = 0.3  # m/s, below: the vehicle stands
SHORT: Final = 0.5  # s, shorter: a tap on the pedal
WEAK: Final = 0.5  # m/s^2, below: an error of it in per cent says nothing
PRESSED: Final = 2.0  # %, of the accelerator; the ECU learns nothing above it either
OVERLAP: Final = 0.1  # of the pressure over time: so much may overlap while the foot changes pedals
SLOPE_ROWS: Final = 200  # before an application, from which the slope is known
LEAST_SLOPE_ROWS: Final = 50


class Prediction(NamedTuple):
    """What an application is expected to do, all [m/s^2]."""

    decel: float
    """Mean deceleration."""
    sigma: float
    brakes: float
    """Part of the brakes, while the vehicle moves."""
    motors: float
    """Part of the motors, while the vehicle moves; negative: they drive."""


def corners(rows: Vector, name: str) -> Vector:
    """Return the four columns of a corner output of `rows`, shape (..., N_ROW) to (..., 4)."""
    first = OUTPUT[f"{name}_fl"]
    return rows[..., first : first + 4]


def mean(values: Vector, weights: Vector | None = None) -> float:
    """Return the mean of what is known, NaN if nothing is; `weights` of the shape of `values`."""
    known = np.isfinite(values)
    weights = np.ones_like(values) if weights is None else weights
    total = float(weights[known].sum())
    return float(values[known] @ weights[known]) / total if total > 0.0 else float("nan")


def slope_felt(t: Vector, rows: Vector) -> float:
    """Return gravity along the road [m/s^2], uphill positive: specific force less dv/dt over `rows`.

    `t` [s], shape (n,), `rows`, shape (n, N_ROW); 0 where too little is known.
    """
    speed, accel = rows[:, OUTPUT["vehicle_speed"]], rows[:, OUTPUT["accel_x_road"]]
    known = np.flatnonzero(np.isfinite(speed) & np.isfinite(accel))
    if len(known) < LEAST_SLOPE_ROWS:
        return 0.0
    first, last = known[0], known[-1]
    return mean(accel[known]) - float((speed[last] - speed[first]) / (t[last] - t[first]))


def predict(rows: Vector, before: Vector, slope: float, params: RecordArray) -> Prediction:
    """Return what to expect of an application.

    Args:
        rows: of the application, shape (n, N_ROW).
        before: the row that precedes it, shape (N_ROW,), whose friction is used.
        slope: gravity along the road [m/s^2], uphill positive.
        params: `PARAMS`, shape (1,).
    """
    p = params[0]
    speed = rows[:, OUTPUT["vehicle_speed"]]
    pressure = np.maximum(corners(rows, "calliper_pressure") * BAR - p["push_out_pressure"], 0.0)
    lever = 2.0 * p["piston_area"] * p["effective_radius"] / p["wheel_radius"] * pressure
    brakes, unsure = lever @ corners(before, "mu_b"), lever @ corners(before, "sigma_mu_b")
    motors = (_motor_torques(rows) / p["wheel_radius"]).sum(axis=1)
    resistance = p["drag_area"] * speed**2 + (p["rolling_resistance"] * GRAVITY + slope) * p["mass"]
    moves = speed > STANDING
    inert = p["mass"] + (p["wheel_inertia"] / p["wheel_radius"] ** 2).sum()
    mean_motors = mean(np.where(moves, motors, 0.0))
    return Prediction(
        mean(np.where(moves, brakes + motors + resistance, 0.0)) / inert,
        float(np.hypot(mean(np.where(moves, unsure, 0.0)), p["sigma_motor_torque"] * mean_motors)) / inert,
        mean(brakes[moves]) / inert,
        mean(motors[moves]) / inert,
    )


def _motor_torques(rows: Vector) -> Vector:
    return np.nan_to_num(rows[:, N_OUTPUTS : N_OUTPUTS + 4])


def driven_against(rows: Vector, prediction: Prediction) -> str:
    """Return how the vehicle was driven against its brakes, empty if it was not."""
    moving = rows[rows[:, OUTPUT["vehicle_speed"]] > STANDING]
    pressure = np.maximum(np.nan_to_num(corners(moving, "calliper_pressure")), 0.0).sum(axis=1)
    if pressure @ (moving[:, N_OUTPUTS + 4] > PRESSED) > OVERLAP * pressure.sum():
        return "accelerator pressed"
    return "driving torque" if -prediction.motors > DRIVEN * prediction.brakes else ""


def left_out(duration: float, decel: float, against: str, predicted: float) -> str:
    if duration < SHORT:
        return f"shorter than {SHORT} s"
    if against:
        return against
    if not np.isfinite([decel, predicted]).all():
        return "inputs lost"
    return f"below {WEAK} m/s²" if decel < WEAK else ""


class Errors(NamedTuple):
    """How far predictions are from what was measured, as shares of the measured; NaN where none counts."""

    counted: int
    nominal: int
    """Of these, made with friction of which no corner had learned anything."""
    median: float
    """Of the magnitude."""
    worst: float
    """Of the magnitude."""
    bias: float
    """Mean; positive: more was predicted than came."""


def errors(measured: Sequence[float], predicted: Sequence[float], learned: Sequence[bool]) -> Errors:
    """Return the errors of predictions that count, one place each; decelerations in m/s^2."""
    if not measured:
        return Errors(0, 0, *[float("nan")] * 3)
    shares = np.asarray(predicted) / np.asarray(measured) - 1.0
    off = np.abs(shares)
    return Errors(
        len(shares),
        len(learned) - sum(learned),
        float(np.median(off)),
        float(off.max()),
        float(shares.mean()),
    )
