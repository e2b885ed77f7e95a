"""Estimators of section 2.4 on short trips."""

from dataclasses import replace

import numpy as np
import pytest

from brakelab.friction_lab import trips
from brakelab.friction_lab.columns import Columns
from brakelab.friction_lab.dynamometer import new_bench
from brakelab.friction_lab.estimators import (
    CONSTANT,
    NETWORK,
    OSTERMEYER,
    SURFACE,
    block_inputs,
    error_by_temperature,
    errors_by_manoeuvre,
    estimators,
    response_surface,
)
from brakelab.friction_lab.stops import Stops
from brakelab.friction_lab.trips import Trip, drive, manoeuvres
from brakelab.plant.linings import Lining


@pytest.fixture(scope="module")
def two_trips(lining: Lining, columns: Columns) -> tuple[Trip, Trip]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trips, "BRAKINGS", 40)
        bench = new_bench(lining, "A", 1)
        return drive(bench, columns, 1), drive(bench, columns, 2)


def test_a_trip_brakes_gently_most_of_the_time(two_trips: tuple[Trip, Trip], lining: Lining) -> None:
    stops = two_trips[0].stops
    radius = lining.brake.tyre_radius / lining.brake.effective_radius
    ends = stops.first[1:] - 1
    slowed = radius * (stops.start_speed - stops.speed[ends]) / ((ends - stops.first[:-1]) * stops.dt)
    assert np.mean(slowed < 2.0) > 0.75
    assert set(manoeuvres(stops, radius)) == set("ABCD")


def test_the_lumped_temperature_is_near_but_not_the_measured(two_trips: tuple[Trip, Trip]) -> None:
    trip = two_trips[0]
    off = trip.lumped.temperature - trip.stops.temperature
    assert 2.0 < np.sqrt(np.mean(off**2)) < 60.0
    assert trip.lumped.mu == pytest.approx(trip.stops.mu)


def test_a_second_order_surface_finds_a_second_order_surface(stops: Stops) -> None:
    """Up to the edge of the quasi-static blocks, beyond which it is held."""
    speed, pressure, _ = block_inputs(stops).T
    made = 0.3 + 0.01 * speed - 5e-4 * speed**2 + 1e-8 * pressure - 5e-16 * pressure**2
    made = replace(stops, mu=made)
    assert response_surface(made)(made) == pytest.approx(made.mu, abs=1e-3)


def test_the_ranking_of_table_2_1(two_trips: tuple[Trip, Trip], lining: Lining) -> None:
    """The network first in every manoeuvre; a wrong temperature costs it, and the surface nothing."""
    first, second = two_trips
    found = estimators(first.stops, lining.brake, 0)
    radius = lining.brake.tyre_radius / lining.brake.effective_radius
    errors = errors_by_manoeuvre(found, second, radius)
    print(errors)
    for kind in "ABCD":
        if len(manoeuvres(second.stops, radius)[kind]) > 3:
            assert errors[NETWORK][kind] < errors[OSTERMEYER][kind]
    wrong = {name: error_by_temperature(found[name], second.stops, 0.6) for name in found}
    right = {name: error_by_temperature(found[name], second.stops, 1.0) for name in found}
    assert wrong[SURFACE] == right[SURFACE]
    assert wrong[CONSTANT] == right[CONSTANT]
    assert wrong[NETWORK] > 1.5 * right[NETWORK]
