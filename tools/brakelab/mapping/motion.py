"""Motion of a car by its four wheel speeds or its one speed, and what is known of the car beforehand."""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.physics.line import MOVING, RATE, smooth
from brakelab.logs.physics.samples import ANY_CAR, Car, Rows
from brakelab.mapping.names import converts, corner_of, score
from brakelab.mapping.series import Series, coarseness
from ecu.bus.units import CONVERSIONS, spelled
from ecu.contract.signals import CORNERS, INPUT, INPUT_SIGNALS

STANDING: Final = 0.1  # m/s
BRIDGED: Final = 0.5  # s without a sample that a straight line may fill
PERIODS: Final = 3.0  # likewise, of a sender that is slow
MARGIN: Final = 0.5  # s beside a gap, that smoothing and delay reach


class Found(NamedTuple):
    """A signal proposed for an input."""

    target: str
    series: Series
    factor: float
    offset: float
    """In `unit`, as the value after the factor."""
    unit: str
    evidence: str
    sure: bool
    """Physics agrees; else the name alone speaks for it."""
    warning: str = ""
    lag: float = 0.0
    """By which it comes late [s]; columns alone have one."""


class Motion(NamedTuple):
    """Motion of the car by its wheels, on a grid of `RATE`."""

    t: Vector
    speed: Vector
    """m/s"""
    change: Vector
    """dv/dt [m/s^2]"""
    yaw_rates: tuple[Vector, ...]
    """rad/s, positive to the left; of both axles, the front and the rear one; 0 by one speed"""
    known: Rows
    """Where samples of all wheels are near."""
    cache: dict[int, tuple[Series, Vector]]
    """What `smoothed` was given and returned, by the identity of the values."""

    @property
    def drives(self) -> bool:
        """Whether the car drove far enough for physics to tell anything."""
        return bool(np.mean(self.faster(MOVING)) > 0.02)

    def faster(self, speed: float) -> Rows:
        """Return where the car is known to be faster than `speed` [m/s]."""
        return (self.speed > speed) & self.known

    def values(self, series: Series) -> Vector:
        """Return a series on the grid, straight lines between its samples."""
        return _on_grid(series, self.t)

    def smoothed(self, series: Series) -> Vector:
        """Return a series on the grid, smoothed."""
        key = id(series.value)
        if key not in self.cache:
            self.cache[key] = series, smooth(self.values(series))
        return self.cache[key][1]

    def near(self, series: Series) -> Rows:
        """Return where the grid has samples of a series before and after it, not far away."""
        return _is_near(series, self.t)


def contract_unit(target: str) -> str:
    """Return the contract's unit of an input."""
    return INPUT_SIGNALS[INPUT[target]].unit


def _on_grid(series: Series, t: Vector) -> Vector:
    known = np.isfinite(series.value)
    if not known.any():
        return np.full(len(t), np.nan)
    return np.interp(t, series.t[known], series.value[known])


def _is_near(series: Series, t: Vector) -> Rows:
    times = series.t[np.isfinite(series.value)]
    if len(times) < 2:
        return np.zeros(len(t), np.bool_)
    widest = max(BRIDGED, PERIODS * series.period)
    gaps = np.flatnonzero(np.diff(times) > widest)
    near = (t >= times[0]) & (t <= times[-1])
    for begin, end in zip(times[gaps], times[gaps + 1], strict=True):
        first, last = np.searchsorted(t, (begin - MARGIN, end + MARGIN))
        near[first:last] = False
    return near


def wheel_speeds(series: Iterable[Series]) -> dict[str, Series]:
    """Return the four wheel speeds by corner, empty if there are none.

    Four signals whose names differ by the corner alone, in a unit of speed or rotation, or named as wheels;
    of one message where one has all four. A car may send them twice: the less coarse ones are taken.
    """
    groups: dict[tuple[str, int], dict[str, dict[str, Series]]] = {}
    for one in series:
        corner, stem = corner_of(one.signal)
        fitting = converts(one.unit, "rad/s") or converts(one.unit, "m/s")
        if not corner or one.flag or not (fitting or score(one.signal, "wheel_speed") >= 2):
            continue
        groups.setdefault((stem, one.bus), {}).setdefault(one.message, {}).setdefault(corner, one)
    sets: list[dict[str, Series]] = []
    for messages in groups.values():
        parts = [group for group in messages.values() if len(group) < len(CORNERS)]
        sets += [group for group in messages.values() if len(group) == len(CORNERS)]
        sets.append({corner: one for group in reversed(parts) for corner, one in group.items()})
    whole = [group for group in sets if len(group) == len(CORNERS)]

    def worth(group: dict[str, Series]) -> tuple[bool, float, float]:
        means = np.array([np.nanmean(np.abs(one.value)) for one in group.values()])
        together = bool(means.max() <= 1.1 * means.min() + 0.5)
        name = score(group["fl"].name, "wheel_speed")
        return together, name, -coarseness(group["fl"])

    best = max(whole, key=worth, default=None)
    return {} if best is None else {corner: best[corner] for corner in CORNERS}


def vehicle_speed(series: Iterable[Series]) -> Series | None:
    """Return the car's speed, by its name, of several the least coarse; else that of a wheel."""
    along = [one for one in series if not one.flag and converts(one.unit, "m/s")]
    cars = [one for one in along if not corner_of(one.signal)[0] and score(one.signal, "vehicle_speed") >= 1]
    wheels = [one for one in along if score(one.signal, "wheel_speed") >= 2]

    def worth(one: Series) -> tuple[float, float]:
        return score(one.signal, "vehicle_speed"), -coarseness(one)

    return max(cars or wheels, key=worth, default=None)


def speeds(series: Sequence[Series]) -> dict[str, Series]:
    """Return what tells the car's motion, by input: four wheel speeds, else the car's speed, else nothing."""
    if wheels := wheel_speeds(series):
        return {f"wheel_speed_{corner}": one for corner, one in wheels.items()}
    one = vehicle_speed(series)
    return {} if one is None else {"vehicle_speed": one}


def _metres_per_second(series: Series, radius: float) -> Callable[[Vector], Vector]:
    unit = spelled(series.unit)
    if unit in CONVERSIONS["m/s"]:
        scale = CONVERSIONS["m/s"][unit][0]
    else:
        scale = CONVERSIONS["rad/s"].get(unit, (1.0, 0.0))[0] * radius
    return lambda values: values * scale


def motion_of(found: dict[str, Series], car: Car = ANY_CAR) -> Motion:
    """Return how the car moved by what `speeds` found, which is something."""
    start = max(one.t[0] for one in found.values())
    end = min(one.t[-1] for one in found.values())
    t = np.arange(start, end, 1.0 / RATE)
    metres = _metres_per_second(next(iter(found.values())), float(car.radius.mean()))
    each = [smooth(np.abs(metres(_on_grid(one, t)))) for one in found.values()]
    speed = np.mean(each, axis=0)
    fl, fr, rl, rr = each if len(each) == len(CORNERS) else each * len(CORNERS)
    front, rear = (fr - fl) / car.track, (rr - rl) / car.track
    known = np.logical_and.reduce([_is_near(one, t) for one in found.values()])
    change = np.where(known, np.gradient(speed, 1.0 / RATE), 0.0)
    return Motion(t, speed, change, (0.5 * (front + rear), front, rear), known, {})
