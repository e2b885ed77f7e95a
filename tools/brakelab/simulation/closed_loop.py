"""Closed loop of simulated vehicle and ECU in memory, over real frames (`brake-ecu simulate`).

One cycle k: the driver acts, the vehicle measures and sends; its frames arrive shortly before T_k; the ECU
receives, steps and sends; the vehicle decodes the demands and advances by 10 ms. All of it runs in one kernel
with the ECU's own kernels, so that simulated and driven code are the same. Frames of both directions pass the
scenario's faults (`brakelab.simulation.faults`) in between.
"""

import math
from collections.abc import Iterator
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from brakelab.plant.driver import drive
from brakelab.simulation.fault_kernels import Link, deliver, new_link
from brakelab.simulation.outages import find_outages
from brakelab.simulation.scenario import LONGEST_DRIVE, Scenario
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
from ecu.algorithm.step import new_state, step
from ecu.bus.freshness import begin_cycle, end_cycle, target_dtype
from ecu.bus.receive import Reception, new_reception, receive
from ecu.bus.receive_plan import ReceivePlan, contract_listen_plan, contract_receive_plan
from ecu.bus.transmit import (
    Transmission,
    TransmitPlan,
    contract_transmit_plan,
    frame_buffer,
    new_transmission,
    transmit,
)
from ecu.contract.records import FRAME, INPUTS, OUTPUTS, RecordArray, new_record, output_vector
from ecu.contract.signals import CYCLE_NS, INPUT_SIGNALS, N_INPUTS, N_OUTPUTS, OUTPUT_COLUMNS
from ecu.jit import kernel
from ecu.settings.config import Config, new_params
from ecu.settings.resources import resource

START_NS: Final = 1_700_000_000_000_000_000
"""T_0 of every simulation on the real-time clock."""
SPACING_NS: Final = 10_000  # between frames of one burst
CHUNK: Final = 1000  # cycles per call of the kernel at most
VEHICLE_BUS: Final = "can0"


class Plans(NamedTuple):
    """Frames that each side sends and decodes."""

    vehicle_sends: TransmitPlan
    vehicle_hears: ReceivePlan
    ecu_sends: TransmitPlan
    ecu_hears: ReceivePlan


class Sides(NamedTuple):
    """Vehicle and ECU, each with its ends of the bus."""

    vehicle: Vehicle
    values: NDArray[np.float64]
    vehicle_sent: Transmission
    heard: RecordArray
    vehicle_reception: Reception
    params: RecordArray
    state: RecordArray
    inputs: RecordArray
    outputs: RecordArray
    output_vector: NDArray[np.float64]
    ecu_sent: Transmission
    ecu_reception: Reception
    vehicle_frames: RecordArray
    ecu_frames: RecordArray
    to_ecu: Link
    to_vehicle: Link


class Loop(NamedTuple):
    """One closed loop."""

    sides: Sides
    noise: Generator


class FrictionOverride(NamedTuple):
    """Friction imposed on the ECU's pressure law in place of its own."""

    true_share: float = 0.0
    """Of the true friction: 1 makes the ideal controller; 0: not override."""
    front: float = 0.0
    """Amplitude of a sine about the base friction, relative to it, of the front axle."""
    rear: float = 0.0
    frequency: float = 0.0
    """Of the sine [Hz]; 0: not override."""


class Drive(NamedTuple):
    """A simulated drive, one row per cycle; names and units of the contract."""

    t: NDArray[np.float64]
    """T_k since the start [s], shape (n,)."""
    inputs: dict[str, NDArray[np.float64]]
    """As the ECU decoded them; NaN where no new sample arrived."""
    outputs: dict[str, NDArray[np.float64]]
    truth: dict[str, NDArray[np.float64]]
    """At T_k, by `TRUTH_COLUMNS`."""
    frames: RecordArray
    """`FRAME` of both directions in the order of their stamps."""


class Block(NamedTuple):
    """Some cycles of a `Drive`, one per row, of shape (n, N_INPUTS), (n, N_OUTPUTS), (n, N_TRUTH); frames."""

    decoded: NDArray[np.float64]
    outputs: NDArray[np.float64]
    truth: NDArray[np.float64]
    frames: RecordArray


@cache
def plans() -> Plans:
    """Return the plans of the contract's database.

    A frame without any new sample is not sent, which represents a slow or dead sensor.
    """
    dbc = resource("dbc/brake_ecu.dbc")
    vehicle_sends = contract_transmit_plan(dbc, "Vehicle")
    vehicle_sends.messages["optional"] = 1
    return Plans(
        vehicle_sends,
        contract_listen_plan(dbc),
        contract_transmit_plan(dbc, "BrakeEcu"),
        contract_receive_plan(dbc),
    )


def new_loop(scenario: Scenario, config: Config, seed: int, armed: bool = True) -> Loop:
    """Return a closed loop before its first cycle; car and noise are drawn from `seed`.

    `armed`: the ECU's demands count, overriding `config.transmit`; otherwise the vehicle's fallback brakes.

    Raises:
        UserError: the plant's file cannot be read or is wrong.
    """
    params = new_params(config)
    params["transmit"] = armed
    outputs = new_record(OUTPUTS)
    plan = plans()
    sides = Sides(
        new_vehicle(scenario, seed),
        new_values(),
        new_transmission(plan.vehicle_sends),
        np.zeros(1, target_dtype(N_OUTPUTS)),
        new_reception(plan.vehicle_hears),
        params,
        new_state(params),
        new_record(INPUTS),
        outputs,
        output_vector(outputs),
        new_transmission(plan.ecu_sends),
        new_reception(plan.ecu_hears),
        frame_buffer(plan.vehicle_sends),
        frame_buffer(plan.ecu_sends),
        new_link(),
        new_link(),
    )
    return Loop(sides, new_noise(seed))


@kernel
def _stamp(frames: Any, count: int, sent_ns: int) -> None:
    for i in range(count):
        frames[i].stamp_ns = sent_ns


@kernel
def _hand_over(frames: Any, count: int, first_ns: int, spacing_ns: int, kept: Any, place: int) -> int:
    """Stamp `count` frames and copy them from index `place` on; return the index behind them.

    One that was delayed keeps its stamp if that is earlier.
    """
    last_ns = kept[place - 1].stamp_ns if place > 0 else 0
    for i in range(count):
        last_ns = max(last_ns, min(first_ns + i * spacing_ns, frames[i].stamp_ns))
        frames[i].stamp_ns = last_ns
        kept[place + i] = frames[i]
    return place + count


@kernel
def _override_friction(override: FrictionOverride, control: Any, true: Any, t: float) -> None:
    """Impose a friction on the pressure law, of state `control`; `true`: the car's friction; `t` [s]."""
    for i in range(4):
        if override.true_share > 0.0:
            control.mu_override[i] = override.true_share * true[i]
        elif override.frequency > 0.0:
            amplitude = override.front if i < 2 else override.rear
            wave = 1.0 + amplitude * math.sin(2.0 * math.pi * override.frequency * t)
            control.mu_override[i] = control.base[i] * wave


@kernel
def _run(
    plan: Plans,
    loop: Sides,
    noise: Generator,
    override: FrictionOverride,
    alive: bool,
    first_cycle: int,
    decoded: NDArray[np.float64],
    outputs: NDArray[np.float64],
    truth: NDArray[np.float64],
    kept: Any,
) -> tuple[int, int, bool]:
    """Run cycles until the rows are full or the script has ended.

    Returns rows and frames written, and whether the script continues.
    """
    vehicle, inputs, heard = loop.vehicle, loop.inputs[0], loop.heard[0]
    place = 0
    for row in range(len(truth)):
        if not drive(vehicle.script, vehicle.params[0], vehicle.state[0], vehicle.driver[0], 1e-9 * CYCLE_NS):
            return row, place, False
        cycle = first_cycle + row
        t_ns = START_NS + cycle * CYCLE_NS
        sense(vehicle, noise, loop.values)
        write_truth(vehicle, truth[row])
        sent = transmit(plan.vehicle_sends, loop.vehicle_sent, loop.values, cycle, loop.vehicle_frames)
        t = 1e-9 * (cycle * CYCLE_NS)
        _stamp(loop.vehicle_frames, sent, t_ns)
        sent = deliver(vehicle.faults, loop.to_ecu, t, noise, loop.vehicle_frames, sent)
        arrived = loop.to_ecu.arrived
        # A log's time grid starts at its first frame: the first burst is stamped T_0.
        spacing = SPACING_NS if cycle > 0 else 0
        place = _hand_over(arrived, sent, t_ns - sent * spacing, spacing, kept, place)

        if not alive:
            decoded[row] = outputs[row] = np.nan
            advance(vehicle)
            continue
        begin_cycle(inputs, t_ns, CYCLE_NS)
        receive(plan.ecu_hears, loop.ecu_reception, arrived, 0, sent, inputs)
        end_cycle(inputs, loop.ecu_reception.freshness)
        for i in range(N_INPUTS):
            decoded[row, i] = inputs.value[i] if inputs.new[i] else np.nan
        _override_friction(override, loop.state[0].control, vehicle.state[0].mu_b, t)
        step(loop.params, loop.state, loop.inputs, loop.outputs)
        outputs[row] = loop.output_vector

        sent = transmit(plan.ecu_sends, loop.ecu_sent, loop.output_vector, cycle, loop.ecu_frames)
        _stamp(loop.ecu_frames, sent, t_ns + CYCLE_NS // 2)
        sent = deliver(vehicle.faults, loop.to_vehicle, t, noise, loop.ecu_frames, sent)
        arrived = loop.to_vehicle.arrived
        place = _hand_over(arrived, sent, t_ns + 10 * SPACING_NS, SPACING_NS, kept, place)
        begin_cycle(heard, t_ns + CYCLE_NS // 2, CYCLE_NS)
        receive(plan.vehicle_hears, loop.vehicle_reception, arrived, 0, sent, heard)
        decode_demands(heard, vehicle.demand[0])
        advance(vehicle)
    return len(truth), place, True


def _start_anew(sides: Sides) -> None:
    """Restart the ECU with the values stored by the side process of the former one."""
    learned = sides.state["learned"].copy()
    sides.state[:] = new_state(sides.params, learned)
    memory: tuple[NDArray[Any], ...] = (*sides.ecu_reception, *sides.ecu_sent)
    fresh = (*new_reception(plans().ecu_hears), *new_transmission(plans().ecu_sends))
    for old, new in zip(memory, fresh, strict=True):
        old[:] = new


def run_blocks(
    loop: Loop, seconds: float = LONGEST_DRIVE, override: FrictionOverride | None = None
) -> Iterator[Block]:
    """Run a new loop like `run`, yielding blocks of its cycles; each block overwrites the last."""
    override, sides = override or FrictionOverride(), loop.sides
    decoded, outputs, truth = (np.empty((CHUNK, width)) for width in (N_INPUTS, N_OUTPUTS, N_TRUTH))
    kept = new_record(FRAME, CHUNK * 2 * (len(sides.vehicle_frames) + len(sides.ecu_frames)))
    first, last, running = 0, round(seconds * 1e9 / CYCLE_NS), True
    outages = find_outages(sides.vehicle.faults)
    while running and first < last:
        if outages and first >= outages[0].end:
            if not outages.pop(0).standby:
                _start_anew(sides)
            continue
        alive = not outages or first < outages[0].begin
        until = (outages[0].begin if alive else outages[0].end) if outages else last
        size = min(CHUNK, last - first, until - first)
        rows = decoded[:size], outputs[:size], truth[:size]
        done, count, running = _run(plans(), sides, loop.noise, override, alive, first, *rows, kept)
        yield Block(decoded[:done], outputs[:done], truth[:done], kept[:count])
        first += done


def run(
    loop: Loop, ideal: bool = False, seconds: float = LONGEST_DRIVE, override: FrictionOverride | None = None
) -> Drive:
    """Run a new loop to the end of its script, or for `seconds`, and return the drive.

    `ideal`: the ECU's pressure law uses the true friction, as a reference for compensation; `override`: an
    imposed one. During a daemon outage outputs are NaN until the daemon, or its standby, sends again.
    """
    running = run_blocks(loop, seconds, override or FrictionOverride(1.0 if ideal else 0.0))
    blocks = [tuple(map(np.copy, block)) for block in running]
    decoded, outputs, truth, frames = (np.concatenate(values) for values in zip(*blocks, strict=True))
    return Drive(
        np.arange(len(truth), dtype=np.float64) * (1e-9 * CYCLE_NS),
        dict(zip((signal.name for signal in INPUT_SIGNALS), decoded.T, strict=True)),
        dict(zip(OUTPUT_COLUMNS, outputs.T, strict=True)),
        dict(zip(TRUTH_COLUMNS, truth.T, strict=True)),
        frames,
    )
