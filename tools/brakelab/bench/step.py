"""Time of a `step` and of the four friction filters in it, beside filterpy and plain numpy."""

from typing import Any, Final

import numpy as np

from brakelab.bench.braking import simulated_stop
from brakelab.bench.filters import (
    FILTER_INPUT,
    FilterpyFilters,
    NumpyFilters,
    constants,
    filter_cycle,
    filter_cycles,
    new_observer,
    note_inputs,
)
from brakelab.studies.measure import NOT_INSTALLED, Figure, Row, alternate, installed, timed
from ecu.algorithm.step import new_state, step
from ecu.contract.records import OUTPUTS, RecordArray, new_record
from ecu.jit import kernel

ROUNDS: Final = 15
CYCLES: Final = 500  # of braking, all four corners observing: from 31 to 12 m/s


@kernel
def run_steps(params: Any, state: Any, inputs: Any, outputs: Any) -> None:
    """Step through `inputs`, shape (cycles,)."""
    for k in range(len(inputs)):
        step(params, state, inputs[k : k + 1], outputs)


@kernel
def _noted_steps(params: Any, state: Any, inputs: Any, outputs: Any, table: Any) -> None:
    for k in range(len(inputs)):
        step(params, state, inputs[k : k + 1], outputs)
        note_inputs(params[0], state[0], inputs[k], table[k])


def filter_table(cycles: int) -> tuple[RecordArray, RecordArray, RecordArray, RecordArray]:
    """Return parameters, the state at the beginning of `cycles` of braking, its inputs, and the inputs
    of the four filters in it (`FILTER_INPUT`, shape (cycles, 4))."""
    stop = simulated_stop()
    outputs = new_record(OUTPUTS)
    state = new_state(stop.params)
    run_steps(stop.params, state, stop.inputs[: stop.braking], outputs)
    inputs = stop.inputs[stop.braking : stop.braking + cycles]
    table = np.zeros((len(inputs), 4), FILTER_INPUT)
    _noted_steps(stop.params, state.copy(), inputs, outputs, table)
    return stop.params, state, inputs, table


def step_rows(rounds: int = ROUNDS, cycles: int = CYCLES) -> list[Row]:
    """Return the rows; times per cycle (all four corners)."""
    params, start, inputs, table = filter_table(cycles)
    const, count = constants(params), len(inputs)
    state, outputs = start.copy(), new_record(OUTPUTS)
    beginning = new_observer(params, table)
    observer = beginning.copy()
    numpy_filters: list[NumpyFilters] = []
    filterpy_filters: list[FilterpyFilters] = []
    row_of = [table[k] for k in range(count)]
    inputs_of = [inputs[k : k + 1] for k in range(count)]

    def reset() -> None:
        state[:] = start
        observer[:] = beginning
        numpy_filters[:] = [NumpyFilters(const, table[0])]

    def steps_from_python() -> None:
        for given in inputs_of:
            step(params, state, given, outputs)

    def filters_from_python() -> None:
        for k in range(count):
            filter_cycle(params, observer, table, k)

    def in_numpy() -> None:
        for row in row_of:
            numpy_filters[0].cycle(row)

    def reset_filterpy() -> None:
        filterpy_filters[:] = [FilterpyFilters(const, table[0])]

    def in_filterpy() -> None:
        for row in row_of:
            filterpy_filters[0].cycle(row)

    tasks = [
        timed(lambda: run_steps(params, state, inputs, outputs), count, reset),
        timed(steps_from_python, count, reset),
        timed(lambda: filter_cycles(params, observer, table), count, reset),
        timed(filters_from_python, count, reset),
        timed(in_numpy, count, reset),
    ]
    try:
        reset_filterpy()
        tasks.append(timed(in_filterpy, count, reset_filterpy))
    except ImportError:
        pass
    figures = alternate(rounds, tasks)
    peer: Figure | None = figures[5] if len(figures) > 5 else None
    name = installed("filterpy") if peer else NOT_INSTALLED.format("filterpy")
    four, stacked = f"{name}, four filters only", "numpy, four wheels stacked"
    return [
        Row("whole step, compiled loop", figures[0], peer, "µs", four),
        Row("whole step, called from Python", figures[1], peer, "µs", four),
        Row("four filters, compiled loop", figures[2], peer, "µs", name),
        Row("four filters, called from Python", figures[3], peer, "µs", name),
        Row("four filters, compiled loop", figures[2], figures[4], "µs", stacked),
        Row("four filters, called from Python", figures[3], figures[4], "µs", stacked),
    ]
