"""Table of brake applications: one row per application and corner, from the rows of results.

An application is a run of rows with `braking` = 1. For corner i with piston area A_i of one side, effective
radius r_eff, push-out pressure p_0 and tyre radius r:

    mu_b_mean       = ∫ T_b / (2 A_i r_eff (p − p_0)) ds / ∫ ds

from 90 % of the steady pressure (the median of values above half of the highest) until release or 5 km/h.
Expected deceleration: `brakelab.results.prediction`.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.results.dust import airborne_mass, dust_of
from brakelab.results.prediction import STANDING, Vector, corners, left_out, mean, predict
from brakelab.results.wear import wear_of
from ecu.algorithm.monitoring.wear import REGRESSORS
from ecu.contract.faults import E2E_REJECTIONS, FAULTS, PRESSURE_LOST, WHEEL_SPEED_LOST
from ecu.contract.params import BAR
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, FAULT, HOLDING, OBSERVING, OUTPUT

RELEASE_BAR: Final = 1.0  # an application lasts while a pressure is this much above p_0 (contract)
LOWEST_SPEED: Final = 5.0 / 3.6  # m/s, end of the friction mean (contract)
PERIOD: Final = 0.01  # s, one row
LEARNED: Final = "learned"
HOLDS: Final = WHEEL_SPEED_LOST | PRESSURE_LOST | E2E_REJECTIONS
"""Fault bits that explain why nothing was learned."""

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
    # Beyond the contract: learned values after the application, for the next one.
    "mu_b_end": "-",
    "sigma_mu_b_end": "-",
    "observed": "s",
    "learning": "-",
    # Beyond the contract: quality of the prediction, see `brakelab.results.prediction`.
    "mu_b_before": "-",
    "sigma_mu_b_before": "-",
    "specific_force_mean": "m/s^2",
    "specific_force_predicted": "m/s^2",
    "sigma_specific_force": "m/s^2",
    "specific_force_configured": "m/s^2",
    "specific_force_rest": "m/s^2",
    "specific_force_configured_rest": "m/s^2",
    "learned_before": "-",
    "left_out": "-",
    "sigma_pad_wear_mass": "g",
    "emission_factor_low": "log10(particles)",
    "emission_factor_high": "log10(particles)",
    "particle_mass": "mg",
    # Beyond the contract: its 95 % band.
    "particle_mass_low": "mg",
    "particle_mass_high": "mg",
    **dict(REGRESSORS),
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
    mu_b_before: float
    sigma_mu_b_before: float
    specific_force_mean: float
    """Measured; positive braking."""
    specific_force_predicted: float
    sigma_specific_force: float
    specific_force_configured: float
    """Predicted with the configured friction."""
    specific_force_rest: float
    """Part of the predicted one that is not the linings'."""
    specific_force_configured_rest: float
    learned_before: int
    """1: the friction in the prediction was learned, 0: it is nominal."""
    left_out: str
    """Why the prediction does not count, empty where it does."""
    sigma_pad_wear_mass: float
    emission_factor_low: float
    emission_factor_high: float
    particle_mass: float
    """By the wear that the ECU believes, measured thicknesses included."""
    particle_mass_low: float
    particle_mass_high: float
    wear_energy: float
    wear_energy_t: float
    wear_energy_t2: float
    wear_torque_rate: float
    wear_torque_rate_t: float
    wear_power2: float
    wear_power2_t: float


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
    over = (pressure * BAR < p_0 + RELEASE_BAR * BAR) | (speed < LOWEST_SPEED)
    ends = np.flatnonzero(over[first:])
    last = first + int(ends[0]) if len(ends) else len(pressure)
    if last == first:
        return none
    part = slice(first, last)
    friction = torque[part] / (lever * (pressure[part] * BAR - p_0))
    return mean(friction, np.nan_to_num(speed[part])), mean(friction)


def _modes(rows: Vector, i: int) -> Vector:
    return rows[..., OUTPUT["mode_fl"] + i]


def learning(rows: Vector, i: int, params: RecordArray) -> str:
    """Return `LEARNED` if corner i was observed in `rows`, shape (n, N_ROW), else the reason why not."""
    p = params[0]
    if p["fixed"]:
        return "physics contradicts"
    if np.any(_modes(rows, i) == OBSERVING):
        return LEARNED
    if np.mean(_modes(rows, i) == FAULT) > 0.5:
        return "inputs lost"
    shown = np.nan_to_num(rows[:, OUTPUT["active_faults"]]).astype(np.int64)
    for fault in FAULTS:
        if fault.bit & HOLDS and np.mean(shown & fault.bit != 0) > 0.5:
            return fault.name
    fastest = np.nanmax(rows[:, OUTPUT["vehicle_speed"]], initial=0.0)
    if fastest <= p["min_speed"]:
        return "stands" if fastest < STANDING else f"slower than {3.6 * p['min_speed']:.0f} km/h"
    return "held: ABS, ESP, accelerator or reverse, or a wheel that slides"


def application(
    number: int, t: Vector, rows: Vector, before: Vector, after: Vector, params: RecordArray
) -> list[BrakeRow]:
    """Return the four rows of one application.

    `t` [s] and `rows`, shapes (n,) and (n, N_ROW), are its own, `before` and `after` the rows around it.
    """
    p = params[0]
    speed = rows[:, OUTPUT["vehicle_speed"]]
    duration = float(t[-1] - t[0]) + PERIOD
    known = speed[np.isfinite(speed)]
    v_in, v_end = (float(known[0]), float(known[-1])) if len(known) else (float("nan"), float("nan"))
    decel = max((v_in - v_end) / duration, 0.0)
    prediction = predict(rows, before, params)
    torque, pressure = corners(rows, "brake_torque"), corners(rows, "calliper_pressure")
    slip, heat = np.nan_to_num(corners(rows, "slip")), corners(rows, "disc_temperature")
    wear, dust = wear_of(rows, params), dust_of(rows, params)
    worn = corners(after, "pad_wear_mass") - corners(before, "pad_wear_mass")
    relative = np.divide(wear.sigma, wear.mass, out=np.full_like(wear.sigma, np.nan), where=wear.mass > 0.0)
    airborne = airborne_mass(worn, relative, params)
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
                float(wear.mass[i]),
                float(dust.factor[i]),
                float(corners(after, "mu_b")[i]),
                float(corners(after, "sigma_mu_b")[i]),
                PERIOD * float(np.count_nonzero(_modes(rows, i) == OBSERVING)),
                learning(rows, i, params),
                float(corners(before, "mu_b")[i]),
                float(corners(before, "sigma_mu_b")[i]),
                prediction.measured,
                prediction.force,
                prediction.sigma,
                prediction.configured,
                prediction.rest,
                prediction.configured_rest,
                int(_modes(before, i) == HOLDING),
                left_out(duration, prediction.measured, prediction.force, prediction.too_few),
                float(wear.sigma[i]),
                float(dust.low[i]),
                float(dust.high[i]),
                *(float(mass[i]) for mass in airborne),
                *wear.regressors[:, i].tolist(),
            )
        )
    return lines


class BrakeBook:
    """Collector of applications from blocks of rows; it keeps the rows of the current application
    and the row before it."""

    def __init__(self, params: RecordArray) -> None:
        self.rows: list[BrakeRow] = []
        self._params = params
        self._t: Vector = np.empty(0)
        self._rows: Vector = np.empty((0, 0))

    def add(self, t: Vector, rows: Vector) -> None:
        """Add rows that follow the last: `t` [s], shape (n,), and `rows`, shape (n, N_ROW)."""
        first = 0
        if len(self._t):  # only the application that goes on, or begins here, needs the rows before
            first = int(np.argmin(np.append(rows[:, OUTPUT["braking"]] == 1.0, False)))
            joined = slice(first + 1)
            self._take(np.concatenate((self._t, t[joined])), np.concatenate((self._rows, rows[joined])))
        if first < len(t):
            self._take(t[first:], rows[first:])

    def _take(self, t: Vector, rows: Vector) -> None:
        braking = rows[:, OUTPUT["braking"]] == 1.0
        edges = np.flatnonzero(np.diff(braking, prepend=False))
        for start, end in zip(edges[0::2], edges[1::2], strict=False):
            self._close(t, rows, int(start), int(end))
        kept = max(int(edges[-1]) - 1, 0) if len(edges) % 2 else max(len(t) - 1, 0)
        self._t, self._rows = t[kept:].copy(), rows[kept:].copy()

    def end_log(self) -> None:
        """End a log: an unfinished application ends with it, and the next row starts anew."""
        if len(self._t) and self._rows[-1, OUTPUT["braking"]] == 1.0:
            first = int(np.argmax(self._rows[:, OUTPUT["braking"]] == 1.0))
            self._close(self._t, self._rows, first, len(self._t))
            self.rows[-4:] = [row._replace(learning="the log ends first") for row in self.rows[-4:]]
        self._t, self._rows = np.empty(0), np.empty((0, 0))

    def _close(self, t: Vector, rows: Vector, start: int, end: int) -> None:
        number = len(self.rows) // len(CORNERS)
        before, after = rows[max(start - 1, 0)], rows[min(end, len(rows) - 1)]
        own = np.ascontiguousarray(rows[start:end])  # sums have the same bits however rows are stored
        self.rows += application(number, t[start:end], own, before, after, self._params)
