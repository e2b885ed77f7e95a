"""Book of the brake applications: one row per application and corner, from the rows of results.

An application is a run of rows with `braking` = 1. For corner i with piston area A_i of one side, effective
radius r_eff, push-out pressure p_0 and tyre radius r:

    mu_b_mean       = ∫ T_b / (2 A_i r_eff (p − p_0)) ds / ∫ ds

from 90 % of the steady pressure (the median of what lies above half of the highest) until release or 5 km/h.
What it was expected to do: `brakelab.replay.prediction`.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.replay.prediction import (
    SLOPE_ROWS,
    STANDING,
    Vector,
    corners,
    driven_against,
    left_out,
    mean,
    predict,
    slope_felt,
)
from ecu.estimation.friction import SECONDS_FOR_LEARNING, SIGMA_FOR_LEARNING
from ecu.params import BAR
from ecu.records import RecordArray
from ecu.signals import CORNERS, FAULT, HOLDING, OBSERVING, OUTPUT

RELEASE_BAR: Final = 1.0  # an application lasts while a pressure is this much above p_0 (contract)
SLOWEST: Final = 5.0 / 3.6  # m/s, end of the friction mean (contract)
PERIOD: Final = 0.01  # s, one row
LEARNED: Final = "learned"

BRAKE_UNITS: Final = {
    "brake": "-",
    "corner": "-",
    "t_start": "s",
    "duration": "s",
    "v_in": "m/s",
    "v_end": "m/s",
    "decel_mean": "m/s^2",
    "decel_predicted": "m/s^2",
    "mu_b_mean": "-",
    "mu_b_mean_time": "-",
    "brake_torque_mean": "N m",
    "brake_energy": "J",
    "disc_temperature_in": "degC",
    "disc_temperature_mean": "degC",
    "pad_wear_mass": "g",
    "emission_factor": "log10(particles)",
    # Beyond the contract: what became of the estimate.
    "mu_b_end": "-",
    "sigma_mu_b_end": "-",
    "observed": "s",
    "learning": "-",
    # Beyond the contract: what the prediction is worth.
    "sigma_decel_predicted": "m/s^2",
    "learned_before": "-",
    "left_out": "-",
}


class BrakeRow(NamedTuple):
    """One application at one corner; NaN: not available. Units: `BRAKE_UNITS`."""

    brake: int
    corner: str
    t_start: float
    duration: float
    v_in: float
    v_end: float
    decel_mean: float
    decel_predicted: float
    mu_b_mean: float
    mu_b_mean_time: float
    brake_torque_mean: float
    brake_energy: float
    disc_temperature_in: float
    disc_temperature_mean: float
    pad_wear_mass: float
    emission_factor: float
    mu_b_end: float
    sigma_mu_b_end: float
    observed: float
    learning: str
    """`LEARNED`, or why this application taught nothing."""
    sigma_decel_predicted: float
    learned_before: int
    """1: the friction in the prediction was learned, 0: it is nominal."""
    left_out: str
    """Why the prediction does not count, empty where it does."""


def friction_means(
    torque: Vector, pressure: Vector, speed: Vector, lever: float, p_0: float
) -> tuple[float, float]:
    """Return the mean friction by distance and by time; NaN if the pressure never acted.

    `torque` [N m], `pressure` [bar] and `speed` [m/s] over one application, shape (n,);
    `lever` 2 A r_eff [m^3], `p_0` push-out pressure [Pa].
    """
    none = (float("nan"), float("nan"))
    highest = np.nanmax(pressure, initial=0.0)
    if not highest * BAR > p_0 + RELEASE_BAR * BAR:
        return none
    steady = np.median(pressure[pressure > 0.5 * highest])
    reached = np.flatnonzero(pressure >= 0.9 * steady)
    first = int(reached[0])
    over = (pressure * BAR < p_0 + RELEASE_BAR * BAR) | (speed < SLOWEST)
    ends = np.flatnonzero(over[first:])
    last = first + int(ends[0]) if len(ends) else len(pressure)
    if last == first:
        return none
    part = slice(first, last)
    friction = torque[part] / (lever * (pressure[part] * BAR - p_0))
    return mean(friction, np.nan_to_num(speed[part])), mean(friction)


def _modes(rows: Vector, i: int) -> Vector:
    return rows[..., OUTPUT["mode_fl"] + i]


def learning(rows: Vector, i: int, params: RecordArray, against: str = "") -> str:
    """Return `LEARNED` if corner i's estimate over `rows`, shape (n, N_ROW), was kept, else why not.

    `against`: what `driven_against` says.
    """
    p = params[0]
    observed = PERIOD * np.count_nonzero(_modes(rows, i) == OBSERVING)
    sigma = corners(rows[-1], "sigma_mu_b")[i] / corners(rows[-1], "mu_b")[i]
    if observed >= SECONDS_FOR_LEARNING and sigma < SIGMA_FOR_LEARNING:
        return LEARNED
    if observed >= SECONDS_FOR_LEARNING:
        return f"σ {100 * sigma:.0f} %"
    if observed > 0.0:
        return f"observed {observed:.1f} s only"
    if np.mean(_modes(rows, i) == FAULT) > 0.5:
        return "inputs lost"
    fastest = np.nanmax(rows[:, OUTPUT["vehicle_speed"]], initial=0.0)
    strongest = np.nanmax(-rows[:, OUTPUT["accel_x_road"]], initial=0.0)
    if fastest <= p["min_speed"]:
        return "stands" if fastest < STANDING else f"slower than {3.6 * p['min_speed']:.0f} km/h"
    if strongest <= p["activation_decel"][i]:
        return f"below {p['activation_decel'][i]:.1f} m/s²"
    return against or "held: ABS, ESP, accelerator or reverse, or slip too small or too large"


def application(number: int, t: Vector, rows: Vector, start: int, params: RecordArray) -> list[BrakeRow]:
    """Return the four rows of one application.

    `t` [s] and `rows`, shapes (n,) and (n, N_ROW), are its own from place `start` on and what precedes it.
    """
    p = params[0]
    slope = slope_felt(t[:start], rows[:start])
    before = rows[max(start - 1, 0)]
    t, rows = t[start:], rows[start:]
    speed = rows[:, OUTPUT["vehicle_speed"]]
    duration = float(t[-1] - t[0]) + PERIOD
    known = speed[np.isfinite(speed)]
    v_in, v_end = (float(known[0]), float(known[-1])) if len(known) else (float("nan"), float("nan"))
    decel = max((v_in - v_end) / duration, 0.0)
    prediction = predict(rows, before, slope, params)
    against = driven_against(rows, prediction)
    torque, pressure = corners(rows, "brake_torque"), corners(rows, "calliper_pressure")
    slip, heat = np.nan_to_num(corners(rows, "slip")), corners(rows, "disc_temperature")
    worn = corners(rows[-1], "pad_wear_mass") - corners(before, "pad_wear_mass")
    lines = []
    for i, corner in enumerate(CORNERS):
        lever = float(2.0 * p["piston_area"][i] * p["effective_radius"][i])
        mu_distance, mu_time = friction_means(
            torque[:, i], pressure[:, i], speed, lever, float(p["push_out_pressure"][i])
        )
        power = torque[:, i] * speed * (1.0 + slip[:, i]) / p["wheel_radius"][i]
        lines.append(
            BrakeRow(
                number,
                corner,
                float(t[0]),
                duration,
                v_in,
                v_end,
                decel,
                prediction.decel,
                mu_distance,
                mu_time,
                mean(torque[:, i]),
                mean(power) * duration,
                float(heat[0, i]),
                mean(heat[:, i]),
                float(worn[i]),
                float("nan"),
                float(corners(rows[-1], "mu_b")[i]),
                float(corners(rows[-1], "sigma_mu_b")[i]),
                PERIOD * float(np.count_nonzero(_modes(rows, i) == OBSERVING)),
                learning(rows, i, params, against),
                prediction.sigma,
                int(_modes(before, i) == HOLDING),
                left_out(duration, decel, against, prediction.decel),
            )
        )
    return lines


class BrakeBook:
    """Collects applications from rows that come in blocks; it keeps only the rows of the one that lasts and
    those just before."""

    def __init__(self, params: RecordArray) -> None:
        self.rows: list[BrakeRow] = []
        self._params = params
        self._t: Vector = np.empty(0)
        self._rows: Vector = np.empty((0, 0))
        self._done = 0
        """So many of the rows kept are no part of an application to come."""

    def add(self, t: Vector, rows: Vector) -> None:
        """Add rows that follow the last: `t` [s], shape (n,), and `rows`, shape (n, N_ROW)."""
        if len(self._t):
            t, rows = np.concatenate((self._t, t)), np.concatenate((self._rows, rows))
        braking = rows[self._done :, OUTPUT["braking"]] == 1.0
        edges = self._done + np.flatnonzero(np.diff(braking, prepend=False))
        for start, end in zip(edges[0::2], edges[1::2], strict=False):
            self._close(t[:end], rows[:end], int(start))
        done = int(edges[-1]) if len(edges) % 2 else len(t)
        kept = max(done - SLOPE_ROWS, 0)
        self._t, self._rows, self._done = t[kept:].copy(), rows[kept:].copy(), done - kept

    def end_log(self) -> None:
        """End a log: an application that still lasts ends with it, and the next row follows nothing."""
        if self._done < len(self._t):
            self._close(self._t, self._rows, self._done)
            self.rows[-4:] = [row._replace(learning="the log ends first") for row in self.rows[-4:]]
        self._t, self._rows, self._done = np.empty(0), np.empty((0, 0)), 0

    def _close(self, t: Vector, rows: Vector, start: int) -> None:
        number = len(self.rows) // len(CORNERS)
        known = max(start - SLOPE_ROWS, 0)
        self.rows += application(number, t[known:], rows[known:], start - known, self._params)
