"""Data identifiers: numbers that stay, all that `watch` shows, bytes that the database describes."""

import math

import cantools
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.contract.signals import CORNERS
from ecu.diagnostics import identifiers
from ecu.diagnostics.identifiers import (
    BY_NAME,
    MEASURED,
    OF_SNAPSHOT,
    TEXTS,
    UNITS,
    has_corners,
    length_of,
    measured,
    scaling_of,
    snapshot,
    snapshot_values,
    to_bytes,
    to_values,
)
from ecu.recording.ring import RECORDED
from ecu.settings.resources import resource
from ecu.watch.history import COLUMNS

NAMES = {f"{one.name}_{corner}" for one in MEASURED if has_corners(one) for corner in CORNERS}
NAMES |= {one.name for one in MEASURED if not has_corners(one)}


def test_everything_that_watch_shows_can_be_read():
    assert set(COLUMNS) <= NAMES


def test_each_has_a_number_of_its_own_in_the_manufacturers_range():
    numbers = [one.number for one in MEASURED] + list(TEXTS)
    assert len(set(numbers)) == len(numbers)
    assert all(0x0100 <= one.number <= 0xA5FF for one in MEASURED)
    assert 0xF190 not in numbers  # a VIN that is empty is worse than none
    assert {one.name for one in MEASURED} <= set(UNITS)


@pytest.mark.parametrize(
    ("name", "number", "values", "text"),
    [
        ("mode", 0x0100, 2.0, "02"),
        ("active_faults", 0x0101, float(1 << 31 | 3), "80 00 00 03"),
        ("vehicle_speed", 0x0103, 20.0, "00 9C 40"),
        ("vehicle_speed", 0x0103, -1.0, "FF F8 30"),
        ("vehicle_speed", 0x0103, math.nan, "F8 00 00"),
        ("accel_x_road", 0x0105, -4.0, "F3 80"),
        ("mu_b", 0x0110, [0.45, 0.5, math.nan, 9.9], "11 94 13 88 1F FF 1F FE"),
        ("calliper_pressure", 0x0114, [0.0, -10.0, 100.0, math.inf], "07 D0 00 00 55 F0 FF FF"),
        ("clock", 0x0120, 1_795_667_963.599, "01 A2 16 26 AE CF"),
        ("speaks", 0x0123, math.nan, "00"),
    ],
)
def test_numbers_and_bytes_that_testers_rely_on(name, number, values, text):
    one = BY_NAME[name]
    assert one.number == number
    assert to_bytes(one, {name: np.array(values)}).hex(" ").upper() == text


@pytest.mark.parametrize("one", [one for one in MEASURED if one.like], ids=lambda one: one.name)
def test_bytes_are_what_the_database_would_send(one):
    """By another reading of the database: cantools encodes the message, and cuts the signal's code out."""
    name = f"{one.like}_fl" if has_corners(one) else one.like
    database = cantools.database.load_file(resource("dbc/brake_ecu.dbc"))
    message, signal = next(
        (message, signal)
        for message in database.messages
        for signal in message.signals
        if signal.name == name
    )
    for share in (0.0, 0.3, 1.0):
        value = signal.minimum + share * (signal.maximum - signal.minimum)
        others = {other.name: other.minimum or 0 for other in message.signals}
        text = message.encode({**others, name: value}, scaling=True, strict=False)
        raw = message.decode(text, scaling=False, decode_choices=False)[name]
        ours = to_bytes(one, {one.name: np.full(4 if has_corners(one) else 1, value)})[
            : scaling_of(one).bytes
        ]
        assert int.from_bytes(ours, "big", signed=signal.is_signed) == pytest.approx(raw, abs=1)


@given(st.sampled_from(MEASURED), st.lists(st.floats(allow_nan=True), min_size=4, max_size=4))
def test_any_number_has_bytes_and_they_are_read_as_that_number(one, numbers):
    numbers = numbers if has_corners(one) else numbers[:1]
    text = to_bytes(one, {one.name: np.array(numbers)})
    assert len(text) == length_of(one)
    scaling = scaling_of(one)
    low, high = (scaling.scale * raw + scaling.offset for raw in (scaling.low, scaling.high))
    for number, value in zip(numbers, to_values(one, text), strict=True):
        if math.isfinite(number):
            assert value == pytest.approx(min(max(number, low), high), abs=0.501 * scaling.scale)
        elif scaling.not_available is not None:
            assert value is None


def test_a_snapshot_is_read_as_what_it_was_made_of():
    record = np.zeros(1, RECORDED)
    record["cycle"]["t_ns"], record["cycle"]["clock_set_ns"] = 1_700_000_000_000_000_000, 5_000_000_000
    for name, value in (("vehicle_speed", 20.0), ("mode", 2), ("decel_demand_total", 4.0)):
        record["outputs"][name] = value
    record["outputs"]["mu_b"], record["outputs"]["calliper_pressure"] = 0.4, [30, 31, 20, np.nan]
    assert snapshot_values(snapshot(record)) == {
        "clock": [1_700_000_005.0],
        "vehicle_speed": [20.0],
        "decel_demand_total": [4.0],
        "mode": [2.0],
        "calliper_pressure": [30.0, 31.0, 20.0, None],
        "mu_b": [0.4] * 4,
    }
    assert set(measured(record)) == set(BY_NAME)
    assert len(snapshot(record)) == sum(2 + length_of(one) for one in OF_SNAPSHOT)


@given(st.binary(max_size=60))
def test_another_ecus_snapshot_is_read_as_far_as_it_is_known(text):
    assert set(snapshot_values(text)) <= set(BY_NAME)


def test_the_database_is_read_once():
    assert identifiers._signals() is identifiers._signals()
