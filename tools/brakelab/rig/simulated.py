"""Verdicts on one drive by expectations: of `brake-ecu simulate`, of `rig --vary`, of a test."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from brakelab.report.brakings import brakings
from brakelab.report.drive import Drive
from brakelab.rig.figures import figures
from brakelab.rig.outcome import undisturbed
from brakelab.rig.verdicts import Verdict, judge
from brakelab.simulation.closed_loop import Drive as InMemory
from brakelab.simulation.expectations import Expectation
from brakelab.simulation.scenario import Scenario
from brakelab.simulation.simulate import Simulated
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS
from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import OUTPUT_COLUMNS
from ecu.output import give
from ecu.settings.config import Config


class Driven(NamedTuple):
    """A drive, and what it is a drive of."""

    scenario: Scenario
    vehicle: Config
    seed: int
    drive: Drive
    """The ECU's outputs, where it lives."""
    truth: Drive
    path: Path = Path("truth")
    """File of the truth, for messages."""


def driven_in_memory(scenario: Scenario, vehicle: Config, seed: int, loop: InMemory) -> Driven:
    """Return a drive of the closed loop in memory."""
    lives = np.isfinite(loop.outputs["mode"])
    drive = Drive(loop.t[lives], {name: values[lives] for name, values in loop.outputs.items()}, {})
    return Driven(scenario, vehicle, seed, drive, Drive(loop.t, loop.truth, {}))


def verdicts(driven: Driven, expected: Sequence[Expectation]) -> list[Verdict]:
    """Return the verdict on each expectation; for "longer_stop" the drive without faults is driven, too."""
    drive, scenario = driven.drive, driven.scenario
    seen = figures(drive, driven.truth, driven.path, brakings(drive, driven.path), scenario.fault)
    longer = math.nan
    if any(one.what == "longer_stop" for one in expected):
        longer = undisturbed(scenario, driven.vehicle, driven.seed).longer(seen.stop.distance)
    return judge(expected, seen, longer, scenario.fault)


def judge_simulated(simulated: Simulated, seed: int) -> int:
    """Print the verdicts; return 1 if an expectation is not met, else 0. `seed`: of the drive."""
    columns = zip(OUTPUT_COLUMNS, simulated.outputs.T, strict=True)
    truth = dict(zip(TRUTH_COLUMNS, simulated.truth.T, strict=True))
    loop = InMemory(simulated.t, {}, dict(columns), truth, new_record(FRAME, 0))
    driven = driven_in_memory(simulated.scenario, simulated.vehicle, seed, loop)
    found = verdicts(driven._replace(path=simulated.path), simulated.scenario.expect)
    for verdict in found:
        print(verdict.line)
    give(verdicts=found)
    return int(not all(verdict.passed for verdict in found))
