"""Table of brake applications: one row per application and corner, from the rows of results.

An application is a run of rows with `braking` = 1. For corner i with piston area A_i of one side, effective
radius r_eff, push-out pressure p_0 and tyre radius r:

    mu_b_mean       = ∫ T_b / (2 A_i r_eff (p − p_0)) ds / ∫ ds

from 90 % of the steady pressure (the median of values above half of the highest) until release or 5 km/h.
Expected deceleration: `brakelab.results.prediction`.
"""

from typing import Annotated, Final, NamedTuple, get_type_hints

import numpy as np

from brakelab.arrays import median
from brakelab.results.dust import airborne_mass, dust_of
from brakelab.results.prediction import PERIOD, STANDING, Vector, corners, left_out, mean, predict
from brakelab.results.wear import wear_of
from ecu.algorithm.monitoring.wear import REGRESSORS
from ecu.contract.faults import E2E_REJECTIONS, FAULTS, PRESSURE_LOST, WHEEL_SPEED_LOST
from ecu.contract.params import BAR
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, FAULT, HOLDING, OBSERVING, OUTPUT

RELEASE_BAR: Final = 1.0  # an application lasts while a pressure is this much above p_0 (contract)
LOWEST_SPEED: Final = 5.0 / 3.6  # m/s, end of the friction mean (contract)
LEARNED: Final = "learned"
HOLDS: Final = WHEEL_SPEED_LOST | PRESSURE_LOST | E2E_REJECTIONS
"""Fault bits that explain why nothing was learned."""


class BrakeRow(NamedTuple):
    """One application at one corner, each value with its unit; NaN: not available.

    From `mu_b_end` on beyond the contract: learned values after the application, for the next one; from
    `mu_b_before` on quality of the prediction, see `brakelab.results.prediction`.
    """

    brake: Annotated[int, "-"]
    """Number of the application, from 0."""
    corner: Annotated[str, "-"]
    """fl, fr, rl or rr."""
    t_start: Annotated[float, "s"]
    """Its first row."""
    duration: Annotated[float, "s"]
    """From its first to its last row and one more."""
    v_in: Annotated[float, "m/s"]
    """Speed at its start."""
    v_end: Annotated[float, "m/s"]
    """Speed at its end."""
    decel_mean: Annotated[float, "m/s^2"]
    """(v_in - v_end) / duration, at least 0."""
    decel_predicted: Annotated[float, "m/s^2"]
    """The same from pressures and the friction learned before."""
    mu_b_mean: Annotated[float, "-"]
    """Friction by torque and pressure, mean by distance."""
    mu_b_mean_time: Annotated[float, "-"]
    """Mean by time."""
    brake_torque_mean: Annotated[float, "N m"]
    """Of the linings."""
    brake_energy: Annotated[float, "J"]
    """Into this brake."""
    disc_temperature_in: Annotated[float, "degC"]
    """At its start."""
    disc_temperature_mean: Annotated[float, "degC"]
    """Mean over it."""
    pad_wear_mass: Annotated[float, "g"]
    """That both pads lose."""
    emission_factor: Annotated[float, "log10(particles)"]
    """Particles of this brake."""
    mu_b_end: Annotated[float, "-"]
    """Friction known after it."""
    sigma_mu_b_end: Annotated[float, "-"]
    """Its standard deviation."""
    observed: Annotated[float, "s"]
    """Time in which friction was observed."""
    learning: Annotated[str, "-"]
    """`learned`, or why this application taught nothing."""
    mu_b_before: Annotated[float, "-"]
    """Friction known before it."""
    sigma_mu_b_before: Annotated[float, "-"]
    """Its standard deviation."""
    specific_force_mean: Annotated[float, "m/s^2"]
    """Measured; positive braking."""
    specific_force_predicted: Annotated[float, "m/s^2"]
    """By pressures and motors, and what was known before."""
    sigma_specific_force: Annotated[float, "m/s^2"]
    """Standard deviation of the prediction."""
    specific_force_configured: Annotated[float, "m/s^2"]
    """Predicted with the configured friction."""
    specific_force_rest: Annotated[float, "m/s^2"]
    """Part of the predicted one that is not the linings'."""
    specific_force_configured_rest: Annotated[float, "m/s^2"]
    """Likewise, of the one with the configured friction."""
    learned_before: Annotated[int, "-"]
    """1: the friction in the prediction was learned, 0: it is nominal."""
    left_out: Annotated[str, "-"]
    """Why the prediction does not count, empty where it does."""
    sigma_pad_wear_mass: Annotated[float, "g"]
    """Standard deviation of the mass."""
    emission_factor_low: Annotated[float, "log10(particles)"]
    """Lower limit of 95 %."""
    emission_factor_high: Annotated[float, "log10(particles)"]
    """Upper limit."""
    particle_mass: Annotated[float, "mg"]
    """By the wear that the ECU believes, measured thicknesses included."""
    particle_mass_low: Annotated[float, "mg"]
    """Lower limit of 95 %."""
    particle_mass_high: Annotated[float, "mg"]
    """Upper limit."""
    wear_energy: float
    """Regressor of the wear law (7.16), P power, T disc temperature: ∫ P dt."""
    wear_energy_t: float
    """∫ P T dt."""
    wear_energy_t2: float
    """∫ P T² dt."""
    wear_torque_rate: float
    """∫ of torque times the wheel's deceleration."""
    wear_torque_rate_t: float
    """The same times T."""
    wear_power2: float
    """∫ P² dt."""
    wear_power2_t: float
    """∫ P² T dt."""


BRAKE_UNITS: Final = {
    name: hint.__metadata__[0]
    for name, hint in get_type_hints(BrakeRow, include_extras=True).items()
    if hasattr(hint, "__metadata__")
} | dict(REGRESSORS)
"""Unit of each value of a row."""
_PARTICLES: Final = ("particle_mass", "particle_mass_low", "particle_mass_high")
_REGRESSORS: Final = tuple(name for name, _ in REGRESSORS)


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
    steady = median(pressure[pressure > 0.5 * highest])
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
                brake=number,
                corner=corner,
                t_start=float(t[0]),
                duration=duration,
                v_in=v_in,
                v_end=v_end,
                decel_mean=decel,
                decel_predicted=prediction.decel,
                mu_b_mean=mu_distance,
                mu_b_mean_time=mu_time,
                brake_torque_mean=mean(torque[:, i]),
                brake_energy=mean(power) * duration,
                disc_temperature_in=float(heat[0, i]),
                disc_temperature_mean=mean(heat[:, i]),
                pad_wear_mass=float(wear.mass[i]),
                emission_factor=float(dust.factor[i]),
                mu_b_end=float(corners(after, "mu_b")[i]),
                sigma_mu_b_end=float(corners(after, "sigma_mu_b")[i]),
                observed=PERIOD * float(np.count_nonzero(_modes(rows, i) == OBSERVING)),
                learning=learning(rows, i, params),
                mu_b_before=float(corners(before, "mu_b")[i]),
                sigma_mu_b_before=float(corners(before, "sigma_mu_b")[i]),
                specific_force_mean=prediction.measured,
                specific_force_predicted=prediction.force,
                sigma_specific_force=prediction.sigma,
                specific_force_configured=prediction.configured,
                specific_force_rest=prediction.rest,
                specific_force_configured_rest=prediction.configured_rest,
                learned_before=int(_modes(before, i) == HOLDING),
                left_out=left_out(duration, prediction.measured, prediction.force, prediction.too_few),
                sigma_pad_wear_mass=float(wear.sigma[i]),
                emission_factor_low=float(dust.low[i]),
                emission_factor_high=float(dust.high[i]),
                **dict(zip(_PARTICLES, (float(mass[i]) for mass in airborne), strict=True)),
                **dict(zip(_REGRESSORS, wear.regressors[:, i].tolist(), strict=True)),
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
            if not self._rows[-1, OUTPUT["vehicle_speed"]] < STANDING:
                self.rows[-4:] = [row._replace(learning="the log ends first") for row in self.rows[-4:]]
        self._t, self._rows = np.empty(0), np.empty((0, 0))

    def _close(self, t: Vector, rows: Vector, start: int, end: int) -> None:
        number = len(self.rows) // len(CORNERS)
        before, after = rows[max(start - 1, 0)], rows[min(end, len(rows) - 1)]
        own = np.ascontiguousarray(rows[start:end])  # sums have the same bits however rows are stored
        self.rows += application(number, t[start:end], own, before, after, self._params)
