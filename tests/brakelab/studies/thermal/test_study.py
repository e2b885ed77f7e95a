"""The study of disc temperature: the judged trips are others, a whole car stays within its goal."""

import numpy as np
import pytest

from brakelab.studies.thermal.study import IDENTIFIED, JUDGED, drive_car

pytestmark = pytest.mark.study


def test_no_car_is_judged_by_the_trip_that_it_was_identified_on() -> None:
    for one in IDENTIFIED:
        for other in JUDGED:
            assert (one.driver, one.air) != (other.driver, other.air)
    assert {trip.wetness for trip in JUDGED} == {0.0, 1.0}
    assert JUDGED[0].from_share == 0.0  # town too


def test_one_car_from_thermocouples_to_another_trip() -> None:
    car = drive_car(5)
    for trip in car.trips:
        print(trip.trip, np.round(trip.before, 1), np.round(trip.after, 1), np.round(trip.inside, 2))
        assert (trip.after < trip.before).all()
        assert trip.after.max() < 13.0
        assert trip.inside.mean() > 0.85
