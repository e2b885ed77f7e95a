"""Verdicts on a run: each expectation of its scenario, held against the figures of the drive."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from brakelab.report.modes import fault_masks
from brakelab.rig.figures import Figures
from brakelab.rig.reaction import first_after, raised
from brakelab.simulation.expectations import UNITS, Expectation
from brakelab.simulation.faults import Fault
from ecu.recording.events import MODES

HEARD_S = 0.02
"""The ECU's mode at a time is that of a row so shortly before."""


class Verdict(NamedTuple):
    """What was expected of a run, and what it showed."""

    expected: str
    found: str
    passed: bool
    margin: float = math.nan
    """By how much the limit is kept, in its unit; below 0: it is not; ±inf: yes or no; NaN: no limit."""

    @property
    def line(self) -> str:
        """One line of text."""
        return f"{'passed' if self.passed else 'FAILED'}: {self.expected} (found: {self.found})"


def judge(
    expectations: Sequence[Expectation], seen: Figures, longer: float, faults: Sequence[Fault]
) -> list[Verdict]:
    """Return the verdict on each expectation; `longer`: the stop against that without `faults`, a share."""
    return [_verdict(one, seen, longer, faults) for one in expectations]


def _verdict(one: Expectation, seen: Figures, longer: float, faults: Sequence[Fault]) -> Verdict:
    drive = seen.drive
    match one.what:
        case "bit":
            bits = seen.reactions[one.fault - 1].bits if one.t is None else raised(drive, one.t)
            return _in_time(one, dict(bits).get(one.fault_bit.name, math.nan))
        case "no_bit" if one.t is not None and one.t > seen.truth.t[-1]:
            return _yes_or_no(one, f"the run ended at t = {seen.truth.t[-1]:.3g} s", passed=False)
        case "no_bit":
            rows = (drive.t >= (one.t or 0.0)) & (drive.t <= seen.truth.t[-1])
            rows &= (fault_masks(drive) & one.fault_bit.bit) != 0
            at = 1e-3 * first_after(drive.t, rows, 0.0)
            return _yes_or_no(one, "never" if math.isnan(at) else f"at t = {at:.2f} s", math.isnan(at))
        case "mode" if one.within is None:
            return _mode_at(one, seen)
        case "mode":
            since = faults[one.fault - 1].t if one.t is None else one.t
            reached = (drive.column("mode") == MODES.index(str(one.mode))) & (drive.t >= since)
            return _in_time(one, first_after(drive.t, reached, since))
        case "recovered":
            return _in_time(one, seen.reactions[one.fault - 1].recovered)
        case "stopping_distance":
            return _in_limits(one, seen.stop.distance)
        case "stopping_time":
            return _in_limits(one, seen.stop.seconds)
        case "longer_stop":
            return _in_limits(one, 100.0 * longer)
        case "friction_error":
            return _in_limits(one, 100.0 * seen.friction_error[str(one.axle)])
        case "decel_error":
            return _in_limits(one, seen.decel_error)


def _in_time(one: Expectation, after_ms: float) -> Verdict:
    assert one.within is not None
    after = round(1e-3 * after_ms, 6)
    if math.isnan(after):
        return _yes_or_no(one, "never", passed=False)
    return Verdict(one.text, f"after {after:.3g} s", after <= one.within, one.within - after)


def _yes_or_no(one: Expectation, found: str, passed: bool) -> Verdict:
    return Verdict(one.text, found, passed, math.inf if passed else -math.inf)


def _mode_at(one: Expectation, seen: Figures) -> Verdict:
    assert one.t is not None
    t = seen.drive.t
    rows = np.flatnonzero((t <= one.t) & (t > one.t - HEARD_S))
    found = MODES[int(seen.drive.column("mode")[rows[-1]])] if len(rows) else "silent"
    return _yes_or_no(one, found, found == one.mode)


def _in_limits(one: Expectation, value: float) -> Verdict:
    if math.isnan(value):
        return _yes_or_no(one, "none", passed=False)
    least = -math.inf if one.at_least is None else one.at_least
    most = math.inf if one.at_most is None else one.at_most
    margin = min(value - least, most - value)
    return Verdict(one.text, f"{value:.3f} {UNITS[one.what]}", margin >= 0.0, margin)
