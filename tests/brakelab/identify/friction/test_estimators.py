"""Estimators of section 2.4 on short trips."""

from dataclasses import replace

import numpy as np
import pytest

from brakelab.identify.friction import trips
from brakelab.identify.friction.candidate import Candidate
from brakelab.identify.friction.candidates import candidates
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.estimators import (
    CONSTANT,
    NETWORK,
    OSTERMEYER,
    SURFACE,
    error_by_temperature,
    errors_by_manoeuvre,
    estimators,
    quasi_static,
    steady,
)
from brakelab.identify.friction.fit import error_of, fit, refit, replayed
from brakelab.identify.friction.stops import Stops, block_inputs, some
from brakelab.identify.friction.trips import Trip, drive, manoeuvres
from brakelab.plant.linings import Lining

pytestmark = pytest.mark.study


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


def named(name: str, stops: Stops, columns: Columns) -> Candidate:
    return next(one for one in candidates(stops, columns.brake) if one.name == name)


def test_a_second_order_surface_finds_a_second_order_surface(stops: Stops, columns: Columns) -> None:
    """Up to the edge of the middle 98 % of speeds and pressures, beyond which it is held."""
    speed, pressure, _ = block_inputs(stops).T
    made = 0.3 + 0.01 * speed - 5e-4 * speed**2 + 1e-8 * pressure - 5e-16 * pressure**2
    made = replace(stops, mu=made)
    found = fit(named("quadratic", made, columns), columns.brake, steady(made))
    within = np.all([abs(x - x.mean()) < 0.9 * (x.max() - x.mean()) for x in (speed, pressure)], axis=0)
    assert np.count_nonzero(within) > 500
    law = replayed(found.law, columns.brake, made, False)
    assert law[within] == pytest.approx(made.mu[within], abs=1e-3)


def test_the_ranking_of_table_2_1(two_trips: tuple[Trip, Trip], lining: Lining) -> None:
    """The network first over all manoeuvres, of which a trip of 40 brakings has few each (in each of them:
    `bench lab`); a wrong temperature costs it, and the surface nothing."""
    first, second = two_trips
    found = estimators(first.stops, lining.brake, 0)
    radius = lining.brake.tyre_radius / lining.brake.effective_radius
    errors = errors_by_manoeuvre(found, second, radius)
    print(errors)
    whole = {
        name: np.mean([e.nrmse for e in errors[name].values()]) for name in (NETWORK, OSTERMEYER, SURFACE)
    }
    assert min(whole, key=lambda name: whole[name]) == NETWORK
    wrong = {name: error_by_temperature(found[name], second.stops, 0.6) for name in found}
    right = {name: error_by_temperature(found[name], second.stops, 1.0) for name in found}
    assert wrong[SURFACE] == right[SURFACE]
    assert wrong[CONSTANT] == right[CONSTANT]
    assert wrong[NETWORK] > 1.5 * right[NETWORK]


def test_static_lugre_finds_its_own_numbers(stops: Stops, columns: Columns) -> None:
    """Stribeck's fall of 0.08 below 2.5 m/s on 0.38, and 0.002 s/m: known again where blocks are steady."""
    v = block_inputs(stops)[:, 0]
    true = 0.38 + 0.08 * np.exp(-((v / 2.5) ** 2)) + 0.002 * v
    noise = 0.003 * np.random.default_rng(3).standard_normal(len(v))
    made = replace(stops, mu=true + noise)
    found = fit(named("static_lugre", made, columns), columns.brake, steady(made))
    assert replayed(found.law, columns.brake, stops, False) == pytest.approx(true, abs=2e-3)
    off = np.array(found.values) - (0.38, 0.08, 2.5, 0.002)
    assert np.all(np.abs(off) < 2.0 * found.half + 1e-3)


def test_the_network_is_a_law_that_runs_in_closed_loop(stops: Stops, columns: Columns) -> None:
    """Trained on three of four stops it knows the others better than a constant; and again on others."""
    fourth = np.arange(len(stops)) % 4 == 3
    seen, unseen = some(stops, np.flatnonzero(~fourth)), some(stops, np.flatnonzero(fourth))
    errors = {}
    for name in ("constant", "network"):
        candidate = named(name, seen, columns)
        fitted = fit(candidate, columns.brake, seen)
        errors[name] = error_of(fitted.law, columns.brake, unseen, closed=True)
        again = refit(fitted, columns.brake, unseen)
        assert error_of(again, columns.brake, unseen) <= errors[name]
    print(errors)
    assert errors["network"] < 0.7 * errors["constant"]
    assert 1 <= fitted.agreed <= fitted.tried == 4
    assert candidate.size == 93
    assert fitted.unidentified() == []


def test_quasi_static_leaves_out_what_changes(stops: Stops) -> None:
    """Constant pressure passes; pressure that rises by a tenth within 50 ms does not."""
    assert np.mean(quasi_static(stops)) > 0.9
    lengths = np.diff(stops.first)
    t = stops.dt * np.concatenate([np.arange(length) for length in lengths])
    assert np.mean(quasi_static(replace(stops, pressure=stops.pressure * np.exp(2.0 * t)))) < 0.1


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_an_error_has_a_mean_part_and_scatter(two_trips: tuple[Trip, Trip], lining: Lining) -> None:
    """An estimator 0.02 above the truth everywhere errs by that alone; the mean is left with its scatter."""
    trip = two_trips[0]
    radius = lining.brake.tyre_radius / lining.brake.effective_radius
    found = {CONSTANT: lambda stops: np.full(len(stops.mu), 0.4), SURFACE: lambda stops: stops.mu + 0.02}
    errors = errors_by_manoeuvre(found, trip, radius)
    kinds = {kind: which for kind, which in manoeuvres(trip.stops, radius).items() if len(which)}
    assert len(kinds) >= 2
    for kind, which in kinds.items():
        mu = trip.stops.mu[np.isin(trip.stops.block_stop, which)]
        assert list(errors[SURFACE][kind]) == pytest.approx([2.0 / mu.mean()] * 2)
        assert errors[CONSTANT][kind].mean == pytest.approx(100.0 * (0.4 / mu.mean() - 1.0))
        scatter = np.hypot(errors[CONSTANT][kind].mean, 100.0 * mu.std() / mu.mean())
        assert errors[CONSTANT][kind].nrmse == pytest.approx(scatter)
