"""From the frames drained to the inputs of `step`, by kernels: the same on every bus.

Stamps are turned to the run's time line, frames received, other senders of ours heard, and what the service
alone knows is added to the inputs. Fault bits of the service come from the bus's status and from counters:
one that rose shows its bit for `HOLD_CYCLES`.
"""

from typing import Any, Final

import numpy as np

from ecu.bus.foreign import another_ecu_speaks, place_of_ours
from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.receive import Reception, receive
from ecu.bus.receive_plan import ReceivePlan
from ecu.bus.transmit import TransmitPlan
from ecu.contract import faults
from ecu.contract.records import E2E_COUNTS, RecordArray
from ecu.contract.signals import CYCLE_NS
from ecu.jit import Record, kernel
from ecu.runtime.clock import MICROSECOND_NS
from ecu.runtime.memory import Ecu
from ecu.runtime.standby import claim_is_lost, listen, yield_to_other

GIVEN_UP_NS: Final = 3 * CYCLE_NS
"""Age of a demand that receivers have given up; it is not sent any more."""
HOLD_CYCLES: Final = 100  # a transient fault of the service shows for a second
_COUNTED: Final = (faults.SEND_FAILED, faults.FRAMES_DROPPED, faults.FOREIGN_SENDER, faults.LATE)
_N_E2E: Final = len(E2E_COUNTS)


@kernel
def take_frames(
    frames: RecordArray, loop: RecordArray, grid: RecordArray, count: int, drained_ns: int
) -> None:
    """Add `count` frames behind those that wait, and turn their stamps to the run's time line.

    They were drained at `drained_ns` of the monotonic clock, just before `grid` (`GRID`, shape (1,)) followed
    real time.
    """
    state, first = loop[0], loop[0].waiting
    now_ns = drained_ns + grid[0].offset_ns
    state.waiting += count
    _stamp(frames, first, state.waiting, grid[0].set_ns, state.set_ns, state.emptied_ns, now_ns)
    state.set_ns, state.emptied_ns = grid[0].set_ns, now_ns


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
def fill_inputs(ecu: Ecu, loop: RecordArray) -> None:
    """Fill the inputs of a cycle from the frames that wait; its record has number and tick.

    Consumed frames are counted in the cycle's record. Whether this daemon sends is settled: `loop.standby`.
    """
    state, cycle, inputs, frames = loop[0], ecu.cycle[0], ecu.inputs[0], ecu.waiting
    missed: Any = np.int64(cycle.missed)
    consumed, late, foreign, beside = _gather(
        ecu.receive_plan,
        ecu.transmit_plan,
        ecu.reception,
        frames,
        state.waiting,
        ecu.inputs,
        cycle.t_ns,
        (missed + 1) * CYCLE_NS,
        state.previous_t_ns,
    )
    state.previous_t_ns = cycle.t_ns
    if not state.standby.waits:
        state.foreign += foreign
        if claim_is_lost(state.claim, beside, missed):
            yield_to_other(state.standby)
    if state.standby.waits:
        listen(state.standby, ecu.transmit_plan, ecu.transmission, frames, state.waiting, cycle.t_mono_ns)
    state.overruns += missed
    state.worst_lateness_ns = max(state.worst_lateness_ns, cycle.lateness_ns)
    inputs.bus_faults = _service_faults(state, cycle.number)
    inputs.overruns = state.overruns
    inputs.worst_lateness_us = state.worst_lateness_ns / MICROSECOND_NS
    _note(cycle, state, inputs, ecu.reception.totals[0])
    cycle.frames, cycle.late_frames = consumed, late


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
def _service_faults(state: Record, number: int) -> int:
    """Return the fault bits known to the service alone in cycle `number`."""
    status = state.status
    bits = faults.BUS_OFF if status.bus_off else 0
    if status.error_passive:
        bits |= faults.ERROR_PASSIVE
    if not state.kept:
        bits |= faults.NOT_KEPT
    if state.compiled:
        bits |= faults.COMPILED
    counters = (status.send_failures, status.dropped, state.foreign, state.overruns)
    for place in range(len(_COUNTED)):
        if counters[place] > state.seen[place]:
            state.seen[place] = counters[place]
            state.until[place] = number + HOLD_CYCLES
        if number < state.until[place]:
            bits |= _COUNTED[place]
    return bits


@kernel
def _note(cycle: Record, state: Record, inputs: Record, totals: Record) -> None:
    cycle.bus_faults, cycle.overruns = inputs.bus_faults, inputs.overruns
    cycle.worst_lateness_us = inputs.worst_lateness_us
    cycle.dropped = state.status.dropped
    for i in range(_N_E2E):
        cycle.e2e[i] = totals.e2e[i]
    cycle.speaks, cycle.clock_set_ns = state.standby.speaks, state.set_ns


@kernel
def keep_rest(ecu: Ecu, loop: RecordArray) -> None:
    """Move the frames not consumed to the front."""
    frames, state, consumed = ecu.waiting, loop[0], ecu.cycle[0].frames
    for i in range(consumed, state.waiting):
        frames[i - consumed] = frames[i]
    state.waiting -= consumed
