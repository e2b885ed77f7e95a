"""Emission of one brake application at each corner, from its rows, by the models that the ECU runs.

The same means as `ecu/algorithm/monitoring/dust.py` takes, of what results hold. Outside what a model was
trained on, and where there is none, nothing is counted.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.results.prediction import Vector, corners
from ecu.algorithm.monitoring.dust import LEAST_WORK, MOVING
from ecu.algorithm.monitoring.emission_factor import emission_factor, inside
from ecu.contract.dust import NONE
from ecu.contract.params import BAR
from ecu.contract.records import RecordArray
from ecu.contract.signals import OUTPUT

PERIOD: Final = 0.01  # s, one row
TWO_SIDED: Final = 1.96  # standard deviations, 95 %

Corners = NDArray[np.float64]


class Dust(NamedTuple):
    """Of an application, log10 of particles, shapes (4,); NaN: not available."""

    factor: Corners
    low: Corners
    """Ends of the 95 % interval."""
    high: Corners


def airborne_mass(worn: Corners, error: Corners, params: RecordArray) -> tuple[Corners, Corners, Corners]:
    """Return the airborne mass of `worn` [g] and its 95 % band [mg], shapes (4,).

    `error`: relative standard deviation of the wear. The share in the air is anything within its bounds: no
    signal of a car shows it.
    """
    p = params[0]
    worn = np.maximum(worn, 0.0)
    low, high = worn * np.maximum(1.0 - TWO_SIDED * error, 0.0), worn * (1.0 + TWO_SIDED * error)
    return 1e3 * p["airborne_share"] * worn, 1e3 * p["airborne_low"] * low, 1e3 * p["airborne_high"] * high


def dust_of(rows: Vector, params: RecordArray) -> Dust:
    """Return the emission of the application of `rows`, shape (n, N_ROW)."""
    p = params[0]
    found = Dust(*np.full((3, 4), np.nan))
    speed = rows[:, OUTPUT["vehicle_speed"]]
    part = rows[speed > MOVING]
    if not len(part) or (p["dust_model"] == NONE).all():
        return found
    speed = part[:, OUTPUT["vehicle_speed"]]
    torque, heat = corners(part, "brake_torque"), corners(part, "disc_temperature")
    pressure = corners(part, "calliper_pressure") - p["push_out_pressure"] / BAR
    work = PERIOD * np.sum(torque * speed[:, None], axis=0) / p["wheel_radius"]
    for i in range(4):
        features = np.array(
            [speed[0], speed[-1], torque[:, i].mean(), heat[:, i].mean(), PERIOD * len(part),
             pressure[:, i].mean()]
        )  # fmt: skip
        model = int(p["dust_model"][i])
        if model == NONE or work[i] <= LEAST_WORK:
            continue
        if not inside(p["dust_low"][i], p["dust_high"][i], features):
            continue
        found.factor[i] = emission_factor(model, p["dust_numbers"][i], features)
        found.low[i] = found.factor[i] + p["dust_below"][i]
        found.high[i] = found.factor[i] + p["dust_above"][i]
    return found
