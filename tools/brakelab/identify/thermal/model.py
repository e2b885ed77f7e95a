"""Temperature of one disc over a drive, in closed form: the ECU's own model (3.7) and a sensor that lags.

    theta' = xi P - delta theta        delta = delta_0 + delta_1 v, dry or wet
    theta(t) = exp(-D) (theta_0 + xi integral P exp(D) dt)        D(t) = integral delta dt
    y' = (air + offset + theta - y) / lag

P is the friction power that the ECU believes, constant over a row, as are v and rain. Linear in xi, theta_0
and the offset. Source: section 3.4; `ecu/algorithm/monitoring/disc_temperature.py` runs the same at 100 Hz.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from brakelab.arrays import Array

ROW: Final = 1.0  # s, of one row
GREATEST_EXPONENT: Final = 600.0  # of D within one piece: exp stays finite


class Series(NamedTuple):
    """One drive on rows of `ROW` seconds."""

    name: str
    power: Array
    """Friction power by the ECU [W], shape (n, 4)."""
    speed: Array
    """m/s, shape (n,)."""
    wet: NDArray[np.bool_]
    """Rain is reported, shape (n,)."""
    air: Array
    """degC, shape (n,)."""
    air_known: bool
    """Measured; else the configuration's."""
    measured: Array
    """Disc temperature [degC], mean of a row, NaN without a sample, shape (n, 4)."""


class Cooling(NamedTuple):
    """delta_0 [1/s] and delta_1 [1/m], dry and wet."""

    still: float
    by_speed: float
    still_wet: float
    by_speed_wet: float

    def rate(self, speed: Array, wet: NDArray[np.bool_]) -> Array:
        """Return delta [1/s], shape (n,)."""
        dry = self.still + self.by_speed * np.abs(speed)
        return np.where(wet, self.still_wet + self.by_speed_wet * np.abs(speed), dry)


def respond(rate: Array, power: Array) -> tuple[Array, Array]:
    """Return the excess at the end of every row per xi and per starting excess.

    Args:
        rate: delta [1/s], shape (n,).
        power: W, shape (n,).
    """
    depth = np.concatenate([[0.0], np.cumsum(rate) * ROW])
    stays = np.exp(-rate * ROW)
    warmed = power * (1.0 - stays) / rate  # J that are left of a row at its end
    heat, decay = np.empty_like(power), np.exp(-depth[1:])
    carried, first = 0.0, 0
    while first < len(power):
        last = int(np.searchsorted(depth, depth[first] + GREATEST_EXPONENT, "right")) - 1
        last = min(max(last, first + 1), len(power))
        grown = np.exp(depth[first + 1 : last + 1] - depth[first])
        heat[first:last] = (carried + np.cumsum(warmed[first:last] * grown)) / grown
        carried, first = float(heat[last - 1]), last
    return heat, decay


def lagged(values: Array, lag: float) -> Array:
    """Return the reading of a sensor of time constant `lag` [s], settled at the first value, shape (n,)."""
    stays = float(np.exp(-ROW / lag))
    shown, _ = lfilter([1.0 - stays], [1.0, -stays], values, zi=[stays * values[0]])
    return np.asarray(shown)
