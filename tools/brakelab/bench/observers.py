"""`brake-ecu bench observers`: the observers beside their goals, and the time of a step with each."""

from collections.abc import Callable, Iterable
from typing import Final

from brakelab.bench.braking import simulated_stop
from brakelab.bench.step import CYCLES, ROUNDS, run_steps
from brakelab.results.processes import new_pool
from brakelab.results.progress import tracked
from brakelab.simulation.configured import configured, with_observer
from brakelab.studies.accuracy.observers import Sample, Task, observer_rows, tasks
from brakelab.studies.accuracy.observers_picture import PICTURED, consistency_of, write_picture
from brakelab.studies.accuracy.observers_table import finite, observer_tables
from brakelab.studies.accuracy.stops import drawn_of
from brakelab.studies.measure import Figure, alternate, machine, plain_row, timed
from brakelab.studies.study import Asked, Measured, Study
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


TEXT: Final = (
    "Cars and their sensors are drawn per seed about config/plant/suv.toml and Table 4.1. Cold: the "
    "configuration as it is, nothing learned. Adapted: after ten minutes of "
    "config/scenarios/ordinary.toml in the same car, with what the state store keeps of them. Every "
    "observer closes the loop itself; figures stand for front/rear. Counted while the brakes of both axles "
    "have been on for 0.8 s, above 15 km/h.\n\n"
    "![Error of the friction over 2σ, and the squared innovations](images/observers.svg)"
)


def _run(asked: Asked) -> Measured:
    seeds, todo = asked.seeds, tasks(asked.seeds, asked.draw)
    with new_pool() as pool:

        def all_cores(drive: Callable[[Task], list[Sample]], cars: list[Task]) -> Iterable[list[Sample]]:
            return tracked(pool.map(drive, cars), "observers", len(cars))

        rows = observer_rows(todo, all_cores)
        consistency = list(pool.map(consistency_of, range(min(seeds, PICTURED))))
    times = step_times()
    step_us = {name: value._asdict() for name, value in times.items()}
    return Measured(
        observer_tables(rows, times, consistency, asked.draw),
        f"{drawn_of('suv.toml', configured(), asked)}. {machine()}",
        finite({"rows": [plain_row(row) for row in rows], "step_us": step_us}),
        lambda folder: write_picture(folder / "observers.svg", consistency),
    )


STUDY: Final = Study("The observers beside their goals", TEXT, _run)
