"""`brake-ecu rig SCENARIO… --lock-step --vary mass=1900..2400`: scenarios with many cars, on all cores.

Each `--vary` is a range, from which `--runs` values are drawn, or a list; lists are combined with each other
and with every draw. A run is judged by its scenario's `[[expect]]` alone; nothing is written of it but its
verdicts, in `vary.parquet` and with `--junit`.
"""

import json
import math
import re
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Final, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq
from scipy.stats import qmc

from brakelab.results.console import new_console
from brakelab.results.outputs import check_outputs, config_files, write_text
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table, show
from brakelab.rig.junit import junit_text
from brakelab.rig.live import make_folder
from brakelab.rig.simulated import drive_in_memory, verdicts
from brakelab.rig.verdicts import Verdict
from brakelab.simulation.car_parameters import NUMBER, parameter
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.scenario_car import with_plant_for
from ecu.errors import UserError
from ecu.output import wrote
from ecu.settings.config import Config, load_config

RANGE: Final = re.compile(rf"({NUMBER})\.\.({NUMBER}) ?(%?)")
LIST: Final = re.compile(rf"({NUMBER}(?:,{NUMBER})*) ?(%?)")
RUNS: Final = 50
WIDTH: Final = 150  # columns of the table if the terminal's width is unknown

Car = dict[str, float | str]
"""A scenario's `[car]`."""


class Span(NamedTuple):
    """One `--vary`."""

    name: str
    numbers: tuple[float, ...]
    """Those of the list, or least and greatest of the range."""
    drawn: bool
    percent: bool
    """Of the drawn car's value."""

    def value(self, number: float) -> float | str:
        """Return a number as a value of `[car]`, one that is drawn to four digits."""
        text = f"{number:{'.4g' if self.drawn else '.15g'}}"
        return f"{text} %" if self.percent else float(text)


def span(text: str) -> Span:
    """Return a `--vary`. Raises UserError, one line."""
    name, _, given = text.partition("=")
    try:
        parameter(name)
    except ValueError as error:
        raise UserError("--vary", text, str(error)) from None
    drawn, listed = RANGE.fullmatch(given), LIST.fullmatch(given)
    if drawn:
        written, percent = [drawn[1], drawn[2]], drawn[3]
    elif listed:
        written, percent = listed[1].split(","), listed[2]
    else:
        raise UserError(
            "--vary", text, "give NAME=LOW..HIGH or NAME=A,B,C; a % at the end: of the drawn car's value"
        )
    numbers = tuple(map(float, written))
    if not all(0.0 < number < math.inf for number in numbers):
        raise UserError("--vary", text, "give finite numbers above 0")
    if drawn and numbers[0] >= numbers[1]:
        raise UserError("--vary", text, "give the lower number first")
    return Span(name, numbers, drawn is not None, bool(percent))


def cars(spans: Sequence[Span], runs: int, seed: int) -> list[Car]:
    """Return the cars of all runs: a Latin hypercube over the ranges, for each combination of the lists.

    Raises:
        UserError: a parameter is given twice.
    """
    names = [one.name for one in spans]
    if len({*names}) < len(names):
        raise UserError("--vary", " ".join(names), "a parameter is given twice")
    ranges, lists = [one for one in spans if one.drawn], [one for one in spans if not one.drawn]
    drawn: list[Car] = [{}]
    if ranges:
        shares = qmc.LatinHypercube(len(ranges), rng=seed).random(runs)
        low, high = zip(*(one.numbers for one in ranges), strict=True)
        rows = qmc.scale(shares, low, high)
        drawn = [{one.name: one.value(x) for one, x in zip(ranges, row, strict=True)} for row in rows]
    combined = product(*([(one.name, one.value(x)) for x in one.numbers] for one in lists))
    return [dict(some) | car for some in combined for car in drawn]


def car_text(car: Car) -> str:
    """Return a car as a scenario has it, between the braces of `car = { … }`."""
    return ", ".join(f"{name} = {json.dumps(value)}" for name, value in car.items())


def judged(job: tuple[Scenario, Config, int]) -> list[Verdict]:
    """Drive a scenario in memory; return the verdicts."""
    scenario, vehicle, seed = job
    return verdicts(drive_in_memory(scenario, vehicle, seed), scenario.expect)


class Run(NamedTuple):
    """One expectation of one run."""

    scenario: str
    car: Car
    verdict: Verdict


def worst(runs: Sequence[Run]) -> Table:
    """Return for each expectation of each scenario how often it failed, and the run that is nearest to it."""
    groups: dict[tuple[str, str], list[Run]] = {}
    for one in runs:
        groups.setdefault((one.scenario, one.verdict.expected), []).append(one)
    rows = []
    for (scenario, expected), group in groups.items():
        least = min(group, key=lambda one: one.verdict.margin)
        failed = sum(not one.verdict.passed for one in group)
        cells = (scenario, expected, f"{failed} of {len(group)}", least.verdict.found, car_text(least.car))
        rows.append((failed / len(group), cells))
    rows.sort(key=lambda row: row[0], reverse=True)
    columns = ("scenario", "expected", "failed", "worst: found", "of the car")
    return Table("The worst of each expectation", columns, [cells for _, cells in rows], "")


def write_runs(path: Path, runs: Sequence[Run]) -> None:
    """Write a row for each expectation of each run; a share of the drawn car's value is text."""
    rows = [{"scenario": one.scenario} | one.car | one.verdict._asdict() for one in runs]
    pq.write_table(pa.Table.from_pylist(rows), path)


def vary(
    names: Sequence[Path],
    config: Path,
    out: Path,
    spans: Sequence[Span],
    runs: int | None,
    seed: int,
    plant: str | None = None,
    junit: Path | None = None,
) -> int:
    """Drive each scenario with all cars; return 0, or 1 if an expectation of a run is not met.

    Raises:
        UserError: a scenario or the configuration is invalid or expects nothing, or nothing can be written.
    """
    written = [out / "vary.parquet", *([junit] if junit else [])]
    if runs is not None and not any(one.drawn for one in spans):
        raise UserError("--runs", str(runs), "draws from the ranges of --vary; give one")
    vehicle, given = load_config(config), cars(spans, runs or RUNS, seed)
    scenarios = [load_scenario(path) for path in names]
    for path, scenario in zip(names, scenarios, strict=True):
        if not scenario.expect:
            raise UserError(str(path), "expect", "missing; --vary judges runs by [[expect]], add one")
    check_outputs(out, written[:1], ())
    if junit is not None:
        check_outputs(junit, (junit,), [*config_files(config), *names], option="--junit")
        if junit.absolute() == written[0].absolute():
            raise UserError("--junit", str(junit), "has the runs themselves; choose another name")
    make_folder(out)
    jobs: list[tuple[Scenario, Config, int]] = []
    for shipped in scenarios:
        scenario = with_plant_for(shipped, plant, vehicle, out / "plant")
        jobs += [(scenario.model_copy(update={"car": scenario.car | car}), vehicle, seed) for car in given]
    of_runs = [(path.stem, car) for path in names for car in given]
    done = run_each(f"{len(jobs)} runs", judged, jobs)
    found = [Run(*one, verdict) for one, some in zip(of_runs, done, strict=True) for verdict in some]
    show(new_console(WIDTH), worst(found))
    write_runs(written[0], found)
    if junit is not None:
        by_scenario: dict[str, list[Verdict]] = {path.stem: [] for path in names}
        for one in found:
            named = one.verdict._replace(expected=f"{one.verdict.expected}; {car_text(one.car)}")
            by_scenario[one.scenario].append(named)
        write_text(junit, junit_text(by_scenario), option="--junit")
    wrote(*written)
    return int(not all(one.verdict.passed for one in found))
