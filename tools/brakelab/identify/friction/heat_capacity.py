"""The disc's heat capacity over temperature from the stops of a programme (3.7, Figure 3.6a).

Model. A stop with friction energy E raises the disc of heat capacity C(tau) = C_100 (1 + rise (tau - 100)) by

    tau_end - tau_start + cooled = share (E - lag P_end) / C(tau)

cooled: what the air takes at the rate of 3.7; P_end the power at the end, which a thermocouple that lags has
not shown yet. C_100, rise and lag are found by least squares over all stops; cooling is taken as given. A lag
below zero is of a thermocouple on the surface, which is ahead of the disc.

A thermocouple that lags by more than `SLOW` shows a law another disc than it had: friction that falls with
heat seems to fall with time. What the last seconds have heated is then added to what is shown.
"""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from brakelab.arrays import Vector
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.fit import quantile
from brakelab.identify.friction.stops import Stops
from brakelab.plant.disc import DISC_SHARE

AT: Final = 100.0  # degC
AMBIENT: Final = 20.0  # degC
LAST: Final = 0.8  # s of power that a thermocouple of about half that lag has not shown
SLOW: Final = 1.0  # s; in a disc one lags by 0.2 to 0.6 s
UNSHOWN: Final = (
    "its temperatures do not follow the work of the stops: a thermocouple that is late by whole stops, or "
    "not in the disc"
)
USUAL: Final = 4000.0  # J/K
FROM_USUAL: Final = 10.0  # times the usual heat capacity, times its rise of 0.1 % per K
FEW: Final = 5  # samples of the shown temperature at either end


class HeatCapacity(NamedTuple):
    """Of one disc."""

    at_100: float  # J/K
    half: float  # of its interval of 95 %
    rise: float  # 1/K, of at_100
    rise_half: float
    lag: float  # s, of the thermocouple
    temperature: Vector  # (stops,), degC, mean of each
    each: Vector  # (stops,), J/K, of each stop, the lag accounted for
    known: bool  # the stops show it: by no thermocouple that lags by whole stops


def heat_capacity(stops: Stops, columns: Columns) -> HeatCapacity:
    """Return the heat capacity by the stops."""
    disc, radius = columns.disc, columns.brake.effective_radius
    to_car = columns.brake.tyre_radius / radius
    energy, last, shown, mean = [], [], [], []
    lasts = stops.dt * float(np.median(np.diff(stops.first)))
    for begin, end in zip(stops.first[:-1], stops.first[1:], strict=True):
        power = stops.torque[begin:end] * stops.speed[begin:end] / radius
        temperature = stops.temperature[begin:end]
        rates = disc.cooling + disc.cooling_by_speed * to_car * stops.speed[begin:end]
        cooled = float(np.sum(rates * (temperature - AMBIENT))) * stops.dt
        energy.append(float(power.sum()) * stops.dt)
        last.append(power[-max(round(LAST / stops.dt), 1) :].mean())
        shown.append(temperature[-FEW:].mean() - temperature[:FEW].mean() + cooled)
        mean.append(temperature.mean())
    tau, e, p, rise = (np.array(values) for values in (mean, energy, last, shown))
    scale = np.array([DISC_SHARE / USUAL, 1.0, 1e-3])
    most = np.array([FROM_USUAL, lasts, FROM_USUAL])

    def left(scaled: Vector) -> Vector:
        xi, lag, by_heat = scale * scaled
        return np.asarray(xi * (e - lag * p) / (1.0 + by_heat * (tau - AT)) - rise)

    least = np.array([1.0 / FROM_USUAL, -lasts, -FROM_USUAL])
    found = least_squares(left, np.array([1.0, 0.0, 0.0]), bounds=(least, most))
    free = len(rise) - len(scale)
    covariance = 2.0 * float(found.cost) / free * np.linalg.pinv(found.jac.T @ found.jac)
    deviations = scale * np.sqrt(np.diag(covariance)) * quantile(free)
    xi, lag, by_heat = (float(value) for value in scale * found.x)
    at_100 = DISC_SHARE / xi
    known = not found.active_mask[0] and found.active_mask[1] < 1 and float(deviations[0]) < 0.5 * xi
    return HeatCapacity(
        at_100,
        at_100 * float(deviations[0]) / xi,
        by_heat,
        float(deviations[2]),
        lag,
        tau,
        DISC_SHARE * (e - lag * p) / rise,
        known,
    )


def undelayed(stops: Stops, found: HeatCapacity, columns: Columns) -> Stops:
    """Return the stops with the temperature that the disc had when a lagging thermocouple showed less."""
    if not found.known or found.lag < SLOW:
        return stops
    late = round(found.lag / stops.dt)
    temperature = stops.temperature.copy()
    for begin, end in zip(stops.first[:-1], stops.first[1:], strict=True):
        power = stops.torque[begin:end] * stops.speed[begin:end] / columns.brake.effective_radius
        energy = np.cumsum(power) * stops.dt
        hidden = energy - np.concatenate([np.zeros(late), energy])[: len(energy)]
        temperature[begin:end] += DISC_SHARE / found.at_100 * hidden
    return replace(stops, temperature=temperature)
