"""How well the product predicts the next braking of strangers' cars, beside simple predictors.

    python -m tests.wide_world.judge [--cars 0-29] [--seed 1] [--json FILE] [--svg FILE] [--keep DIR]

Judged is the mean deceleration of each braking beyond 1.5 m/s^2, over the rows that a force balance can judge
(`brakings`): predicted from its pressures and from what was known before it, against what the accelerometer
measured.

    product, published   friction, zeros, mass, drag and ceiling of the row before, in the force balance here
    product, table       `specific_force_predicted` of its own table of brakings, against its own measurement
    product, table v     `decel_predicted` of the same table, against the loss of speed
"""

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np

from brakelab.api import Result, replay
from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, Line, Panel, write_chart
from brakelab.results.prediction import bent, power_drag

from .brakings import Braking, Signals, find, lining_decel, read, rest_decel
from .config import Nominal
from .draw import CARS, SETS, draw
from .logger import CORNERS, record, truth, write
from .references import REFERENCES, Prediction
from .route import G, Values

LEAST_DECEL = 1.5  # m/s^2, of a braking that is judged
SIGMAS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
MOST_BRAKINGS = 40  # brakings of a car, lest one outweigh the others


class Judged(NamedTuple):
    """One prediction of one braking."""

    car: int
    letter: str
    traits: tuple[str, ...]  # of the car, `Stranger.traits`
    number: int  # of the braking in its drive, from 1
    predictor: str
    predicted: float  # m/s^2
    measured: float
    sigma: float  # m/s^2, NaN: none stated

    @property
    def error(self) -> float:
        """Relative error [%]."""
        return 100.0 * (self.predicted / self.measured - 1.0)


def published(result: Result, signals: Signals, brakings: list[Braking], nominal: Nominal) -> Prediction:
    """Return what the columns of the row before each braking predict in the force balance of `brakings`."""

    def four(name: str, row: int) -> Values:
        return np.array([result[f"{name}_{corner}"][row] for corner in CORNERS])

    decel, sigma = [], []
    for braking in brakings:
        row = int(np.searchsorted(result["t"], signals.t[braking.start] + 1e-6)) - 2
        friction = four("mu_b", row)
        mu = np.where(np.isnan(friction), np.repeat(nominal.mu_nominal, 2), friction)
        mass, zero, overrun, power, relative = (
            float(np.nan_to_num(result[name][row]))
            for name in ("vehicle_mass", "accel_x_zero", "overrun", "overrun_power", "sigma_brake_force")
        )
        mass = mass if mass > 0.0 else nominal.mass
        knee = result["grip_knee"][row]
        offset = signals.zero - np.nan_to_num(four("pressure_zero", row))
        here = signals._replace(pressure=signals.pressure + offset)
        each = lining_decel(here, braking.rows, nominal, mu, mass)
        if np.isfinite(knee):
            each = bent(each, result["grip_limit"][row], knee, result["grip_fall"][row])
        lining = float(np.mean(each))
        known = signals._replace(motor=signals.motor * result["motor_torque_share"][row])
        rest = rest_decel(known, braking.rows, nominal, mass)
        overrun += power * float(np.mean(power_drag(signals.speed[braking.rows])))
        decel.append(lining + rest + overrun - zero / (1.0 + G * nominal.pitch_gradient))
        if relative == 0.0:
            relative = float(np.mean(four("sigma_mu_b", row) / mu))
        sigma.append(relative * lining)
    return Prediction(np.array(decel), np.array(sigma))


def tabled(
    result: Result, signals: Signals, brakings: list[Braking], names: tuple[str, str, str]
) -> tuple[Prediction, Values]:
    """Return predictions and measurements of the product's own table; NaN where it has none or left it out.

    Args:
        result: of the replay.
        signals: the logged ones.
        brakings: found in them.
        names: columns of the prediction, of the measurement and of sigma ("": none).
    """
    table = result.brakings
    first = np.asarray(table["corner"]) == CORNERS[0]
    start = np.asarray(table["t_start"])[first]
    end = start + np.asarray(table["duration"])[first]
    rows = np.full((len(brakings), 3), np.nan)
    for row, braking in zip(rows, brakings, strict=True):
        begins, ends = signals.t[braking.start], signals.t[braking.end - 1]
        overlap = np.minimum(end, ends) - np.maximum(start, begins)
        if len(overlap) == 0 or np.max(overlap) < 0.5 * (ends - begins):
            continue
        which = int(np.argmax(overlap))
        if "left_out" in table.columns and table["left_out"][first][which]:
            continue
        row[:] = [table[name][first][which] if name in table.columns else np.nan for name in names]
    return Prediction(rows[:, 0], rows[:, 2]), rows[:, 1]


TABLES = {
    "product, table": ("specific_force_predicted", "specific_force_mean", "sigma_specific_force"),
    "product, table v": ("decel_predicted", "decel_mean", ""),
}


def judge_car(seed: int, number: int, folder: Path) -> list[Judged]:
    """Drive, record and replay a stranger; his files stay in the folder."""
    stranger = draw(seed, range(number, number + 1))[0]
    rows = stranger.drive()
    columns = record(rows, stranger.logger, stranger.nominal.radius)
    name = folder / f"{number:02d}-{stranger.letter}"
    log, config = name.with_suffix(".parquet"), name.with_suffix(".toml")
    write(columns, log)
    write(truth(rows, stranger.logger), name.with_suffix(".truth.parquet"))
    config.write_text(stranger.nominal.toml(f"stranger-{number}"), "utf-8")
    signals = read(columns, stranger.nominal)
    brakings = [one for one in find(signals, stranger.nominal) if one.measured > LEAST_DECEL][:MOST_BRAKINGS]
    measured = np.array([braking.measured for braking in brakings])
    predictions = {name: (reference(brakings), measured) for name, reference in REFERENCES.items()}
    result = replay(log, config=config, out=name.with_suffix(".result.parquet"))
    predictions["product, published"] = published(result, signals, brakings, stranger.nominal), measured
    for table, names in TABLES.items():
        predictions[table] = tabled(result, signals, brakings, names)
    who = number, stranger.letter, stranger.traits
    return [
        Judged(*who, k + 1, predictor, float(said.decel[k]), float(real[k]), float(said.sigma[k]))
        for predictor, (said, real) in predictions.items()
        for k in range(len(brakings))
        if not np.isnan(said.decel[k]) and real[k] > LEAST_DECEL
    ]


def _cell(judged: Iterable[Judged]) -> str:
    some = list(judged)
    if not some:
        return "-"
    errors = np.array([one.error for one in some])
    text = f"{np.mean(np.abs(errors)):.1f}/{np.percentile(np.abs(errors), 90):.0f}"
    stated = [one for one in some if not np.isnan(one.sigma)]
    if stated:
        inside = np.mean([abs(one.predicted - one.measured) <= 2.0 * one.sigma for one in stated])
        text += f" {100 * inside:.0f}"
    return text


def _bias(judged: Iterable[Judged]) -> str:
    errors = np.array([one.error for one in judged])
    return f"{np.mean(np.abs(errors)):.1f} ({np.mean(errors):+.0f})" if len(errors) else "-"


def table(
    judged: list[Judged],
    columns: dict[str, Callable[[Judged], bool]],
    cell: Callable[[Iterable[Judged]], str],
) -> str:
    """Return a Markdown table, a predictor a row."""
    predictors = dict.fromkeys(one.predictor for one in judged)
    lines = ["| | " + " | ".join(columns) + " |", "| --- |" + " --- |" * len(columns)]
    for predictor in predictors:
        mine = [one for one in judged if one.predictor == predictor]
        cells = [cell(one for one in mine if belongs(one)) for belongs in columns.values()]
        lines.append(f"| {predictor} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _errors_over_sigma(judged: list[Judged]) -> dict[str, np.ndarray]:
    """Return the magnitudes of error over sigma of every predictor that states sigma."""
    found: dict[str, list[float]] = {}
    for one in judged:
        if not np.isnan(one.sigma):
            found.setdefault(one.predictor, []).append(abs(one.predicted - one.measured) / one.sigma)
    return {predictor: np.array(off) for predictor, off in found.items()}


def draw_calibration(judged: list[Judged], path: Path) -> None:
    """Draw the share inside k sigma of every predictor that states sigma, beside the normal distribution."""
    k = np.linspace(0.0, SIGMAS[-1], 61)
    normal = np.array([100.0 * math.erf(one / 2**0.5) for one in k])
    lines, legend = [Line(k, normal, GREY, dashed=True)], [("normal distribution", GREY)]
    for (predictor, off), colour in zip(
        _errors_over_sigma(judged).items(), (GREEN, ORANGE, BLUE), strict=False
    ):
        share = np.array([100.0 * np.mean(off <= one) for one in k])
        lines.append(Line(k, share, colour))
        legend.append((predictor, colour))
    write_chart(
        path, [Panel("share inside k sigma [%]", "k", (0.0, SIGMAS[-1]), (0.0, 100.0), lines)], legend
    )


def calibration(judged: list[Judged]) -> str:
    """Return a Markdown table of the share inside k sigma [%] of every predictor that states sigma."""
    lines = [
        "| k | " + " | ".join(f"{k:g}" for k in SIGMAS) + " | median sigma [%] |",
        "| --- |" + " --- |" * (len(SIGMAS) + 1),
        "| normal distribution | " + " | ".join(f"{100 * math.erf(k / 2**0.5):.0f}" for k in SIGMAS) + " | |",
    ]
    for predictor, off in _errors_over_sigma(judged).items():
        share = " | ".join(f"{100 * np.mean(off <= k):.0f}" for k in SIGMAS)
        median = np.nanmedian(
            [100.0 * one.sigma / one.measured for one in judged if one.predictor == predictor]
        )
        lines.append(f"| {predictor} | {share} | {median:.1f} |")
    return "\n".join(lines)


def report(judged: list[Judged]) -> str:
    """Return all tables."""
    each = [one for one in judged if one.predictor == "never learning"]

    def columns(belongs: dict[str, Callable[[Judged], bool]]) -> dict[str, Callable[[Judged], bool]]:
        counts = {name: sum(map(test, each)) for name, test in belongs.items()}
        return {f"{name} ({counts[name]})": test for name, test in belongs.items() if counts[name]}

    sets = {letter: lambda one, letter=letter: one.letter == letter for letter in SETS}
    traits = {
        name: lambda one, name=name: name in one.traits
        for name in dict.fromkeys(t for o in each for t in o.traits)
    }
    spoilt = {"accelerator rests at 2.5 %", "engine's torque at 2.5 times"}
    sound = {"both signals sound": lambda one: not spoilt & set(one.traits)}
    numbers = {str(n): lambda one, n=n: one.number == n for n in range(1, 9)} | {
        "9 on": lambda one: one.number > 8
    }
    return "\n\n".join(
        (
            f"Brake applications beyond {LEAST_DECEL} m/s^2. "
            "Mean/p90 error [%], share inside 2 sigma [%]. By set:",
            table(judged, columns({"pooled": lambda one: True} | sets), _cell),
            "By what the cars have:",
            table(judged, columns(sound | traits), _cell),
            "By the number of the brake application, mean error (bias) [%]:",
            table(judged, columns(numbers), _bias),
            "Share inside k sigma [%]:",
            calibration(judged),
        )
    )


def _numbers(text: str) -> range:
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def main(arguments: list[str] | None = None) -> int:
    """Judge the cars that the command line names and print the tables."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.wide_world.judge", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--cars", type=_numbers, default=range(CARS), metavar="FIRST-LAST")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", type=Path, metavar="FILE", help="every prediction of every braking")
    parser.add_argument("--svg", type=Path, metavar="FILE", help="the share inside k sigma as a picture")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="logs, configurations, truths and results")
    asked = parser.parse_args(arguments)
    began, judged = time.monotonic(), []
    if asked.keep:
        asked.keep.mkdir(parents=True, exist_ok=True)
    with (
        nullcontext(asked.keep) if asked.keep else tempfile.TemporaryDirectory() as folder,
        ProcessPoolExecutor(asked.workers) as pool,
    ):
        jobs = {pool.submit(judge_car, asked.seed, number, Path(folder)): number for number in asked.cars}
        for done, job in enumerate(as_completed(jobs), 1):
            judged += job.result()
            elapsed = time.monotonic() - began
            print(f"car {jobs[job]}: {done} of {len(jobs)}, {elapsed:.0f} s", file=sys.stderr, flush=True)
    judged.sort(key=lambda one: one.car)
    print(report(judged))
    if asked.json:
        asked.json.write_text(
            json.dumps([one._asdict() | {"sigma": one.sigma if one.sigma > 0.0 else None} for one in judged]),
            "utf-8",
        )
    if asked.svg:
        draw_calibration(judged, asked.svg)
    return 0


if __name__ == "__main__":
    sys.exit(main())
