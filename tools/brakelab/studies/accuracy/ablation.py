"""Ablation of the joint observer: its errors with one ingredient taken away.

The ECU is unchanged. A signal is withheld by the scenario, a measurement by a standard deviation that makes
it worthless, a learned value by setting it to the prior in `LEARNED`; the demand as a model of the pressure
by stepping a recorded drive with `transmit = false`, as a shadow. The same was withheld in the ten minutes
before.
"""

from collections.abc import Iterable
from itertools import chain, product
from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.plant.sensor_errors import ABSENT
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.simulation.accuracy import AXLES, estimate_errors
from brakelab.simulation.closed_loop import Drive, new_loop, plans, run
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.ecu_inputs import ecu_inputs, vehicle_frames
from brakelab.simulation.scenario import Scenario
from brakelab.studies.accuracy.observers import ORDINARY, counted
from brakelab.studies.accuracy.observers_cases import ACCURACY
from brakelab.studies.study import Asked, Measured, Study
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    DEFLECTION_GAIN,
    DRAG,
    LEVEL,
    LOAD,
    MASS,
    PEAK,
    RADIUS,
    RATIO,
    ROLLING,
    STIFFNESS,
)
from ecu.algorithm.estimation.joint.learned import KEPT
from ecu.algorithm.step import new_state, step
from ecu.contract.records import OUTPUTS, RecordArray, new_record, output_vector
from ecu.contract.signals import N_OUTPUTS, OUTPUT_COLUMNS
from ecu.jit import kernel
from ecu.settings.config import new_params

CARS: Final = 10
CASES: Final = ("stop #1", "1 m/s²", "blending 0.4")
UNKNOWN: Final = 1e3
"""A standard deviation without information."""


class Ablation(NamedTuple):
    """The ingredient withheld."""

    withheld: tuple[str, ...] = ()
    """Signals."""
    only_before: bool = False
    """They are there in the case itself."""
    worthless: str = ""
    """A standard deviation of `PARAMS`."""
    shadow: bool = False
    """The demand shows nothing of the pressure."""
    forgotten: tuple[int, ...] = ()
    """States that the case begins without."""
    linings: bool = False
    """Friction is forgotten."""


def _withhold(*names: str, only_before: bool = False) -> Ablation:
    return Ablation(withheld=names, only_before=only_before)


ABLATIONS: Final = {
    "nothing": Ablation(),
    "balance of forces": Ablation(worthless="sigma_accel"),
    "wheel slip": Ablation(worthless="sigma_wheel_speed"),
    "pressure by the demand": Ablation(shadow=True),
    "speed reference": _withhold("vehicle_speed"),
    "yaw rate, lateral acceleration, steering": _withhold("yaw_rate", "accel_y", "steering_angle"),
    "motor torque, in the ten minutes": _withhold("motor_torque", only_before=True),
    "learned mass": Ablation(forgotten=(MASS,)),
    "learned stiffness and peak": Ablation(forgotten=(STIFFNESS, PEAK)),
    "learned stiffness ratio and exponent": Ablation(forgotten=(RATIO, LOAD)),
    "learned radii": Ablation(forgotten=(*range(RADIUS, RADIUS + 4), ROLLING)),
    "learned change of radius with load": Ablation(forgotten=(DEFLECTION_GAIN,)),
    "learned accelerometer bias and drag": Ablation(forgotten=(BIAS, DRAG)),
    "learned friction": Ablation(linings=True),
}


class Sample(NamedTuple):
    """One car's case."""

    ablation: str
    case: str
    adapted: bool
    nrmse: tuple[float, float]
    """Front and rear [%]."""


def without(ablation: Ablation, scenario: Scenario, before: bool) -> Scenario:
    """Return a scenario without the withheld signals; `before`: the ten minutes."""
    if ablation.only_before and not before:
        return scenario
    sensor = scenario.sensor | dict.fromkeys(ablation.withheld, ABSENT)
    return scenario.model_copy(update={"sensor": sensor})


def forget(ablation: Ablation, learned: RecordArray) -> RecordArray:
    """Return `LEARNED`, shape (1,), with the prior of the forgotten values, uncorrelated with the rest."""
    learned = learned.copy()
    states = list(ablation.forgotten)
    if ablation.linings:
        states += range(LEVEL, LEVEL + 4)
        learned["observed_s"] = 0.0
    prior = new_state(new_params(configured()))["joint"]["p"][0][np.ix_(KEPT, KEPT)]
    triangle, gone = np.tril_indices(len(KEPT)), np.isin(KEPT, states)
    covariance = np.zeros_like(prior)
    covariance[triangle] = learned["joint_covariance"][0]
    covariance[gone], covariance[:, gone] = 0.0, 0.0
    covariance[np.ix_(gone, gone)] = prior[np.ix_(gone, gone)]
    learned["joint_covariance"][0] = covariance[triangle]
    learned["joint"][0, states] = 0.0
    return learned


def drive_without(
    ablation: Ablation, scenario: Scenario, seed: int, learned: RecordArray | None
) -> tuple[Drive, RecordArray]:
    """Return the drive of one car, and `LEARNED` at its end."""
    loop = new_loop(scenario, configured(), seed)
    sides = loop.sides
    if ablation.worthless:
        sides.params[ablation.worthless] = UNKNOWN
    sides.state[:] = new_state(sides.params, learned)
    drive = run(loop)
    return _as_shadow(drive, learned) if ablation.shadow else (drive, sides.state["learned"].copy())


@kernel
def _steps(params: Any, state: Any, inputs: Any, outputs: Any, vector: Vector, rows: Vector) -> None:
    for k in range(len(inputs)):
        step(params, state, inputs[k : k + 1], outputs)
        rows[k] = vector


def _as_shadow(drive: Drive, learned: RecordArray | None) -> tuple[Drive, RecordArray]:
    params = new_params(configured())
    params["mapped"] = plans().ecu_hears.mapped
    state, outputs = new_state(params, learned), new_record(OUTPUTS)
    inputs = ecu_inputs(vehicle_frames(drive.frames), len(drive.t))
    rows = np.empty((len(inputs), N_OUTPUTS))
    _steps(params, state, inputs, outputs, output_vector(outputs), rows)
    estimates = dict(zip(OUTPUT_COLUMNS, rows.T, strict=True))
    return drive._replace(outputs=estimates), state["learned"].copy()


def samples_of(seed: int) -> list[Sample]:
    """Drive all cases of one car with all ablations."""
    samples = []
    ordinary = shipped(ORDINARY)
    _, everything = drive_without(Ablation(), ordinary, seed, None)
    for name, ablation in ABLATIONS.items():
        lasting = bool(ablation.withheld or ablation.worthless or ablation.shadow)
        learned = everything
        if lasting:
            _, learned = drive_without(ablation, without(ablation, ordinary, True), seed, None)
        learned = forget(ablation, learned)
        cold = (None,) if ablation == Ablation() or (lasting and not ablation.only_before) else ()
        for case in CASES:
            scenario = without(ablation, ACCURACY[case].scenario, False)
            for before in (*cold, learned):
                drive, _ = drive_without(ablation, scenario, seed, before)
                rows = counted(drive)
                front, rear = (estimate_errors(drive, rows, axle)[0] for axle in AXLES)
                samples.append(Sample(name, case, before is not None, (front, rear)))
    return samples


def ablation_table(cars: Iterable[list[Sample]]) -> Table:
    """Return the table of all cars."""
    groups: dict[tuple[str, str, bool], list[tuple[float, float]]] = {}
    every = list(cars)
    for sample in chain.from_iterable(every):
        groups.setdefault((sample.ablation, sample.case, sample.adapted), []).append(sample.nrmse)

    def cell(key: tuple[str, str, bool]) -> str:
        if key not in groups:
            return "–"
        front, rear = np.median(groups[key], axis=0)
        return f"{front:.2f}/{rear:.2f}"

    states = tuple(product(CASES, (False, True)))
    return Table(
        "Friction without one ingredient: nRMSE [%]",
        ("without", *(f"{case}, {'adapted' if adapted else 'cold'}" for case, adapted in states)),
        [(name, *(cell((name, *state)) for state in states)) for name in ABLATIONS],
        f"Front/rear, medians over {len(every)} cars. –: as with nothing taken away.",
    )


TEXT: Final = (
    "Each line takes one thing away from the joint observer; the rest is as in "
    "[observers.md](observers.md). What is withheld or worthless is so in the ten minutes before too, "
    "what was learned is forgotten after them. Balance of forces: the accelerometer still drives the "
    "speed. Pressure by the demand: the same drives seen by a shadow, which has the samples alone. Motor "
    "torque: it is there in the case itself. Friction's rate, the zeros of the pressure sensors and the "
    "changing share of front and rear cannot be taken away from outside."
)


def _run(asked: Asked) -> Measured:
    cars = run_each("ablation", samples_of, range(min(asked.seeds, CARS)))
    return Measured([ablation_table(cars)])


STUDY: Final = Study("What carries the joint observer", TEXT, _run)
