"""Quality of a thermal fit: predicted beside measured temperature, with band; and keys for a CONFIG."""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.config_file import Section
from brakelab.identify.thermal.fit import (
    BY_SPEED,
    BY_SPEED_WET,
    HEATING,
    OFFSET,
    OFFSET_NO_AIR,
    STILL,
    STILL_WET,
    Disc,
    Fit,
)
from brakelab.identify.thermal.model import Cooling, lagged, respond
from ecu.settings.config import Axle

HEAT_CAPACITY: Final = 0.02
"""Relative: c_p where other drives are hotter or colder (section 3.4: 450 to 550 J/(kg K)). Assumption."""
AIR_FLOW: Final = 0.05
"""Relative: wind, traffic ahead and load change the cooling from drive to drive. Assumption."""
RAIN: Final = 0.21
"""Relative: the water of the day that was identified and of another, 15 % of the cooling each. Assumption."""
WARMS: Final = "brake harder and more often, from higher speeds"
RESTS: Final = "let the hot discs cool for ten minutes, standing or at walking pace"
CRUISES: Final = "cruise at 100 km/h and more for ten minutes, the discs hot before"
REMEDIES: Final = {
    HEATING: WARMS,
    STILL: RESTS,
    BY_SPEED: CRUISES,
    STILL_WET: f"in rain: {RESTS}",
    BY_SPEED_WET: f"in rain: {CRUISES}",
}
SYMBOLS: Final = {
    HEATING: "ξ",
    STILL: "δ0",
    BY_SPEED: "δ1",
    STILL_WET: "δ0 in rain",
    BY_SPEED_WET: "δ1 in rain",
}
KEYS: Final = {
    HEATING: ("disc_heating", "K/J"),
    STILL: ("disc_cooling", "1/s"),
    BY_SPEED: ("disc_cooling_by_speed", "1/m"),
    STILL_WET: ("disc_cooling_wet", "1/s"),
    BY_SPEED_WET: ("disc_cooling_by_speed_wet", "1/m"),
}


class Errors(NamedTuple):
    """Relative standard deviations that the ECU is given."""

    heating: float
    cooling: float
    wet: float


class Prediction(NamedTuple):
    """One disc in one log, predicted and measured; shapes (n,)."""

    predicted: Array
    """By the fit from the fitted start, as the sensor shows it [degC]."""
    sigma: Array
    """K"""
    before: float
    """RMSE of the start configuration, its own best start [K]."""
    after: float
    inside: float
    """Share of the seen rows inside two sigma."""


def start_of(axle: Axle) -> Cooling:
    """Return the rates of a configuration."""
    return Cooling(axle.disc_cooling, axle.disc_cooling_by_speed, *axle.wet_cooling())


def values_of(heating: float, cooling: Cooling) -> tuple[float, ...]:
    """Return the five parameters in the order of their places."""
    return heating, *cooling


def errors_of(fit: Fit, axle: Axle) -> Errors:
    """Return the errors of a fit, widened by the spread between drives; without data those configured."""
    heating = (
        float(np.hypot(fit.stated[0], HEAT_CAPACITY)) if fit.identified[HEATING] else axle.sigma_disc_heating
    )
    cooling, wet = axle.sigma_disc_cooling, axle.sigma_disc_cooling_wet
    if fit.identified[[STILL, BY_SPEED]].any():
        cooling = float(np.hypot(fit.stated[1], AIR_FLOW))
    if fit.identified[[STILL_WET, BY_SPEED_WET]].any():
        wet = float(np.linalg.norm([fit.stated[2], AIR_FLOW, RAIN]))
    return Errors(*(min(max(value, 0.01), 0.9) for value in (heating, cooling, wet)))


def predict(
    disc: Disc, heating: float, cooling: Cooling, errors: Errors, friction: Array, lag: float, start: float
) -> tuple[Array, Array]:
    """Return temperature [degC] as its sensor shows it and standard deviation [K], as the ECU forms it.

    `friction`: relative standard deviation of the friction, shape (n,); `start` [K] above the air, known.
    """
    series = disc.series
    rate, power = cooling.rate(series.speed, series.wet), series.power[:, disc.corner]
    heat, decay = respond(rate, power)
    excess = heating * heat + start * decay
    by_heating = respond(rate, heating * power * np.hypot(errors.heating, friction))[0]
    by_cooling = respond(rate, rate * excess * np.where(series.wet, errors.wet, errors.cooling))[0]
    air = OFFSET if series.air_known else OFFSET_NO_AIR
    return lagged(series.air + excess, lag), np.sqrt(by_heating**2 + by_cooling**2 + air**2)


def judge(disc: Disc, friction: Array, fit: Fit, number: int, errors: Errors, before: Fit) -> Prediction:
    """Return the fit of disc `number` beside the measurement; `before` is that of the configuration."""
    seen = disc.seen
    measured = disc.series.measured[seen, disc.corner]

    def rmse(predicted: Array) -> float:
        return float(np.sqrt(np.mean((predicted[seen] - measured) ** 2)))

    said, sigma = predict(
        disc, fit.heating, fit.cooling, errors, friction, fit.lag, float(fit.starts[number])
    )
    old, _ = predict(
        disc, before.heating, before.cooling, errors, friction, before.lag, float(before.starts[number])
    )
    inside = float(np.mean(np.abs(said[seen] - measured) <= 2.0 * sigma[seen]))
    return Prediction(said, sigma, rmse(old), rmse(said), inside)


def section_of(fit: Fit, axle: Axle, errors: Errors, about: str) -> Section:
    """Return the fitted keys of one axle; `about` names logs and errors."""
    found: Section = {}
    given = axle.disc_cooling_wet is not None or axle.disc_cooling_by_speed_wet is not None
    for place, value in enumerate(values_of(fit.heating, fit.cooling)):
        key, unit = KEYS[place]
        if fit.identified[place]:
            sigma = value * float(fit.sigma[place])
            found[key] = (f"{value:.4g}", f"{unit}, ± {sigma:.2g}; {about}")
        elif place >= STILL_WET and (given or fit.identified[[STILL_WET, BY_SPEED_WET]].any()):
            found[key] = (f"{value:.4g}", f"{unit}, not identified: by its ratio to the dry one")
    found["sigma_disc_heating"] = (f"{errors.heating:.3g}", "relative, with c_p by temperature")
    found["sigma_disc_cooling"] = (f"{errors.cooling:.3g}", "relative, with wind and load of other days")
    if fit.identified[[STILL_WET, BY_SPEED_WET]].any():
        found["sigma_disc_cooling_wet"] = (f"{errors.wet:.3g}", "relative, with other rain")
    return found
