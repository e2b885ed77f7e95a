"""Finds the sections of a programme in the stops of a recording, and their friction.

Recordings carry no programme: stops are aligned with those that the programme asks for, both in their order,
so that the conditions differ least altogether (Needleman and Wunsch, with gaps). A stop that fits nothing
costs as much as one that is far off, a stop that the recording lacks little; a gap that begins or ends within
a section costs more, so that six stops are rather the whole section of six than the last six of thirty. Where
the recording has a column of sections, its number counts as one more condition.

Friction of an application as SAE J2522 has it: mean over distance from 90 % of the pressure on.
"""

import re
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Matrix, Vector
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.sequence import Sequence
from brakelab.identify.friction.stops import Places, Stops

NUMBER: Final = re.compile(r"\s*(\d+(?:\.\d+)?)")
OUTSIDE: Final = 4.0  # cost of a stop that is of no section
LACKING: Final = 0.5  # of one that the recording lacks
WITHIN: Final = 1.5  # of a gap that begins or ends within a section
BETWEEN: Final = 0.1  # likewise, between sections
FARTHEST_CONDITION: Final = 3.0  # of one condition, beyond which a stop is of another section
MISLABELLED: Final = 3.0
RISE: Final = (0.3, 0.9)
"""Of the pressure held, between which its gradient is measured."""
MARKS: Final = (60.0, 30.0)  # km/h, of Figure 3.4
NEAR_MARK: Final = 3.0  # km/h, by which the last block of a stop may be above a mark


class Conditions(NamedTuple):
    """Of every stop, in units of the trade; shape (stops,)."""

    speed: Vector  # km/h, of the car
    end_speed: Vector  # km/h
    pressure: Vector  # bar, mean where friction counts
    deceleration: Vector  # m/s^2, of the car
    start: Vector  # degC
    end: Vector  # degC
    gradient: Vector  # bar/s, of the rise of pressure; NaN: faster than the samples show
    least: Vector  # friction, of blocks of 50 ms
    greatest: Vector
    at_marks: Matrix  # (stops, 3), friction at the beginning, and at MARKS; NaN: not passed


class Part(NamedTuple):
    """A section as recorded: numbers of its stops, and the place of each among those that it asks for."""

    name: str
    stops: Places
    places: Places
    asked: int  # applications of the section


def conditions_of(stops: Stops, columns: Columns) -> Conditions:
    """Return the conditions of the stops."""
    to_kmh = 3.6 * columns.brake.tyre_radius / columns.brake.effective_radius
    first, last = stops.first[:-1], stops.first[1:] - 1
    few = min(stops.per_block, int(np.min(last - first)) + 1)
    speed = to_kmh * stops.start_speed
    end_speed = to_kmh * np.array([stops.speed[end - few + 1 : end + 1].mean() for end in last])
    seconds = np.maximum((last - first) * stops.dt, stops.dt)
    blocks = [stops.mu[stops.block_stop == k] for k in range(len(stops))]
    return Conditions(
        speed,
        end_speed,
        1e-5 * stops.held_pressure,
        (speed - end_speed) / 3.6 / seconds,
        stops.start_temperature,
        np.array([stops.temperature[end - few + 1 : end + 1].mean() for end in last]),
        np.array([_gradient(stops, k) for k in range(len(stops))]),
        np.array([mu.min(initial=np.inf) for mu in blocks]),
        np.array([mu.max(initial=-np.inf) for mu in blocks]),
        np.array([_at_marks(stops, k, to_kmh) for k in range(len(stops))]),
    )


def _gradient(stops: Stops, stop: int) -> float:
    pressure = stops.pressure[stops.first[stop] : stops.first[stop + 1]]
    low, high = (share * stops.held_pressure[stop] for share in RISE)
    begins, ends = int(np.argmax(pressure >= low)), int(np.argmax(pressure >= high))
    if begins >= ends:
        return np.nan
    return 1e-5 * float(pressure[ends] - pressure[begins]) / ((ends - begins) * stops.dt)


def _at_marks(stops: Stops, stop: int, to_kmh: float) -> list[float]:
    """Return friction where it counts first and at MARKS, between blocks."""
    of = stops.block_stop == stop
    if not of.any():
        return [np.nan] * (1 + len(MARKS))
    mu = stops.mu[of]
    at = stops.block_first[of][:, None] + np.arange(stops.per_block)
    speed = to_kmh * stops.speed[at].mean(axis=1)
    passed = [np.interp(-mark, -speed, mu) if speed[-1] - NEAR_MARK <= mark <= speed[0] else np.nan
              for mark in MARKS]  # fmt: skip
    return [float(mu[0]), *map(float, passed)]


def find_sections(
    sequence: Sequence, found: Conditions, labels: NDArray[np.str_] | None = None
) -> tuple[list[Part], Places]:
    """Return the sections of `sequence` that the stops show, in its order, and the stops that are of none.

    `labels`: of the stops in the recording's column of sections, shape (stops,); their numbers count.
    """
    owner = np.repeat(np.arange(len(sequence.section)), [len(one.each()) for one in sequence.section])
    within = np.concatenate([np.arange(len(one.each())) for one in sequence.section])
    matched = _aligned(_costs(sequence, owner, found, labels), within)
    parts = []
    for number, section in enumerate(sequence.section):
        stops = np.flatnonzero((matched >= 0) & (owner[matched] == number))
        if len(stops):
            parts.append(Part(section.name, stops, within[matched[stops]], int(np.sum(owner == number))))
    return parts, np.flatnonzero(matched < 0)


def speed_ratio(sequence: Sequence, parts: list[Part], found: Conditions) -> float:
    """Return the median of the initial speeds over those that the sections ask for; 0 without any."""
    asked = {one.name: one.speed for one in sequence.section}
    ratios = [found.speed[part.stops] / asked[part.name] for part in parts]
    return float(np.median(np.concatenate(ratios))) if ratios else 0.0


def number_of(label: str) -> str:
    """Return the number that a name of a section begins with, empty if none."""
    return match[1] if (match := NUMBER.match(label)) else ""


def _costs(sequence: Sequence, owner: Places, found: Conditions, labels: NDArray[np.str_] | None) -> Matrix:
    """Return how far every stop is from every application that is asked for, shape (stops, asked)."""
    rows = [
        (s.speed, s.end_speed, level, wanted, s.control == "pressure")
        for s in sequence.section
        for level, wanted in s.each()
    ]
    speed, end_speed, level, wanted, by_pressure = (
        np.array(column, float) for column in zip(*rows, strict=True)
    )
    room = 8.0 + 0.05 * speed
    pressed = np.abs(np.log(np.maximum(found.pressure[:, None], 0.1) / level)) / 0.15
    slowed = np.abs(np.log(np.maximum(found.deceleration[:, None], 0.01) / level)) / 0.2
    parts = [
        np.abs(found.speed[:, None] - speed) / room,
        np.abs(found.end_speed[:, None] - end_speed) / room,
        np.where(by_pressure > 0.0, pressed, slowed),
        np.abs(found.start[:, None] - wanted) / (25.0 + 0.1 * wanted),
    ]
    total: Matrix = np.sum(parts, axis=0)
    total[np.max(parts, axis=0) > FARTHEST_CONDITION] = 2.0 * OUTSIDE
    if labels is not None and any(map(number_of, labels)):
        numbers = [number_of(one.name) for one in sequence.section]
        wrong = [[not _within(number, number_of(label)) for number in numbers] for label in labels]
        total += MISLABELLED * np.array(wrong, float)[:, owner]
    return total


def _within(number: str, label: str) -> bool:
    """Return whether the section `number` is the labelled one, or a part of it."""
    return number == label or number.startswith(f"{label}.")


def _aligned(costs: Matrix, within: Places) -> Places:
    """Return which application each stop is, shape (stops,), -1 for none, at the least cost altogether."""
    stops, asked = costs.shape
    opens = np.concatenate([np.where(within > 0, WITHIN, BETWEEN), [0.0]])
    best = np.full((stops + 1, asked + 1, 2), np.inf)  # last: 0 no gap is open, 1 one is
    best[0, 0, 0] = 0.0
    for j in range(1, asked + 1):
        best[0, j, 1] = best[0, j - 1].min() + LACKING
    for k in range(1, stops + 1):
        best[k, :, 0] = best[k - 1, :, 0] + OUTSIDE
        met = np.minimum(best[k - 1, :-1, 0], best[k - 1, :-1, 1] + opens[:-1]) + costs[k - 1]
        best[k, 1:, 0] = np.minimum(best[k, 1:, 0], met)
        best[k, :, 1] = best[k - 1, :, 1] + OUTSIDE
        # A gap goes on or opens: the least over where it opened, each application LACKING.
        ramp = LACKING * np.arange(asked + 1)
        opened = np.minimum(best[k, :, 1], best[k, :, 0] + opens) - ramp
        gone_on = np.minimum.accumulate(opened)[:-1] + ramp[1:]
        best[k, 1:, 1] = np.minimum(best[k, 1:, 1], gone_on)
    return _walked_back(best, costs, opens)


def _walked_back(best: NDArray[np.float64], costs: Matrix, opens: Vector) -> Places:
    k, asked = costs.shape
    matched = np.full(k, -1, np.int64)
    # A test may end anywhere: what was never run opens no gap.
    j, gap = int(np.argmin(best[k, :, 0] + LACKING * (asked - np.arange(asked + 1)))), 0
    while k > 0 or j > 0:
        now = best[k, j, gap]
        if k and np.isclose(now, best[k - 1, j, gap] + OUTSIDE):
            k -= 1
        elif gap:
            stays = best[k, j - 1, 1] + LACKING
            gap = int(np.isclose(now, stays))
            j -= 1
        else:
            k, j = k - 1, j - 1
            matched[k] = j
            gap = int(best[k, j, 1] + opens[j] < best[k, j, 0])
    return matched
