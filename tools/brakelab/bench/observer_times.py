"""Processor time of a whole cycle with each friction observer."""

from collections.abc import Callable

from brakelab.bench.braking import simulated_stop
from brakelab.bench.step import CYCLES, ROUNDS, run_steps
from brakelab.simulation.configured import configured, with_observer
from brakelab.studies.measure import Figure, alternate, timed
from ecu.algorithm.step import new_state
from ecu.contract.params import OBSERVERS
from ecu.contract.records import OUTPUTS, RecordArray, new_record
from ecu.settings.config import new_params


def step_times() -> dict[str, Figure]:
    """Return the processor time of a whole cycle with each observer [µs]."""
    stop = simulated_stop()
    inputs = stop.inputs[: stop.braking + CYCLES]
    measured = []
    for observer in OBSERVERS:
        params = new_params(with_observer(configured(), observer))
        params["mapped"] = stop.params["mapped"]
        state, outputs = new_state(params), new_record(OUTPUTS)
        run_steps(params, state, inputs[: stop.braking], outputs)
        measured.append(_timed(params, state, inputs[stop.braking :], outputs))
    return dict(zip(OBSERVERS, alternate(ROUNDS, measured), strict=True))


def _timed(
    params: RecordArray, start: RecordArray, inputs: RecordArray, outputs: RecordArray
) -> Callable[[], float]:
    state = start.copy()

    def reset() -> None:
        state[:] = start

    return timed(lambda: run_steps(params, state, inputs, outputs), len(inputs), reset)
