"""The 10 ms cycle: wait, drain, receive, step, transmit, send, publish.

`cycle_once` works on memory allocated by `new_ecu` and on an open channel, ring and grid. It makes no lasting
allocation, logs nothing and waits for its deadline alone.
"""

import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from ecu.algorithm.step import step
from ecu.bus.protocol import BusStatus, Channel
from ecu.bus.socketcan import SocketcanChannel
from ecu.bus.transmit import slowest_demand, transmit
from ecu.contract.records import STAGES
from ecu.contract.signals import CYCLE_NS, DEMANDS
from ecu.jit import CompileCounter
from ecu.recording.publish import publish
from ecu.recording.ring import Ring
from ecu.runtime.clock import Grid, Histogram
from ecu.runtime.exchange import LEAD_NS, exchange
from ecu.runtime.loop import GIVEN_UP_NS, fill_inputs, keep_rest, take_frames
from ecu.runtime.memory import Ecu, new_loop, new_twin

FAREWELLS: Final = 3  # one may be lost


class Timing:
    """Lateness and stage times of a run."""

    def __init__(self) -> None:
        self.lateness = Histogram()
        self.stages = tuple(Histogram() for _ in STAGES)

    def add(self, lateness_ns: int, stages_ns: Sequence[int]) -> None:
        """Add one cycle."""
        self.lateness.add(lateness_ns)
        for histogram, duration_ns in zip(self.stages, stages_ns, strict=True):
            histogram.add(duration_ns)


class Progress:
    """State of the loop beside the ECU's own records. `waits`: as a standby."""

    def __init__(self, ecu: Ecu, start: BusStatus, compiled: CompileCounter, *, waits: bool = False) -> None:
        self.loop, self.timing, self.number = new_loop(waits=waits), Timing(), 0
        self.twin, self.twin_loop = new_twin(ecu), self.loop.copy()
        self.loop["seen"][0, :2] = start.send_failures, start.dropped
        self._compiled, self._compiled_at_start = compiled, compiled.count

    @property
    def speaks(self) -> bool:
        """Return whether this daemon sends."""
        return bool(self.loop["standby"]["speaks"][0])

    @property
    def overruns(self) -> int:
        """Return how many periods were missed."""
        return int(self.loop["overruns"][0])

    def look_at_compiler(self) -> None:
        """Note a compilation in operation."""
        if self._compiled.count > self._compiled_at_start:
            self.loop["compiled"] = 1


def cycle_once(ecu: Ecu, channel: Channel, ring: Ring, grid: Grid, run: Progress) -> None:
    """Run one cycle: the ECU, from the socket to the socket."""
    cycle = ecu.cycle
    cycle["number"] = run.number
    run.look_at_compiler()
    if isinstance(channel, SocketcanChannel):
        grid.approach(LEAD_NS)
        channel.bind_again()
        exchange(ecu, run.twin, run.loop, run.twin_loop, grid.memory, channel.memory)
        grid.deadline_ns = int(cycle["t_mono_ns"][0])
    else:
        _exchange(ecu, channel, grid, run)
    publish(ring, cycle, ecu.outputs, ecu.inputs, ecu.estimate, ecu.learned, ecu.watched, ecu.waiting)
    keep_rest(ecu, run.loop)
    run.timing.add(int(cycle["lateness_ns"][0]), cycle["stage_ns"][0].tolist())
    run.number += 1


def _exchange(ecu: Ecu, channel: Channel, grid: Grid, run: Progress) -> None:
    """Wait, drain, receive, step, transmit and send, as `exchange` does on SocketCAN."""
    cycle, loop, clock = ecu.cycle, run.loop, grid.source.monotonic_ns
    tick = grid.wait()
    woken = clock()
    cycle["t_ns"], cycle["t_mono_ns"] = tick.t_ns, tick.t_mono_ns
    cycle["missed"], cycle["lateness_ns"] = tick.missed, tick.lateness_ns
    count = channel.drain(ecu.waiting, int(loop["waiting"][0]))
    grid.follow_realtime()
    drained = clock()
    take_frames(ecu.waiting, loop, grid.memory, count, drained)
    loop["status"] = tuple(channel.status())
    fill_inputs(ecu, loop)
    received = clock()
    step(ecu.params, ecu.state, ecu.inputs, ecu.outputs)
    stepped = clock()
    due = 0
    if run.speaks:
        due = transmit(ecu.transmit_plan, ecu.transmission, ecu.vector, run.number, ecu.sending)
    encoded = clock()
    for i in range(due):
        if clock() - tick.t_mono_ns < GIVEN_UP_NS:  # else the process stood still since it woke
            channel.send(ecu.sending[i : i + 1], 1)
    instants = (woken, drained, received, stepped, encoded, clock())
    cycle["stage_ns"] = tuple(after - before for before, after in pairwise(instants))


def send_farewell(
    ecu: Ecu, channel: Channel, number: int, sleep: Callable[[float], None] = time.sleep
) -> None:
    """Send all frames due with demand 0 flagged invalid, in three cycles from `number` on.

    In as many more as the slowest message of a map with a demand needs. The hydraulic fallback takes over at
    once. It works at any point of an interrupted cycle.
    """
    outputs = ecu.outputs
    for name in DEMANDS:
        outputs[name] = 0.0
    outputs["pressure_demand_valid"] = outputs["motor_demand_valid"] = 0.0
    outputs["motor_demand"] = np.nan
    for cycle in range(number, number + max(FAREWELLS, slowest_demand(ecu.transmit_plan))):
        if cycle > number:
            sleep(CYCLE_NS * 1e-9)
        due = transmit(ecu.transmit_plan, ecu.transmission, ecu.vector, cycle, ecu.sending)
        channel.send(ecu.sending, due)
