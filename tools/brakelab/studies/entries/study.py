"""Error of an entry's friction against the truth, and of its predictions."""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.results.prediction import Errors, errors, predict
from brakelab.simulation.accuracy import nrmse
from brakelab.studies.entries.drives import (
    PERIOD,
    CarTracks,
    RealDrive,
    Track,
    applications,
    car_tracks,
)
from brakelab.studies.entries.observer import EntryError, Observer, load_class
from brakelab.studies.entries.ours import OURS
from brakelab.studies.entries.player import Heard, new_entry, play, reset
from ecu.contract.params import BAR
from ecu.contract.signals import OUTPUT
from ecu.settings.config import new_params

COLD, ADAPTED, EVERYDAY = GROUPS = ("stops, cold", "stops, driven in", "everyday")
FIRST: Final = 2  # the third application of a recorded car: counted from here on
BEFORE: Final = 100  # cycles before the first counted one: the brakes are free


class Judged(NamedTuple):
    """One drive."""

    nrmse: tuple[float, float]
    """Front and rear [%]."""
    inside: tuple[float, float]
    """Share of rows and corners inside 1 and 2 sigma [%]; NaN: sigma not stated."""


class CarScore(NamedTuple):
    """One entry on all drives of one car."""

    drives: dict[str, list[Judged]]
    """By `GROUPS`."""
    recorded: tuple[float, ...]
    """Error of the brake force of all wheels, median of the magnitude [%], by `SETS`."""
    us: float
    """Of a step: mean over a drive, median over the drives [µs]."""


CarScores = dict[str, CarScore | str]
"""By name of the entry; a text says how it failed."""


def judge(heard: Heard, track: Track) -> Judged:
    """Return the errors of answers to a drive."""
    mu, sigma, true = heard.mu[track.rows], heard.sigma[track.rows], track.mu[track.rows]
    off = np.abs(mu - true)
    stated = not np.isnan(sigma).any()
    inside = [100.0 * float(np.mean(off <= n * sigma)) if stated else float("nan") for n in (1, 2)]
    return Judged((nrmse(mu[:, :2], true[:, :2]), nrmse(mu[:, 2:], true[:, 2:])), (inside[0], inside[1]))


def force_error(heard: Heard, track: Track) -> float:
    """Return the error of the brake force of all wheels [%], median of the magnitude.

    By the friction before each application, beside its mean true friction, at its true pressures; from the
    third application on.
    """
    car = new_params(track.config)[0]
    off = []
    for rows in list(applications(track))[FIRST:]:
        acts = np.maximum(track.pressure[rows] * BAR - car["push_out_pressure"], 0.0)
        weight = car["piston_area"] * car["effective_radius"] / car["wheel_radius"] * acts.mean(axis=0)
        known, true = heard.mu[max(rows.start - BEFORE, 0)], track.mu[rows].mean(axis=0)
        off.append(abs(float(weight @ known) / float(weight @ true) - 1.0))
    return 100.0 * float(np.median(off))


def judge_entry(entry: Observer, car: CarTracks) -> CarScore:
    """Play every drive of a car to an entry. Raises EntryError if it fails."""
    drives: dict[str, list[Judged]] = {group: [] for group in GROUPS}
    recorded, times = [], []

    def hear(track: Track) -> Heard:
        heard = play(entry, track)
        times.append(heard.us)
        return heard

    for stop in car.stops:
        reset(entry, stop.config)
        drives[COLD].append(judge(hear(stop), stop))
    reset(entry, car.everyday.config)
    drives[EVERYDAY].append(judge(hear(car.everyday), car.everyday))
    for stop in car.stops:
        drives[ADAPTED].append(judge(hear(stop), stop))
    for track in car.recorded:
        reset(entry, track.config)
        recorded.append(force_error(hear(track), track))
    return CarScore(drives, tuple(recorded), float(np.median(times)))


def class_of(name: str) -> type[Observer]:
    """Return one of ours by its name, or the class that `module:Class` names."""
    return OURS[name] if name in OURS else load_class(name)


def judge_all(names: Sequence[str], car: CarTracks) -> CarScores:
    """Return the errors of each entry with a car, or how it failed."""
    scores: CarScores = {}
    for name in names:
        try:
            scores[name] = judge_entry(new_entry(class_of(name)), car)
        except EntryError as error:
            scores[name] = str(error)
    return scores


def judge_car(names: Sequence[str], seed: int) -> CarScores:
    """Drive the car `seed` once and return the estimates of each entry."""
    return judge_all(names, car_tracks(seed))


def predicted(heard: Heard, drive: RealDrive) -> list[float]:
    """Return the specific force of each brake application of a recorded drive as known before it [m/s^2]."""
    forces = []
    for braking in drive.brakings:
        first = round(braking.t_start / PERIOD)
        rows = drive.results[first : first + round(braking.duration / PERIOD)]
        known, before = heard.known[first - 1], drive.results[first - 1].copy()
        values: Iterable[tuple[str, float | Vector]] = (
            ("mu_b_fl", heard.mu[first - 1]),
            ("pressure_zero_fl", known.pressure_zero),
        )
        for name, four in values:
            before[OUTPUT[name] : OUTPUT[name] + 4] = four
        before[OUTPUT["vehicle_mass"]], before[OUTPUT["overrun"]] = known.mass, known.overrun
        forces.append(predict(rows, before, drive.params).force)
    return forces


def predict_all(names: Sequence[str], drive: RealDrive) -> dict[str, Errors | str]:
    """Return the errors of each entry's predictions of a recorded drive, or how it failed."""
    measured = [braking.specific_force_mean for braking in drive.brakings]
    asked = {round(braking.t_start / PERIOD) - 1 for braking in drive.brakings}
    found: dict[str, Errors | str] = {}
    for name in names:
        try:
            entry = new_entry(class_of(name))
            reset(entry, drive.track.config)
            found[name] = errors(measured, predicted(play(entry, drive.track, asked), drive))
        except EntryError as error:
            found[name] = str(error)
    return found
