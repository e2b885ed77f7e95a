"""The configuration as numbers."""

import math

import pytest

from ecu.settings.sections import Config
from ecu.xcp.parameters import NO_WORD, parameters, to_record


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("vehicle.mass", 2105.0),
        ("front.pistons", 2.0),
        ("control.slip_guard", 1),
        ("control.compensation", 1),  # "second-order", "inverse", "off"
        ("observer.kind", 0),
        ("front.dust.model", NO_WORD),
    ],
)
def test_a_key_has_the_value_of_the_configuration(configuration, key, value):
    given = {**configuration, "front": {**configuration["front"], "pistons": 2}}
    assert to_record(given)[key].tolist() == [value]


def test_what_is_not_given_is_nan(configuration):
    record = to_record(configuration)
    assert math.isnan(record["control.front_share"][0])
    points = configuration["control"]["pedal_position"]
    row = record["control.pedal_position"][0].tolist()
    assert row[: len(points)] == points
    assert all(math.isnan(one) for one in row[len(points) :])
    assert all(math.isnan(one) for one in record["front.dust.low"][0])


def test_every_key_but_names_is_there():
    keys = {one.key for one in parameters()}
    assert len(keys) == len(parameters())
    tables = {"vehicle", "front", "rear", "sensors", "observer", "control", "blending"}
    assert {key.partition(".")[0] for key in keys} == (set(Config.model_fields) - {"name"})
    assert tables < set(Config.model_fields)
