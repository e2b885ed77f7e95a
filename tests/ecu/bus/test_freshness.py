"""Samples to verdicts: time-outs, rates, ranges, old and invalid samples."""

import math
from typing import Any

import numpy as np
import pytest

from ecu.bus.freshness import (
    accept,
    begin_cycle,
    end_cycle,
    input_freshness,
    new_freshness,
    target_dtype,
)
from ecu.contract.records import RecordArray
from ecu.contract.signals import ALIVE, RATE_OK, VALID

MS = 1_000_000
T0 = 1_700_000_000_000_000_000


class Signal:
    """One target place, with a time-out of 0.1 s, a period of 10 ms and a range of 0 to 100."""

    def __init__(self, period_s: float = 0.01, slowest_s: float | None = None) -> None:
        self.inputs: RecordArray = np.zeros(1, target_dtype(1))
        self.freshness = new_freshness([0.1], [period_s], [slowest_s or period_s], [0.0], [100.0])

    def cycle(self, ms: float, *samples: tuple[float, float, bool]) -> tuple[float, int, int]:
        """Take samples (stamp in ms, value, valid) in the cycle that ends at `ms`; value, new, verdict."""
        inputs: Any = self.inputs[0]
        begin_cycle(inputs, T0 + round(ms * MS), 10 * MS)
        for stamp, value, valid in samples:
            accept(inputs, self.freshness, 0, value, T0 + round(stamp * MS), valid)
        end_cycle(inputs, self.freshness)
        return float(inputs["value"][0]), int(inputs["new"][0]), int(inputs["verdict"][0])

    @property
    def age_ms(self) -> float:
        return float(self.inputs["age_ns"][0, 0]) / MS


def test_a_signal_that_never_came() -> None:
    signal = Signal()
    assert signal.cycle(10) == (0.0, 0, 0)
    assert signal.age_ms > 1e9


def test_one_sample_is_new_once_and_ages() -> None:
    signal = Signal()
    assert signal.cycle(10, (7, 5.0, True)) == (5.0, 1, ALIVE | VALID)
    assert signal.age_ms == 3
    assert signal.cycle(20) == (5.0, 0, ALIVE | VALID)
    assert signal.age_ms == 13


@pytest.mark.parametrize(("age_ms", "alive"), [(99, True), (100, True), (101, False)])
@pytest.mark.requirement("REQ-IN-1")
def test_time_out(age_ms: int, alive: bool) -> None:
    signal = Signal()
    signal.cycle(10, (10, 5.0, True))
    assert (signal.cycle(10 + age_ms)[2] & ALIVE != 0) is alive


@pytest.mark.parametrize("value", [0.0, 100.0])
def test_the_ends_of_the_range_belong_to_it(value: float) -> None:
    """A pedal at rest says 0 %."""
    assert Signal().cycle(10, (10, value, True)) == (value, 1, ALIVE | VALID)


@pytest.mark.parametrize("value", [-0.1, 100.1, math.nan, math.inf, -math.inf])
@pytest.mark.requirement("REQ-IN-1")
def test_a_value_out_of_range_is_not_taken_but_proves_life(value: float) -> None:
    signal = Signal()
    signal.cycle(10, (10, 5.0, True))
    assert signal.cycle(20, (20, value, True)) == (5.0, 0, ALIVE | RATE_OK)
    assert signal.age_ms == 0
    assert signal.cycle(30, (30, 6.0, True)) == (6.0, 1, ALIVE | RATE_OK | VALID)


@pytest.mark.requirement("REQ-IN-1")
def test_a_sample_declared_invalid() -> None:
    signal = Signal()
    signal.cycle(10, (10, 5.0, True))
    assert signal.cycle(20, (20, 6.0, False))[:2] == (5.0, 0)
    assert signal.cycle(30)[2] & VALID == 0


def test_an_older_sample_is_ignored() -> None:
    signal = Signal()
    assert signal.cycle(20, (18, 5.0, True), (12, 9.0, True))[:2] == (5.0, 1)
    assert signal.cycle(30, (17, 9.0, True))[:2] == (5.0, 0)
    assert signal.cycle(40, (40, 6.0, True), (39, 9.0, True))[:2] == (6.0, 1), (
        "nor one older than a deadline's"
    )


def test_samples_of_the_same_stamp_are_all_taken() -> None:
    signal = Signal()
    assert signal.cycle(20, (18, 5.0, True), (18, 9.0, True))[:2] == (9.0, 1)


def test_two_samples_of_one_stamp_do_not_begin_the_rate_anew() -> None:
    signal = Signal()
    for k in range(10):
        signal.cycle(10 * k, (10 * k, 5.0, True))
    assert signal.cycle(100, (100, 5.0, True), (100, 5.0, True))[2] & RATE_OK


def test_a_clock_that_is_set_back_does_not_freeze_the_signal() -> None:
    signal = Signal()
    signal.cycle(5000, (5000, 5.0, True))
    assert signal.cycle(10, (9, 6.0, True)) == (6.0, 1, ALIVE | VALID)
    assert signal.cycle(20, (19, 6.0, True)) == (6.0, 1, ALIVE | RATE_OK | VALID)


@pytest.mark.parametrize(
    ("interval_ms", "period_s", "slowest_s", "right"),
    [
        (10, 0.01, 0.01, True),
        (6, 0.01, 0.01, True),
        (19, 0.01, 0.01, True),
        (5, 0.01, 0.01, True),  # half and double belong to it
        (20, 0.01, 0.01, True),
        (4, 0.01, 0.01, False),
        (25, 0.01, 0.01, False),
        (10, 0.01, 0.1, True),  # VehicleSpeed: every 10 to 100 ms
        (40, 0.01, 0.1, True),
        (100, 0.01, 0.1, True),
        (4, 0.01, 0.1, False),
    ],
)
def test_rate(interval_ms: int, period_s: float, slowest_s: float, right: bool) -> None:
    signal = Signal(period_s, slowest_s)
    for k in range(40):
        verdict = signal.cycle(interval_ms * k, (interval_ms * k, 5.0, True))[2]
    assert (verdict & RATE_OK != 0) is right


def test_a_lost_frame_now_and_then_is_no_wrong_rate() -> None:
    signal = Signal()
    for k in range(100):
        samples = [] if k % 5 == 4 else [(10.0 * k, 5.0, True)]
        verdict = signal.cycle(10 * k, *samples)[2]
        assert k < 1 or verdict & RATE_OK


def test_after_a_gap_the_rate_is_measured_anew() -> None:
    signal = Signal()
    for k in range(20):
        signal.cycle(10 * k, (10 * k, 5.0, True))
    assert signal.cycle(1000)[2] == VALID
    assert signal.cycle(1010, (1010, 5.0, True))[2] == ALIVE | VALID
    assert signal.cycle(1020, (1020, 5.0, True))[2] == ALIVE | RATE_OK | VALID


def test_what_is_expected_before_the_first_sample() -> None:
    known = new_freshness([0.1, 0.2], [0.01, 0.02], [0.01, 0.1], [0.0, -1.0], [100.0, 1.0])
    assert len(known) == 2
    assert known["timeout_ns"].tolist() == [100 * MS, 200 * MS]
    assert known["shortest_ns"].tolist() == [5 * MS, 10 * MS]
    assert known["longest_ns"].tolist() == [20 * MS, 200 * MS]
    assert (known["samples"] == 0).all()
    place_without_a_message = input_freshness({}, {})[0]
    assert (place_without_a_message["shortest_ns"], place_without_a_message["longest_ns"]) == (0.0, 0.0)


def test_the_mean_interval_is_that_of_all_samples_at_first() -> None:
    """10, 20, 30 ms: 10, then 15, then 20 on the average."""
    signal, means = Signal(), []
    for stamp in (0, 10, 30, 60):
        signal.cycle(stamp, (stamp, 5.0, True))
        means.append(float(signal.freshness[0]["interval_ns"]) / MS)
    assert means == [0.0, 10.0, 15.0, 20.0]


def test_a_new_cycle_has_no_new_sample_and_an_age_that_is_never_negative() -> None:
    signal = Signal()
    assert signal.cycle(10, (12, 5.0, True))[1] == 1
    assert signal.age_ms == 0
    assert signal.cycle(20)[1] == 0


def test_every_sample_is_counted_by_what_became_of_it() -> None:
    signal = Signal()
    signal.cycle(10, (2, 5.0, True), (4, 6.0, True), (6, 200.0, True), (8, math.nan, True), (10, 5.0, False))
    counted = signal.freshness[0]
    assert (counted["taken"], counted["outside"], counted["invalid"]) == (2, 1, 2)


@pytest.mark.parametrize(("interval_ms", "timeout_ms"), [(10, 100), (30, 100), (50, 150), (400, 1200)])
def test_where_no_rate_is_promised_the_time_out_is_three_intervals(interval_ms: int, timeout_ms: int) -> None:
    signal = Signal()
    signal.freshness["patience_ns"] = 1000 * MS
    for k in range(20):
        signal.cycle(interval_ms * k, (interval_ms * k, 5.0, True))
    last = interval_ms * 19
    assert signal.cycle(last + timeout_ms)[2] & ALIVE
    assert not signal.cycle(last + timeout_ms + 1)[2] & ALIVE


def test_the_time_out_of_a_sender_that_promised_its_rate_does_not_follow_it() -> None:
    signal = Signal()
    for k in range(20):
        signal.cycle(90 * k, (90 * k, 5.0, True))
    assert signal.cycle(90 * 19 + 100)[2] & ALIVE
    assert not signal.cycle(90 * 19 + 101)[2] & ALIVE


def test_the_mean_interval_forgets_with_a_sixteenth() -> None:
    signal = Signal()
    for k in range(40):
        signal.cycle(10 * k, (10 * k, 5.0, True))
    signal.cycle(416, (416, 5.0, True))
    assert float(signal.freshness[0]["interval_ns"]) / MS == pytest.approx(10.0 + 16.0 / 16)


def test_a_place_has_the_period_range_and_the_time_out_it_is_given() -> None:
    known = input_freshness({3: (0.01, 0.1)}, {3: 0.7})[3]
    assert (known["shortest_ns"], known["longest_ns"]) == (5 * MS, 200 * MS)
    assert known["timeout_ns"] == 700 * MS
