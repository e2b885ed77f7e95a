"""The 10 ms cycle: wait, drain, receive, step, transmit, send, publish.

`cycle_once` works on memory allocated by `new_ecu` and on an open channel, ring and grid. It makes no lasting
allocation, logs nothing and waits for its deadline alone.
"""

import time
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.step import new_state, step
from ecu.bus.foreign import another_ecu_speaks, place_of_ours
from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.protocol import BusStatus, Channel
from ecu.bus.receive import Reception, new_reception, receive
from ecu.bus.receive_plan import ReceivePlan
from ecu.bus.transmit import (
    Transmission,
    TransmitPlan,
    frame_buffer,
    new_transmission,
    slowest_demand,
    transmit,
)
from ecu.contract import faults
from ecu.contract.records import (
    CYCLE,
    FRAME,
    INPUTS,
    OUTPUTS,
    STAGES,
    RecordArray,
    new_record,
    output_vector,
)
from ecu.contract.signals import CYCLE_NS, DEMANDS
from ecu.jit import CompileCounter, kernel
from ecu.recording.ring import Ring, publish
from ecu.runtime.clock import MICROSECOND_NS, Grid, Histogram, Tick
from ecu.runtime.standby import Claim, Standby

WAITING_FRAMES: Final = 16384  # more than a socket holds: what waited while the process stood still
GIVEN_UP_NS: Final = 3 * CYCLE_NS
"""Age of a demand that receivers have given up; it is not sent any more."""
HOLD_CYCLES: Final = 100  # a transient fault of the service shows for a second
FAREWELLS: Final = 3  # one may be lost
_COUNTED: Final = (faults.SEND_FAILED, faults.FRAMES_DROPPED, faults.FOREIGN_SENDER, faults.LATE)


class Ecu(NamedTuple):
    """Memory of the cycle, allocated before the first one."""

    params: RecordArray
    state: RecordArray
    inputs: RecordArray
    outputs: RecordArray
    vector: NDArray[np.float64]
    """The outputs as `transmit` reads them."""
    learned: RecordArray
    """A view into the state."""
    watched: RecordArray
    """Likewise."""
    cycle: RecordArray
    receive_plan: ReceivePlan
    reception: Reception
    transmit_plan: TransmitPlan
    transmission: Transmission
    waiting: RecordArray
    """Frames received and not consumed yet, from index 0."""
    sending: RecordArray


def new_ecu(
    params: RecordArray, learned: RecordArray | None, receive_plan: ReceivePlan, transmit_plan: TransmitPlan
) -> Ecu:
    """Return an ECU before its first cycle, with the values `learned` before (None: unadapted)."""
    params = params.copy()
    params["mapped"] = receive_plan.mapped
    state = new_state(params, learned)
    outputs = new_record(OUTPUTS)
    return Ecu(
        params,
        state,
        new_record(INPUTS),
        outputs,
        output_vector(outputs),
        state["learned"],
        state["witness"]["published"],
        new_record(CYCLE),
        receive_plan,
        new_reception(receive_plan),
        transmit_plan,
        new_transmission(transmit_plan),
        new_record(FRAME, WAITING_FRAMES),
        frame_buffer(transmit_plan),
    )


class Timing:
    """Lateness and stage times of a run."""

    def __init__(self) -> None:
        self.lateness = Histogram()
        self.stages = tuple(Histogram() for _ in STAGES)

    def add(self, lateness_ns: int, stages_ns: tuple[int, ...]) -> None:
        """Add one cycle."""
        self.lateness.add(lateness_ns)
        for histogram, duration_ns in zip(self.stages, stages_ns, strict=True):
            histogram.add(duration_ns)


class Watch:
    """Fault bits known to the service alone. A counter that rose shows its bit for `HOLD_CYCLES`."""

    def __init__(self, start: BusStatus, compiled: CompileCounter) -> None:
        self._compiled, self._compiled_at_start = compiled, compiled.count
        self._seen = [start.send_failures, start.dropped, 0, 0]
        self._until = [0, 0, 0, 0]
        self.kept = True
        """Whether the side process stores its data."""

    def look(self, number: int, status: BusStatus, foreign: int, overruns: int) -> int:
        """Return the bits in cycle `number`."""
        bits = faults.BUS_OFF if status.bus_off else 0
        if status.error_passive:
            bits |= faults.ERROR_PASSIVE
        if not self.kept:
            bits |= faults.NOT_KEPT
        if self._compiled.count > self._compiled_at_start:
            bits |= faults.COMPILED
        counters = (status.send_failures, status.dropped, foreign, overruns)
        for place, bit in enumerate(_COUNTED):
            if counters[place] > self._seen[place]:
                self._seen[place] = counters[place]
                self._until[place] = number + HOLD_CYCLES
            if number < self._until[place]:
                bits |= bit
        return bits


class Progress:
    """State of the loop beside the ECU's own records."""

    def __init__(self, watch: Watch, standby: Standby | None = None) -> None:
        self.watch, self.standby, self.claim, self.timing = watch, standby, Claim(), Timing()
        self.number = self.overruns = self.waiting = self.foreign = 0
        self.worst_lateness_ns = self.previous_t_ns = self.emptied_ns = 0

    @property
    def speaks(self) -> bool:
        """Return whether this daemon sends."""
        return self.standby is None or self.standby.speaks


def cycle_once(ecu: Ecu, channel: Channel, ring: Ring, grid: Grid, run: Progress) -> None:
    """Run one cycle: the ECU, from the socket to the socket."""
    clock = grid.source.monotonic_ns
    tick = grid.wait()
    woken = clock()
    first, set_before_ns, emptied_ns = run.waiting, grid.set_ns, run.emptied_ns
    run.waiting += channel.drain(ecu.waiting, first)
    set_ns = grid.follow_realtime()
    drained = clock()
    run.emptied_ns = drained + grid.offset_ns
    _stamp(ecu.waiting, first, run.waiting, set_ns, set_before_ns, emptied_ns, run.emptied_ns)
    consumed, late, foreign, beside = _gather(
        ecu.receive_plan,
        ecu.transmit_plan,
        ecu.reception,
        ecu.waiting,
        run.waiting,
        ecu.inputs,
        tick.t_ns,
        (tick.missed + 1) * CYCLE_NS,
        run.previous_t_ns,
    )
    if run.standby is None:
        run.foreign += foreign
        if run.claim.is_lost(beside, tick.missed):
            run.standby = Standby(yielded=True)
    if run.standby is not None:
        run.standby.listen(ecu.transmit_plan, ecu.transmission, ecu.waiting, run.waiting, tick.t_mono_ns)
    status = channel.status()
    _note_service(ecu, run, tick, status)
    received = clock()
    step(ecu.params, ecu.state, ecu.inputs, ecu.outputs)
    stepped = clock()
    due = 0
    if run.speaks:
        due = transmit(ecu.transmit_plan, ecu.transmission, ecu.vector, run.number, ecu.sending)
    encoded = clock()
    if encoded - tick.t_mono_ns < GIVEN_UP_NS:  # else the process stood still since it woke
        channel.send(ecu.sending, due)
    sent = clock()

    stages = (drained - woken, received - drained, stepped - received, encoded - stepped, sent - encoded)
    _note_cycle(ecu, run, tick, consumed, late, status.dropped, stages)
    ecu.cycle["clock_set_ns"] = set_ns
    publish(ring, ecu.cycle, ecu.outputs, ecu.learned, ecu.watched, ecu.waiting)
    run.waiting = _keep_rest(ecu.waiting, consumed, run.waiting)
    run.timing.add(tick.lateness_ns, stages)
    run.previous_t_ns = tick.t_ns
    run.number += 1


def _note_service(ecu: Ecu, run: Progress, tick: Tick, status: BusStatus) -> None:
    """Pass the service's own findings to `step`."""
    run.overruns += tick.missed
    run.worst_lateness_ns = max(run.worst_lateness_ns, tick.lateness_ns)
    inputs = ecu.inputs
    inputs["bus_faults"] = run.watch.look(run.number, status, run.foreign, run.overruns)
    inputs["overruns"] = run.overruns
    inputs["worst_lateness_us"] = run.worst_lateness_ns / MICROSECOND_NS


def _note_cycle(
    ecu: Ecu, run: Progress, tick: Tick, consumed: int, late: int, dropped: int, stages_ns: tuple[int, ...]
) -> None:
    cycle = ecu.cycle
    cycle["number"], cycle["t_ns"], cycle["t_mono_ns"] = run.number, tick.t_ns, tick.t_mono_ns
    cycle["missed"], cycle["lateness_ns"] = tick.missed, tick.lateness_ns
    for name in ("bus_faults", "overruns", "worst_lateness_us"):
        cycle[name] = ecu.inputs[name]
    cycle["frames"], cycle["late_frames"], cycle["dropped"] = consumed, late, dropped
    cycle["e2e"] = ecu.reception.totals["e2e"]
    cycle["stage_ns"], cycle["speaks"] = stages_ns, run.speaks


@kernel
def _stamp(
    frames: Any, first: int, count: int, set_ns: int, set_before_ns: int, emptied_ns: int, now_ns: int
) -> None:
    """Turn the stamps of `frames[first:count]` from the real-time clock to the run's time line.

    They came after `emptied_ns`. Where the clock was set since, from `set_before_ns` to `set_ns`, those that
    this contradicts were stamped before. A stamp in the future, of a driver with a clock of its own, becomes
    now.
    """
    now_us = now_ns // MICROSECOND_NS * MICROSECOND_NS
    for i in range(first, count):
        stamp_ns = frames[i].stamp_ns - set_ns
        if set_before_ns != set_ns and not emptied_ns < stamp_ns <= now_ns:
            stamp_ns = frames[i].stamp_ns - set_before_ns
        frames[i].stamp_ns = min(stamp_ns, now_us)


@kernel
def _gather(
    plan: ReceivePlan,
    own: TransmitPlan,
    reception: Reception,
    frames: Any,
    count: int,
    inputs: Any,
    t_ns: int,
    dt_ns: int,
    previous_t_ns: int,
) -> tuple[int, int, int, int]:
    """Fill `inputs` from the frames stamped up to `t_ns`.

    Returns their number, how many of them were late, how many have one of our own identifiers, and in how
    many periods another ECU's came (`ecu/bus/foreign.py`).
    """
    begin_cycle(inputs[0], t_ns, dt_ns)
    consumed = receive(plan, reception, frames, 0, count, inputs[0])
    end_cycle(inputs[0], reception.freshness)
    late = foreign = beside = begin = 0
    for i in range(consumed):
        if frames[i].stamp_ns <= previous_t_ns:
            late += 1
        if place_of_ours(own, frames[i]) >= 0:
            foreign += 1
    while begin < consumed and foreign > 1:
        period, end = (t_ns - frames[begin].stamp_ns) // CYCLE_NS, begin + 1
        while end < consumed and (t_ns - frames[end].stamp_ns) // CYCLE_NS == period:
            end += 1
        if another_ecu_speaks(own, frames[begin:end], end - begin):
            beside += 1
        begin = end
    return consumed, late, foreign, beside


@kernel
def _keep_rest(frames: Any, first: int, count: int) -> int:
    """Move `frames[first:count]` to the front; return their number."""
    for i in range(first, count):
        frames[i - first] = frames[i]
    return count - first


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
