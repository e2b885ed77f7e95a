"""Verdicts on a drive of `brake-ecu simulate`, by the expectations of its scenario."""

import numpy as np

from brakelab.report.brakings import brakings
from brakelab.report.drive import Drive
from brakelab.rig.figures import figures
from brakelab.rig.outcome import undisturbed
from brakelab.rig.verdicts import judge
from brakelab.simulation.simulate import Simulated
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS
from ecu.contract.signals import OUTPUT_COLUMNS
from ecu.output import give


def judge_simulated(driven: Simulated, seed: int) -> int:
    """Print the verdicts; return 1 if an expectation is not met, else 0. `seed`: of the drive."""
    scenario = driven.scenario
    outputs = dict(zip(OUTPUT_COLUMNS, driven.outputs.T, strict=True))
    lives = np.isfinite(outputs["mode"])
    drive = Drive(driven.t[lives], {name: values[lives] for name, values in outputs.items()}, {})
    truth = Drive(driven.t, dict(zip(TRUTH_COLUMNS, driven.truth.T, strict=True)), {})
    seen = figures(drive, truth, driven.path, brakings(drive, driven.path), scenario.fault)
    sound = undisturbed(scenario, driven.vehicle, seed)
    verdicts = judge(scenario.expect, seen, sound.longer(seen.stop.distance), scenario.fault)
    for verdict in verdicts:
        print(verdict.line)
    give(verdicts=verdicts)
    return int(not all(verdict.passed for verdict in verdicts))
