"""Time grid of 10 ms: absolute deadlines on the monotonic clock, missed periods, lateness statistics.

Missed periods are not caught up in a burst but counted, whether the cycle before lasted too long or the sleep
did (a stopped process, a paused virtual machine, a suspended machine, whose time the monotonic clock here
counts): a cycle's deadline T_k is the last one on the grid when it wakes, never one from before the sleep.

The frames' stamps are of the real-time clock, which can be set at any time. A run keeps the time line on
which it began, real time at its start plus monotonic time since; `follow_realtime` returns by how much the
real-time clock has been set, and the cycle takes that off the stamps.
"""

import ctypes
import math
import os
import time
from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.contract.records import RecordArray, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.jit import kernel

MICROSECOND_NS: Final = 1000


_SUSPENDED_TOO: Final[int | None] = getattr(time, "CLOCK_BOOTTIME", None)
monotonic_ns: Final[Callable[[], int]] = (
    time.monotonic_ns if _SUSPENDED_TOO is None else partial(time.clock_gettime_ns, _SUSPENDED_TOO)
)
"""The monotonic clock of the cycle [ns], with the time for which the machine was suspended, if known."""


def monotonic_s() -> float:
    """Return the cycle's monotonic clock [s]."""
    return 1e-9 * monotonic_ns()


class TimeSource(NamedTuple):
    """The two clocks in ns and a sleep until a monotonic instant; tests substitute their own."""

    monotonic_ns: Callable[[], int]
    realtime_ns: Callable[[], int]
    sleep_until: Callable[[int], None]


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


def _absolute_sleep() -> Callable[[int], None]:
    """Return clock_nanosleep(TIMER_ABSTIME) on the monotonic clock, or time.sleep where libc has none."""
    nanosleep = getattr(ctypes.CDLL(None), "clock_nanosleep", None) if os.name == "posix" else None
    if nanosleep is None:
        return lambda deadline_ns: time.sleep(max(0, deadline_ns - monotonic_ns()) / 1e9)
    clock = time.CLOCK_MONOTONIC if _SUSPENDED_TOO is None else _SUSPENDED_TOO
    nanosleep.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    until = _Timespec()
    address = ctypes.addressof(until)
    absolute = 1  # TIMER_ABSTIME

    def sleep_until(deadline_ns: int) -> None:
        until.seconds, until.nanoseconds = divmod(deadline_ns, 1_000_000_000)
        nanosleep(clock, absolute, address, None)

    return sleep_until


def system_time() -> TimeSource:
    """Return the machine's clocks."""
    return TimeSource(monotonic_ns, time.time_ns, _absolute_sleep())


class Tick(NamedTuple):
    """One deadline after its wait."""

    t_ns: int
    """T_k on the run's time line, whole microseconds."""
    t_mono_ns: int
    missed: int
    """Periods that passed unserved since the cycle before."""
    lateness_ns: int
    """How long after its deadline the cycle woke; if periods were missed, after the first of theirs."""


GRID: Final = np.dtype(
    [
        ("deadline_ns", "i8"),  # of the cycle before
        ("wakes_ns", "i8"),  # deadline up to which this one sleeps
        ("period_ns", "i8"),
        ("offset_ns", "i8"),  # real time at the start less monotonic time: the time line, for the whole run
        ("spread_ns", "i8"),  # time that the reading took
        ("set_ns", "i8"),  # by how much the real-time clock has been set since the start, whole microseconds
    ]
)


def _arrival(
    deadline_ns: int, wakes_ns: int, period_ns: int, offset_ns: int, now_ns: int
) -> tuple[int, int, int, int]:
    """Return the `Tick` of a cycle that woke at `now_ns`; the arguments are those of `GRID`."""
    due_ns = deadline_ns + period_ns
    deadline_ns = wakes_ns + (now_ns - wakes_ns) // period_ns * period_ns
    t_ns = (deadline_ns + offset_ns) // MICROSECOND_NS * MICROSECOND_NS
    return t_ns, deadline_ns, (deadline_ns - due_ns) // period_ns, now_ns - due_ns


arrival = kernel(_arrival)


@kernel
def follow_realtime(grid: RecordArray, before_ns: int, real_ns: int, after_ns: int) -> None:
    """Update the set time of a `GRID`, shape (1,), by a reading of real time between two of monotonic time.

    It changes only if the real-time clock was set: a sleep between the readings falsifies them.
    """
    line = grid[0]
    offset_ns, spread_ns = real_ns - (before_ns + after_ns) // 2, after_ns - before_ns
    if abs(offset_ns - line.offset_ns - line.set_ns) > spread_ns + line.spread_ns + MICROSECOND_NS:
        line.set_ns = (offset_ns - line.offset_ns) // MICROSECOND_NS * MICROSECOND_NS
        line.spread_ns = spread_ns


class Grid:
    """Deadlines every `period_ns`, the first one a period after the start."""

    def __init__(self, source: TimeSource, period_ns: int = CYCLE_NS) -> None:
        self.source, self.period_ns = source, period_ns
        self.deadline_ns = source.monotonic_ns()
        before_ns, real_ns, after_ns = self._read()
        self.offset_ns = real_ns - (before_ns + after_ns) // 2
        self.memory = new_record(GRID)
        self.memory["period_ns"], self.memory["offset_ns"] = period_ns, self.offset_ns
        self.memory["spread_ns"] = after_ns - before_ns

    def wait(self) -> Tick:
        """Sleep until the next deadline; a signal may interrupt the sleep, which then continues."""
        wakes_ns, now_ns = self._sleep(0)
        tick = Tick(*_arrival(self.deadline_ns, wakes_ns, self.period_ns, self.offset_ns, now_ns))
        self.deadline_ns = tick.t_mono_ns
        return tick

    def approach(self, lead_ns: int) -> None:
        """Sleep until `lead_ns` before the next deadline; a kernel has the rest of the wait, by `memory`."""
        wakes_ns, _ = self._sleep(lead_ns)
        self.memory["deadline_ns"], self.memory["wakes_ns"] = self.deadline_ns, wakes_ns

    def _sleep(self, lead_ns: int) -> tuple[int, int]:
        """Sleep until `lead_ns` before the next deadline; return that deadline, and now."""
        now_ns = self.source.monotonic_ns()
        late_ns = max(0, now_ns - self.deadline_ns)
        wakes_ns = self.deadline_ns + self.period_ns + late_ns // self.period_ns * self.period_ns
        while now_ns < wakes_ns - lead_ns:
            self.source.sleep_until(wakes_ns - lead_ns)
            now_ns = self.source.monotonic_ns()
        return wakes_ns, now_ns

    def _read(self) -> tuple[int, int, int]:
        """Return monotonic, real and again monotonic time [ns]."""
        return self.source.monotonic_ns(), self.source.realtime_ns(), self.source.monotonic_ns()

    def follow_realtime(self) -> int:
        """Return by how much the real-time clock has been set since the start [ns]."""
        follow_realtime(self.memory, *self._read())
        return int(self.memory["set_ns"][0])


class Welford:
    """Count, mean, deviation, minimum and maximum in O(1) memory; NaN while empty."""

    def __init__(self) -> None:
        self.count = 0
        self._mean = self._squares = 0.0
        self.minimum = self.maximum = math.nan

    def add(self, value: float) -> None:
        """Add one value."""
        self.count += 1
        step = value - self._mean
        self._mean += step / self.count
        self._squares += step * (value - self._mean)
        if not value >= self.minimum:
            self.minimum = value
        if not value <= self.maximum:
            self.maximum = value

    @property
    def mean(self) -> float:
        """Arithmetic mean."""
        return self._mean if self.count else math.nan

    @property
    def deviation(self) -> float:
        """Sample standard deviation; NaN below two values."""
        return math.sqrt(self._squares / (self.count - 1)) if self.count > 1 else math.nan


BINS_PER_OCTAVE: Final = 8
OCTAVES: Final = 36  # 1 ns to 68 s


class Histogram:
    """Counts of durations in log-spaced bins (9 % wide), preallocated, with the running moments."""

    def __init__(self) -> None:
        self.counts: NDArray[np.int64] = np.zeros(BINS_PER_OCTAVE * OCTAVES, np.int64)
        self.moments = Welford()

    def add(self, duration_ns: int) -> None:
        """Count one duration [ns]."""
        place = int(BINS_PER_OCTAVE * math.log2(duration_ns)) if duration_ns > 1 else 0
        self.counts[min(place, len(self.counts) - 1)] += 1
        self.moments.add(duration_ns)

    def quantile(self, share: float) -> float:
        """Return the duration [ns] not exceeded by a `share` of all: a bin's upper edge, at most the
        largest value seen. NaN while empty."""
        if not self.moments.count:
            return math.nan
        place = int(np.searchsorted(np.cumsum(self.counts), share * self.moments.count))
        return float(min(2.0 ** ((place + 1) / BINS_PER_OCTAVE), self.moments.maximum))
