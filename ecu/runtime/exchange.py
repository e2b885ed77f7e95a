"""A cycle on SocketCAN as one kernel: the end of the wait, drain, receive, step, transmit and send.

After 10 ms of sleep caches are cold: a step that takes 2 µs in a loop takes ten times as long. The loop
therefore wakes `LEAD_NS` before the deadline, drains what has come in so far, and rehearses the cycle on
copies, whose outcome is thrown away.
"""

from typing import Final

from ecu.algorithm.step import step
from ecu.bus.socketcan import Socket, read_status, receive_frames, send_frames
from ecu.bus.transmit import transmit
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS
from ecu.jit import kernel
from ecu.runtime.clock import arrival, follow_realtime
from ecu.runtime.loop import GIVEN_UP_NS, fill_inputs, take_frames
from ecu.runtime.memory import Ecu
from ecu.system_calls import clock_gettime, clock_nanosleep

LEAD_NS: Final = 400_000
"""A guest wakes 0.1 ms late, and the rehearsal takes as long."""
LONGEST_NS: Final = 2 * LEAD_NS
"""A rehearsal that was interrupted counts as one of this length."""
FORGETS: Final = 1024
"""Cycles in which a machine too slow for rehearsals forgets their length: it may end one late."""
_CLOCK_REALTIME, _CLOCK_BOOTTIME, _TIMER_ABSTIME = 0, 7, 1  # linux/time.h


@kernel
def _now_ns(clock: int, loop: RecordArray) -> int:
    instant = loop[0].instant
    clock_gettime(clock, instant.ctypes.data)
    return instant[0] * 1_000_000_000 + instant[1]


@kernel
def _sleep_until(deadline_ns: int, loop: RecordArray) -> int:
    """Sleep until an instant; return when it was over [ns]. A signal does not end it."""
    instant = loop[0].instant
    now_ns = _now_ns(_CLOCK_BOOTTIME, loop)
    while now_ns < deadline_ns:
        instant[0], instant[1] = deadline_ns // 1_000_000_000, deadline_ns % 1_000_000_000
        clock_nanosleep(_CLOCK_BOOTTIME, _TIMER_ABSTIME, instant.ctypes.data, 0)
        now_ns = _now_ns(_CLOCK_BOOTTIME, loop)
    return now_ns


@kernel
def _drain(ecu: Ecu, loop: RecordArray, grid: RecordArray, can: Socket) -> int:
    """Add the frames that wait in the socket to those that wait here; return when that ended [ns]."""
    count = receive_frames(can, ecu.waiting, loop[0].waiting)
    before_ns = _now_ns(_CLOCK_BOOTTIME, loop)
    real_ns = _now_ns(_CLOCK_REALTIME, loop)
    after_ns = _now_ns(_CLOCK_BOOTTIME, loop)
    follow_realtime(grid, before_ns, real_ns, after_ns)
    take_frames(ecu.waiting, loop, grid, count, after_ns)
    return after_ns


@kernel
def exchange(
    ecu: Ecu, twin: Ecu, loop: RecordArray, twin_loop: RecordArray, grid: RecordArray, can: Socket
) -> None:
    """Wait for the deadline and run the cycle whose number is in its record, from the socket to the socket.

    Tick and stage times go into the same record; the first stage begins with the waking.

    Args:
        ecu: of the daemon.
        twin: its `new_twin`, for the rehearsal.
        loop: `LOOP`, shape (1,).
        twin_loop: likewise, for the rehearsal.
        grid: `GRID`, shape (1,), as `Grid.approach` leaves it.
        can: the bus.
    """
    cycle, state, times = ecu.cycle[0], loop[0], grid[0]
    began_ns = _now_ns(_CLOCK_BOOTTIME, loop)
    if times.wakes_ns - began_ns > state.rehearsal_ns:
        _drain(ecu, loop, grid, can)
        _rehearse(ecu, twin, loop, twin_loop)
        spent_ns = min(_now_ns(_CLOCK_BOOTTIME, loop) - began_ns, LONGEST_NS)
        state.rehearsal_ns += (spent_ns - state.rehearsal_ns) // 4
    else:
        state.rehearsal_ns -= state.rehearsal_ns // FORGETS
    woken_ns = _sleep_until(times.wakes_ns, loop)
    cycle.t_ns, cycle.t_mono_ns, cycle.missed, cycle.lateness_ns = arrival(
        times.deadline_ns, times.wakes_ns, times.period_ns, times.offset_ns, woken_ns
    )
    drained_ns = _drain(ecu, loop, grid, can)
    read_status(can, state.status)
    fill_inputs(ecu, loop)
    received_ns = _now_ns(_CLOCK_BOOTTIME, loop)
    step(ecu.params, ecu.state, ecu.inputs, ecu.outputs)
    stepped_ns = _now_ns(_CLOCK_BOOTTIME, loop)
    due = 0
    if state.standby.speaks:
        due = transmit(ecu.transmit_plan, ecu.transmission, ecu.vector, cycle.number, ecu.sending)
    encoded_ns = _now_ns(_CLOCK_BOOTTIME, loop)
    if encoded_ns - cycle.t_mono_ns < GIVEN_UP_NS:  # else the process stood still since it woke
        send_frames(can, ecu.sending, due)
    sent_ns = _now_ns(_CLOCK_BOOTTIME, loop)
    stage_ns = cycle.stage_ns
    stage_ns[0], stage_ns[1] = drained_ns - woken_ns, received_ns - drained_ns
    stage_ns[2], stage_ns[3] = stepped_ns - received_ns, encoded_ns - stepped_ns
    stage_ns[4] = sent_ns - encoded_ns


@kernel
def _rehearse(ecu: Ecu, twin: Ecu, loop: RecordArray, twin_loop: RecordArray) -> None:
    """Run the coming cycle on the copies of `twin` and `twin_loop`, with the frames that wait."""
    twin_loop[0] = loop[0]
    twin.state[0] = ecu.state[0]
    twin.inputs[0] = ecu.inputs[0]
    twin.cycle[0] = ecu.cycle[0]
    twin.reception.messages[:] = ecu.reception.messages
    twin.reception.totals[0] = ecu.reception.totals[0]
    twin.reception.freshness[:] = ecu.reception.freshness
    twin.reception.request[0] = ecu.reception.request[0]
    twin.transmission.counter[:] = ecu.transmission.counter
    twin.transmission.sent[:] = ecu.transmission.sent
    coming = twin.cycle[0]
    coming.t_ns += CYCLE_NS
    coming.t_mono_ns += CYCLE_NS
    fill_inputs(twin, twin_loop)
    step(twin.params, twin.state, twin.inputs, twin.outputs)
    transmit(twin.transmit_plan, twin.transmission, twin.vector, coming.number, twin.sending)
