"""Benefit of compensation: the manoeuvres of section 5.7 and fade, with cars drawn per seed.

ideal           the same controller in the same car, given the true friction
compensated     as configured, unadapted
uncompensated   nominal friction always (`control.compensation = "off"`)
under, over     the controller uses 1.15 and 0.85 of the true friction (section 5.6)

Achieved is the sum over the wheels of (brake torque + motor torque) / rolling radius, over the mass, all
true. Errors are against the ideal at the same time, above 15 km/h.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK
from brakelab.simulation.accuracy import LOWEST_SPEED, achieved_decel, columns
from brakelab.simulation.closed_loop import Drive, FrictionOverride, new_loop, run
from brakelab.simulation.configured import shipped, with_keys
from brakelab.simulation.scenario import Scenario
from brakelab.stretches import stretches
from ecu.settings.config import Config

CARS: Final = 5
RUNS: Final = {
    "ideal": GREY,
    "compensated": ORANGE,
    "uncompensated": BLUE,
    "under": GREEN,
    "over": PINK,
}
GIVEN_SHARE: Final = {"ideal": 1.0, "under": 1.15, "over": 0.85}
SWEEP: Final = 78.0  # % of the pedal, for 6.3 m/s^2: the curve up to 6
LEVELS: Final = np.arange(1.0, 6.01, 0.5)  # m/s^2
MOTORS: Final = 0.7  # f of section 5.7.2


class Manoeuvre(NamedTuple):
    """A scenario and its changes."""

    scenario: str
    pedal: float | None = None
    """Greatest [%], in place of the scenario's."""
    motors: float = 0.0
    """Share f (5.2, 5.3) that the ECU asks of the motors of both axles."""


MANOEUVRES: Final = {
    "single application": Manoeuvre("single"),
    "repeated": Manoeuvre("repeated"),
    "repeated, pedal at 50 mm/s": Manoeuvre("repeated-slow"),
    "repeated, motors take 70 %": Manoeuvre("repeated", motors=MOTORS),
    "repeated up to 6 m/s²": Manoeuvre("repeated", SWEEP),
    "repeated up to 6 m/s², pedal at 50 mm/s": Manoeuvre("repeated-slow", SWEEP),
    "repeated up to 6 m/s², motors take 70 %": Manoeuvre("repeated", SWEEP, MOTORS),
    "repeated up to 6 m/s², pedal at 50 mm/s, motors take 70 %": Manoeuvre("repeated-slow", SWEEP, MOTORS),
}
CURVES: Final = tuple(name for name, how in MANOEUVRES.items() if how.pedal)
ASKED: Final = 0.2  # m/s^2
FULL: Final = 0.98  # of the demand
SETTLED_S: Final = 2.5  # of an application with a kept deceleration


class Run(NamedTuple):
    """One drive."""

    drive: Drive
    decel: Vector


def manoeuvre(name: str) -> Scenario:
    """Return a manoeuvre of `MANOEUVRES`."""
    how = MANOEUVRES[name]
    scenario = shipped(how.scenario)
    scenario = scenario.model_copy(update={"blending": how.motors > 0.0})
    if how.pedal is None:
        return scenario
    phases = [p if p.pedal is None else p.model_copy(update={"pedal": how.pedal}) for p in scenario.phase]
    return scenario.model_copy(update={"phase": phases})


def config_of(name: str, config: Config) -> Config:
    """Return the configuration of a manoeuvre of `MANOEUVRES`."""
    share = MANOEUVRES[name].motors
    return with_keys(config, {"blending.front": share, "blending.rear": share})


def drive_as(kind: str, scenario: Scenario, config: Config, seed: int) -> Run:
    """Drive a scenario as one of `RUNS`."""
    if kind == "uncompensated":
        config = with_keys(config, {"control.compensation": "off"})
    loop = new_loop(scenario, config, seed)
    drive = run(loop, override=FrictionOverride(GIVEN_SHARE.get(kind, 0.0)))
    return Run(drive, achieved_decel(loop, drive))


def asked_rows(drive: Drive) -> list[NDArray[np.int_]]:
    """Return the rows of each brake application, from the first demand to the last."""
    asked = drive.outputs["decel_demand_total"]
    return [np.arange(start, end) for start, end in stretches(asked > ASKED)]


def applications(drive: Drive) -> list[NDArray[np.int_]]:
    """Return the rows of each brake application until its demand falls again."""
    asked, found = drive.outputs["decel_demand_total"], []
    for rows in asked_rows(drive):
        last = np.flatnonzero(asked[rows] >= FULL * asked[rows].max())[-1]
        found.append(rows[: last + 1])
    return found


def application_errors(run: Run, ideal: Run) -> list[float]:
    """Return the mean relative error of the deceleration [%] of each application, from 1 m/s^2 on."""
    n = min(len(run.decel), len(ideal.decel))
    errors = []
    for rows in applications(ideal.drive):
        rows = rows[rows < n]
        rows = rows[
            (ideal.decel[rows] >= LEVELS[0]) & (ideal.drive.truth["vehicle_speed"][rows] > LOWEST_SPEED)
        ]
        if len(rows) > 0:
            errors.append(float(100.0 * np.mean(np.abs(run.decel[rows] / ideal.decel[rows] - 1.0))))
    return errors


def pedal_curve(run: Run, rows: NDArray[np.int_]) -> Vector:
    """Return the pedal [%] at which the deceleration of an application first passes each of `LEVELS`.

    NaN where a level is not reached while the pedal moves.
    """
    pedal, decel = run.drive.truth["pedal_position"][rows], np.maximum.accumulate(run.decel[rows])
    crossed = np.searchsorted(decel, LEVELS)
    found = np.full(len(LEVELS), np.nan)
    for place, row in enumerate(crossed):
        if 0 < row < len(rows) and pedal[row] < pedal.max():
            share = (LEVELS[place] - decel[row - 1]) / (decel[row] - decel[row - 1])
            found[place] = pedal[row - 1] + share * (pedal[row] - pedal[row - 1])
    return found


def level_errors(run: Run, ideal: Run) -> tuple[Vector, Vector]:
    """Return errors of deceleration and pedal travel [%] at `LEVELS`, from the second application on.

    Deceleration: at the time at which the ideal passes the level. Shape (applications, levels) each.
    """
    decel, travel = [], []
    for rows in applications(ideal.drive)[1:]:
        rows = rows[rows < min(len(run.decel), len(ideal.decel))]
        fast = ideal.drive.truth["vehicle_speed"][rows] > LOWEST_SPEED
        rows = rows[fast]
        reached = np.maximum.accumulate(ideal.decel[rows])
        at = np.searchsorted(reached, LEVELS)
        errors = np.full(len(LEVELS), np.nan)
        inside = at < len(rows)
        places = rows[at[inside]]
        errors[inside] = 100.0 * (run.decel[places] / ideal.decel[places] - 1.0)
        decel.append(errors)
        travel.append(100.0 * (pedal_curve(run, rows) / pedal_curve(ideal, rows) - 1.0))
    return np.array(decel), np.array(travel)


def fade_pedal(run: Run) -> tuple[Vector, Vector]:
    """Return pedal [%] and true front friction of each stop, means once the driver has settled."""
    pedals, frictions = [], []
    for rows in asked_rows(run.drive):
        rows = rows[round(SETTLED_S / 0.01) :]
        rows = rows[run.drive.truth["vehicle_speed"][rows] > 6.0]
        if len(rows) > 0:
            pedals.append(run.drive.truth["pedal_position"][rows].mean())
            chosen = np.isin(np.arange(len(run.decel)), rows)
            frictions.append(columns(run.drive.truth, "mu_b", "front", chosen).mean())
    return np.array(pedals), np.array(frictions)


def drive_all(name: str, config: Config, seed: int) -> dict[str, Run]:
    """Drive a manoeuvre of `MANOEUVRES` as each of `RUNS`."""
    scenario, config = manoeuvre(name), config_of(name, config)
    return {kind: drive_as(kind, scenario, config, seed) for kind in RUNS}


class Car(NamedTuple):
    """Results of one car."""

    errors: dict[tuple[str, str], list[float]]
    """By manoeuvre and run, one per application."""
    levels: dict[tuple[str, str], tuple[Vector, Vector]]
    fade: dict[str, tuple[Vector, Vector]]
    excess: float
    """Mass beyond the configured one [%]."""


FADE_RUNS: Final = ("ideal", "compensated", "uncompensated")


def one_car(config: Config, seed: int) -> Car:
    """Drive every manoeuvre in every variant."""
    vehicle = new_loop(manoeuvre("single application"), config, seed).sides.vehicle
    mass = float(vehicle.params["mass"][0])
    car = Car({}, {}, {}, 100.0 * (mass / config.vehicle.mass - 1.0))
    for name in MANOEUVRES:
        runs = drive_all(name, config, seed)
        for kind in list(RUNS)[1:]:
            car.errors[name, kind] = application_errors(runs[kind], runs["ideal"])
            if name in CURVES:
                car.levels[name, kind] = level_errors(runs[kind], runs["ideal"])
    fade = shipped("fade")
    for kind in FADE_RUNS:
        car.fade[kind] = fade_pedal(drive_as(kind, fade, config, seed))
    return car
