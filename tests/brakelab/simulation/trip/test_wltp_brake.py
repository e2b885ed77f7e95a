"""The WLTP-Brake cycle: its published totals, its trips, and brakings that a driver can do."""

from itertools import pairwise

import numpy as np
import pytest

from brakelab.simulation.trip.table import KMH, brakings
from brakelab.simulation.trip.wltp_brake import DISC_AT_START, TRIPS, Division, wltp_brake

NUMBERS = [None, *range(1, 11)]


def slopes(trip: int | None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return time and speed of the knots, and duration and slope of the pieces between them."""
    t, v = wltp_brake(trip).T
    return t, v, np.diff(t), np.diff(v) / np.diff(t)


def test_the_totals_are_those_that_are_published() -> None:
    """Typed here once more: UN GTR 24 has 10 trips, 303 brakings, 192 km, 15,826 s, 43.7 and 132.5 km/h."""
    t, v, _, slope = slopes(None)
    braked = slope < -0.4
    metres = float(np.trapezoid(v, t))
    assert len(TRIPS) == len(DISC_AT_START) == 10
    assert t[0] == 0.0
    assert t[-1] == pytest.approx(15_826.0, abs=1e-6)
    assert metres == pytest.approx(192e3, abs=1e-3)
    assert metres / t[-1] / KMH == pytest.approx(43.7, abs=0.05)
    assert v.max() / KMH == pytest.approx(132.5)
    assert braked.sum() == 303
    assert -slope[braked].mean() == pytest.approx(0.97, abs=1e-6)
    assert DISC_AT_START == (23.0,) + 9 * (40.0,)


@pytest.mark.parametrize(("number", "trip"), list(enumerate(TRIPS, 1)))
def test_a_trip_has_its_part_of_them(number: int, trip: Division) -> None:
    t, v, dt, slope = slopes(number)
    assert t[-1] == pytest.approx(trip.seconds, abs=1e-6)
    assert np.trapezoid(v, t) == pytest.approx(trip.metres, abs=1e-3)
    assert (slope < -0.4).sum() == trip.brakings
    assert v[0] == v[-1] == 0.0
    assert dt[(slope == 0.0) & (v[1:] == 0.0)].sum() / trip.seconds == pytest.approx(0.13, abs=1e-6)


def test_trips_in_a_row_are_the_cycle() -> None:
    t, v = wltp_brake(None).T
    starts = np.cumsum([0.0, *(trip.seconds for trip in TRIPS)])
    for number, (start, end) in enumerate(pairwise(starts), 1):
        one = wltp_brake(number)
        inside = np.interp(start + one[:, 0], t, v)
        assert np.allclose(inside, one[:, 1], atol=1e-6)
        assert end - start == pytest.approx(one[-1, 0])


@pytest.mark.parametrize("trip", NUMBERS)
def test_a_car_and_its_driver_can_do_it(trip: int | None) -> None:
    _, v, dt, slope = slopes(trip)
    assert np.isfinite(v).all()
    assert (v >= 0.0).all()
    assert (dt > 0.5).all()
    assert slope.max() <= 1.3 + 1e-9
    assert slope.min() >= -2.2 - 1e-9
    assert dt[(slope == 0.0) & (v[1:] > 0.0)].min() >= 2.0


def test_the_cycle_is_the_same_every_time_and_its_brakings_are_found_by_the_trip_table() -> None:
    assert wltp_brake(None) is wltp_brake(None)
    rows = wltp_brake(None)
    t = np.arange(0.0, rows[-1, 0], 0.1)
    found = brakings(t, np.interp(t, *rows.T), -np.gradient(np.interp(t, *rows.T), t))
    assert 290 <= len(found.start) <= 303  # those by less than 0.5 m/s^2 or 5 km/h are none in that table
    assert found.mean_decel.mean() == pytest.approx(0.97, abs=0.02)
