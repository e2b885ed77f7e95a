"""Finds the stops in a recording and makes friction of torque and pressure (3.1, 3.2).

A stop is an application of the brake above 1.5 bar without a gap in time, of 0.5 s and more, in which the
speed falls by a tenth and more; drags are no stops. It ends where the disc stands: there the torque is what
holds it, not friction. A stop whose torque does not explain its loss of speed is left out. Friction follows
from T = 2 mu_b (p - p_0) A_k r_eff (A.19, corrected: A_k sums the pistons of a side) by least squares:
recursively with forgetting for a curve over time, in blocks of 50 ms (the same without forgetting, begun
anew) for identification, whose errors are then independent.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.recording import Recording
from brakelab.results.torque_friction import friction_over_time
from brakelab.stretches import stretches
from ecu.errors import UserError
from ecu.output import say

Places = NDArray[np.int64]

APPLIED: Final = 1.5e5  # Pa
SHORTEST_STOP: Final = 0.5  # s
GAP: Final = 0.1  # s
BLOCK: Final = 0.05  # s
RISEN: Final = 0.9  # of the pressure that a stop holds: from here friction counts (SAE J2522)
RELEASED: Final = 0.5  # likewise: below it at the end the brake is let go
STANDS: Final = 0.2  # m/s of sliding
DEAD: Final = 2.0  # factor between the inertia of a stop and that of most, from which on its torque is wrong


@dataclass(frozen=True)
class Stops:
    """All stops of a recording, one after the other; samples of stop k: first[k] to first[k + 1].

    Blocks are those samples that count, in groups of `per_block`; block j of stop k has the samples from
    block_first[j] on.
    """

    first: Places  # (stops + 1,)
    dt: float  # s
    pressure: Vector  # (samples,) Pa, on the pads
    speed: Vector  # m/s, sliding
    temperature: Vector  # degC
    torque: Vector  # N m
    per_block: int
    block_first: Places  # (blocks,)
    block_stop: Places  # (blocks,), the stop of each
    mu: Vector  # (blocks,), measured
    mean: Vector  # (stops,), over distance, of the recursive curve (SAE J2522)
    begin: Vector  # (stops,), s, of the recording
    start_speed: Vector  # (stops,), m/s, sliding
    start_temperature: Vector  # (stops,), degC
    held_pressure: Vector  # (stops,), Pa, mean where friction counts
    inertia: float  # kg m^2
    lever: float  # m^3, torque over friction and pressure: 2 A_k r_eff
    dead: Vector  # s, beginnings of stops that are left out: torque and loss of speed disagree

    def __len__(self) -> int:
        return len(self.mean)


def find_stops(recording: Recording, columns: Columns, where: str) -> Stops:
    """Return the stops of a recording. Raises `UserError` naming `where` if there is none."""
    time = recording.time
    dt = float(np.median(np.diff(time)))
    radius = columns.brake.effective_radius
    pressed = np.maximum(recording.pressure - 1e5 * columns.rig.push_out_pressure, 0.0)
    on = (pressed > APPLIED) & (radius * recording.speed > STANDS)
    applied = [run for run in _applications(time, on) if _is_stop(recording, run, dt)]
    if not applied:
        raise UserError(where, "", "no stop found: pressure above 1.5 bar for 0.5 s while the speed falls")
    inertias = np.array([_inertia(recording, run) for run in applied])
    most = float(np.median(inertias))
    sound = np.abs(np.log(np.maximum(inertias, 1e-9) / max(most, 1e-9))) < np.log(DEAD)
    runs = [run for run, kept in zip(applied, sound, strict=True) if kept]
    dead = np.array([time[run[0]] for run, kept in zip(applied, sound, strict=True) if not kept])
    lever = 2.0 * columns.brake.piston_area * radius
    inertia = columns.rig.inertia or most
    picked = np.concatenate([np.arange(*run) for run in runs])
    first = np.concatenate([[0], np.cumsum([end - begin for begin, end in runs])])
    torque, pressure = recording.torque[picked], pressed[picked]
    speed = radius * recording.speed[picked]
    per_block = max(round(BLOCK / dt), 1)
    starts, owners, mu, mean, held = [], [], [], [], []
    for stop, (begin, end) in enumerate(pairwise(first)):
        on = pressure[begin:end]
        held_at = np.median(on[on > APPLIED])
        risen = begin + int(np.argmax(on >= RISEN * held_at))
        let_go = end - int(np.argmax(on[::-1] >= RELEASED * held_at))
        count = (let_go - risen) // per_block
        blocks = risen + per_block * np.arange(count)
        use = blocks[:, None] + np.arange(per_block)
        lever_arm = lever * pressure[use]
        found = (torque[use] * lever_arm).sum(axis=1) / (lever_arm**2).sum(axis=1)
        starts.append(blocks)
        owners.append(np.full(count, stop))
        mu.append(found)
        curve = friction_over_time(torque[begin:end], on, lever, dt)
        mean.append(np.average(curve[risen - begin : let_go - begin], weights=speed[risen:let_go]))
        held.append(pressure[risen:let_go].mean())
    return Stops(
        first.astype(np.int64),
        dt,
        pressure,
        speed,
        recording.temperature[picked],
        torque,
        per_block,
        np.concatenate(starts).astype(np.int64),
        np.concatenate(owners).astype(np.int64),
        np.concatenate(mu),
        np.array(mean),
        np.array([time[run[0]] for run in runs]),
        np.array([speed[begin : begin + per_block].mean() for begin in first[:-1]]),
        np.array([recording.temperature[run[0] : run[0] + per_block].mean() for run in runs]),
        np.array(held),
        inertia,
        lever,
        dead,
    )


def block_inputs(stops: Stops) -> NDArray[np.float64]:
    """Return sliding speed [m/s], pressure [Pa] and temperature [degC] of the blocks, shape (blocks, 3)."""
    at = stops.block_first[:, None] + np.arange(stops.per_block)
    columns = (stops.speed, stops.pressure, stops.temperature)
    return np.stack([column[at].mean(axis=1) for column in columns], axis=1)


def say_dead(stops: Stops, where: str) -> None:
    """Say which stops of the recording `where` are left out, if any."""
    if len(stops.dead):
        say(
            f"{where}: {len(stops.dead)} of {len(stops.dead) + len(stops)} stops left out, the first at "
            f"{stops.dead[0]:.1f} s: their torque does not explain the loss of speed; check its sensor there"
        )


def some(stops: Stops, wanted: Places) -> Stops:
    """Return the stops of the numbers `wanted`, in this order."""
    spans = [np.arange(stops.first[k], stops.first[k + 1]) for k in wanted]
    picked = np.concatenate(spans)
    first = np.concatenate([[0], np.cumsum([len(span) for span in spans])])
    blocks = [np.flatnonzero(stops.block_stop == k) for k in wanted]
    moved = [
        stops.block_first[block] - stops.first[k] + begin
        for block, k, begin in zip(blocks, wanted, first, strict=False)
    ]
    owners = [np.full(len(block), place) for place, block in enumerate(blocks)]
    sampled = ("pressure", "speed", "temperature", "torque")
    each = ("mean", "begin", "start_speed", "start_temperature", "held_pressure")
    return replace(
        stops,
        first=first.astype(np.int64),
        block_first=np.concatenate(moved).astype(np.int64),
        block_stop=np.concatenate(owners).astype(np.int64),
        mu=stops.mu[np.concatenate(blocks)],
        **{name: getattr(stops, name)[picked] for name in sampled},
        **{name: getattr(stops, name)[wanted] for name in each},
    )


def _applications(time: Vector, on: NDArray[np.bool_]) -> list[tuple[int, int]]:
    # Noise about the threshold is no release: fill what is shorter than five samples.
    runs: list[tuple[int, int]] = []
    for begin, end in stretches(on):
        if runs and begin - runs[-1][1] <= 5 and time[begin] - time[runs[-1][1] - 1] <= GAP:
            runs[-1] = (runs[-1][0], int(end))
        else:
            runs.append((int(begin), int(end)))
    whole = []
    for begin, end in runs:
        cuts = begin + 1 + np.flatnonzero(np.diff(time[begin:end]) > GAP)
        bounds = [begin, *(int(cut) for cut in cuts), end]
        whole += list(pairwise(bounds))
    return whole


def _is_stop(recording: Recording, run: tuple[int, int], dt: float) -> bool:
    begin, end = run
    few = max(round(BLOCK / dt), 1)
    if (end - begin) * dt < SHORTEST_STOP:
        return False
    before = recording.speed[begin : begin + few].mean()
    return bool(recording.speed[end - few : end].mean() < 0.9 * before)


def _inertia(recording: Recording, run: tuple[int, int]) -> float:
    """Return the inertia [kg m^2] by the torque impulse over the loss of speed."""
    few = 5
    begin, end = run
    first, last = slice(begin, begin + few), slice(end - few, end)
    middle = slice(begin + few // 2, end - few // 2)
    impulse = float(np.trapezoid(recording.torque[middle], recording.time[middle]))
    return impulse / float(recording.speed[first].mean() - recording.speed[last].mean())
