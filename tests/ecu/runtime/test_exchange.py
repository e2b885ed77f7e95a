"""The cycle on SocketCAN as one kernel: the same bits as the cycle through Python, in real time."""

import gc
import signal
import sys
import time

import numpy as np
import pytest

from brakelab.bench.braking import simulated_stop
from brakelab.bench.cycle import bursts
from brakelab.bench.socket_pair import daemon_channel, put, socket_pair, wire_format
from ecu.bus.receive_plan import contract_receive_plan
from ecu.bus.transmit import contract_transmit_plan
from ecu.contract import faults
from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.jit import CompileCounter
from ecu.recording.ring import RingReader, create_ring
from ecu.runtime.clock import Grid, TimeSource, system_time
from ecu.runtime.cycle import Progress, cycle_once
from ecu.runtime.exchange import exchange
from ecu.runtime.memory import new_ecu
from ecu.runtime.warm_up import warm_up
from ecu.settings.resources import resource

pytestmark = pytest.mark.compiled  # plain Python needs ten periods for a cycle
DBC = resource("dbc/brake_ecu.dbc")
MS = 1_000_000
ERROR = 1 << 29


class Daemon:
    """All that one loop holds."""

    def __init__(self, params, folder, grid) -> None:
        receiving, sending = contract_receive_plan(DBC), contract_transmit_plan(DBC, "BrakeEcu")
        self.ecu = new_ecu(params, None, receiving, sending)
        self.ring = create_ring(folder, {}, b"", slots=64, frames=4096)
        self.reader, self.grid = RingReader(self.ring.path), grid
        self.compiled = CompileCounter()

    def begin(self, channel) -> None:
        warm_up(self.ecu, self.compiled)
        self.channel = channel
        self.progress = Progress(self.ecu, channel.status(), self.compiled)

    def cycle(self):
        cycle_once(self.ecu, self.channel, self.ring, self.grid, self.progress)
        return self.ecu.cycle[0]


class OnSocket(Daemon):
    """A loop on one end of a socket pair."""

    def __init__(self, params, folder, period_ns=CYCLE_NS) -> None:
        super().__init__(params, folder, Grid(system_time(), period_ns))
        ends = socket_pair()
        self.vehicle = ends.vehicle
        ids = [*self.ecu.receive_plan.ids, *self.ecu.transmit_plan.ids]
        self.begin(daemon_channel(ends.ecu, np.array(ids, np.uint32)))
        self.grid.deadline_ns = self.grid.source.monotonic_ns()

    def said(self) -> list[bytes]:
        """Return what it has sent."""
        found = []
        while True:
            try:
                found.append(self.vehicle.recv(72))
            except BlockingIOError:
                return found

    def close(self) -> None:
        self.channel.close()
        self.vehicle.close()


class Echo(Daemon):
    """A loop through Python that lives through the cycles of another one: its frames, ticks and bus."""

    name = "echo"

    def __init__(self, params, folder, other) -> None:
        self.other, self.now_ns, self.woken_ns = other, 0, 0
        source = TimeSource(lambda: self.now_ns, lambda: self.now_ns + other.grid.offset_ns, self.sleep)
        super().__init__(params, folder, Grid(source))
        self.frames, self.sent = new_record(FRAME, 0), []
        self.begin(self)

    def sleep(self, until_ns) -> None:
        self.now_ns = self.woken_ns

    def drain(self, frames, start):
        self.sent = []
        frames[start : start + len(self.frames)] = self.frames
        return len(self.frames)

    def send(self, frames, count):
        self.sent += wire_format(frames[:count])
        return count

    def status(self):
        return self.other.channel.status()

    def close(self) -> None:
        pass

    def follow(self, before_ns) -> None:
        """Run the cycle that the other one has run; its deadline before was `before_ns`."""
        cycle = self.other.ecu.cycle[0]
        self.grid.deadline_ns = self.now_ns = before_ns
        self.woken_ns = int(cycle["t_mono_ns"] - cycle["missed"] * CYCLE_NS + cycle["lateness_ns"])
        self.frames = self.other.reader.read().frames
        self.cycle()


def differing(ours, theirs, name=""):
    """Return the names of fields that differ; NaN equals NaN, gaps between fields have no meaning."""
    if ours.dtype.names:
        inside = [(field, ours[field], theirs[field]) for field in ours.dtype.names]
        return [found for field, a, b in inside for found in differing(a, b, f"{name}.{field}")]
    return [] if np.array_equal(ours, theirs, equal_nan=ours.dtype.kind == "f") else [name]


STOP = simulated_stop()


@pytest.fixture
def loop(tmp_path):
    made = OnSocket(STOP.params, tmp_path / "ring")
    yield made
    made.close()


def frame(can_id, data=bytes(8)):
    one = new_record(FRAME)
    one["can_id"], one["length"] = can_id, len(data)
    one["data"][0, : len(data)] = list(data)
    return wire_format(one)


def more_of(kind, ecu):
    """Return frames beside the vehicle's."""
    own = [int(number) for number in ecu.transmit_plan.ids[:2]]
    return {
        "bus off": frame(ERROR | 0x40),
        "restarted": frame(ERROR | 0x100),
        "error passive": frame(ERROR | 0x04, bytes([0, 0x20, *bytes(6)])),
        "ours": frame(own[0]) + frame(own[1]),
        "unknown, short, wrong": frame(0x7FF) + frame(0x40, bytes(3)) + frame(0x41),
    }[kind]


# cycle -> what happens before it
EVENTS = {
    10: "unknown, short, wrong",
    15: "bus off",
    17: "restarted",
    20: "error passive",
    25: "ours",
    26: "ours",
    **dict.fromkeys(range(60, 75), "ours"),
    30: 25 * MS,  # held up
    40: 503 * MS,
}


def test_one_kernel_gives_the_bits_of_the_cycle_through_python(loop, tmp_path):
    echo = Echo(STOP.params, tmp_path / "echo", loop)
    frames, sent, missed = 0, 0, 0
    sent_before = bursts(STOP, 90)
    for number, burst in enumerate(sent_before):
        event = EVENTS.get(number)
        if isinstance(event, int):
            time.sleep(event / 1e9)
        put(loop.vehicle, burst[:13] + (more_of(event, loop.ecu) if isinstance(event, str) else []))
        before_ns = loop.grid.deadline_ns
        cycle = loop.cycle()
        echo.follow(before_ns)
        found = differing(echo.ecu.cycle, loop.ecu.cycle)
        assert set(found) <= {".stage_ns"}, (number, found)
        for name in ("inputs", "state", "outputs"):
            assert differing(getattr(echo.ecu, name), getattr(loop.ecu, name)) == [], (number, name)
        for name in ("reception", "transmission"):
            ours, theirs = getattr(loop.ecu, name), getattr(echo.ecu, name)
            assert [differing(a, b) for a, b in zip(ours, theirs, strict=True)] == [[]] * len(ours), number
        assert loop.said() == echo.sent, number
        frames, sent, missed = (
            frames + int(cycle["frames"]),
            sent + len(echo.sent),
            missed + int(cycle["missed"]),
        )
    assert frames > 80 * 13
    assert sent > 90 * 3
    assert missed >= 52
    assert loop.progress.loop["rehearsal_ns"][0] > 0
    assert loop.compiled.count == echo.compiled.count


# error frame -> fault bits after the cycle in which it came
LINES = {"bus off": faults.BUS_OFF, "error passive": faults.ERROR_PASSIVE, "ours": faults.FOREIGN_SENDER}


@pytest.mark.parametrize(("event", "bits"), LINES.items())
def test_what_the_socket_tells_reaches_step_in_the_same_cycle(loop, event, bits):
    loop.cycle()
    put(loop.vehicle, more_of(event, loop.ecu))
    assert int(loop.cycle()["bus_faults"]) & ~faults.LATE == bits  # this machine may be late
    assert int(loop.ecu.outputs["active_faults"][0]) & bits == bits


def test_frames_that_linux_does_not_take_are_a_fault(loop):
    loop.cycle()
    loop.vehicle.close()
    loop.cycle()
    assert int(loop.cycle()["bus_faults"]) & ~faults.LATE == faults.SEND_FAILED


def run_at(loop, wakes_ns):
    """Run a cycle whose deadline is this."""
    run, grid = loop.progress, loop.grid.memory
    grid["wakes_ns"], grid["deadline_ns"] = wakes_ns, wakes_ns - loop.grid.period_ns
    exchange(loop.ecu, run.twin, run.loop, run.twin_loop, grid, loop.channel.memory)
    return loop.ecu.cycle[0]


def test_a_signal_that_wakes_the_sleep_does_not_start_the_cycle(loop):
    heard = []
    signal.signal(signal.SIGALRM, lambda number, frame: heard.append(number))
    signal.setitimer(signal.ITIMER_REAL, 2e-3)
    try:
        assert run_at(loop, loop.grid.source.monotonic_ns() + 8 * MS)["lateness_ns"] >= 0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
    assert heard


@pytest.mark.parametrize(("still_ms", "said"), [(0, True), (10, True), (35, False), (5000, False)])
@pytest.mark.requirement("REQ-DEM-5")
def test_what_was_computed_before_the_process_stood_still_is_not_sent(tmp_path, still_ms, said):
    slow = OnSocket(STOP.params, tmp_path / "ring", period_ns=10_000 * MS)  # a deadline stays the last one
    try:
        run_at(slow, slow.grid.source.monotonic_ns() - still_ms * MS)
        assert bool(slow.said()) is said
    finally:
        slow.close()


@pytest.mark.requirement("REQ-LOOP-2")
def test_thousands_of_cycles_leave_no_memory_behind(tmp_path):
    fast = OnSocket(STOP.params, tmp_path / "ring", period_ns=MS)
    gc.disable()
    try:
        blocks = []
        for _ in range(4):
            for _ in range(500):
                fast.cycle()
                fast.said()
            blocks.append(sys.getallocatedblocks())
    finally:
        gc.enable()
        fast.close()
    assert np.diff(blocks).min() <= 4
