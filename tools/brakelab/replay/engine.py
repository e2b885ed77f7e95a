"""Frames or samples through the ECU's own kernels, cycle by cycle: rows of results come out.

Cycle k consumes the frames stamped up to T_k, then `step` runs, exactly as in the daemon. T_k is either the
grid t_0 + k·10 ms from the first frame or sample up to the last, or that of a recording, which notes the T_k,
missed periods and bus faults of its cycles.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import chain, count
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.logs.physics.samples import KEPT
from brakelab.logs.sample_block import SampleBlock
from brakelab.replay.seen import look_at, new_seen
from brakelab.results.row import MEASURED_INPUTS, N_ROW
from ecu.algorithm.step import new_state, step
from ecu.bus.freshness import accept, begin_cycle, end_cycle
from ecu.bus.receive import Reception, receive
from ecu.bus.receive_plan import ReceivePlan
from ecu.contract.records import CYCLE, FRAME, INPUTS, OUTPUTS, RecordArray, new_record, output_vector
from ecu.contract.signals import (
    CYCLE_NS,
    N_OUTPUTS,
    USABLE,
)
from ecu.jit import Record, batch_kernel, kernel

Block = TypeVar("Block")

BLOCK_CYCLES: Final = 16384

_APART: Final = 8  # numbers, a line of the processor's cache
_EVERYTHING: Final = 1 << 62
# Where a run stands between two calls of its kernel: place in the block, cycles done of the chunk, whether
# the next is open and how many frames it may still take.
_AT: Final = np.dtype([("cursor", "i8"), ("done", "i8"), ("open", "i8"), ("left", "i8")])


class Ecu(NamedTuple):
    """The records of one ECU, each of shape (1,), and the quality of its inputs."""

    params: RecordArray
    state: RecordArray
    inputs: RecordArray
    outputs: RecordArray
    seen: RecordArray
    """SEEN, shape (N_INPUTS,)."""


class Rows(NamedTuple):
    """Rows of results in the order of time."""

    t_ns: NDArray[np.int64]
    """T_k, shape (n,)."""
    t: Vector
    """T_k as the input states it [s], else NaN, shape (n,)."""
    values: Vector
    """Shape (n, N_ROW)."""
    samples: Vector
    """Of `KEPT`, NaN in a cycle without a valid one, shape (n, len(KEPT))."""


def new_ecu(params: RecordArray, learned: RecordArray | None) -> Ecu:
    """Return an ECU before its first cycle that has `learned`, shape (1,), from before; None: nothing."""
    return Ecu(params, new_state(params, learned), new_record(INPUTS), new_record(OUTPUTS), new_seen())


@kernel
def _open_cycle(inputs: Record, cycle: Record) -> None:
    begin_cycle(inputs, cycle.t_ns, (cycle.missed + 1) * CYCLE_NS)
    inputs.bus_faults = cycle.bus_faults
    inputs.overruns = cycle.overruns
    inputs.worst_lateness_us = cycle.worst_lateness_us


@kernel
def _close_cycle(
    params: Any,
    state: Any,
    inputs: Any,
    outputs: Any,
    seen: Any,
    vector: Vector,
    freshness: Any,
    row: Vector,
    samples: Vector,
) -> None:
    end_cycle(inputs[0], freshness)
    look_at(inputs[0], seen)
    step(params, state, inputs, outputs)
    row[:N_OUTPUTS] = vector
    for i in range(len(MEASURED_INPUTS)):
        place = MEASURED_INPUTS[i]
        usable = inputs[0].verdict[place] & USABLE == USABLE
        row[N_OUTPUTS + i] = inputs[0].value[place] if usable else np.nan
    for i in range(len(KEPT)):
        place = KEPT[i]
        samples[i] = inputs[0].value[place] if inputs[0].new[place] else np.nan


@batch_kernel
def _run_frames(
    params: Any,
    state: Any,
    inputs: Any,
    outputs: Any,
    seen: Any,
    vector: Vector,
    plan: ReceivePlan,
    reception: Reception,
    counted: bool,
    frames: Any,
    cycles: Any,
    values: Vector,
    samples: Vector,
    at: Any,
    last: bool,
) -> None:
    """Run `cycles` until frames are wanted that are not here yet; `last`: no more will come.

    `counted`: a cycle takes as many frames as it notes, which a recording knows.
    """
    run = at[0]
    while run.done < len(cycles):
        cycle = cycles[run.done]
        if run.open == 0:
            _open_cycle(inputs[0], cycle)
            run.open = 1
            run.left = cycle.frames if counted else _EVERYTHING
        limit = min(len(frames), run.cursor + run.left)
        cursor = receive(plan, reception, frames, run.cursor, limit, inputs[0])
        run.left -= cursor - run.cursor
        run.cursor = cursor
        if cursor == len(frames) and run.left > 0 and not last:
            return
        _close_cycle(
            params,
            state,
            inputs,
            outputs,
            seen,
            vector,
            reception.freshness,
            values[run.done],
            samples[run.done],
        )
        run.done += 1
        run.open = 0


@batch_kernel
def _run_samples(
    params: Any,
    state: Any,
    inputs: Any,
    outputs: Any,
    seen: Any,
    vector: Vector,
    freshness: Any,
    block: SampleBlock,
    cycles: Any,
    t: Vector,
    values: Vector,
    samples: Vector,
    at: Any,
    last: bool,
) -> None:
    """Run `cycles` until rows are wanted that are not here yet; `last`: no more will come."""
    run = at[0]
    while run.done < len(cycles):
        cycle = cycles[run.done]
        if run.open == 0:
            _open_cycle(inputs[0], cycle)
            run.open = 1
        while run.cursor < len(block.t_ns) and block.t_ns[run.cursor] <= cycle.t_ns:
            row = run.cursor
            for column in range(len(block.places)):
                value = block.values[row, column]
                if not np.isnan(value):
                    accept(inputs[0], freshness, block.places[column], value, block.t_ns[row], True)
            if block.t_ns[row] == cycle.t_ns:
                t[run.done] = block.t[row]
            run.cursor += 1
        if run.cursor == len(block.t_ns) and not last:
            return
        _close_cycle(
            params, state, inputs, outputs, seen, vector, freshness, values[run.done], samples[run.done]
        )
        run.done += 1
        run.open = 0


def _grid(start_ns: int) -> Iterator[RecordArray]:
    for first in count(0, BLOCK_CYCLES):
        cycles = np.zeros(BLOCK_CYCLES, CYCLE)
        cycles["number"] = np.arange(first, first + BLOCK_CYCLES)
        cycles["t_ns"] = start_ns + cycles["number"] * CYCLE_NS
        yield cycles


def _recorded(cycles: RecordArray) -> Iterator[RecordArray]:
    for first in range(0, len(cycles), BLOCK_CYCLES):
        yield cycles[first : first + BLOCK_CYCLES].copy()


def run_frames(
    ecu: Ecu,
    plan: ReceivePlan,
    reception: Reception,
    blocks: Iterable[RecordArray],
    cycles: RecordArray | None = None,
    counted: bool = False,
) -> Iterator[Rows]:
    """Yield the rows of a log whose frames come in `blocks` of FRAME, in the order of arrival.

    `cycles` (CYCLE, shape (n,)) gives T_k instead of the grid; `counted`: its `frames` were consumed in each.
    """
    vector = output_vector(ecu.outputs)

    def advance(frames: RecordArray, rows: Rows, chunk: RecordArray, at: RecordArray, last: bool) -> None:
        _run_frames(
            *ecu, vector, plan, reception, counted, frames, chunk, rows.values, rows.samples, at, last
        )

    return _run(blocks, new_record(FRAME, 0), lambda frames: frames["stamp_ns"], cycles, advance)


def run_samples(ecu: Ecu, freshness: RecordArray, blocks: Iterable[SampleBlock]) -> Iterator[Rows]:
    """Yield the rows of a signal file; `freshness` is FRESHNESS per input, overwritten."""
    vector = output_vector(ecu.outputs)
    end = SampleBlock(np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 0)))

    def advance(block: SampleBlock, rows: Rows, chunk: RecordArray, at: RecordArray, last: bool) -> None:
        _run_samples(*ecu, vector, freshness, block, chunk, rows.t, rows.values, rows.samples, at, last)

    return _run(blocks, end, lambda block: block.t_ns, None, advance)


def _run(
    blocks: Iterable[Block],
    end: Block,
    stamps: Callable[[Block], NDArray[np.int64]],
    cycles: RecordArray | None,
    advance: Callable[[Block, Rows, RecordArray, RecordArray, bool], None],
) -> Iterator[Rows]:
    """Hand blocks of input and chunks of cycles to `advance` until one ends; `end` is an empty block."""
    schedule = None if cycles is None else _recorded(cycles)
    chunk = new_record(CYCLE, 0)
    rows = _new_rows(chunk)
    at = new_record(_AT)
    latest = None
    for block in chain(blocks, [end]):
        last = block is end
        if schedule is None:
            if last:
                return
            schedule = _grid(int(stamps(block)[0]))
        if not last:
            newest = int(stamps(block).max())
            latest = newest if latest is None else max(newest, latest)
        at["cursor"] = 0
        while True:
            if at[0]["done"] == len(chunk):
                if len(chunk):
                    yield rows
                chunk = next(schedule, new_record(CYCLE, 0))
                rows = _new_rows(chunk)
                at["done"] = 0
            whole = len(chunk)
            if last and cycles is None:
                chunk = chunk[chunk["t_ns"] <= latest]
            if not len(chunk):
                return
            advance(block, rows, chunk, at, last)
            if at[0]["done"] < len(chunk):
                break
            if len(chunk) < whole:
                n = len(chunk)
                yield Rows(rows.t_ns[:n], rows.t[:n], rows.values[:n], rows.samples[:n])
                return


def _new_rows(cycles: RecordArray) -> Rows:
    count = len(cycles)
    # Column by column, as results store them; a row lies in as many sets of the processor's cache as it can.
    values = np.empty((N_ROW, count + _APART))[:, :count].T
    return Rows(cycles["t_ns"], np.full(count, np.nan), values, np.empty((count, len(KEPT))))
