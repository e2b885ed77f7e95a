"""Simulated cars as recorded by loggers: learning of the joint observer as a bystander, by application.

A driver brakes a car whose front and rear pressures are proportional, with an ECU that corrects nothing. Only
the signals of such a logger are replayed: wheel speeds, one pressure per axle, accelerations and yaw rate; no
speed reference and no motor torque. Each application is predicted from the values known before it.
"""

from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.plant.description import Engine
from brakelab.replay.drive import replay_drive
from brakelab.replay.quality import Findings
from brakelab.replay.source import load_source
from brakelab.replay.summary import errors_of, judged, peers
from brakelab.results.brakes import BrakeBook, BrakeRow
from brakelab.results.prediction import corners, errors
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.results.verdict import Goal, verdict
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.configured import configured, shipped, with_keys
from brakelab.simulation.scenario import Phase, Scenario
from brakelab.simulation.simulate import write_columns
from brakelab.studies.accuracy.table import spread
from brakelab.studies.measure import figure
from brakelab.studies.study import Asked, Measured, Study
from ecu.contract.signals import CORNERS
from ecu.settings.config import Config, new_params

CARS: Final = 20
GOAL: Final = 4.0  # %
SHARE: Final = 0.68  # of the brake force in front
FIRST: Final = 2  # the third application: counted from here on
ENGINE: Final = Engine(
    drag_torque=25.0,
    drag_growth=0.06,
    lowest_speed=126.0,
    ratios=(14.8, 9.86, 6.60, 5.26, 4.06, 3.15, 2.65, 2.11),
    share_front=1.0,
)
"""Some three litres, eight gears: 0.1 m/s^2 at 30 m/s, 0.4 at 5. Assumption."""
DECELS: Final = (2.0, 5.0, 3.0, 6.5, 1.5, 4.0, 7.0, 2.5, 5.5, 3.5)  # m/s^2
PRESSURE_EVERY: Final = 5  # cycles: 20 Hz


class Logger(NamedTuple):
    """Signals of a drive that a logger has."""

    accel_every: int
    """Cycles between samples of the accelerometer."""
    yaw_rate: bool


LOGGERS: Final = {
    "accelerometer 50 Hz": Logger(2, True),
    "accelerometer 10 Hz": Logger(10, True),
    "accelerometer 50 Hz, no yaw rate, no lateral acceleration": Logger(2, False),
}


class Recorded(NamedTuple):
    """One car, from the third application on."""

    sum_error: float
    """Of the brake force of all wheels, as learned before an application: median of the magnitude [%]."""
    inside: float
    """Share of the corners whose friction was inside 2 sigma [%]."""
    predicted: float
    """Error of the predicted specific force: median of the magnitude [%]."""
    others: tuple[float, ...]
    """The same of the peers, in the order of their names."""


def uncorrected() -> Config:
    """Return the configuration of an ECU that corrects nothing; pressures are proportional."""
    changed = {"distribution": "fixed", "front_share": SHARE, "compensation": "off"}
    return with_keys(configured(), {f"control.{key}": value for key, value in changed.items()})


def recorded_scenario() -> Scenario:
    """Return ten brake applications by the driver of a car with an engine, without a speed reference."""
    base = shipped("sensitivity")
    phases = []
    for decel in DECELS:
        phases += [
            Phase(kind="cruise", speed=30.0, seconds=25.0),
            Phase(kind="coast", seconds=3.0),
            Phase(kind="brake", decel=decel, until_speed=6.0),
            Phase(kind="coast", seconds=0.7),
        ]
    return base.model_copy(update={"phase": phases, "vehicle_speed": "none", "engine": ENGINE})


def logger_columns(drive: Drive, logger: Logger) -> dict[str, Vector]:
    """Return the logger's columns of a drive, a row a cycle."""
    rows = np.arange(len(drive.t))
    columns = {name: drive.inputs[name].copy() for name in drive.inputs if name.startswith("wheel_speed")}
    columns["accel_x"] = np.where(rows % logger.accel_every == 0, drive.inputs["accel_x"], np.nan)
    for axle in ("fl", "fr"), ("rl", "rr"):
        own = np.nan_to_num(drive.inputs[f"calliper_pressure_{axle[0]}"])
        mean = np.convolve(own, np.full(PRESSURE_EVERY, 1.0 / PRESSURE_EVERY))[: len(own)]
        read = np.where(rows % PRESSURE_EVERY == 0, mean, np.nan)
        columns |= {f"calliper_pressure_{corner}": read for corner in axle}
    if logger.yaw_rate:
        columns |= {name: drive.inputs[name] for name in ("accel_y", "yaw_rate")}
    columns["pedal_pressed"] = drive.inputs["pedal_pressed"]
    return columns


def replayed(t: Vector, columns: dict[str, Vector], config: Config) -> tuple[Vector, list[BrakeRow]]:
    """Return rows of results, shape (n, N_ROW), and the applications of a bystander's replay of signals."""
    params, rows = new_params(config), []
    book = BrakeBook(params)

    def write(t: Vector, block: Vector) -> None:
        book.add(t, block)
        rows.append(block.copy())

    with TemporaryDirectory(prefix="brake-ecu-loggers-") as folder:
        path = Path(folder, "drive.parquet")
        write_columns(path, t, columns, {})
        replay_drive([Findings(path)], params, None, load_source(None), write, book.end_log, lambda _: None)
    return np.concatenate(rows), book.rows


def _judge(drive: Drive, rows: Vector, found: list[BrakeRow], config: Config) -> Recorded:
    true = np.stack([drive.truth[f"mu_b_{corner}"] for corner in CORNERS], axis=1)
    pressure = np.stack([drive.truth[f"calliper_pressure_{corner}"] for corner in CORNERS], axis=1)
    p: Any = new_params(config)[0]
    lever = p["piston_area"] * p["effective_radius"] / p["wheel_radius"]
    sums, inside = [], []
    counted = judged(found)[FIRST:]
    for application in counted:
        at = int(np.searchsorted(drive.t, application.t_start))
        last = int(np.searchsorted(drive.t, application.t_start + application.duration))
        weight = lever * np.maximum(pressure[at:last], 0.0).mean(axis=0)
        mu, sigma = (corners(rows, name)[at - 1] for name in ("mu_b", "sigma_mu_b"))
        truth = true[at:last].mean(axis=0)
        sums.append(abs(float(weight @ mu) / float(weight @ truth) - 1.0))
        inside += list(np.abs(mu - truth) <= 2.0 * sigma)
    measured = [row.specific_force_mean for row in counted]
    others = [100.0 * errors(measured, other).median for other in peers(counted).values()]
    return Recorded(
        100.0 * float(np.median(sums)),
        100.0 * float(np.mean(inside)),
        100.0 * errors_of(counted).median,
        tuple(others),
    )


def recorded_of(seed: int) -> list[Recorded]:
    """Drive one car and replay it with each logger's signals."""
    config = uncorrected()
    drive = run(new_loop(recorded_scenario(), config, seed))
    seen = [replayed(drive.t, logger_columns(drive, logger), config) for logger in LOGGERS.values()]
    return [_judge(drive, *one, config) for one in seen]


def recorded_table(cars: Iterable[list[Recorded]]) -> Table:
    """Return the table of all cars."""
    every = list(cars)
    lines = []
    for place, name in enumerate(LOGGERS):
        found = [car[place] for car in every]
        others = np.median([car.others for car in found], axis=0)
        lines.append(
            (
                name,
                spread(force := figure([car.sum_error for car in found])),
                spread(predicted := figure([car.predicted for car in found])),
                *(f"{value:.2f}" for value in others),
                f"{np.mean([car.inside for car in found]):.0f}",
                verdict(Goal("force", force.median, GOAL), Goal("prediction", predicted.median, GOAL)),
            )
        )
    return Table(
        "Learned from a logger's signals, from the third application on [%]",
        (
            "logger",
            "brake force, all wheels",
            "prediction",
            "configured",
            "running average",
            "hindsight",
            "inside 2σ",
            f"goal {GOAL:g} %",
        ),
        lines,
        f"Median over each car's applications, then median (least–greatest) over {len(every)} cars of the "
        "wide draw. Brake force of all wheels: by the friction known before the application, beside its mean "
        "true friction at its true pressures. Prediction: of the specific force, beside the same with the "
        "configured friction, a running average of the ratio that starts there, and one scale chosen "
        "afterwards. Goals: medians of brake force and prediction. Inside 2σ: friction of each corner, of "
        "which proportional pressures hardly show more than the sum.",
    )


TEXT: Final = (
    "Ten brake applications of 1.5 to 7 m/s² from 30 m/s by cars whose front and rear pressures are "
    "proportional, braked by an ECU that corrects nothing. Replayed is what a logger has: wheel speeds at "
    "100 Hz, one pressure per axle at 20 Hz, the accelerometer at 50 or 10 Hz; no speed reference, no motor "
    "torque. The cars have an engine in front, whose drag nothing reports: 0.1 m/s² at 30 m/s to 0.4 at 5, "
    "by its gear, drawn within ±40 %."
)


def _run(asked: Asked) -> Measured:
    cars = run_each("loggers", recorded_of, range(min(asked.seeds, CARS)))
    return Measured([recorded_table(cars)])


STUDY: Final = Study("Cars as loggers record them", TEXT, _run)
