"""The friction laboratory beside chapters 2 and 3: three drawn pads, all laws, all estimators."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.friction_lab.analysis import Components, History, history_effect, principal_components
from brakelab.friction_lab.candidates import candidates
from brakelab.friction_lab.columns import Columns
from brakelab.friction_lab.dynamometer import new_bench, run_programme
from brakelab.friction_lab.estimators import error_by_temperature, errors_by_manoeuvre, estimators
from brakelab.friction_lab.fitting import fit, replayed
from brakelab.friction_lab.identification import Identified, Judged, identify
from brakelab.friction_lab.recording import THRESHOLD, Recording, joined
from brakelab.friction_lab.stops import Stops, find_stops
from brakelab.friction_lab.trips import drive
from brakelab.plant.description import read_file
from brakelab.plant.dynamometer import DECELERATION, PRESSURE, mean_friction, new_stop, run_stop
from brakelab.plant.dynamometer_programme import load_programme
from brakelab.plant.linings import Lining, Linings, rig_with
from brakelab.studies.friction import TEMPERATURES
from brakelab.studies.heat import BRAKES, KMH
from ecu.settings.resources import resource

Vector = NDArray[np.float64]

SEED: Final = 1
DRAWS: Final = 20
NOISE: Final = 0.01  # of the torque
GRAVITY: Final = 9.81  # m/s^2
FACTORS: Final = (0.6, 0.8, 1.0, 1.2, 1.4)  # of a wrong temperature


class OnAms(NamedTuple):
    """A law on the AMS programme, which it never saw."""

    nrmse: Vector  # (6,), per stop [%], measured pressure replayed
    replayed: Vector  # (6,), relative error of the mean [%]
    closed: Vector  # (6,), likewise, the law's own friction sets the pressure
    whole: float  # nRMSE [%] over all six


class Brake(NamedTuple):
    """One brake: what CPC shows, the laws identified on it, and these on AMS."""

    components: Components
    history: History
    identified: Identified
    measured: Vector  # (6,), mean friction of the AMS stops
    ams: dict[str, OnAms]


class Recovery(NamedTuple):
    """R1 identified from its own data with noise."""

    names: tuple[str, ...]
    truth: Vector
    inside: Vector  # (free,), share of draws within the interval of 95 %
    width: Vector  # (free,), median half interval over the value [%]


class Lab(NamedTuple):
    """All that the bench measures."""

    brakes: dict[str, Brake]
    recovery: dict[str, Recovery]
    manoeuvres: dict[str, dict[str, float]]  # nRMSE [%] by estimator and manoeuvre
    wrong_temperature: dict[str, list[float]]  # nRMSE [%] by estimator, at FACTORS


def linings() -> Linings:
    """Return the shipped linings."""
    return read_file(resource("config/plant/linings.toml"), Linings)


def columns_of(lining: Lining, law: str = "SIM") -> Columns:
    """Return what describes recordings of `lining` on the flywheel of a law."""
    rig = rig_with(lining, law)[0]
    return Columns.own(lining, float(rig["mass"] * rig["tyre_radius"] ** 2))


def measure(brake: str, progress: Callable[[str], None]) -> Brake:
    """Return a drawn pad of brake A, B or C measured and identified."""
    lining = linings().lining[brake]
    columns = columns_of(lining)
    bench = new_bench(lining, brake, SEED)

    def stops_of(programme: str) -> Stops:
        found = load_programme(resource(f"config/rig/{programme}.toml"))
        return find_stops(run_programme(bench, found, lambda done, of: None), columns, programme)

    cpc, ams = stops_of("cpc"), stops_of("ams")
    identified = identify(columns, cpc, None, lambda line: progress(f"{brake}: {line}"))
    laws = {judged.name: on_ams(judged, lining, ams) for judged in identified.laws}
    return Brake(principal_components(cpc), history_effect(cpc), identified, ams.mean, laws)


def on_ams(judged: Judged, lining: Lining, stops: Stops) -> OnAms:
    """Return a law's errors on the AMS stops."""
    estimate = replayed(judged.law, lining.brake, stops, judged.starts_at_measured)
    off = estimate - stops.mu
    each = [stops.block_stop == stop for stop in range(len(stops))]
    speed = stops.speed[stops.block_first]
    means = np.array([np.average(estimate[at], weights=speed[at]) for at in each])
    rig = rig_with(lining.model_copy(update={"friction": {"it": judged.law}}), "it")
    own = []
    for temperature in TEMPERATURES:
        stop = new_stop(DECELERATION, 100.0 * KMH, 5.0 * KMH, temperature, deceleration=GRAVITY)
        own.append(mean_friction(run_stop(rig, stop)))
    return OnAms(
        np.array([100.0 * np.sqrt(np.mean(off[at] ** 2)) / stops.mu[at].mean() for at in each]),
        100.0 * (means / stops.mean - 1.0),
        100.0 * (np.array(own) / stops.mean - 1.0),
        100.0 * float(np.sqrt(np.mean(off**2)) / stops.mu.mean()),
    )


def recovered(job: tuple[str, int]) -> tuple[str, Vector, Vector, Vector]:
    """Return brake, values, half intervals and truth of ILVO identified from a noisy recording of R1."""
    brake, draw = job
    lining = linings().lining[brake]
    columns = columns_of(lining, "R1")
    stops = find_stops(r1_recording(lining, NOISE, draw), columns, "R1")
    candidate = next(c for c in candidates(stops, lining.brake) if c.name == "ilvo")
    fitted = fit(candidate, lining.brake, stops, draw)
    law = lining.friction["R1"].model_dump()
    truth = [law["kappa_0"], law["kappa_1"], -law["speed_gain"], law["debris"], law["heat_loss"]]
    return brake, np.array(fitted.values), fitted.half, np.array(truth)


def r1_recording(lining: Lining, noise: float, seed: int) -> Recording:
    """Return 36 stops of R1 at constant pressure in steps of 0.25 ms, with `noise` relative to the torque."""
    random = np.random.default_rng(seed)
    rig = rig_with(lining, "R1")
    parts = []
    grid = product((50.0, 80.0, 110.0, 140.0, 170.0, 200.0), (80.0, 120.0), (15.0, 40.0, 70.0))
    for place, (temperature, speed, bar) in enumerate(grid):
        stop = new_stop(PRESSURE, speed * KMH, 30.0 * KMH, temperature, pressure=bar * 1e5)
        seen = run_stop(rig, stop, dt=2.5e-4)[::20]
        torque = seen["torque"] * (1.0 + noise * random.standard_normal(len(seen)))
        speeds = seen["speed"] / lining.brake.tyre_radius
        parts.append(
            Recording(
                100.0 * place + seen["t"], seen["pressure"] + THRESHOLD, torque, speeds, seen["temperature"]
            )
        )
    return joined(parts)


def recovery(brake: str, found: list[tuple[str, Vector, Vector, Vector]]) -> Recovery:
    """Return the coverage of the intervals over all draws of a brake."""
    ours = [each[1:] for each in found if each[0] == brake]
    values, halves, truths = (np.array(column) for column in zip(*ours, strict=True))
    names = ("kappa_0", "kappa_1", "a", "b", "c")
    inside = np.mean(np.abs(values - truths) < halves, axis=0)
    return Recovery(names, truths[0], inside, 100.0 * np.median(halves / np.abs(truths), axis=0))


def trips() -> tuple[dict[str, dict[str, float]], dict[str, list[float]]]:
    """Return the estimators' errors by manoeuvre, and with a wrong temperature, on a pad's second trip."""
    lining = linings().lining["A"]
    columns = columns_of(lining)
    bench = new_bench(lining, "A", SEED)
    first, second = drive(bench, columns, 1), drive(bench, columns, 2)
    found = estimators(first.stops, lining.brake, SEED)
    radius = lining.brake.tyre_radius / lining.brake.effective_radius
    wrong = {
        name: [error_by_temperature(estimator, second.stops, factor) for factor in FACTORS]
        for name, estimator in found.items()
    }
    return errors_by_manoeuvre(found, second, radius), wrong


def run_lab(progress: Callable[[str], None]) -> Lab:
    """Return all results; `progress` is told a line at a time. Minutes, on two cores."""
    brakes = {brake: measure(brake, progress) for brake in BRAKES}
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        on_road = pool.submit(trips)
        draws = list(pool.map(recovered, product(BRAKES, range(DRAWS))))
        progress(f"recovery: {len(draws)} draws")
        manoeuvres, wrong = on_road.result()
    return Lab(brakes, {brake: recovery(brake, draws) for brake in BRAKES}, manoeuvres, wrong)
