"""Comparison of friction observers over `observers_cases`: the thesis's two, the joint one and a constant.

Every observer drives its own closed loop with the same cars and the same noise. Counted are the rows in which
the brakes of both axles have been on for 0.8 s (the demand's ramp of 0.3 s and the half second of
`stops.window`), above 15 km/h; nRMSE as there. *Adapted*: a new state starts with the learned values that the
state store would keep after ten minutes of `config/scenarios/ordinary.toml` in the same car.
"""

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.logs.signal_file import freshness_at_any_rate
from brakelab.simulation.accuracy import AXLES, LOWEST_SPEED, columns, friction_errors, nrmse
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.configured import configured, shipped, with_observer
from brakelab.simulation.scenario_car import with_draw
from brakelab.studies.accuracy.observers_cases import (
    ACCURACY,
    CASES,
    EVENTS,
    ROBUSTNESS,
    SENSORS,
    TRANSDUCERS,
    WRONG_START,
    Case,
    Setup,
)
from brakelab.studies.measure import Figure, figure
from brakelab.studies.study import WIDE
from ecu.algorithm.step import new_state
from ecu.contract.params import OBSERVERS
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS
from ecu.recording.learned_range import out_of_range
from ecu.settings.config import new_params

SEEDS: Final = 20
ROBUST_SHARE: Final = 4
"""Robustness is judged with one car out of so many: each disturbance has ten minutes of its own."""
JOINT: Final = OBSERVERS[0]
ORDINARY: Final = "ordinary"
FILLED: Final = 2.0  # bar: the brakes are on
ON_FOR: Final = 80  # cycles
LOCKED: Final = 0.12  # slip
SETTLED: Final = 0.05  # of the truth
BEFORE: Final = 50  # cycles, compared with before an event
NEVER: Final = float("inf")


class Task(NamedTuple):
    """Task of one process: cases of one car, which share its ordinary driving."""

    observer: str
    seed: int
    cases: tuple[str, ...]
    draw: str = WIDE
    """How far the cars differ from their file."""


class Sample(NamedTuple):
    """One car's drive."""

    case: str
    observer: str
    adapted: bool
    nrmse: tuple[float, float]
    """Front and rear [%]."""
    inside_2_sigma: tuple[float, float]
    """Share of the rows."""
    nominal: tuple[float, float]
    """nRMSE of the configured constant [%]."""
    seconds: float
    """How long an event was felt, see `settling`; NaN: there was none."""
    force: float
    """nRMSE of the front wheels' longitudinal forces in an event [%]; NaN: there was none."""


def counted(drive: Drive) -> NDArray[np.bool_]:
    """Return the rows that count, shape (n,)."""
    pressure = np.stack([drive.truth[f"calliper_pressure_{corner}"] for corner in CORNERS])
    on = np.all(pressure > FILLED, axis=0)
    last_off = np.maximum.accumulate(np.where(on, -1, np.arange(len(on))))
    rows: NDArray[np.bool_] = (np.arange(len(on)) - last_off > ON_FOR) & (
        drive.truth["vehicle_speed"] > LOWEST_SPEED
    )
    return rows


def drive_car(
    setup: Setup, observer: str, seed: int, learned: RecordArray | None = None
) -> tuple[Drive, RecordArray]:
    """Return the drive of one car and the learned values (`LEARNED`, shape (1,)) at its end.

    `learned`: values learned before; None: unadapted. Only `observer1` has wheel force transducers.
    """
    config = with_observer(setup.config, observer)
    transducers = {"wheel_transducers": observer == "observer1"}
    loop = new_loop(setup.scenario.model_copy(update=transducers), config, seed)
    sides = loop.sides
    for name, factors in setup.car:
        sides.vehicle.params[name][0] *= factors
    for name, value in setup.form:
        sides.vehicle.params[name] = value
    if setup.any_rate:
        sides.ecu_reception.freshness[:] = freshness_at_any_rate()
    if learned is not None:
        sides.state[:] = new_state(sides.params, learned)
    return run(loop), sides.state["learned"].copy()


def _setup(case: Case, task: Task) -> Setup:
    sign = 1.0 if task.seed % 2 == 0 else -1.0
    return case.change(Setup(with_draw(case.scenario, task.draw), configured()), sign)


def _ordinary(case: Case, task: Task) -> RecordArray | None:
    """Return the values learned in ordinary driving (ten minutes); of `case` the car and lasting errors hold.

    None: the store would reject them.
    """
    ordinary = Case(shipped(ORDINARY).model_copy(update={"plant": case.scenario.plant}))
    if case.lasting:
        ordinary = ordinary._replace(change=case.change)
    setup = _setup(ordinary, task)
    _, learned = drive_car(setup, task.observer, task.seed)
    return None if out_of_range(learned, new_params(setup.config)["mu_nominal"][0]) else learned


def _axle_error(drive: Drive, axle: str) -> Vector:
    """Return the relative error of the axle's mean friction, shape (n,)."""
    everywhere = np.ones(len(drive.t), np.bool_)
    true = columns(drive.truth, "mu_b", axle, everywhere).mean(axis=0)
    return np.asarray(columns(drive.outputs, "mu_b", axle, everywhere).mean(axis=0) / true - 1.0)


def settling(drive: Drive, start: int, against: int | None) -> float:
    """Return the time after row `start` until friction stays within 5 % at both axles [s].

    Relative to the truth; with `against`, to the error in the half second before that row. `NEVER`: not by
    the end.
    """
    rows = np.flatnonzero(counted(drive))
    last, end = start, int(rows[-1])
    for axle in AXLES:
        error = _axle_error(drive, axle)
        if against is not None:
            error = error - error[against - BEFORE : against].mean()
        off = np.flatnonzero(np.abs(error[start : end + 1]) > SETTLED)
        last = max(last, start + int(off[-1]) + 1) if len(off) else last
    return NEVER if last > end else float(drive.t[last] - drive.t[start])


def _event(name: str, drive: Drive) -> tuple[float, float]:
    """Return the time [s] and the force error [%] of an event."""
    scenario = EVENTS[name].scenario
    if name == WRONG_START:
        filled = int(np.argmax(drive.truth["calliper_pressure_fl"] > FILLED))
        return settling(drive, filled, None), float("nan")
    if scenario.tyre_fault is not None:
        first = last = int(np.searchsorted(drive.t, scenario.tyre_fault.time))
    else:
        slip = np.stack([drive.truth[f"slip_{corner}"] for corner in CORNERS])
        sliding = np.flatnonzero(
            np.any(np.abs(slip) > LOCKED, axis=0) & (drive.truth["vehicle_speed"] > LOWEST_SPEED)
        )
        first, last = int(sliding[0]), int(sliding[-1])
    rows = np.zeros(len(drive.t), np.bool_)
    rows[first : last + 2 * BEFORE] = True
    true = columns(drive.truth, "wheel_force_x", "front", rows)
    force = nrmse(columns(drive.outputs, "wheel_force_x", "front", rows), true)
    return settling(drive, last, first), abs(force)


def _sample(name: str, task: Task, adapted: bool, learned: RecordArray | None) -> Sample:
    setup = _setup(CASES[name], task)
    drive, _ = drive_car(setup, task.observer, task.seed, learned)
    rows, config = counted(drive), setup.config
    front = friction_errors(drive, rows, "front", config.front.mu_nominal)
    rear = friction_errors(drive, rows, "rear", config.rear.mu_nominal)
    event = _event(name, drive) if name in EVENTS else (float("nan"), float("nan"))
    error, inside, nominal = ((front[k], rear[k]) for k in range(3))
    return Sample(name, task.observer, adapted, error, inside, nominal, *event)


def drive_task(task: Task) -> list[Sample]:
    """Drive the cases of a task, unadapted and adapted."""
    samples = []
    ordinary: dict[tuple[str, str], RecordArray | None] = {}
    for name in task.cases:
        case = CASES[name]
        before = case.scenario.plant, name if case.lasting else ORDINARY
        if before not in ordinary:
            ordinary[before] = _ordinary(case, task)
        learned = ordinary[before]
        if name == WRONG_START and learned is not None:
            learned = learned.copy()
            learned["observed_s"] = 0.0  # the linings are new, the car is not
        samples += [_sample(name, task, False, None), _sample(name, task, True, learned)]
    return samples


def tasks(seeds: int, draw: str = WIDE) -> list[Task]:
    """Return all tasks with cars 0 to `seeds` - 1, the longest first."""
    few = ROBUSTNESS | SENSORS
    passing = tuple(name for name, case in few.items() if not case.lasting)
    lasting = tuple(name for name, case in few.items() if case.lasting)
    robust = range(max(seeds // ROBUST_SHARE, 1))
    alone = [Task(JOINT, seed, lasting, draw) for seed in robust]
    own = {JOINT: passing, "observer1": tuple(TRANSDUCERS)}
    return alone + [
        Task(observer, seed, (*ACCURACY, *EVENTS, *(own.get(observer, ()) if seed in robust else ())), draw)
        for observer in OBSERVERS
        for seed in range(seeds)
    ]


class Row(NamedTuple):
    """One case of one observer over the cars."""

    case: str
    observer: str
    adapted: bool
    nrmse: tuple[Figure, Figure]
    """Front and rear [%]."""
    inside_2_sigma: tuple[float, float]
    """[%]"""
    nominal: tuple[Figure, Figure]
    seconds: Figure
    force: Figure


Drivers = Callable[[Callable[[Task], list[Sample]], list[Task]], Iterable[list[Sample]]]
"""As `map` does it."""


def observer_rows(todo: list[Task], spread: Drivers = map) -> list[Row]:
    """Drive the tasks and return their rows in the order of the cases."""
    groups: dict[tuple[str, str, bool], list[Sample]] = {}
    for samples in spread(drive_task, todo):
        for sample in samples:
            groups.setdefault((sample.case, sample.observer, sample.adapted), []).append(sample)

    def axles(values: list[tuple[float, float]]) -> tuple[Figure, Figure]:
        front, rear = zip(*values, strict=True)
        return figure(front), figure(rear)

    rows = []
    for key in sorted(groups, key=lambda key: list(CASES).index(key[0])):
        cars = groups[key]
        front, rear = 100.0 * np.mean([car.inside_2_sigma for car in cars], axis=0)
        rows.append(
            Row(
                *key,
                axles([car.nrmse for car in cars]),
                (float(front), float(rear)),
                axles([car.nominal for car in cars]),
                figure([car.seconds for car in cars]),
                figure([car.force for car in cars]),
            )
        )
    return rows
