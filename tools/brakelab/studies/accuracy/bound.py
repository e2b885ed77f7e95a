"""Lower bound of the adapted joint observer's error: whether its goals can be met with these sensors.

The drives of `observers` as a linear system about the true drive (`bound_car.py`), bounded by
`linear_bound.py`. Prior knowledge in a case:

learned          that of the joint observer, by its own standard deviations
ten minutes      the best of a filter of this structure after config/scenarios/ordinary.toml
car known        car and sensors exactly; only friction is left
change known     as ten minutes, with the change of friction known, so that its level alone is left

But for the last, friction changes by a rate per axle, a Gauss-Markov process whose covariance and correlation
time are those of the very drive. Draws of the errors are judged as `observers` judges its drives.
"""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.simulation.accuracy import AXLES, estimate_errors
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.scenario_car import with_draw
from brakelab.simulation.vehicle_bus import new_vehicle
from brakelab.studies.accuracy.bound_car import (
    BIAS,
    DEFLECTION_GAIN,
    DEGRESSION,
    DRAG,
    MASS,
    MOTOR,
    MU,
    PEAK,
    PUSH_OUT,
    RADIUS,
    RATE,
    RATIO,
    ROLLING,
    SLOPE,
    STIFFNESS,
    TRANSFER,
    N,
    Trajectory,
    V,
    derivatives,
    trajectory_of,
)
from brakelab.studies.accuracy.bound_system import PRIOR, Wander, before_stop, prior, system_of, wander_of
from brakelab.studies.accuracy.linear_bound import filtered, sampled
from brakelab.studies.accuracy.observers import JOINT, ORDINARY, counted, drive_car
from brakelab.studies.accuracy.observers_cases import ACCURACY, Setup, goals
from brakelab.studies.accuracy.observers_table import ROUNDING
from brakelab.studies.study import Asked, Measured, Study
from ecu.algorithm.estimation.joint import layout
from ecu.algorithm.step import new_state
from ecu.contract.records import RecordArray
from ecu.settings.config import new_params

CARS: Final = 10
DRAWS: Final = 64
LEVELS: Final = ("learned", "ten minutes", "car known", "change known")
REMEDY: Final = {
    "ten minutes": "yes",
    "car known": "with the car known",
    "change known": "with the change known",
}
BELOW: Final = (
    "Front/rear, medians over {} cars of the nominal draw, whose spread the bounds know; of the bounds over "
    f"{DRAWS} draws each of noise and of what is not "
    "known. A smoother knows the rest of the stop as well, which no ECU does. Front, rear: can a filter meet "
    "the goal that the joint observer misses? Yes: with what ten minutes show; with the car known: only with "
    "car and sensors known exactly; with the change known: only if it is known beforehand how friction is "
    "going to change; no: not even then. The joint observer can be better than *learned*, which allows for "
    "wrong motor torque; these cars report it exactly."
)


class Limit(NamedTuple):
    """nRMSE [%] of front and rear in draws of the noise, shape (2, DRAWS)."""

    filter: Vector
    smoother: Vector
    """Bound of a smoother, which knows the rest of the drive too."""


class Bound(NamedTuple):
    """One case of one car."""

    case: str
    joint: tuple[float, float]
    """Error that the joint observer reached, adapted [%]."""
    limits: dict[str, Limit]
    """By level."""


def as_learned(params: RecordArray, learned: RecordArray, wander: Wander) -> Vector:
    """Return the covariance that the joint observer starts with, in the states of this bound."""
    turn = np.zeros((N, layout.N))
    for mine, its in (
        (BIAS, layout.BIAS),
        (MASS, layout.MASS),
        (DRAG, layout.DRAG),
        (MOTOR, layout.MOTOR),
        (STIFFNESS, layout.STIFFNESS),
        (RATIO, layout.RATIO),
        (DEGRESSION, layout.LOAD),
        (PEAK, layout.PEAK),
        (DEFLECTION_GAIN, layout.DEFLECTION_GAIN),
        *((RADIUS + i, layout.RADIUS + i) for i in range(4)),
        *((PUSH_OUT + i, layout.OFFSET + i) for i in range(2)),
        *((MU + i, layout.LEVEL + i) for i in range(4)),
    ):
        turn[mine, its] = 1.0
    turn[RADIUS : RADIUS + 4, layout.ROLLING] = 1.0
    turn[DRAG, layout.MASS] = 1.0  # in `ordinary` it is drag over mass
    p = turn @ new_state(params, learned)["joint"]["p"][0] @ turn.T
    for state in (V, SLOPE, ROLLING, TRANSFER):
        p[state, state] = PRIOR[state] ** 2
    p[RATE:, RATE:] = wander.covariance
    return np.asarray(p)


def axle_errors(trajectory: Trajectory, errors: Vector) -> Vector:
    """Return nRMSE [%] of errors of ln friction, shape (n, N, draws), as shape (2, draws)."""
    rows = trajectory.counted
    found = []
    for axle in range(2):
        mu = trajectory.mu[rows, 2 * axle : 2 * axle + 2]
        off = errors[rows, MU + 2 * axle : MU + 2 * axle + 2] * mu[:, :, None]
        found.append(100.0 * np.sqrt((off**2).mean(axis=(0, 1))) / mu.mean())
    return np.stack(found)


def bounds_of(seed: int, names: Sequence[str] = tuple(ACCURACY)) -> list[Bound]:
    """Return the bounds of one car."""
    config, before = configured(), with_draw(shipped(ORDINARY), "nominal")
    ordinary, learned = drive_car(Setup(before, config), JOINT, seed)
    car = new_vehicle(before, seed).params[0]
    taught = trajectory_of(ordinary, car, counted(ordinary))
    shown, usual = derivatives(car, taught), wander_of(taught)
    known_after = {
        car_known: filtered(system_of(taught, shown, usual, car_known), prior(car_known, usual)).p[-1]
        for car_known in (False, True)
    }
    bounds = []
    for name in names:
        scenario = with_draw(ACCURACY[name].scenario, "nominal")
        drive, _ = drive_car(Setup(scenario, config), JOINT, seed, learned)
        rows = counted(drive)
        trajectory = trajectory_of(drive, car, rows)
        shown, wander = derivatives(car, trajectory), wander_of(trajectory)
        still = wander._replace(covariance=np.zeros((2, 2)))
        limits = {}
        for level, process, car_known in zip(
            LEVELS, (wander, wander, wander, still), (False, False, True, False), strict=True
        ):
            start = before_stop(known_after[car_known], process, car_known)
            if level == "learned":
                start = as_learned(new_params(config), learned, process)
            system = system_of(trajectory, shown, process, car_known)
            random = np.random.default_rng(seed)
            errors = sampled(system, filtered(system, start), start, DRAWS, random)
            limits[level] = Limit(*(axle_errors(trajectory, error) for error in errors))
        front, rear = (estimate_errors(drive, rows, axle)[0] for axle in AXLES)
        bounds.append(Bound(name, (front, rear), limits))
    return bounds


def _verdict(goal: float, reached: float, limits: dict[str, float]) -> str:
    """Return the change needed to meet a goal [%] that was missed."""
    if reached <= goal + ROUNDING:
        return "met"
    enough = [level for level in LEVELS[1:] if limits[level] <= goal + ROUNDING]
    return REMEDY[enough[0]] if enough else "no"


def bound_table(bounds: Iterable[list[Bound]]) -> Table:
    """Return the table of all cars."""
    cars = list(bounds)
    lines = []
    for place, case in enumerate(ACCURACY):
        found = [car[place] for car in cars]
        joint = np.median([bound.joint for bound in found], axis=0)
        filters, smoothers = (
            {
                level: np.median(np.hstack([bound.limits[level][kind] for bound in found]), axis=1)
                for level in LEVELS
            }
            for kind in range(2)
        )
        _, goal = goals(case, "nominal")
        assert goal is not None
        cells = [f"{_pair(filters[level])} ({_pair(smoothers[level])})" for level in LEVELS]
        verdicts = [
            _verdict(goal[axle], joint[axle], {level: filters[level][axle] for level in LEVELS})
            for axle in range(2)
        ]
        lines.append((case, f"{goal[0]:g}/{goal[1]:g}", _pair(joint), *cells, *verdicts))
    return Table(
        "Friction, adapted: the least nRMSE [%] that the sensors allow, as a filter (as a smoother)",
        ("case", "goal", "joint", *LEVELS, "front", "rear"),
        lines,
        BELOW.format(len(cars)),
    )


def _pair(values: Vector) -> str:
    return f"{values[0]:.2f}/{values[1]:.2f}"


TEXT: Final = (
    "How well friction could be known at all with the noise of Table 4.1: a posterior Cramér-Rao bound. "
    "The drives of [observers.md](observers.md), adapted, become a linear system about what really "
    "happened, 27 states in the simulated car's own structure, apart from the code of the ECU. Kalman's "
    "filter of it is the best there is. *Learned*: it starts with the standard deviations that the joint "
    "observer kept of the ten minutes. *Ten minutes*: with what they show at best, to one who knew the "
    "spread of the drawn cars. *Car known*: friction alone is unknown. In these three friction changes by "
    "a rate of each axle, random, but as fast and for as long as in that very stop. *Change known*: as "
    "ten minutes, but how friction changes is known, as if a law of friction gave it. Assumed: friction "
    "at the beginning of an application is known from the one before to 5 % in common and 3 % an axle; "
    "pressure follows the demand to 5 % of its change; motor torque is exact, as it is in these cars."
)


def _run(asked: Asked) -> Measured:
    return Measured([bound_table(run_each("bound", bounds_of, range(min(asked.seeds, CARS))))])


STUDY: Final = Study("What the sensors allow", TEXT, _run)
