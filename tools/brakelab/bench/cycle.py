"""Stage times of a whole 100 Hz cycle, 39 frames in and 6 out over a socket pair, in real time.

Ours is the daemon's own `cycle_once`, with SocketCAN channel, ring and grid; beside it `PythonEcu`. Both wake
every 10 ms, with caches as cold as the sleep left them; times are those of the clock, not of the processor,
from the waking at the deadline on. What ours does before it (`ecu/runtime/exchange.py`) is in no stage.
"""

import gc
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.bench.braking import ALL_DUE, MESSAGES_IN, Stop, simulated_stop
from brakelab.bench.python_ecu import PythonEcu
from brakelab.bench.socket_pair import PythonCanBus, daemon_channel, put, socket_pair, take, wire_format
from brakelab.studies.measure import Figure, Row, figure, installed
from ecu.bus.e2e import P01_MODULO
from ecu.bus.receive_plan import ReceivePlan, contract_receive_plan, places_of
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.contract.records import STAGES
from ecu.jit import CompileCounter
from ecu.recording.ring import create_ring, remove_ring
from ecu.runtime.clock import Grid, system_time
from ecu.runtime.cycle import Progress, cycle_once
from ecu.runtime.memory import new_ecu
from ecu.runtime.warm_up import warm_up
from ecu.settings.resources import resource

ROUNDS: Final = 10
CYCLES: Final = 210  # a round
OFFSETS: Final = (0, 0x200, 0x500)
"""Each of the 13 input messages under three identifiers: 39 frames, a full 500 kbit/s bus."""
FRAMES_IN: Final = len(OFFSETS) * MESSAGES_IN
PERIOD_NS: Final = 1_000_000
"""Period for the E2E check: how this bench sends depends on how late it wakes."""
SIX_DUE: Final = 3
"""A cycle in which six frames are due: four demands, BlcfRear, DiscTemperature."""

Cycle = Callable[[], tuple[int, ...]]
"""Runs one cycle and returns its stage times [ns], shape (5,)."""


class Side(NamedTuple):
    """One program on its own bus."""

    cycle: Cycle
    vehicle: Any
    """The socket at the other end."""
    close: Callable[[], None]


def thrice(plan: ReceivePlan) -> ReceivePlan:
    """Return the plan that receives every message under all `OFFSETS` of its identifier."""
    inputs = plan.messages[plan.messages["foreign"] == 0]
    messages = np.concatenate([inputs] * len(OFFSETS))
    messages["id"] += np.repeat(np.array(OFFSETS, np.uint32), len(inputs))
    messages["period_ns"] = PERIOD_NS
    messages = np.sort(messages, order="id")
    ids = np.ascontiguousarray(messages["id"])
    return plan._replace(ids=ids, places=places_of(ids), messages=messages)


def bursts(stop: Stop, cycles: int) -> list[list[bytes]]:
    """Return the vehicle's frames in each of `cycles` of braking: 39 frames with continuous counters."""
    plan = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "Vehicle")
    transmission, frames = new_transmission(plan), frame_buffer(plan)
    sent: list[list[bytes]] = []
    for values in stop.values[stop.braking : stop.braking + cycles]:
        due = frames[: transmit(plan, transmission, values, ALL_DUE, frames)]
        burst: list[bytes] = []
        for offset in OFFSETS:
            shifted = due.copy()
            shifted["can_id"] += offset
            burst += wire_format(shifted)
        sent.append(burst)
    return sent


def our_side(stop: Stop, folder: Path) -> Side:
    """Return the daemon's cycle; its ring is in `folder`."""
    dbc = resource("dbc/brake_ecu.dbc")
    receiving, sending = thrice(contract_receive_plan(dbc)), contract_transmit_plan(dbc, "BrakeEcu")
    ecu = new_ecu(stop.params, None, receiving, sending)
    pair = socket_pair()
    channel = daemon_channel(pair.ecu, receiving.ids)
    ring = create_ring(folder / "ring", {}, b"", slots=256, frames=64 * 256)
    compiled = CompileCounter()
    warm_up(ecu, compiled)
    progress = Progress(ecu, channel.status(), compiled)
    grid = Grid(system_time())

    def cycle() -> tuple[int, ...]:
        progress.number = SIX_DUE
        cycle_once(ecu, channel, ring, grid, progress)
        assert int(ecu.cycle["frames"][0]) == FRAMES_IN
        return tuple(ecu.cycle["stage_ns"][0].tolist())

    def close() -> None:
        remove_ring(ring.path)
        channel.close()
        pair.vehicle.close()

    return Side(cycle, pair.vehicle, close)


def python_side(stop: Stop) -> Side:
    """Return the cycle of `PythonEcu`."""
    pair = socket_pair()
    bus = PythonCanBus(pair.ecu)
    ecu = PythonEcu(bus, stop.params, OFFSETS)
    grid = Grid(system_time())
    clock = time.monotonic_ns

    def cycle() -> tuple[int, ...]:
        grid.wait()
        woken = clock()
        received = ecu.drain()
        drained = clock()
        ecu.receive(received)
        decoded = clock()
        demand = ecu.step()
        stepped = clock()
        sending = ecu.transmit(demand)
        packed = clock()
        ecu.send(sending)
        sent = clock()
        assert len(received) == FRAMES_IN
        return drained - woken, decoded - drained, stepped - decoded, packed - stepped, sent - packed

    def close() -> None:
        bus.shutdown()
        pair.vehicle.close()

    return Side(cycle, pair.vehicle, close)


def run_cycles(side: Side, sent: list[list[bytes]]) -> NDArray[np.float64]:
    """Run one cycle per burst; return the times of its stages and their sum [µs], shape (len(sent), 6)."""
    times = np.empty((len(sent), len(STAGES)))
    collecting = gc.isenabled()
    gc.disable()
    try:
        for k, burst in enumerate(sent):
            put(side.vehicle, burst)
            times[k] = side.cycle()
            take(side.vehicle)
    finally:
        if collecting:
            gc.enable()
    return np.column_stack([times, times.sum(axis=1)]) / 1e3


def cycle_rows(rounds: int = ROUNDS, cycles: int = CYCLES) -> list[Row]:
    """Return p50, p99 and the longest of each stage; figures over the rounds.

    `cycles` of a round: a multiple of 15, so that counters continue from round to round.
    """
    stop = simulated_stop()
    sent = bursts(stop, cycles)
    with tempfile.TemporaryDirectory(prefix="brake-ecu-") as folder:
        sides = (our_side(stop, Path(folder)), python_side(stop))
        try:
            for side in sides:
                run_cycles(side, sent[:P01_MODULO])
            measured = [[run_cycles(side, sent) for side in sides] for _ in range(rounds)]
        finally:
            for side in sides:
                side.close()
    ours, peer = (np.stack(times) for times in zip(*measured, strict=True))
    on_bus, codec = installed("python-can"), installed("cantools")
    notes = (on_bus, codec, "numpy, four filters only", codec, on_bus, "all of these")
    return [
        Row(
            f"{name} {label}",
            _over_rounds(ours[:, :, stage], share),
            _over_rounds(peer[:, :, stage], share),
            "µs",
            notes[stage],
        )
        for stage, name in enumerate((*STAGES, "whole cycle"))
        for label, share in (("p50", 50.0), ("p99", 99.0), ("max", 100.0))
    ]


def _over_rounds(times: NDArray[np.float64], share: float) -> Figure:
    return figure(np.percentile(times, share, axis=1))
