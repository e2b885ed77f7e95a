"""Frames or samples through the ECU's own kernels, cycle by cycle: rows of results come out.

Cycle k consumes the frames stamped up to T_k, then `step` runs, exactly as in the daemon. T_k is either the
grid t_0 + k·10 ms from the first frame or sample up to the last, or that of a recording, which notes the T_k,
missed periods and bus faults of its cycles. Nothing that is received depends on `step`, so the inputs of the
next cycles are made beside it.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, count
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.logs.physics.samples import KEPT
from brakelab.logs.sample_block import SampleBlock
from brakelab.replay.ahead import read_ahead
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
from ecu.contract.work import Work
from ecu.jit import Record, batch_kernel, kernel
from ecu.workshop import do

Block = TypeVar("Block")

BATCH: Final = 2048
"""Cycles whose inputs are made at once: 1.8 MB."""
BATCHES: Final = 8
"""Of a block of rows."""

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


class Change(NamedTuple):
    """Parameters that take the place of others, and what is done to the state then."""

    cycle: int
    """Number of the first that goes by them."""
    params: RecordArray
    """`PARAMS`, shape (1,)."""
    work: Work | None = None


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


@batch_kernel
def _gather_frames(
    plan: ReceivePlan,
    reception: Reception,
    counted: bool,
    frames: Any,
    cycles: Any,
    now: Any,
    inputs: Any,
    at: Any,
    last: bool,
) -> None:
    """Make the inputs of `cycles` until frames are wanted that are not here yet; `last`: no more will come.

    `counted`: a cycle takes as many frames as it notes, which a recording knows.
    """
    run = at[0]
    while run.done < len(cycles):
        cycle = cycles[run.done]
        if run.open == 0:
            _open_cycle(now[0], cycle)
            run.open = 1
            run.left = cycle.frames if counted else _EVERYTHING
        limit = min(len(frames), run.cursor + run.left)
        cursor = receive(plan, reception, frames, run.cursor, limit, now[0])
        run.left -= cursor - run.cursor
        run.cursor = cursor
        if cursor == len(frames) and run.left > 0 and not last:
            return
        end_cycle(now[0], reception.freshness)
        inputs[run.done] = now[0]
        run.done += 1
        run.open = 0


@batch_kernel
def _gather_samples(
    freshness: Any,
    block: SampleBlock,
    cycles: Any,
    t: Vector,
    now: Any,
    inputs: Any,
    at: Any,
    last: bool,
) -> None:
    """Make the inputs of `cycles` until rows are wanted that are not here yet; `last`: no more will come."""
    run = at[0]
    while run.done < len(cycles):
        cycle = cycles[run.done]
        if run.open == 0:
            _open_cycle(now[0], cycle)
            run.open = 1
        while run.cursor < len(block.t_ns) and block.t_ns[run.cursor] <= cycle.t_ns:
            row = run.cursor
            for column in range(len(block.places)):
                value = block.values[row, column]
                if not np.isnan(value):
                    accept(now[0], freshness, block.places[column], value, block.t_ns[row], True)
            if block.t_ns[row] == cycle.t_ns:
                t[run.done] = block.t[row]
            run.cursor += 1
        if run.cursor == len(block.t_ns) and not last:
            return
        end_cycle(now[0], freshness)
        inputs[run.done] = now[0]
        run.done += 1
        run.open = 0


@batch_kernel
def _run(
    params: Any, state: Any, inputs: Any, outputs: Any, seen: Any, vector: Vector, values: Any, samples: Any
) -> None:
    """Run `step` with each of `inputs`; write a row of `values` and one of `samples`."""
    for k in range(len(inputs)):
        now = inputs[k]
        look_at(now, seen)
        step(params, state, inputs[k : k + 1], outputs)
        values[k, :N_OUTPUTS] = vector
        for i in range(len(MEASURED_INPUTS)):
            place = MEASURED_INPUTS[i]
            usable = now.verdict[place] & USABLE == USABLE
            values[k, N_OUTPUTS + i] = now.value[place] if usable else np.nan
        for i in range(len(KEPT)):
            place = KEPT[i]
            samples[k, i] = now.value[place] if now.new[place] else np.nan


def _grid(start_ns: int) -> Iterator[RecordArray]:
    for first in count(0, BATCH):
        cycles = np.zeros(BATCH, CYCLE)
        cycles["number"] = np.arange(first, first + BATCH)
        cycles["t_ns"] = start_ns + cycles["number"] * CYCLE_NS
        yield cycles


def _recorded(cycles: RecordArray) -> Iterator[RecordArray]:
    for first in range(0, len(cycles), BATCH):
        yield cycles[first : first + BATCH].copy()


def run_frames(
    ecu: Ecu,
    plan: ReceivePlan,
    reception: Reception,
    blocks: Iterable[RecordArray],
    cycles: RecordArray | None = None,
    counted: bool = False,
    changes: Iterable[Change] = (),
) -> Iterator[Rows]:
    """Yield the rows of a log whose frames come in `blocks` of FRAME, in the order of arrival.

    `cycles` (CYCLE, shape (n,)) gives T_k instead of the grid; `counted`: its `frames` were consumed in each.
    `changes` are of the recorded run, in order. Another thread reads `blocks`.
    """

    def gather(frames: RecordArray, batch: _Batch, at: RecordArray, last: bool) -> None:
        _gather_frames(plan, reception, counted, frames, batch.cycles, ecu.inputs, batch.inputs, at, last)

    return _rows(
        ecu,
        _gathered(blocks, new_record(FRAME, 0), lambda frames: frames["stamp_ns"], cycles, gather),
        changes,
    )


def run_samples(ecu: Ecu, freshness: RecordArray, blocks: Iterable[SampleBlock]) -> Iterator[Rows]:
    """Yield the rows of a signal file; `freshness` is FRESHNESS per input, overwritten.

    Another thread reads `blocks`.
    """
    end = SampleBlock(np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 0)))

    def gather(block: SampleBlock, batch: _Batch, at: RecordArray, last: bool) -> None:
        _gather_samples(freshness, block, batch.cycles, batch.t, ecu.inputs, batch.inputs, at, last)

    return _rows(ecu, _gathered(blocks, end, lambda block: block.t_ns, None, gather))


class _Batch(NamedTuple):
    """Cycles and their inputs."""

    cycles: RecordArray
    t: Vector
    inputs: RecordArray


def _new_batch(cycles: RecordArray) -> _Batch:
    return _Batch(cycles, np.full(len(cycles), np.nan), np.empty(len(cycles), INPUTS))


def _gathered(
    blocks: Iterable[Block],
    end: Block,
    stamps: Callable[[Block], NDArray[np.int64]],
    cycles: RecordArray | None,
    gather: Callable[[Block, _Batch, RecordArray, bool], None],
) -> Iterator[_Batch]:
    """Hand blocks of input and batches of cycles to `gather` until one ends; `end` is an empty block."""
    schedule = None if cycles is None else _recorded(cycles)
    batch = _new_batch(new_record(CYCLE, 0))
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
            if at[0]["done"] == len(batch.cycles):
                if len(batch.cycles):
                    yield batch
                batch = _new_batch(next(schedule, new_record(CYCLE, 0)))
                at["done"] = 0
            if last and cycles is None:
                due = int(np.count_nonzero(batch.cycles["t_ns"] <= latest))
                if due < len(batch.cycles):
                    schedule, batch = iter(()), _Batch(batch.cycles[:due], batch.t[:due], batch.inputs[:due])
            if not len(batch.cycles):
                return
            gather(block, batch, at, last)
            if at[0]["done"] < len(batch.cycles):
                break


def _rows(ecu: Ecu, batches: Iterator[_Batch], changes: Iterable[Change] = ()) -> Iterator[Rows]:
    vector, params, due = output_vector(ecu.outputs), ecu.params.copy(), deque(changes)
    rows, done = _new_rows(), 0
    for cycles, t, inputs in read_ahead(batches):
        part = slice(done, done + len(cycles))
        rows.t_ns[part], rows.t[part] = cycles["t_ns"], t
        for begin, end in _pieces(cycles["number"], params, ecu.state, due):
            part = slice(done + begin, done + end)
            _run(
                params,
                ecu.state,
                inputs[begin:end],
                ecu.outputs,
                ecu.seen,
                vector,
                rows.values[part],
                rows.samples[part],
            )
        done += len(cycles)
        if done == len(rows.t):
            yield rows
            rows, done = _new_rows(), 0
    if done:
        yield Rows(rows.t_ns[:done], rows.t[:done], rows.values[:done], rows.samples[:done])


def _pieces(
    numbers: NDArray[np.int64], params: RecordArray, state: RecordArray, due: deque[Change]
) -> Iterator[tuple[int, int]]:
    """Yield the pieces of a batch between changes, and make these to `params` and `state`."""
    begin = 0
    while due and due[0].cycle <= numbers[-1]:
        end = int(np.searchsorted(numbers, due[0].cycle))
        if end > begin:
            yield begin, end
        change = due.popleft()
        params[:] = change.params
        if change.work is not None:
            do(change.work, params, state)
        begin = end
    yield begin, len(numbers)


def _new_rows() -> Rows:
    count = BATCH * BATCHES
    # Column by column, as results store them; a row lies in as many sets of the processor's cache as it can.
    values = np.empty((N_ROW, count + _APART))[:, :count].T
    return Rows(np.empty(count, np.int64), np.empty(count), values, np.empty((count, len(KEPT))))
