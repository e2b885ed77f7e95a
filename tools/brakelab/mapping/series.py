"""Every signal of a log that its database knows, as a series over time."""

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

import numpy as np
from cantools.database import Database, Message
from numpy.typing import NDArray

from brakelab.arrays import Vector, median
from ecu.bus.database import fits
from ecu.bus.plan import compile_message, decode
from ecu.bus.units import spelled
from ecu.contract.records import EXTENDED_ID, FRAME_ERROR, FRAME_EXTENDED, FRAME_REMOTE, RecordArray
from ecu.jit import kernel
from ecu.output import say

FEWEST_FRAMES = 20  # frames of a message
MOST_NUMBERS = 16_000_000  # of a log that are looked at, within 1 GB of memory
PER_FRAME = 5
MAGNITUDES = {"deg", "rad", "deg/s", "rad/s", "m/s^2", "g", "N m"}  # units of what has two sides
T = TypeVar("T")
TURNS = 4  # of a sign, in a drive
NOISE = 0.01  # of a signal's spread, of a usual sensor: Table 4.1 has 0.1 rad/s and 0.01 m/s^2
ZERO = 0.05  # of the largest value, that a magnitude is below where its sign turns


def the_first(blocks: Iterable[T], numbers: Callable[[T], int]) -> Iterator[T]:
    """Yield the first blocks of a log, up to `MOST_NUMBERS`, and say so where there are more."""
    left = MOST_NUMBERS
    for block in blocks:
        if left <= 0:
            say("the log is long: its first part is looked at; `map check` reads all of it")
            return
        left -= numbers(block)
        yield block


class Series(NamedTuple):
    """One signal of the log."""

    message: str
    signal: str
    unit: str
    bus: int
    """Place of the interface in the log's list."""
    period: float
    """Median between frames [s]."""
    flag: bool
    """One or two bits: it says yes or no."""
    t: Vector
    """s since the first frame of the log, rising."""
    value: Vector
    """As the database scales it, NaN where the multiplexer selects others."""
    sign: str = ""
    """Signal of the same message that is 1 where the value, sent as a magnitude, is negative."""

    @property
    def name(self) -> str:
        """Message and signal."""
        return f"{self.message}.{self.signal}"

    @property
    def mean_interval(self) -> float:
        """Mean time between frames [s], lost ones included."""
        return float((self.t[-1] - self.t[0]) / max(len(self.t) - 1, 1))

    @property
    def is_known(self) -> bool:
        """Whether any value came; none does of a signal that the multiplexer never selects."""
        return bool(np.isfinite(self.value).any())

    @property
    def longest_gap(self) -> float:
        """Longest time between two values [s]."""
        t = self.t[np.isfinite(self.value)]
        return float(np.diff(t).max()) if len(t) > 1 else math.inf


def step(series: Series) -> float:
    """Return the least step between values, 0: there is but one."""
    values = np.unique(np.round(series.value[np.isfinite(series.value)], 9))
    return float(np.diff(values).min()) if len(values) > 1 else 0.0


def coarseness(series: Series) -> float:
    """Return by how much a signal is worse than another that says the same [s].

    Steps q add q²/12 to the variance of a sensor; that of a sample times the interval of the samples is the
    noise per bandwidth, here over the square of the signal's spread.
    """
    spread = float(np.nanstd(series.value))
    variance = (step(series) / spread) ** 2 / 12.0 + NOISE**2 if spread else math.inf
    return variance * series.mean_interval


@kernel
def _decode_all(
    signals: Any, codes: NDArray[np.int64], data: NDArray[np.uint8], values: NDArray[np.float64]
) -> None:
    for k in range(len(data)):
        decode(signals, codes, data[k], values[k])


def _readable(message: Message) -> bool:
    return message.length > 0 and any(fits(signal, message.length) for signal in message.signals)


def read_series(blocks: Iterable[RecordArray], database: Database) -> list[Series]:
    """Return the series of all messages that came at least `FEWEST_FRAMES` times, on each bus for itself.

    `blocks`: FRAME in the order of the log, of a long one the first. Frames of a wrong length are left out.
    """
    first = the_first(blocks, lambda block: PER_FRAME * len(block))
    frames = np.concatenate([np.asarray(block).copy() for block in first])
    frames = frames[frames["flags"] & (FRAME_ERROR | FRAME_REMOTE) == 0]
    extended = np.where(frames["flags"] & FRAME_EXTENDED, EXTENDED_ID, 0).astype(np.uint32)
    ids = frames["can_id"] | extended
    start = frames["stamp_ns"].min() if len(frames) else 0
    found = []
    for message in database.messages:
        identifier = message.frame_id | (EXTENDED_ID if message.is_extended_frame else 0)
        mine = frames[ids == identifier]
        mine = mine[mine["length"] >= message.length]
        if not _readable(message):
            continue
        for bus in np.unique(mine["bus"]):
            here = mine[mine["bus"] == bus]
            if len(here) >= FEWEST_FRAMES:
                own = [one for one in _series(message, here, int(bus), int(start)) if one.is_known]
                found += [*own, *with_signs(own)]
    return found


def with_signs(series: list[Series]) -> list[Series]:
    """Return the series of one message that may be magnitudes, with each flag that may be their sign.

    A magnitude passes through zero where its sign turns; which flag is the sign, motion shows.
    """
    flags = [one for one in series if one.flag and set(np.unique(one.value)) == {0.0, 1.0}]
    found = []
    for one in series:
        large = np.nanpercentile(one.value, 99)
        if one.flag or spelled(one.unit) not in MAGNITUDES or not large > np.nanmin(one.value) == 0.0:
            continue
        for flag in flags:
            turns = np.flatnonzero(np.diff(flag.value))
            beside = np.minimum(one.value[turns], one.value[turns + 1])
            if len(turns) >= TURNS and np.quantile(beside, 0.9) < ZERO * large:
                value = one.value * (1.0 - 2.0 * flag.value)
                found.append(one._replace(value=value, sign=flag.signal))
    return found


def _series(message: Message, frames: RecordArray, bus: int, start: int) -> list[Series]:
    plan = compile_message(message)
    values = np.empty((len(frames), len(plan.names)))
    _decode_all(plan.signals, plan.codes, np.ascontiguousarray(frames["data"]), values)
    t, first = np.unique((frames["stamp_ns"] - start) * 1e-9, return_index=True)
    period = median(np.diff(t)) if len(t) > 1 else np.nan
    signals = {signal.name: signal for signal in message.signals}
    return [
        Series(
            message.name,
            name,
            signals[name].unit or "",
            bus,
            period,
            signals[name].length <= 2,
            t,
            values[first, place],
        )
        for place, name in enumerate(plan.names)
    ]
