"""Cars whose disc temperature model is identified on one dry and one rainy trip, and judged on others.

The measured discs are those of `plant/disc_nodes.py`, the ECU's torque is its own. Between two trips the car
rests for a night, which the daemon knows by its store.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Array
from brakelab.identify.thermal.command import AXLES, judge_axle, with_fits
from brakelab.identify.thermal.fit import Disc
from brakelab.identify.thermal.model import Cooling, respond
from brakelab.identify.thermal.page import Judged
from brakelab.identify.thermal.reader import ThermalLog
from brakelab.identify.thermal.result import start_of
from brakelab.simulation.closed_loop import new_loop
from brakelab.simulation.configured import configured
from brakelab.studies.thermal.drives import BEYOND_TOWN, Measured, drive_measured, measured_trip
from ecu.algorithm.step import new_state
from ecu.contract.records import RecordArray
from ecu.recording.rest import cool_discs
from ecu.settings.config import Axle, Config

NIGHT: Final = 10 * 3600.0  # s
WHOLE: Final = 10_000.0
LEARNT: Final = 600.0  # s of driving before the first trip that is measured


class Trip(NamedTuple):
    """One trip of the study."""

    name: str
    driver: str
    air: float
    """degC"""
    wetness: float
    from_share: float
    seconds: float


LEARNING: Final = Trip("learning", "usual", 15.0, 0.0, 0.0, LEARNT)
IDENTIFIED: Final = (
    Trip("dry", "usual", 18.0, 0.0, 0.0, WHOLE),
    Trip("rain", "usual", 9.0, 1.0, BEYOND_TOWN, WHOLE),
)
JUDGED: Final = (
    Trip("dry", "lively", 26.0, 0.0, 0.0, WHOLE),
    Trip("rain", "calm", 6.0, 1.0, BEYOND_TOWN, WHOLE),
)


class Appraised(NamedTuple):
    """One trip that the model was not identified on; shapes (4,)."""

    trip: str
    before: Array
    """RMSE [K] of the configuration before, from a cold start, by the ECU's power."""
    after: Array
    """RMSE [K] of the ECU itself with the identified keys."""
    bias: Array
    """Mean error of the ECU [K]."""
    inside: Array
    """Share of the rows within two of the ECU's standard deviations."""
    sigma: Array
    """Mean standard deviation that the ECU states [K]."""
    normalised: Array
    """RMS of error over standard deviation."""
    hottest: Array
    """degC"""


class Series(NamedTuple):
    """One trip for the figures."""

    speed: Array
    said: Array
    sigma: Array
    true: Array
    before: Array


class Car(NamedTuple):
    """One car."""

    seed: int
    axles: list[Judged]
    trips: list[Appraised]
    plotted: list[Series]
    unknown_rest: Array
    """RMSE [K] of the ECU with the keys of the dry trip, had the rest been unknown; shape (4,)."""


def _go(
    config: Config, seed: int, number: int, trip: Trip, learned: RecordArray | None
) -> tuple[Measured, RecordArray]:
    scenario = measured_trip(9000 + 10 * seed + number, trip.driver, trip.air, trip.wetness, trip.from_share)
    loop = new_loop(scenario, config, seed)
    if learned is not None:
        cool_discs(learned, loop.sides.params, NIGHT)
        loop.sides.state[:] = new_state(loop.sides.params, learned)
    driven = drive_measured(loop, seed, trip.air, trip.wetness, trip.air, trip.seconds)
    return driven, loop.sides.state["learned"].copy()


def _cold(drive: ThermalLog, config: Config) -> Array:
    """Return temperatures [degC] of a configuration from a cold start by the ECU's power, shape (n, 4)."""
    series = drive.series
    found = []
    for i in range(4):
        axle: Axle = config.front if i < 2 else config.rear
        heat, _ = respond(start_of(axle).rate(series.speed, series.wet), series.power[:, i])
        found.append(series.air + axle.disc_heating * heat)
    return np.column_stack(found)


def _rms(errors: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(errors**2, axis=0)))


def drive_car(seed: int) -> Car:
    """Identify and judge the car of a seed."""
    config = configured()
    air = config.vehicle.ambient_temperature
    _, learned = _go(config, seed, 9, LEARNING, None)
    drives = []
    for number, trip in enumerate(IDENTIFIED):
        driven, learned = _go(config, seed, number, trip, learned)
        drives.append(driven.drive(trip.name, air))
    axles = [
        judge_axle(
            name, drives, [Disc(drive.series, c) for drive in drives for c in corners], getattr(config, name)
        )
        for name, corners in AXLES.items()
    ]
    fitted = with_fits(config, {axle.name: axle.fit for axle in axles})
    trips, plotted = [], []
    unknown = np.full(4, np.nan)
    for number, trip in enumerate(JUDGED, len(IDENTIFIED)):
        kept = learned.copy()
        driven, learned = _go(fitted, seed, number, trip, learned)
        drive = driven.drive(trip.name, air)
        error = driven.said - driven.true
        cold = _cold(drive, config)
        trips.append(
            Appraised(
                trip.name,
                _rms(cold - driven.true),
                _rms(error),
                error.mean(axis=0),
                (np.abs(error) <= 2.0 * driven.sigma).mean(axis=0),
                driven.sigma.mean(axis=0),
                _rms(error / driven.sigma),
                driven.true.max(axis=0),
            )
        )
        plotted.append(Series(drive.series.speed, driven.said, driven.sigma, driven.true, cold))
        if number == len(IDENTIFIED):
            rates = [start_of(fitted.front if i < 2 else fitted.rear) for i in range(4)]
            left = 0.5 * kept[0]["disc_excess"]
            unknown = _rms(
                error + np.column_stack([_decay(rate, drive, left[i]) for i, rate in enumerate(rates)])
            )
    return Car(seed, axles, trips, plotted, unknown)


def _decay(rate: Cooling, drive: ThermalLog, excess: float) -> NDArray[np.float64]:
    """Return the remainder of a wrong start of `excess` [K], shape (n,)."""
    series = drive.series
    _, decay = respond(rate.rate(series.speed, series.wet), series.power[:, 0])
    return np.asarray(excess * decay)
