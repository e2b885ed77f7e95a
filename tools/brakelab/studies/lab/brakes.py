"""The friction laboratory beside chapters 2 and 3: three drawn pads, all laws, all estimators."""

from collections.abc import Callable
from itertools import product
from time import monotonic
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.analysis import (
    Components,
    History,
    history_effect,
    inputs_of,
    principal_components,
)
from brakelab.identify.friction.candidates import ilvo
from brakelab.identify.friction.choice import Identified, Judged, identify
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.dynamometer import Bench, new_bench
from brakelab.identify.friction.fit import fit, replayed
from brakelab.identify.friction.heat_capacity import HeatCapacity, heat_capacity
from brakelab.identify.friction.recording import THRESHOLD, Recording, joined
from brakelab.identify.friction.sequence import load_sequence, run_sequence
from brakelab.identify.friction.stops import Stops, find_stops
from brakelab.plant.description import read_file
from brakelab.plant.dynamometer import DECELERATION, PRESSURE, REPLAY, mean_friction, new_stop, run_stop
from brakelab.plant.friction.ilvo import Ilvo
from brakelab.plant.linings import Lining, Linings, rig_with
from brakelab.studies.physics.friction import TABLE_3_4, TEMPERATURES, stop_means
from brakelab.studies.physics.heat import BRAKES, KMH, PRINTED
from ecu.settings.resources import resource

SEED: Final = 1
DRAWS: Final = 20
R2_DRAWS: Final = 5
NOISE: Final = 0.01  # of the torque
BY_DISTANCE: Final = {"R1": False, "R2": True}
"""How each set averages a stop of Table 3.4."""
GRAVITY: Final = 9.81  # m/s^2


class OnAms(NamedTuple):
    """A law on the AMS programme, which it never saw."""

    nrmse: Vector  # (6,), per stop [%], measured pressure replayed
    replayed: Vector  # (6,), relative error of the mean [%]
    closed: Vector  # (6,), likewise, the law's own friction sets the pressure

    @property
    def in_closed_loop(self) -> float:
        """Return the RMS error [%] of the six means where the law sets the pressure, as a car's does."""
        return float(np.sqrt(np.mean(self.closed**2)))


class Brake(NamedTuple):
    """One brake: its CPC analysis, the laws identified on it, and these on AMS."""

    inputs: Vector  # (stops, 3), of CPC, as `inputs_of`
    mean: Vector  # (stops,), mean friction
    components: Components
    history: History
    heat: HeatCapacity
    identified: Identified
    measured: Vector  # (6,), mean friction of the AMS stops
    ams: dict[str, OnAms]
    seconds: float  # CPC simulated and all laws identified


class Recovery(NamedTuple):
    """R1 identified from its own data with noise."""

    names: tuple[str, ...]
    truth: Vector
    inside: Vector  # (free,), share of draws within the interval of 95 %
    width: Vector  # (free,), median half interval over the value [%]


def linings() -> Linings:
    """Return the shipped linings."""
    return read_file(resource("config/plant/linings.toml"), Linings)


def columns_of(lining: Lining, law: str = "SIM") -> Columns:
    """Return the description of recordings of `lining` on the flywheel of a law."""
    rig = rig_with(lining, law)[0]
    return Columns.own(lining, float(rig["mass"] * rig["tyre_radius"] ** 2))


def run(bench: Bench, programme: str, columns: Columns) -> Stops:
    """Return the stops of a shipped programme on a bench."""
    found = load_sequence(resource(f"config/rig/{programme}.toml"))
    return find_stops(run_sequence(bench, found, lambda share: None), columns, programme)


def measure(brake: str, progress: Callable[[str], None], seed: int = SEED) -> Brake:
    """Return a drawn pad of brake A, B or C measured and identified."""
    begin = monotonic()
    lining = linings().lining[brake]
    columns = columns_of(lining)
    bench = new_bench(lining, brake, seed)
    cpc = run(bench, "cpc", columns)
    identified = identify(columns, cpc, None, lambda line: progress(f"{brake}, pad {seed}: {line}"))
    seconds = monotonic() - begin
    ams = run(bench, "ams", columns)
    laws = {judged.name: on_ams(judged, lining, ams) for judged in identified.laws}
    return Brake(
        inputs_of(cpc),
        cpc.mean,
        principal_components(cpc),
        history_effect(cpc),
        heat_capacity(cpc, columns),
        identified,
        ams.mean,
        laws,
        seconds,
    )


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
    )


class Recovered(NamedTuple):
    """A published set of ILVO's numbers, identified from a recording of itself."""

    numbers: str
    brake: str
    values: Vector  # (free,)
    half: Vector
    truth: Vector
    means: Vector  # (6,), relative error of the means of Table 3.4's ILVO column, with the values found


def recovered(job: tuple[str, str, int]) -> Recovered:
    """Return the laws identified from a noisy recording; `job`: R1 or R2, brake and draw."""
    numbers, brake, draw = job
    lining = linings().lining[brake]
    stops = find_stops(own_recording(lining, numbers, NOISE, draw), columns_of(lining, numbers), numbers)
    law = lining.friction[numbers]
    assert isinstance(law, Ilvo)
    candidate = ilvo(stops.inertia / lining.brake.tyre_radius**2, law.stress, law.heat_zero)
    fitted = fit(candidate, lining.brake, stops, draw)
    rig = rig_with(lining.model_copy(update={"friction": {"it": fitted.law}}), "it")
    rig["cooling_by_speed"] *= PRINTED
    means = stop_means(rig, REPLAY, BY_DISTANCE[numbers], TABLE_3_4["measured"][brake])
    truth = [law.kappa_0, law.kappa_1, -law.speed_gain, law.debris, law.heat_loss]
    return Recovered(
        numbers,
        brake,
        np.array(fitted.values),
        fitted.half,
        np.array(truth),
        means / np.array(TABLE_3_4["ILVO"][brake]) - 1.0,
    )


def r1_recording(lining: Lining, noise: float, seed: int) -> Recording:
    """Return stops of R1; see below."""
    return own_recording(lining, "R1", noise, seed)


def own_recording(lining: Lining, law: str, noise: float, seed: int) -> Recording:
    """Return 36 stops of a law at constant pressure, in steps of 0.25 ms, `noise` relative to the torque."""
    random = np.random.default_rng(seed)
    rig = rig_with(lining, law)
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


def recovery(brake: str, found: list[Recovered]) -> Recovery:
    """Return the coverage of the intervals over all draws of R1 of a brake."""
    ours = [each for each in found if (each.numbers, each.brake) == ("R1", brake)]
    values, halves, truths = (
        np.array([getattr(each, name) for each in ours]) for name in ("values", "half", "truth")
    )
    names = ("kappa_0", "kappa_1", "a", "b", "c")
    inside = np.mean(np.abs(values - truths) < halves, axis=0)
    return Recovery(names, truths[0], inside, 100.0 * np.median(halves / np.abs(truths), axis=0))


def table_errors(numbers: str, found: list[Recovered]) -> Vector:
    """Return the RMS error [%] of Table 3.4 by a set as it was identified, shape (draws,)."""
    squares = np.array(
        [
            [np.mean(each.means**2) for each in found if (each.numbers, each.brake) == (numbers, b)]
            for b in BRAKES
        ]
    )
    return np.asarray(100.0 * np.sqrt(squares.mean(axis=0)))
