"""Faults of a scenario applied: to frames on the bus, to signals before they are sent, and to the car."""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from brakelab.simulation.faults import (
    ACCUMULATOR_LOW,
    BATCHED,
    BIASED,
    CALLIPER_DEAD,
    CORRUPTED,
    DAEMON_KILLED,
    DELAYED,
    DOUBLED,
    DRIFTING,
    HELD_UP,
    INVALID,
    LATE,
    LONGEST_DELAY,
    MOTOR_LOST,
    NOISY,
    SCALE_DRIFTING,
    SCALED,
    SET,
    STUCK,
    SWAPPED,
)
from ecu.contract import signals
from ecu.contract.records import FRAME, RecordArray, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.jit import Record, kernel

SLACK: Final = 1e-4  # s by which the sum of all steps may fall short of a cycle's time
HELD: Final = 256  # delayed frames at a time
BEHIND: Final = 1e-6  # s
ROOM: Final = 512  # frames that arrive in one cycle
MASKED: Final = 52  # bits of a whole number in a float


class Link(NamedTuple):
    """One direction of the bus."""

    held: RecordArray
    """`FRAME`s that come later, and when:"""
    release: NDArray[np.float64]
    """s, inf where nothing is held."""
    arrived: RecordArray
    """Room for what `deliver` hands over."""


def new_link() -> Link:
    """Return a link without delayed frames."""
    return Link(new_record(FRAME, HELD), np.full(HELD, np.inf), new_record(FRAME, ROOM))


@kernel
def is_on(fault: Record, t: float) -> bool:
    """Return whether the fault acts at `t` [s]."""
    return bool(fault.begin <= t + SLACK < fault.end)


@kernel
def _hits(fault: Record, can_id: int, t: float, noise: Generator) -> bool:
    if not is_on(fault, t):
        return False
    for i in range(fault.n_ids):
        if fault.ids[i] == can_id:
            return bool(fault.share >= 1.0 or noise.random() < fault.share)
    return False


@kernel
def _behind(link: Link, can_id: int) -> float:
    """Return when a frame can arrive at the soonest [s]: a bus keeps the order of one identifier."""
    soonest = -math.inf
    for place in range(len(link.release)):
        if not math.isinf(link.release[place]) and link.held[place].can_id == can_id:
            soonest = max(soonest, link.release[place] + BEHIND)
    return soonest


@kernel
def _hold_up(link: Link, frame: Record, t: float, release: float) -> None:
    release = max(release, _behind(link, frame.can_id))
    for place in range(len(link.release)):
        if math.isinf(link.release[place]):
            link.held[place] = frame
            link.held[place].stamp_ns += np.int64(1e9 * (release - t))
            link.release[place] = release
            return


@kernel
def _release(fault: Record, t: float, noise: Generator) -> float:
    """Return when a frame sent at `t` arrives [s]."""
    if fault.kind == HELD_UP:
        return float(fault.end)
    if fault.kind == BATCHED:
        return float(fault.delay * (math.floor((t + SLACK) / fault.delay) + 1.0))
    if fault.kind == LATE:
        return float(t + fault.delay)
    return float(t + fault.delay * max(1.0 + noise.standard_normal(), 0.0))


@kernel
def _next(link: Link, t: float) -> int:
    """Return the place of the held frame that arrives first, by `t` at the latest; -1: none."""
    found, first = -1, t + SLACK
    for place in range(len(link.release)):
        if link.release[place] < first or (found < 0 and link.release[place] <= first):
            found, first = place, link.release[place]
    return found


@kernel
def deliver(faults: Any, link: Link, t: float, noise: Generator, frames: Any, count: int) -> int:
    """Write the frames that arrive into `link.arrived`: delayed ones, in the order of their arrival, then
    those of `frames[:count]`, sent at `t` [s]; return their number."""
    arrived = 0
    place = _next(link, t)
    while place >= 0:
        link.arrived[arrived] = link.held[place]
        link.release[place] = np.inf
        arrived += 1
        place = _next(link, t)
    for i in range(count):
        kept, copies = True, 1
        link.arrived[arrived] = frames[i]
        for j in range(len(faults)):
            fault = faults[j]
            kind = fault.kind
            if kind >= DAEMON_KILLED:
                continue
            if not _hits(fault, frames[i].can_id, t, noise):
                continue
            if kind == CORRUPTED:
                bit = int(noise.random() * 8 * frames[i].length)
                link.arrived[arrived].data[bit // 8] ^= 1 << (bit % 8)
            elif kind == DOUBLED:
                copies = 2
            else:
                kept = False
                if kind <= HELD_UP:
                    _hold_up(link, frames[i], t, _release(fault, t, noise))
        if kept and _behind(link, frames[i].can_id) > t:
            _hold_up(link, link.arrived[arrived], t, t)
        elif kept:
            arrived += 1
            if copies == 2:
                link.arrived[arrived] = link.arrived[arrived - 1]
                arrived += 1
    return arrived


@kernel
def _spoil_signals(fault: Record, on: bool, t: float, noise: Generator, values: NDArray[np.float64]) -> None:
    drift = min(max(fault.rate * (t - fault.begin), -fault.limit), fault.limit)
    other = -1
    for place in range(len(fault.place)):
        if not fault.place[place]:
            continue
        if fault.kind == DELAYED:
            _delay_signal(fault, place, on, values)
        elif fault.kind == STUCK:
            _hold_signal(fault, place, on, values)
        elif not on:
            continue
        elif fault.kind == SET and not math.isnan(values[place]):
            values[place] = fault.amount
        elif fault.kind == INVALID:
            values[place] = np.nan
        elif fault.kind == BIASED:
            values[place] += fault.amount
        elif fault.kind == NOISY:
            values[place] += fault.amount * noise.standard_normal()
        elif fault.kind == SCALED:
            values[place] *= fault.amount
        elif fault.kind == DRIFTING:
            values[place] += drift
        elif fault.kind == SCALE_DRIFTING:
            values[place] *= 1.0 + drift
        elif fault.kind == SWAPPED and other < 0:
            other = place
        elif fault.kind == SWAPPED:
            values[place], values[other] = values[other], values[place]
    fault.newest = (fault.newest + 1) % LONGEST_DELAY


@kernel
def _hold_signal(fault: Record, place: int, on: bool, values: NDArray[np.float64]) -> None:
    if not on:
        fault.held[place] = np.nan
    elif math.isnan(fault.held[place]):
        fault.held[place] = values[place]
    elif not math.isnan(values[place]):
        values[place] = fault.held[place]


@kernel
def _delay_signal(fault: Record, place: int, on: bool, values: NDArray[np.float64]) -> None:
    fault.past[fault.newest, place] = values[place]
    if on:
        cycles = round(float(fault.delay) / (1e-9 * CYCLE_NS))
        values[place] = fault.past[(fault.newest - cycles) % LONGEST_DELAY, place]


@kernel
def begin_faults(faults: Any, t: float, values: NDArray[np.float64]) -> None:
    """Let the faults begin whose condition holds at `t` [s]; `values` before faults, shape (N_INPUTS,)."""
    for j in range(len(faults)):
        fault = faults[j]
        if fault.watched < 0 or not math.isinf(fault.begin) or t + SLACK < fault.soonest:
            continue
        if fault.sign * (values[fault.watched] - fault.threshold) > 0.0:  # not where it is NaN
            fault.begin, fault.end = t, t + fault.duration


@kernel
def acting(faults: Any, t: float) -> float:
    """Return the mask of the faults that act at `t` [s]: 1 for the first."""
    mask, bit = 0.0, 1.0
    for j in range(min(len(faults), MASKED)):
        if is_on(faults[j], t):
            mask += bit
        bit *= 2.0
    return mask


@kernel
def spoil_car(
    faults: Any, t: float, noise: Generator, sound: Record, params: Record, values: NDArray[np.float64]
) -> None:
    """Apply faults of sensors and actuators to the values to send, shape (N_INPUTS,), and to the car.

    `sound` are the car's parameters without a fault.
    """
    begin_faults(faults, t, values)
    for i in range(4):
        params.motor_share[i] = sound.motor_share[i]
        params.pressure_limit[i] = sound.pressure_limit[i]
    for j in range(len(faults)):
        fault = faults[j]
        on = is_on(fault, t)
        if STUCK <= fault.kind <= SWAPPED:
            _spoil_signals(fault, on, t, noise, values)
        elif on and fault.kind == MOTOR_LOST:
            for i in range(4):
                if fault.corner[i]:
                    params.motor_share[i] = 0.0
        elif on and fault.kind == CALLIPER_DEAD:
            for i in range(4):
                if fault.corner[i]:
                    params.pressure_limit[i] = 0.0
        elif on and fault.kind == ACCUMULATOR_LOW:
            for i in range(4):
                params.pressure_limit[i] = min(params.pressure_limit[i], 1e5 * fault.amount)
            values[signals.ACCUMULATOR_PRESSURE] = fault.amount
            values[signals.HYDRAULIC_READY] = 0.0
