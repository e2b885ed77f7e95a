"""Cars identified from a drive, beside the truth: values, sigma, and predictions of a stranger's drive.

A car of the wide draw drives `config/scenarios/identify.toml`; START is config/suv.toml with every key of
masses, tyres and brakes 20 % off, up or down by the seed, but for what a data sheet says (wheelbase,
frontal area, pistons). Then another trip of the same car, real driving of another seed, is replayed with
START and with the identified CONFIG, and each predicts the brake applications.
"""

from collections.abc import Iterable, Sequence
from operator import attrgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.vehicle.model import Place
from brakelab.identify.vehicle.parameters import Parameter, parameters_of, values_of
from brakelab.identify.vehicle.reader import read_drives
from brakelab.identify.vehicle.solve import identify
from brakelab.plant.records import GRAVITY
from brakelab.plant.tyre import rolling_radius, stiffnesses
from brakelab.replay.summary import errors_of, judged
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.configured import configured, shipped, with_keys
from brakelab.simulation.scenario import Scenario, Trace
from brakelab.simulation.simulate import write_columns
from brakelab.studies.accuracy.loggers import replayed
from brakelab.studies.study import Asked, Measured, Study
from ecu.contract.signals import CORNERS
from ecu.settings.config import Config, new_params

CARS: Final = 10
OFF: Final = 0.20
DRIVEN: Final = 12700.0  # m, by the scenario, roughly: a car's brakes make it up to 250 m more or less
OVER_MASS: Final = ("vehicle.drag_coefficient", "front.mu_nominal", "rear.mu_nominal")
PERIOD: Final = 4800.0  # m, of the scenario's hills at most
STRANGER: Final = 900.0  # s of the other trip
KEYS: Final = {
    "vehicle": ("mass", "front_axle", "cog_height", "track", "drag_coefficient", "rolling_resistance",
                "pitch_gradient"),
    "front": ("unloaded_radius", "vertical_stiffness", "wheel_inertia", "slip_stiffness",
              "stiffness_degression", "effective_radius", "mu_nominal", "push_out_pressure"),
}  # fmt: skip
"""Errors of START; the rear axle as the front one."""


class Beside(NamedTuple):
    """A key of a car."""

    parameter: Parameter
    truth: float


class Car(NamedTuple):
    """One car."""

    keys: list[Beside]
    before: tuple[float, float]
    """Mean error of the stranger's predicted applications with START [%]: learning, and with its friction."""
    after: tuple[float, float]
    """With the identified CONFIG."""
    brakings: int


def start_of(seed: int) -> Config:
    """Return config/suv.toml with its keys 20 % off."""
    config = configured()
    random = np.random.default_rng([seed, 16])
    wrong: dict[str, float | None] = {}
    for section in ("vehicle", "front", "rear"):
        for key in (f"{section}.{name}" for name in KEYS.get(section, KEYS["front"])):
            wrong[key] = attrgetter(key)(config) * (1.0 + OFF * random.choice([-1.0, 1.0]))
    unladen = dict.fromkeys(f"vehicle.laden_{name}" for name in ("mass", "front_axle", "cog_height"))
    return with_keys(config, wrong | unladen)


def with_parameters(config: Config, parameters: Sequence[Parameter]) -> Config:
    """Return `config` with the keys that were identified."""
    return with_keys(config, {one.key: one.value for one in parameters if not one.remedy})


def true_theta(car: Any, drive: Drive, sensors: Any, push_out: Sequence[float]) -> Vector:
    """Return the model's parameters of a simulated car; brakes by least squares beyond `push_out`."""
    theta = np.zeros(len(Place))
    base = car["front_length"] + car["rear_length"]
    share = np.repeat([car["rear_length"], car["front_length"]], 2) / base
    load = 0.5 * car["mass"] * GRAVITY * share
    free, vertical = car["free_radius"], car["vertical_stiffness"]
    radius = [rolling_radius(float(free[i]), float(vertical[i]), float(load[i])) for i in range(4)]
    stiffness = np.array([stiffnesses(car, i, load[i])[0] for i in range(4)]).reshape(2, 2).sum(axis=1)
    brakes = np.zeros(2)
    moves = drive.truth["vehicle_speed"] > 3.0
    for axle, pair in enumerate((CORNERS[:2], CORNERS[2:])):
        pressure = np.mean([drive.truth[f"calliper_pressure_{c}"] for c in pair], axis=0)
        rubs = moves & (pressure > 3.0)
        torque = np.sum([drive.truth[f"brake_torque_{c}"][rubs] for c in pair], axis=0)
        acts = pressure[rubs] - push_out[axle]
        brakes[axle] = float(acts @ torque) / float(acts @ acts)
    mean_radius = float(np.mean(radius))
    sink = car["mass"] * car["cog_height"] / (6.0 * base * float(np.mean(car["vertical_stiffness"])))
    known = {
        Place.MASS: np.log(car["mass"]), Place.DRAG: np.log(car["drag_factor"]),
        Place.ROLLING: car["rolling_resistance"], Place.PITCH: car["pitch_gradient"],
        Place.RADIUS_F: np.log(np.mean(radius[:2])), Place.RADIUS_R: np.log(np.mean(radius[2:])),
        Place.STIFFNESS: 0.5 * np.log(stiffness.prod()),
        Place.STIFFNESS_RATIO: np.log(stiffness[1] / stiffness[0]),
        Place.DEFLECTION: np.log(sink / mean_radius),
        Place.BRAKES: np.log(brakes.sum()), Place.BRAKE_RATIO: np.log(brakes[1] / brakes[0]),
        Place.PUSH_OUT_F: car["push_out_pressure"][0] * 1e-5,
        Place.PUSH_OUT_R: car["push_out_pressure"][2] * 1e-5,
        Place.DELAY: float(sensors[3]["delay"]) * 0.01,
    }  # fmt: skip
    for place, value in known.items():
        theta[place] = value
    return theta


def _on_own_road(scenario: Scenario, seed: int, driven: float) -> Scenario:
    """Return the scenario on hills that begin elsewhere: a road in common would be an error in common.

    They end as high as they began, after the `driven` metres of this car.
    """
    begin = float(np.random.default_rng([seed, 17]).uniform(0.0, PERIOD))
    rows = scenario.road.grade
    shifted = [(place - begin, grade) for place, grade in rows if place > begin]
    first = float(np.interp(begin, *np.transpose(rows)))
    place, grade = np.transpose([(0.0, first), *shifted])
    grade -= np.interp(np.linspace(0.0, driven, 4000), place, grade).mean()
    level = list(zip(place.tolist(), grade.tolist(), strict=True))
    return with_keys(scenario, {"road.grade": level})


def beside_truth(seed: int) -> tuple[list[Beside], Config]:
    """Drive one car and identify it; return its keys and the CONFIG that results."""
    start = start_of(seed)
    suv, driven = configured(), DRIVEN
    for _ in range(2):  # the first drive shows how far it is
        loop = new_loop(_on_own_road(shipped("identify"), seed, driven), suv, seed)
        car, sensors = loop.sides.vehicle.params[0].copy(), loop.sides.vehicle.sensors.copy()
        drive = run(loop)
        driven = float(np.ptp(drive.truth["distance"]))
    with TemporaryDirectory(prefix="brake-ecu-identified-") as folder:
        path = Path(folder, "drive.parquet")
        write_columns(path, drive.t, drive.inputs, {})
        found = identify(read_drives([path], new_params(start), None), new_params(start), closed=True)
    parameters = parameters_of(found, start)
    used = {one.key: one.value for one in parameters}
    push_out = [used[f"{axle}.push_out_pressure"] for axle in ("front", "rear")]
    true = values_of(found, start, true_theta(car, drive, sensors, push_out))
    true["vehicle.track"] = float(car["track"])
    return [Beside(one, true[one.key]) for one in parameters], with_parameters(start, parameters)


def identified_of(seed: int) -> Car:
    """Drive one car, identify it, and let it drive a stranger's trip."""
    keys, config = beside_truth(seed)
    trace = Trace(generate="real-driving", seed=seed + 100)
    trip = shipped("real-driving").model_copy(update={"trace": trace})
    other = run(new_loop(trip, configured(), seed), seconds=STRANGER)
    before, count = _predicted(other, start_of(seed))
    after, _ = _predicted(other, config)
    return Car(keys, before, after, count)


def _predicted(drive: Drive, config: Config) -> tuple[tuple[float, float], int]:
    """Return the mean error of predicted applications [%], learning and with configured friction; count."""
    rows = judged(replayed(drive.t, drive.inputs, config)[1])
    learned, unlearned = errors_of(rows), errors_of(rows, "specific_force_configured")
    return (100.0 * learned.mean, 100.0 * unlearned.mean), len(rows)


def _over_mass(cars: Sequence[Car], key: str) -> tuple[str, ...]:
    """Return the line of a key over mass, in which the scale of motor torque cancels."""
    relative = []
    for car in cars:
        by_key = {each.parameter.key: each for each in car.keys}
        one, mass = by_key[key], by_key["vehicle.mass"]
        relative.append(one.parameter.value / one.truth / (mass.parameter.value / mass.truth) - 1.0)
    off = 100.0 * np.abs(relative)
    within = f"{np.sum(off <= 3.0)} of {len(cars)}"
    return f"{key} / mass", "–", f"{np.median(off):.2f}", f"{off.max():.2f}", "–", "–", within


def identified_tables(cars: Iterable[Car]) -> list[Table]:
    """Return errors by key, each car's worst, and the stranger's brake applications."""
    every = list(cars)
    rows = []
    for place, one in enumerate(every[0].keys):
        identified = [car.keys[place] for car in every if not car.keys[place].parameter.remedy]
        if not identified:
            rows.append((one.parameter.key, f"0 of {len(every)}", *["–"] * 5))
            continue
        error = np.array([each.parameter.value - each.truth for each in identified])
        relative = 100.0 * np.abs(error) / np.maximum(np.abs([each.truth for each in identified]), 1e-9)
        z = error / np.array([each.parameter.sigma for each in identified])
        sigma = np.median([each.parameter.sigma / max(abs(each.truth), 1e-9) for each in identified])
        if one.parameter.key.endswith("delay"):
            spread = f"{1e3 * np.median(np.abs(error)):.1f} ms", f"{1e3 * np.abs(error).max():.1f} ms"
            inside = f"{np.sum(np.abs(z) <= 2.0)} of {len(identified)}"
            rows.append((one.parameter.key, f"{len(identified)} of {len(every)}", *spread, "–", inside, "–"))
            continue
        rows.append((
            one.parameter.key, f"{len(identified)} of {len(every)}", f"{np.median(relative):.2f}",
            f"{relative.max():.2f}", f"{100 * sigma:.2f}", f"{np.sum(np.abs(z) <= 2.0)} of {len(identified)}",
            f"{np.sum(relative <= 3.0)} of {len(identified)}",
        ))  # fmt: skip
    known = {each.parameter.key for each in every[0].keys}
    rows += [_over_mass(every, key) for key in OVER_MASS if key in known]
    strange = [
        (f"{number}", f"{car.brakings}", *(f"{each:.1f}" for each in (*car.before, *car.after)))
        for number, car in enumerate(every, 1)
    ]  # fmt: skip
    misses = [
        (f"{number}", each.parameter.key, f"{each.truth:.4g}", f"{each.parameter.value:.4g}",
         f"{each.parameter.sigma:.2g}", f"{(each.parameter.value - each.truth) / each.parameter.sigma:+.1f}",
         f"{100 * (each.parameter.value / each.truth - 1):+.1f}")
        for number, car in enumerate(every, 1) for each in car.keys
        if not each.parameter.remedy and not each.parameter.key.endswith("delay")
        and (abs(each.parameter.value - each.truth) > 2.0 * each.parameter.sigma
             or abs(each.parameter.value / each.truth - 1.0) > 0.03)
    ]  # fmt: skip
    return [
        Table("Keys beside the truth",
              ("key", "identified", "error, median [%]", "worst [%]", "σ [%]", "inside 2σ", "within 3 %"),
              rows,
              f"{len(every)} cars of the wide draw, START 20 % off. Truth in terms of START's other keys: "
              "torque per bar, stiffness per axle load, deflection for its height of the centre of gravity."),
        Table("Beyond 2σ or 3 %", ("car", "key", "truth", "value", "σ", "error/σ", "error [%]"), misses,
              "Every one of them."),
        Table("Brake applications of a stranger's drive: mean error of the prediction [%]",
              ("car", "number", "START, learning", "START, configured", "CAR, learning", "CAR, configured"),
              strange, "Fifteen minutes of real driving by the same car. Learning: with the friction learned "
              "before each brake application; configured: with that of the CONFIG."),
    ]  # fmt: skip


TEXT: Final = (
    "`brake-ecu identify vehicle --closed` on config/scenarios/identify.toml (689 s, hills shifted by the "
    "seed), driven by cars of the wide draw with an ECU of config/suv.toml; START is that configuration with "
    "masses, tyres and brakes 20 % off, up or down by the seed, rear apart from front. The scale of the "
    "motors' torque, drawn within ±3 %, cannot be seen: it is that of mass, resistance and brakes alike, is "
    "in their σ, and cancels in what is divided by mass, as in every prediction of a deceleration. Friction "
    "is that of this drive, which begins with discs of 100 °C; the stranger's begins at 20 °C, so where a "
    "car's linings depend much on temperature the configured friction is wrong there: only learning helps."
)


def _run(asked: Asked) -> Measured:
    cars = run_each("vehicle", identified_of, range(min(asked.seeds, CARS)))
    return Measured(identified_tables(cars))


STUDY: Final = Study("Cars identified from a drive", TEXT, _run, "identified-cars")
