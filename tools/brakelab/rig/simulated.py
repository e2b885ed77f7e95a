"""Verdicts on one drive by expectations: of `brake-ecu simulate`, of `rig --vary`, of a test."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.report.brakings import brakings
from brakelab.report.drive import DriveResult
from brakelab.rig.figures import figures
from brakelab.rig.outcome import undisturbed
from brakelab.rig.verdicts import Verdict, judge
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.expectations import Expectation
from brakelab.simulation.faults import begun
from brakelab.simulation.scenario import Scenario
from brakelab.simulation.simulate import Simulated
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS
from ecu.contract.signals import OUTPUT_COLUMNS
from ecu.output import give
from ecu.settings.config import Config


class Driven(NamedTuple):
    """A drive, and what it is a drive of."""

    scenario: Scenario
    vehicle: Config
    seed: int
    drive: DriveResult
    """The ECU's outputs, where it lives."""
    truth: DriveResult
    path: Path = Path("truth")
    """File of the truth, for messages."""


def drive_in_memory(scenario: Scenario, vehicle: Config, seed: int) -> Driven:
    """Drive a scenario in the closed loop in memory."""
    loop = run(new_loop(scenario, vehicle, seed))
    drive, truth = _where_it_lives(loop.t, loop.outputs), DriveResult(loop.t, loop.truth, {})
    return Driven(scenario, vehicle, seed, drive, truth)


def _where_it_lives(t: Vector, outputs: Mapping[str, Vector]) -> DriveResult:
    lives = np.isfinite(outputs["mode"])
    return DriveResult(t[lives], {name: values[lives] for name, values in outputs.items()}, {})


def verdicts(driven: Driven, expected: Sequence[Expectation]) -> list[Verdict]:
    """Return the verdict on each expectation; for "longer_stop" the drive without faults is driven, too."""
    drive, scenario = driven.drive, driven.scenario
    faults = begun(scenario.fault, driven.truth.t, driven.truth.column("fault_acting"))
    seen = figures(drive, driven.truth, driven.path, brakings(drive, driven.path), faults)
    longer = math.nan
    if any(one.what == "longer_stop" for one in expected):
        longer = undisturbed(scenario, driven.vehicle, driven.seed).longer(seen.stop.distance)
    return judge(expected, seen, longer, faults)


def judge_simulated(simulated: Simulated, seed: int) -> int:
    """Print the verdicts; return 1 if an expectation is not met, else 0. `seed`: of the drive."""
    scenario, t = simulated.scenario, simulated.t
    drive = _where_it_lives(t, dict(zip(OUTPUT_COLUMNS, simulated.outputs.T, strict=True)))
    truth = DriveResult(t, dict(zip(TRUTH_COLUMNS, simulated.truth.T, strict=True)), {})
    found = verdicts(Driven(scenario, simulated.vehicle, seed, drive, truth, simulated.path), scenario.expect)
    for verdict in found:
        print(verdict.line)
    give(verdicts=found)
    return int(not all(verdict.passed for verdict in found))
