"""Simulated vehicle as a process of its own on a real bus, in real time.

`brake-ecu vehicle SCENARIO -i INTERFACE -c CHANNEL` sends the vehicle's frames every 10 ms on absolute
deadlines, takes the ECU's demands, and leaves when the scenario has ended or on SIGTERM. It prints `ready`
when it is compiled and on the bus, and `driving NS` when it sets off: T_0 on the monotonic clock. Without
valid demands for 30 ms its own hydraulics brake. The scenario's faults act on its sensors, on its actuators
and on the frames of both directions.
"""

import signal
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from brakelab.plant.driver import drive
from brakelab.results.outputs import whole
from brakelab.rig.by_hand import Hand, with_room
from brakelab.simulation.closed_loop import Plans, plans
from brakelab.simulation.fault_kernels import Link, deliver, new_link
from brakelab.simulation.priority import ask_for_priority
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.scenario_car import with_car
from brakelab.simulation.simulate import write_columns
from brakelab.simulation.vehicle_bus import (
    N_TRUTH,
    TRUTH_COLUMNS,
    Vehicle,
    advance,
    decode_demands,
    new_noise,
    new_values,
    new_vehicle,
    sense,
    write_truth,
)
from ecu.bus.channel import open_channel
from ecu.bus.freshness import begin_cycle, target_dtype
from ecu.bus.protocol import Channel
from ecu.bus.receive import Reception, new_reception, receive
from ecu.bus.transmit import Transmission, frame_buffer, new_transmission, transmit
from ecu.contract.records import FRAME, RecordArray
from ecu.contract.signals import CYCLE_NS, N_OUTPUTS
from ecu.jit import kernel
from ecu.runtime.clock import Grid, TimeSource, system_time

RECEIVED_AT_ONCE: Final = 256
SILENCE_CYCLES: Final = 50
"""Without a frame of the ECU: it has left."""


class Side(NamedTuple):
    """The vehicle and its ends of the bus."""

    vehicle: Vehicle
    values: NDArray[np.float64]
    sent: Transmission
    heard: RecordArray
    reception: Reception
    frames_out: RecordArray
    frames_in: RecordArray
    to_ecu: Link
    to_vehicle: Link


class Node(NamedTuple):
    """One vehicle in real time."""

    side: Side
    noise: Generator


class Truth(NamedTuple):
    """True values of the drive, one row per cycle."""

    start_ns: int
    """First T_k on the real-time clock."""
    t: NDArray[np.float64]
    """Seconds since `start_ns`, shape (n,)."""
    values: NDArray[np.float64]
    """In the order of `TRUTH_COLUMNS`, shape (n, N_TRUTH)."""


def new_node(scenario: Scenario, seed: int) -> Node:
    """Return a vehicle before its first cycle; car and noise are drawn from `seed`.

    Raises:
        UserError: the plant's file cannot be read or is wrong.
    """
    plan = plans()
    side = Side(
        new_vehicle(scenario, seed),
        new_values(),
        new_transmission(plan.vehicle_sends),
        np.zeros(1, target_dtype(N_OUTPUTS)),
        new_reception(plan.vehicle_hears),
        frame_buffer(plan.vehicle_sends),
        np.zeros(RECEIVED_AT_ONCE, FRAME),
        new_link(),
        new_link(),
    )
    return Node(side, new_noise(seed))


@kernel
def live_through(
    plan: Plans,
    side: Side,
    noise: Generator,
    now_ns: int,
    received: int,
    periods: int,
    cycle: int,
    row: NDArray[np.float64],
    stays: bool,
) -> int:
    """Decode the demands, advance by `periods` cycles, measure.

    At the end of the script the car goes on if it `stays`: brakes as they are, accelerator released.

    Returns the number of frames of `side.to_ecu.arrived` to send, -1 at the end.
    """
    vehicle = side.vehicle
    t = 1e-9 * (cycle * CYCLE_NS)
    begin_cycle(side.heard[0], now_ns, CYCLE_NS)
    received = deliver(vehicle.faults, side.to_vehicle, t, noise, side.frames_in, received)
    receive(plan.vehicle_hears, side.reception, side.to_vehicle.arrived, 0, received, side.heard[0])
    decode_demands(side.heard[0], vehicle.demand[0])
    driver = vehicle.driver[0]
    for _ in range(periods):
        if driver.started or stays:
            advance(vehicle)
        if stays:
            driver.motor_demand[:] = driver.accelerator_position = 0.0
        elif not drive(vehicle.script, vehicle.params[0], vehicle.state[0], driver, 1e-9 * CYCLE_NS):
            return -1
    sense(vehicle, noise, side.values)
    write_truth(vehicle, row)
    count = transmit(plan.vehicle_sends, side.sent, side.values, cycle, side.frames_out)
    return int(deliver(vehicle.faults, side.to_ecu, t, noise, side.frames_out, count))


def nobody(t: float) -> None:
    """Let nobody type a fault."""


def drive_in_real_time(
    node: Node,
    channel: Channel,
    source: TimeSource,
    stopped: Callable[[], bool] = lambda: False,
    set_off: Callable[[int], None] = lambda t_mono_ns: None,
    by_hand: Callable[[float], None] = nobody,
) -> Truth:
    """Drive the node's scenario on `channel` to its end, or until `stopped`.

    `set_off` is called with T_0 on the monotonic clock, `by_hand` before each cycle with its t [s]. In missed
    periods the car advances without sending.
    """
    side = node.side
    grid = Grid(source)
    set_off(grid.deadline_ns + CYCLE_NS)
    rows: list[NDArray[np.float64]] = []
    cycles: list[int] = []
    start_ns = cycle = 0
    while not stopped():
        tick = grid.wait()
        periods = tick.missed + 1 if rows else 1
        cycle += periods if rows else 0
        start_ns = start_ns or tick.t_ns
        by_hand(1e-9 * cycle * CYCLE_NS)
        received = channel.drain(side.frames_in, 0)
        row = np.empty(N_TRUTH)
        now_ns = source.realtime_ns()
        count = live_through(plans(), side, node.noise, now_ns, received, periods, cycle, row, False)
        if count < 0:
            break
        channel.send(side.to_ecu.arrived, count)
        rows.append(row)
        cycles.append(cycle)
    t = np.array(cycles, np.float64) * (1e-9 * CYCLE_NS)
    return Truth(start_ns, t, np.array(rows).reshape(-1, N_TRUTH))


def wait_for_ecu(node: Node, channel: Channel, stopped: Callable[[], bool]) -> None:
    """Wait until the first frame of the ECU is heard, or until `stopped`."""
    while not stopped() and not channel.drain(node.side.frames_in, 0):
        time.sleep(0.001)


def stay_with_ecu(
    node: Node,
    channel: Channel,
    source: TimeSource,
    cycle: int,
    stopped: Callable[[], bool],
    by_hand: Callable[[float], None] = nobody,
) -> None:
    """Let the car go on from `cycle` with its brakes as they are until the ECU falls silent, or `stopped`."""
    side, grid, row, silent = node.side, Grid(source), np.empty(N_TRUTH), 0
    while silent < SILENCE_CYCLES and not stopped():
        periods, received = grid.wait().missed + 1, channel.drain(side.frames_in, 0)
        cycle += periods
        silent = 0 if received else silent + periods
        by_hand(1e-9 * cycle * CYCLE_NS)
        at_ns = source.realtime_ns()
        count = live_through(plans(), side, node.noise, at_ns, received, periods, cycle, row, True)
        channel.send(side.to_ecu.arrived, count)


def write_truth_file(path: Path, truth: Truth, scenario: str, seed: int) -> None:
    """Write the truth as Parquet with the absolute start in its metadata.

    Raises:
        UserError: the file cannot be written.
    """
    metadata = {"start_time_ns": str(truth.start_ns), "scenario": scenario, "seed": str(seed)}
    with whole(path, "file") as part:
        write_columns(part, truth.t, dict(zip(TRUTH_COLUMNS, truth.values.T, strict=True)), metadata)


def warm_up(scenario: Scenario) -> None:
    """Compile, or load from the cache, the kernels of a cycle."""
    node = new_node(scenario, 0)
    live_through(plans(), node.side, node.noise, CYCLE_NS, 0, 1, 0, np.empty(N_TRUTH), False)


def _tell_set_off(t_mono_ns: int) -> None:
    print(f"driving {t_mono_ns}", flush=True)


def _ends(stop: list[int], written: Future[None] | None) -> bool:
    return bool(stop) or (written is not None and written.done() and written.exception() is not None)


def vehicle_command(
    path: Path,
    bus: tuple[str, str],
    seed: int,
    plant: str | None,
    config: Path | None,
    truth_file: Path | None,
    alone: bool,
    by_hand: bool,
    bus_goes_off: bool,
) -> None:
    """Drive the simulated car of a scenario on a `bus` (interface, channel), to its end or a signal's.

    `alone`: without waiting for an ECU. `by_hand`: with faults from standard input. `bus_goes_off`: faults of
    the kind bus_off are the bus's affair.

    Raises:
        UserError: the scenario or its car is wrong, the bus or the file of the truth cannot be opened.
    """
    stop: list[int] = []

    def ask_to_stop(number: int, frame: Any) -> None:
        stop.append(number)

    signal.signal(signal.SIGTERM, ask_to_stop)
    signal.signal(signal.SIGINT, ask_to_stop)
    scenario = load_scenario(path)
    if bus_goes_off:
        rest = [fault for fault in scenario.fault if fault.kind != "bus_off"]
        scenario = scenario.model_copy(update={"fault": rest})
    with tempfile.TemporaryDirectory(prefix="brake-ecu-") as folder:
        scenario = with_car(scenario, plant, config, Path(folder))
        warm_up(scenario)
        node = new_node(scenario, seed)
    take: Callable[[float], None] = nobody
    if by_hand:
        side = node.side._replace(vehicle=with_room(node.side.vehicle))
        node, take = node._replace(side=side), Hand(side.vehicle, sys.stdin).take
    listened = [int(identifier) for identifier in plans().vehicle_hears.ids]
    channel = open_channel(*bus, receive_ids=listened)
    ask_for_priority()
    print("ready", flush=True)
    source, stopped = system_time(), lambda: bool(stop)
    if not alone:
        wait_for_ecu(node, channel, stopped)
    truth = drive_in_real_time(node, channel, source, stopped, _tell_set_off, take)
    with ThreadPoolExecutor(1) as beside:  # a car that writes is no car that is silent
        written: Future[None] | None = None
        if truth_file is not None:
            written = beside.submit(write_truth_file, truth_file, truth, path.stem, seed)
        if not alone:
            stay_with_ecu(node, channel, source, len(truth.t), partial(_ends, stop, written), take)
    if written is not None:
        written.result()
    channel.close()
