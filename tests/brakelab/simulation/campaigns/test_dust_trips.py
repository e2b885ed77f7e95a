"""The eight trips: near Table 8.1, with sensors' errors, scatter and days as stated."""

import csv

import numpy as np
import pytest

from brakelab.simulation.campaigns import dust_trips
from brakelab.simulation.campaigns.dust_trips import APPLICATION, COLUMNS, campaign, write_campaign

pytestmark = pytest.mark.study


@pytest.fixture(scope="module")
def trips():
    return campaign(1)


def test_trips_come_near_table_8_1(trips):
    """78 to 121 applications, 2.1 to 5.6 MJ and 0.45 to 3.3e9 particles per km of the front right brake."""
    assert len(trips) == 8
    for trip in trips:
        columns = trip.columns
        speed, torque = columns["vehicle_speed"], columns["brake_torque_fr"]
        km = 1e-4 * speed.sum()
        braked = (torque > 5.0) & (speed > 0.5)
        count = np.count_nonzero(np.diff(braked.astype(int)) == 1)
        energy = 1e-6 * float(np.sum(0.1 * torque * speed)) / 0.334
        print(f"{km:.0f} km, {count} applications, {energy:.1f} MJ, {trip.emitted[-1] / km:.2e} /km")
        assert 60.0 < km < 130.0
        assert 60 < count < 180
        assert 1.5 < energy < 9.0
        assert 0.2e9 < trip.emitted[-1] / km < 8e9


def test_the_counter_has_a_sample_a_second(trips):
    known = np.isfinite(trips[0].columns["particle_concentration"])
    assert np.all(np.flatnonzero(known) % 10 == 0)
    assert known.mean() == pytest.approx(0.1, abs=1e-3)


def test_background_is_there_and_grows_with_speed(trips):
    for trip in trips:
        c, v = trip.columns["particle_concentration"], trip.columns["vehicle_speed"]
        slow, fast = (np.nanpercentile(c[part], 10) for part in (v < 1.0, v > 20.0))
        assert 0.0 < slow < fast


def test_applications_scatter_as_stated():
    """Gains of the number over those without scatter, of applications that have ended, over six trips."""
    logs = []
    for trip in campaign(2, day=0.0, trips=6):
        rises = np.diff(trip.expected) > 0.0
        edges = np.flatnonzero(np.diff(rises.astype(int), prepend=0, append=0))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            if trip.expected[end] - trip.expected[start] > 1e8:
                gain = trip.emitted[end] - trip.emitted[start]
                logs.append(np.log(gain / (trip.expected[end] - trip.expected[start])))
    n = len(logs)
    print(n, np.mean(logs), np.std(logs))
    assert n > 100
    # the treatment of the surface is the same with and without scatter; four standard errors
    assert np.mean(logs) == pytest.approx(-0.5 * APPLICATION**2, abs=4 * APPLICATION / np.sqrt(n))
    assert np.std(logs) == pytest.approx(APPLICATION, rel=4 / np.sqrt(2 * n))


def test_a_campaign_is_the_same_for_the_same_seed(trips):
    again = campaign(1, trips=1)
    assert np.array_equal(again[0].columns["brake_torque_fr"], trips[0].columns["brake_torque_fr"])


def test_the_manifest_holds_the_last_trip_out(trips, tmp_path):
    manifest = write_campaign(trips[:2], tmp_path)
    rows = list(csv.DictReader(manifest.open()))
    assert [row["test"] for row in rows] == ["0", "1"]
    header = (tmp_path / rows[0]["file"]).read_text().splitlines()[0]
    assert tuple(header.split(",")) == COLUMNS
    assert dust_trips.TRIPS == 8
