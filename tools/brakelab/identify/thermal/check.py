"""Logs that cannot identify the temperature model of a disc: each refused with one line."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.identify.measurement_files import WARMEST_COLD
from brakelab.identify.thermal.fit import Disc, Fit, fit_axle
from brakelab.identify.thermal.model import ROW, Cooling, Series
from brakelab.identify.thermal.reader import ThermalLog
from brakelab.stretches import stretches
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

SHORTEST_LOG: Final = 300.0  # s
FEWEST_APPLICATIONS: Final = 3  # brake applications
LEAST_ROWS: Final = 200  # with a measured temperature
LEAST_RISE: Final = 15.0  # K
STILL: Final = 2.0  # K, of a sensor that shows nothing
BELOW_AIR: Final = 15.0  # K
STUCK: Final = 30.0  # s at its highest value, to a thousandth of its range
STUCK_LOW: Final = 60.0  # s at its lowest, above the air
SEEN: Final = 0.5  # share of the cycles
UNLIKE: Final = 1.5  # of the spread of the temperatures of an axle, greater over smaller
LIKELY: Final = (0.4, 2.5)  # of xi over the configuration's
BETTER: Final = 0.8  # of the residual, if read in degF


def _longest_run(there: NDArray[np.bool_]) -> int:
    begin, end = stretches(there).T
    return int(np.max(end - begin, initial=0))


def check_drive(drive: ThermalLog) -> list[int]:
    """Return the corners with a measured temperature that can be used.

    Raises:
        UserError: nothing can be identified from this log.
    """
    path, series = str(drive.path), drive.series
    found = np.isfinite(series.measured)
    corners = [i for i in range(4) if found[:, i].any()]
    if not corners:
        remedy = "not in this log; give the disc's thermocouples in degC under these names (or in the map)"
        raise UserError(path, "disc_temperature_measured_*", remedy)
    length = ROW * len(series.speed)
    if length < SHORTEST_LOG:
        raise UserError(
            path, "t", f"lasts {length:.0f} s; a disc heats and cools over {SHORTEST_LOG:.0f} s and more"
        )
    for i in corners:
        if drive.wheels_seen[i] < SEEN:
            share = f"{100 * drive.wheels_seen[i]:.0f} % of the drive"
            remedy = f"known in {share}; the friction power needs it"
            raise UserError(path, f"wheel_speed_{CORNERS[i]}", remedy)
        if drive.pressures_seen[i] < SEEN:
            remedy = "mostly missing; the friction torque comes from it"
            raise UserError(path, f"calliper_pressure_{CORNERS[i]}", remedy)
    if drive.applications < FEWEST_APPLICATIONS:
        remedy = (
            f"{drive.applications} brake applications; give {FEWEST_APPLICATIONS} or more that warm the discs"
        )
        raise UserError(path, "calliper_pressure_*", remedy)
    for i in corners:
        _check_sensor(path, series, i)
    for left in (0, 2):
        if left in corners and left + 1 in corners:
            _check_alike(path, series, left)
    return corners


def _check_alike(path: str, series: Series, left: int) -> None:
    """Refuse discs of an axle of which one heats and cools far more than the other."""
    both = np.isfinite(series.measured[:, left : left + 2]).all(axis=1)
    if np.count_nonzero(both) < LEAST_ROWS:
        return
    spread = series.measured[both, left : left + 2].std(axis=0)
    more, less = (left, left + 1) if spread[0] > spread[1] else (left + 1, left)
    ratio = float(spread.max() / spread.min())
    if ratio > UNLIKE:
        remedy = (
            f"rises and falls {ratio:.1f} times as much as {CORNERS[less]}: degF? give both in degC, or "
            "leave the wrong one out"
        )
        raise UserError(path, f"disc_temperature_measured_{CORNERS[more]}", remedy)


def _check_sensor(path: str, series: Series, corner: int) -> None:
    name = f"disc_temperature_measured_{CORNERS[corner]}"
    seen = np.isfinite(series.measured[:, corner])
    values, air = series.measured[seen, corner], series.air[seen]
    if len(values) < LEAST_ROWS:
        remedy = f"{len(values)} s with a sample; log it once a second or faster, throughout"
        raise UserError(path, name, remedy)
    low, high = float(values.min()), float(values.max())
    if high - low < STILL:
        raise UserError(path, name, f"stays at {low:.1f} for the whole log; is its sensor connected?")
    if low > WARMEST_COLD:
        raise UserError(path, name, f"{low:.0f} to {high:.0f}, never below: K? convert it to degC")
    under = float(np.percentile(air - values, 99.0)) if series.air_known else 0.0
    if under > BELOW_AIR:
        remedy = f"{under:.0f} K below the air, which no disc is; both must be in degC"
        raise UserError(path, name, remedy)
    near = 1e-3 * (high - low)
    top = _longest_run(values >= high - near) * ROW
    if top >= STUCK and high - low >= LEAST_RISE:
        remedy = f"stays at its highest, {high:.1f} degC, for {top:.0f} s: saturated; widen its range"
        raise UserError(path, name, remedy)
    bottom = _longest_run(values <= low + near) * ROW
    if bottom >= STUCK_LOW and low > float(air.max()) + BELOW_AIR:
        remedy = f"stays at its lowest, {low:.1f} degC, for {bottom:.0f} s: its range begins there"
        raise UserError(path, name, remedy)
    if high - low < LEAST_RISE:
        remedy = f"rises by {high - low:.0f} K; brake harder and more often, {LEAST_RISE:.0f} K at least"
        raise UserError(path, name, remedy)


def check_fit(path: str, discs: list[Disc], fit: Fit, heating: float, start: Cooling) -> None:
    """Refuse a fit that says that the temperature is in degF, or not this brake's.

    Raises:
        UserError: it does.
    """
    ratio = fit.heating / heating
    name = f"disc_temperature_measured_{CORNERS[discs[0].corner]}"
    if all(_warm_enough(disc) for disc in discs):
        turned = [Disc(_in_celsius(disc.series), disc.corner) for disc in discs]
        again = fit_axle(turned, heating, start)
        nearer = abs(np.log(again.heating / heating)) < abs(np.log(ratio))
        if nearer and 1.8 * again.noise < BETTER * fit.noise:
            remedy = f"rises {ratio:.1f} times what the work warms the disc: degF? convert it to degC"
            raise UserError(path, name, remedy)
    if not LIKELY[0] < ratio < LIKELY[1]:
        remedy = (
            f"rises {ratio:.1f} times what the work warms the disc by disc_heating of CONFIG; is it this "
            "wheel's, in degC, and are the brakes those of CONFIG?"
        )
        raise UserError(path, name, remedy)


def _warm_enough(disc: Disc) -> bool:
    """Return whether every reading could be one in degF of a disc that is no colder than the air."""
    series, seen = disc.series, disc.seen
    coldest = series.measured[seen, disc.corner] - (1.8 * series.air[seen] + 32.0)
    return float(coldest.min()) > -BELOW_AIR


def _in_celsius(series: Series) -> Series:
    return series._replace(measured=(series.measured - 32.0) / 1.8)
