"""Identification from data of a known law, and the confidence that goes with it."""

from collections.abc import Callable

import numpy as np
import pytest

from brakelab.identify.friction.candidates import Candidate, candidates
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.fit import clustered, error_of, fit, replayed
from brakelab.identify.friction.profile import profile_interval
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.stops import Stops, find_stops, some
from brakelab.plant.friction.constant import Constant
from brakelab.plant.friction.ostermeyer import Ostermeyer
from brakelab.plant.friction.table import Table
from brakelab.plant.linings import Lining, rig_with

pytestmark = pytest.mark.study

TRUTH = {"kappa_0": 0.2687, "kappa_1": 0.3075e-3, "a": 24.1e-9, "b": 2.302e-2, "c": 1.226e-10}
DRAWS = 8

Run = Callable[[float, int], Recording]


def named(name: str, stops: Stops, columns: Columns) -> Candidate:
    return next(c for c in candidates(stops, columns.brake) if c.name == name)


@pytest.fixture(scope="module")
def r1_columns(lining: Lining) -> Columns:
    rig = rig_with(lining, "R1")[0]
    return Columns.own(lining, float(rig["mass"] * rig["tyre_radius"] ** 2))


def test_ilvo_is_found_in_its_own_data_within_its_intervals(
    lining: Lining, r1_columns: Columns, ilvo_recording: Run
) -> None:
    """1 % noise: five numbers within their 95 % intervals. 20 draws: `brake-ecu bench lab`."""
    inside = []
    for draw in range(DRAWS):
        stops = find_stops(ilvo_recording(0.01, draw), r1_columns, "x")
        fitted = fit(named("ilvo", stops, r1_columns), lining.brake, stops, seed=draw)
        assert fitted.unidentified() == []
        off = np.array(fitted.values) - np.array(list(TRUTH.values()))
        inside.append(np.abs(off) < fitted.half)
    covered = np.mean(inside, axis=0)
    print(dict(zip(TRUTH, covered, strict=True)), np.mean(inside))
    assert np.mean(inside) >= 0.85


def test_starts_agree_and_the_profile_is_the_interval(
    lining: Lining, r1_columns: Columns, ilvo_recording: Run
) -> None:
    stops = find_stops(ilvo_recording(0.01, 0), r1_columns, "x")
    fitted = fit(named("ilvo", stops, r1_columns), lining.brake, stops)
    assert fitted.agreed == fitted.tried == 4
    interval = profile_interval(fitted, lining.brake, stops, 3)
    assert interval.name == "b"
    half = 0.5 * (interval.high - interval.low)
    assert half == pytest.approx(fitted.half[3], rel=0.1)
    assert 0.5 * (interval.high + interval.low) == pytest.approx(fitted.values[3], rel=1e-3)


def test_what_the_data_do_not_tell_is_named(stops: Stops, columns: Columns) -> None:
    """Ostermeyer's law against the pad: the search ends where its rate is nothing, and says so."""
    fitted = fit(named("ostermeyer", stops, columns), columns.brake, stops)
    assert {"p_1", "p_2"} <= set(fitted.unidentified())


def test_a_constant_is_the_mean(stops: Stops, columns: Columns) -> None:
    fitted = fit(named("constant", stops, columns), columns.brake, stops)
    assert fitted.values[0] == pytest.approx(stops.mu.mean(), abs=1e-5)
    error = 100.0 * np.std(stops.mu) / stops.mu.mean()
    assert error_of(fitted.law, columns.brake, stops) == pytest.approx(error, rel=1e-6)


def test_ostermeyer_replayed_settles_where_it_must(stops: Stops, columns: Columns) -> None:
    """mu' = 0 of 2.1a: mu = p_3 T / (F v + p_2)."""
    law = Ostermeyer(law="ostermeyer", rig_mass=1.0, p_1=1e-4, p_2=3.6e6, p_3=3.6e3, start=0.4)
    found = replayed(law, columns.brake, stops, True)
    at = stops.block_first + stops.per_block // 2
    force = stops.pressure[at] * columns.brake.piston_area
    settled = 3.6e3 * (stops.temperature[at] + 273.15) / (force * stops.speed[at] + 3.6e6)
    assert found == pytest.approx(settled, rel=0.01)


def test_errors_that_hang_together_widen_the_interval() -> None:
    """Mean of clusters: the covariance is that of the cluster means, ten times too small if ignored."""
    random = np.random.default_rng(0)
    cluster = np.repeat(np.arange(200), 100)
    values = random.standard_normal(200)[cluster]
    found = clustered(np.ones((20_000, 1)), values - values.mean(), cluster, 200)
    assert float(np.sqrt(found[0, 0])) == pytest.approx(1.0 / np.sqrt(200.0), rel=0.1)


def test_a_law_that_leaves_the_numbers_costs_but_does_not_stop(stops: Stops, columns: Columns) -> None:
    law = Constant(law="constant", rig_mass=1.0, mu=1e6)
    assert np.isfinite(replayed(law, columns.brake, stops, False)).all()


@pytest.mark.parametrize("name", ["ilvo", "ostermeyer", "surface", "table"])
def test_no_law_is_given_the_measured_torque(
    name: str, recording: Recording, stops: Stops, columns: Columns
) -> None:
    """Slowing follows from the law's own friction (3.22a); the measured one is the measured friction."""
    candidate = named(name, stops, columns)
    law = candidate.law([free.value(0.4) for free in candidate.free])
    other = find_stops(recording._replace(torque=1.2 * recording.torque), columns, "x")
    assert replayed(law, columns.brake, other, False) == pytest.approx(
        replayed(law, columns.brake, stops, False)
    )


def test_closed_loop_demands_the_measured_torque(stops: Stops, columns: Columns) -> None:
    """Friction that falls with pressure as mu = 0.5 - 0.2 p / 200 bar: T = lever mu p is a square of p."""
    law = Table(
        law="table", rig_mass=1.0, temperature=(0.0, 500.0), pressure=(0.0, 200.0),
        mu=((0.5, 0.5), (0.3, 0.3)),
    )  # fmt: skip
    last = stops.block_first + stops.per_block - 1
    torque = np.array([stops.torque[k - stops.per_block + 1 : k + 1].mean() for k in last])
    per_bar = torque / (1e5 * stops.lever)
    bars = (0.5 - np.sqrt(0.25 - 4.0 * 0.001 * per_bar)) / 0.002
    found = replayed(law, columns.brake, stops, False, closed=True)
    assert found == pytest.approx(0.5 - 0.001 * bars, rel=0.02)


def test_where_no_stop_was_a_table_is_the_mean_with_a_wide_band(stops: Stops, columns: Columns) -> None:
    """No hot stop at high pressure: it used to end at 0.05, the least of the search."""
    cold = stops.start_temperature < 150.0
    seen = some(stops, np.flatnonzero(cold | (stops.held_pressure < 20e5)))
    fitted = fit(named("table", seen, columns), columns.brake, seen)
    assert isinstance(fitted.law, Table)
    mean, hot = float(seen.mu.mean()), fitted.law.mu[-1][-1]
    assert hot == pytest.approx(mean, rel=0.25)
    name = fitted.candidate.free[-1].name
    assert fitted.half[-1] > 0.5 * mean
    assert name in fitted.unidentified()
    assert fitted.half[0] < 0.2 * mean
