"""Variables: names, units and limits are those of the tables that results, frames and CONFIG are made of."""

import math
import re

import numpy as np
import pytest

from ecu.contract.signals import OUTPUT_COLUMNS
from ecu.xcp.variables import RECORDS

BY_NAME = {f"{record.name}.{one.name}": one for record in RECORDS for one in record.variables}
DOUBLE = float(np.finfo(float).max)


@pytest.mark.parametrize(
    ("name", "unit", "low", "high"),
    [
        ("outputs.mu_b_fl", "-", 0.0, 0.819),
        ("outputs.mode", "-", 0.0, 4.0),
        ("outputs.mode_rr", "-", 0.0, 3.0),
        ("outputs.vehicle_speed", "m/s", -DOUBLE, DOUBLE),
        ("outputs.active_faults", "-", 0.0, 2.0**32 - 2),
        ("inputs.calliper_pressure_rl", "bar", -10.0, 250.0),
        ("inputs.calliper_pressure_rl_age_ns", "ns", float(-(2**63)), float(2**63)),
        ("inputs.calliper_pressure_rl_verdict", "-", 0.0, 255.0),
        ("inputs.worst_lateness_us", "us", -DOUBLE, DOUBLE),
        ("estimate.load_rr", "N", -DOUBLE, DOUBLE),
        ("estimate.speed", "m/s", -DOUBLE, DOUBLE),
        ("estimate.exponent_9", "-", -DOUBLE, DOUBLE),
        ("parameters.vehicle.mass", "kg", 200.0, 10000.0),
        ("parameters.front.pad.area", "m^2", 5e-4, 0.05),
        ("parameters.transmit", "-", 0.0, 1.0),
    ],
)
def test_unit_and_limits(name, unit, low, high):
    found = BY_NAME[name]
    assert (found.unit, found.low, found.high) == (unit, pytest.approx(low), pytest.approx(high))


def test_every_field_of_a_record_is_named_once():
    assert len(BY_NAME) == sum(len(record.variables) for record in RECORDS)
    for record in RECORDS:
        taken = np.zeros(record.dtype.itemsize, int)
        for one in record.variables:
            taken[one.offset : one.offset + one.length * one.kind.itemsize] += 1
        fields = sum(kind.itemsize for kind, *_ in record.dtype.fields.values())
        assert taken.max() == 1
        assert taken.sum() == fields, record.name


def test_outputs_have_the_names_of_results():
    assert [one.name for one in RECORDS[0].variables] == list(OUTPUT_COLUMNS)


def test_names_are_identifiers_of_an_a2l_file():
    for name in BY_NAME:
        parts = name.split(".")
        assert all(re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", part) for part in parts), name
        assert len(name) <= 1024
        assert all(len(part) <= 128 for part in parts)


def test_limits_are_ordered_and_finite():
    for one in BY_NAME.values():
        assert math.isfinite(one.low)
        assert one.low < one.high
