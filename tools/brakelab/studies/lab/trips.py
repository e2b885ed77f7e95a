"""The estimators of section 2.4 on each pad's second trip: Table 2.1 and the data of Figures 2.6 to 2.9."""

from itertools import product
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Matrix, Vector
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.estimators import (
    NETWORK,
    SURFACE,
    Error,
    Estimator,
    error_by_temperature,
    errors_by_manoeuvre,
    estimators,
)
from brakelab.identify.friction.stops import Stops, block_inputs
from brakelab.identify.friction.trips import Trip, drive, manoeuvres
from brakelab.studies.lab.brakes import columns_of, linings
from brakelab.studies.physics.heat import BRAKES

PADS: Final = tuple(product(BRAKES, range(1, 6)))
"""Brake and seed of the pads; Figures 2.6 to 2.8 are drawn of the first."""
FACTORS: Final = (0.6, 0.8, 1.0, 1.2, 1.4)  # of a wrong temperature
CELLS: Final = 20  # of a map, along each axis
CLOSE: Final = 30.0  # K, about the temperature of a map


class Map(NamedTuple):
    """An estimator over speed and pressure at one temperature, where the trip was."""

    speed: Vector  # (CELLS + 1,), m/s, sliding, edges
    pressure: Vector  # (CELLS + 1,), Pa
    temperature: float  # degC
    mu: Matrix  # (CELLS of pressure, CELLS of speed), NaN where no block of the trip is


class Trace(NamedTuple):
    """One brake application; all of shape (blocks,)."""

    t: Vector  # s
    speed: Vector  # m/s, of the car
    temperature: Vector  # degC, measured
    lumped: Vector  # degC, of the lumped model
    mu: Vector
    estimates: dict[str, Vector]


class OnTrips(NamedTuple):
    """All of a pad's second trip."""

    errors: dict[str, dict[str, Error]]  # by estimator and manoeuvre
    wrong: dict[str, list[float]]  # nRMSE [%] by estimator, at FACTORS
    maps: dict[str, Map]
    traces: dict[str, Trace]  # by manoeuvre


def trips(pad: tuple[str, int]) -> OnTrips:
    """Return the estimators' errors and their traces on one of `PADS`."""
    brake, seed = pad
    lining = linings().lining[brake]
    columns = columns_of(lining)
    bench = new_bench(lining, brake, seed)
    first, second = drive(bench, columns, 1), drive(bench, columns, 2)
    found = estimators(first.stops, lining.brake, seed)
    radius = lining.brake.tyre_radius / lining.brake.effective_radius
    wrong = {
        name: [error_by_temperature(estimator, second.stops, factor) for factor in FACTORS]
        for name, estimator in found.items()
    }
    maps = {name: map_of(found[name], first.stops) for name in (SURFACE, NETWORK)}
    errors = errors_by_manoeuvre(found, second, radius)
    return OnTrips(errors, wrong, maps, traces(found, second, radius))


def over_pads(found: list[OnTrips]) -> dict[str, dict[str, Vector]]:
    """Return the nRMSE [%] by estimator and manoeuvre, shape (pads,) each."""
    return {
        name: {kind: np.array([pad.errors[name][kind].nrmse for pad in found]) for kind in errors}
        for name, errors in found[0].errors.items()
    }


def median_wrong(found: list[OnTrips]) -> dict[str, Vector]:
    """Return the median nRMSE [%] of the pads by estimator, at `FACTORS`."""
    return {name: np.median([pad.wrong[name] for pad in found], axis=0) for name in found[0].wrong}


def map_of(estimator: Estimator, stops: Stops) -> Map:
    """Return the mean estimate of the blocks in each cell of speed and pressure.

    Only of blocks near the median temperature: an estimator is asked nothing that the trip did not hold.
    """
    inputs = block_inputs(stops)
    middle = float(np.median(inputs[:, 2]))
    near = np.abs(inputs[:, 2] - middle) < CLOSE
    speed, pressure = (np.linspace(0.0, inputs[:, k].max(), CELLS + 1) for k in (0, 1))
    edges = (pressure, speed)
    values = estimator(stops)[near]
    places = (inputs[near, 1], inputs[near, 0])
    total, _, _ = np.histogram2d(*places, bins=edges, weights=values)
    count, _, _ = np.histogram2d(*places, bins=edges)
    with np.errstate(invalid="ignore"):
        return Map(speed, pressure, middle, total / count)


def traces(found: dict[str, Estimator], trip: Trip, radius: float) -> dict[str, Trace]:
    """Return the longest braking of each kind."""
    stops = trip.stops
    estimates = {name: estimator(stops) for name, estimator in found.items()}
    speed, _, temperature = block_inputs(stops).T
    lumped = block_inputs(trip.lumped)[:, 2]
    out = {}
    for kind, which in manoeuvres(stops, radius).items():
        stop = which[int(np.argmax(stops.first[which + 1] - stops.first[which]))]
        at = stops.block_stop == stop
        out[kind] = Trace(
            (stops.block_first[at] - stops.first[stop]) * stops.dt,
            radius * speed[at],
            temperature[at],
            lumped[at],
            stops.mu[at],
            {name: values[at] for name, values in estimates.items()},
        )
    return out
