import math
import statistics
import time as wall
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.runtime.clock import Grid, Histogram, TimeSource, Welford, system_time

MS = 1_000_000
EPOCH_NS = 1_700_000_000_000_000_000


class FakeTime:
    """Two clocks that stand still but for sleeping and what a test adds."""

    def __init__(self, start_ns: int = 0, late_ns: int = 0) -> None:
        self.now_ns, self.offset_ns, self.late_ns = start_ns, EPOCH_NS, late_ns

    def source(self) -> TimeSource:
        return TimeSource(lambda: self.now_ns, lambda: self.now_ns + self.offset_ns, self.sleep_until)

    def sleep_until(self, deadline_ns: int) -> None:
        self.now_ns = max(self.now_ns, deadline_ns) + self.late_ns


# work [ms] of each cycle -> (deadline [ms], missed) of the next one
OVERRUNS = {
    "in time": ([1, 9.9, 2], [(10, 0), (20, 0), (30, 0), (40, 0)]),
    "just one period": ([10, 1], [(10, 0), (30, 1), (40, 0)]),
    "a little over": ([10.1, 1], [(10, 0), (30, 1), (40, 0)]),
    "three periods lost": ([39, 1], [(10, 0), (50, 3), (60, 0)]),
    "twice in a row": ([15, 25, 1], [(10, 0), (30, 1), (60, 2), (70, 0)]),
}


@pytest.mark.parametrize(("work_ms", "expected"), OVERRUNS.values(), ids=OVERRUNS)
@pytest.mark.requirement("REQ-LOOP-3")
def test_missed_periods_are_counted_and_not_made_up_for(work_ms, expected):
    time = FakeTime()
    grid = Grid(time.source())
    ticks = [grid.wait()]
    for work in work_ms:
        time.now_ns += round(work * MS)
        ticks.append(grid.wait())
    assert [(tick.t_mono_ns / MS, tick.missed) for tick in ticks] == expected


# how long [ms] each sleep lasts beyond its deadline -> (deadline [ms], missed, lateness [ms]) of these cycles
OVERSLEPT = {
    "in time": ([0, 0.07], [(10, 0, 0), (20, 0, 0.07)]),
    "not a period": ([9.9, 0], [(10, 0, 9.9), (20, 0, 0)]),
    "just one period": ([10, 0], [(20, 1, 10), (30, 0, 0)]),
    "stopped for half a second": ([503, 0, 0], [(510, 50, 503), (520, 0, 0), (530, 0, 0)]),
    "twice in a row": ([25, 14, 0], [(30, 2, 25), (50, 1, 14), (60, 0, 0)]),
}


@pytest.mark.parametrize(("late_ms", "expected"), OVERSLEPT.values(), ids=OVERSLEPT)
def test_a_sleep_that_lasted_too_long_ends_at_the_deadline_before_the_waking(late_ms, expected):
    time = FakeTime()
    grid = Grid(time.source())
    ticks = []
    for late in late_ms:
        time.late_ns = round(late * MS)
        ticks.append(grid.wait())
    assert [(tick.t_mono_ns / MS, tick.missed, tick.lateness_ns / MS) for tick in ticks] == expected


def test_lateness_is_from_the_deadline():
    grid = Grid(FakeTime(late_ns=70_000).source())
    assert [grid.wait().lateness_ns for _ in range(3)] == [70_000] * 3


def test_a_signal_that_wakes_the_sleep_does_not_start_the_cycle():
    time = FakeTime()
    wakes = iter([3 * MS, 7 * MS, 10 * MS])
    source = time.source()._replace(sleep_until=lambda _: setattr(time, "now_ns", next(wakes)))
    assert Grid(source).wait().lateness_ns == 0


def test_real_time_deadlines_are_whole_microseconds_on_the_same_grid():
    time = FakeTime(start_ns=1_234)
    grid = Grid(time.source())
    stamps = [grid.wait().t_ns for _ in range(4)]
    assert all(stamp % 1000 == 0 for stamp in stamps)
    assert {b - a for a, b in pairwise(stamps)} == {10 * MS}
    assert 0 <= EPOCH_NS + 1_234 + 10 * MS - stamps[0] < 1000


@pytest.mark.parametrize("step_s", [0.05, -0.05, 3600, -3600, 31_536_000, -31_536_000])
@pytest.mark.requirement("REQ-LOOP-4")
def test_a_clock_that_was_set_is_reported_and_moves_no_deadline(step_s):
    time = FakeTime()
    grid = Grid(time.source())
    before = grid.wait()
    time.offset_ns += round(step_s * 1e9)
    after = grid.wait()
    assert after.t_mono_ns - before.t_mono_ns == after.t_ns - before.t_ns == 10 * MS
    assert grid.follow_realtime() == round(step_s * 1e9)
    time.offset_ns = EPOCH_NS
    assert grid.follow_realtime() == 0


def test_a_reading_that_was_interrupted_is_no_clock_that_was_set():
    time = FakeTime()
    grid = Grid(time.source())
    reads = iter([20 * MS, 24 * MS])
    grid.source = time.source()._replace(
        monotonic_ns=lambda: next(reads), realtime_ns=lambda: EPOCH_NS + 20 * MS
    )
    assert grid.follow_realtime() == 0


@pytest.mark.skipif(not hasattr(wall, "CLOCK_BOOTTIME"), reason="no clock here counts a suspension")
def test_a_suspended_machine_s_time_counts():
    """So a cycle after it is one that overslept, and asks for what is asked then."""
    source = system_time()
    before = wall.clock_gettime_ns(wall.CLOCK_BOOTTIME)
    assert before <= source.monotonic_ns() <= wall.clock_gettime_ns(wall.CLOCK_BOOTTIME)
    source.sleep_until(before + MS)
    assert wall.clock_gettime_ns(wall.CLOCK_BOOTTIME) >= before + MS


def test_the_machines_own_clocks_keep_the_grid():
    grid = Grid(system_time())
    ticks = [grid.wait() for _ in range(3)]
    assert all(tick.lateness_ns >= 0 for tick in ticks)
    assert all((b.t_mono_ns - a.t_mono_ns) % (10 * MS) == 0 for a, b in pairwise(ticks))


@given(st.lists(st.floats(-1e9, 1e9), min_size=2, max_size=50))
def test_moments_agree_with_the_definition(values):
    moments = Welford()
    for value in values:
        moments.add(value)
    assert moments.mean == pytest.approx(statistics.fmean(values), rel=1e-9, abs=1e-3)
    assert moments.deviation == pytest.approx(statistics.stdev(values), rel=1e-6, abs=1e-3)
    assert (moments.minimum, moments.maximum) == (min(values), max(values))


def test_nothing_is_known_of_nothing():
    moments = Welford()
    assert all(math.isnan(x) for x in (moments.mean, moments.deviation, moments.minimum, moments.maximum))
    assert math.isnan(Histogram().quantile(0.5))


@given(st.lists(st.integers(0, 10**11), min_size=1, max_size=200), st.sampled_from([0.01, 0.5, 0.99, 1.0]))
def test_a_quantile_is_at_most_a_bin_above_the_exact_one(durations, share):
    histogram = Histogram()
    for duration in durations:
        histogram.add(duration)
    exact = sorted(durations)[max(0, math.ceil(share * len(durations)) - 1)]
    longest = 2.0**36  # what does not fit counts in the last bin
    assert min(exact, longest) * (1 - 1e-9) <= histogram.quantile(share) <= max(2, exact * 1.0906)


def test_a_histogram_does_not_grow():
    histogram = Histogram()
    place = histogram.counts.ctypes.data
    for exponent in range(50):
        histogram.add(2**exponent)
    assert histogram.counts.ctypes.data == place
    assert histogram.counts.sum() == 50
