"""The bench of identified cars: START is 20 % off, the truth is in its terms, tables say every miss."""

import numpy as np
import pytest

from brakelab.identify.vehicle.parameters import Parameter
from brakelab.studies.accuracy.vehicle import (
    KEYS,
    OFF,
    Beside,
    Car,
    identified_of,
    identified_tables,
    start_of,
    with_parameters,
)
from ecu.settings.config import load_config
from ecu.settings.resources import resource

pytestmark = pytest.mark.study


@pytest.mark.parametrize("seed", range(4))
def test_start_is_20_percent_off_everywhere(seed):
    true, start = load_config(resource("config/suv.toml")), start_of(seed)
    for section in ("vehicle", "front", "rear"):
        for key in KEYS.get(section, KEYS["front"]):
            ratio = getattr(getattr(start, section), key) / getattr(getattr(true, section), key)
            assert abs(ratio - 1.0) == pytest.approx(OFF), (section, key)
    assert start.vehicle.wheelbase == true.vehicle.wheelbase


def parameter(key, value, sigma, remedy=""):
    return Parameter(key, "kg", 2000.0, value, sigma, 10, "by hand", remedy)


def test_only_what_was_identified_is_taken():
    start = start_of(1)
    identified = [
        parameter("vehicle.mass", 1900.0, 10.0),
        parameter("front.mu_nominal", 0.3, 0.1, "brakings"),
    ]
    found = with_parameters(start, identified)
    assert found.vehicle.mass == 1900.0
    assert found.front == start.front


def test_the_table_counts_and_names_misses():
    def car(mass):
        keys = [Beside(parameter("vehicle.mass", mass, 20.0), 2000.0)]
        keys.append(Beside(parameter("rear.mu_nominal", 0.4, 0.1, "brakings"), 0.5))
        return Car(keys, (10.0, 20.0), (2.0, 3.0), 12)

    keys, misses, strange = identified_tables([car(2010.0), car(2090.0)])
    assert keys.rows[0] == ("vehicle.mass", "2 of 2", "2.50", "4.50", "1.00", "1 of 2", "1 of 2")
    assert keys.rows[1][1] == "0 of 2"
    assert [(row[0], row[1], row[5], row[6]) for row in misses.rows] == [
        ("2", "vehicle.mass", "+4.5", "+4.5")
    ]
    assert keys.rows[2][:4] == ("rear.mu_nominal / mass", "–", "21.92", "23.44")  # of 0.4 and 1.005, 1.045
    assert strange.rows[0] == ("1", "12", "10.0", "20.0", "2.0", "3.0")


def test_six_cars_are_identified_within_their_sigma_and_predict_a_strangers_drive():
    """The page has ten."""
    cars = [identified_of(seed) for seed in range(6)]
    beside = [each for car in cars for each in car.keys if not each.parameter.remedy]
    z = np.array([(each.parameter.value - each.truth) / each.parameter.sigma for each in beside])
    assert np.mean(np.abs(z) <= 2.0) > 0.9
    assert np.median([car.after[0] for car in cars]) < 0.8 * np.median([car.before[0] for car in cars])
