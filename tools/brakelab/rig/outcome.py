"""Outcome of one scenario of a rig run, in figures."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from brakelab.report.brakings import brakings
from brakelab.report.drive import DriveResult, read_drive
from brakelab.report.sparkline import drive_sparkline
from brakelab.report.timing import Spread, read_timing, spread
from brakelab.rig.figures import figures, last_stop
from brakelab.rig.linings import OF_LININGS, beyond_compensation, tell_linings
from brakelab.rig.reaction import Reaction, raised_alone
from brakelab.rig.results import Frames, Written
from brakelab.rig.verdicts import Verdict, judge
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.faults import Fault, begun
from brakelab.simulation.scenario import Scenario
from ecu.contract.faults import FAULTS, fault_mask, fault_names
from ecu.settings.config import Config

_REMEDY = "run the rig again"


class Outcome(NamedTuple):
    """Outcome of one scenario; NaN where not applicable."""

    scenario: str
    seconds: float
    brakings: int
    decel_error: float
    """As in `Figures` [m/s^2]."""
    nrmse_front: float
    """Of friction, as a share."""
    nrmse_rear: float
    stopping_distance: float
    """From the demand of the last brake application that ends at rest to rest [m]."""
    undisturbed: float
    """The same without the scenario's faults [m]."""
    longer: float
    """Relative increase of the stopping distance by the faults."""
    unexplained: list[str]
    """Fault bits that neither an injected fault nor the car's linings account for."""
    of_linings: list[str]
    """Fault bits that the car's linings account for, with their reason."""
    reactions: list[Reaction]
    verdicts: list[Verdict]
    """On the scenario's expectations."""
    frames: Frames
    differing: int
    """Values that replay did not give again."""
    cycles: int
    missed: int
    lateness: Spread
    """µs"""
    curve: str
    """Demanded and achieved deceleration as SVG."""
    folder: Path


class Undisturbed(NamedTuple):
    """The same drive without the faults of its scenario."""

    stopping_distance: float
    """m; NaN: no such drive."""
    faults: frozenset[str]
    """Names of the fault bits that it shows: of a car beyond what compensation may do, for one."""

    def longer(self, distance: float) -> float:
        """Return by how much of the undisturbed one a stopping distance [m] is longer."""
        return distance / self.stopping_distance - 1.0


def undisturbed(scenario: Scenario, vehicle: Config, seed: int) -> Undisturbed:
    """Return the same drive without the scenario's faults."""
    if not scenario.fault:
        return Undisturbed(math.nan, frozenset())
    sound = run(new_loop(scenario.model_copy(update={"fault": []}), vehicle, seed))
    mask = int(np.bitwise_or.reduce(fault_mask(sound.outputs)))
    return Undisturbed(
        last_stop(DriveResult(sound.t, sound.truth, {})).distance, frozenset(fault_names(mask))
    )


def account_for(
    drive: DriveResult, truth: DriveResult, faults: list[Fault], vehicle: Config, usual: frozenset[str]
) -> tuple[list[str], list[str]]:
    """Return the fault bits that nothing accounts for, and those that the car's linings account for.

    `drive` are the ECU's results, `truth` the vehicle's on its own axis; `usual`: bits shown without the
    scenario's faults too, or expected by it.
    """
    rises = raised_alone(drive, truth, faults)
    beyond = beyond_compensation(truth, vehicle)
    at = np.clip(np.searchsorted(truth.t, drive.t, side="right") - 1, 0, len(truth.t) - 1)
    of_linings = np.where(beyond[at], rises & OF_LININGS, 0)
    rises &= ~of_linings
    alone = [fault.name for fault in FAULTS if (rises & fault.bit).any() and fault.name not in usual]
    why = tell_linings(truth, vehicle) if of_linings.any() else ""
    return alone, [f"{fault.name}: {why}" for fault in FAULTS if (of_linings & fault.bit).any()]


def outcome(
    name: str,
    written: Written,
    truth_path: Path,
    scenario: Scenario,
    vehicle: Config,
    sound: Undisturbed,
    recordings: list[Path],
) -> Outcome:
    """Return the outcome by the files of one drive; fault bits shown without the faults too do not count."""
    drive = read_drive(written.result, ("vehicle_speed",), _REMEDY)
    own = read_drive(truth_path, ("vehicle_speed",), _REMEDY)
    found = brakings(drive, written.result)
    faults = begun(scenario.fault, own.t, own.column("fault_acting"))
    seen = figures(drive, own, truth_path, found, faults)
    longer = sound.longer(seen.stop.distance)
    timings = [read_timing(folder) for folder in recordings]
    lateness = np.concatenate([timing.lateness for timing in timings]) if timings else np.array([np.nan])
    expected = {one.fault_bit.name for one in scenario.expect if one.what == "bit"}
    usual = sound.faults | expected
    alone, of_linings = account_for(seen.drive, own, faults, vehicle, usual)
    return Outcome(
        scenario=name,
        seconds=float(own.t[-1]),
        brakings=len(found),
        decel_error=seen.decel_error,
        nrmse_front=seen.accuracy["front"].nrmse,
        nrmse_rear=seen.accuracy["rear"].nrmse,
        stopping_distance=seen.stop.distance,
        undisturbed=sound.stopping_distance,
        longer=longer,
        unexplained=alone,
        of_linings=of_linings,
        reactions=seen.reactions,
        verdicts=judge(scenario.expect, seen, longer, faults),
        frames=written.frames,
        differing=written.differing,
        cycles=len(drive.t),
        missed=sum(timing.missed for timing in timings),
        lateness=spread(lateness),
        curve=drive_sparkline(drive),
        folder=written.result.parent,
    )


def of_the_rig(one: Outcome, other_car: str) -> Verdict:
    """Return the verdict on what no scenario has to ask for; `other_car`: as of `scenario_car.other_car`."""
    wrong = [f"unexplained: {name}" for name in one.unexplained]
    wrong += [f"replay differs in {one.differing} values"] if one.differing else []
    wrong += [other_car] if other_car else []
    expected = "every fault bit accounted for, replay to the bit, the configured car"
    return Verdict(expected, "; ".join(wrong) or "nothing else", not wrong)
