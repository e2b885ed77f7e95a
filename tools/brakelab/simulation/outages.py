"""Daemon outages of the closed loop in memory: times of death and return."""

from typing import Final, NamedTuple

import numpy as np

from brakelab.simulation.faults import DAEMON_KILLED
from brakelab.simulation.scenario import LONGEST_DRIVE
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS
from ecu.runtime.standby import SILENCE_NS

START_UP: Final = 2.5
"""s from the start of a daemon to its first frame. Assumption, see docs/rig.md"""
TAKEOVER: Final = 1e-9 * (SILENCE_NS + CYCLE_NS)
"""s from the last frame of the first daemon to the first of its standby."""


class Outage(NamedTuple):
    """The ECU does not send in cycles `begin` to `end`; afterwards it is a new one, or the standby."""

    begin: int
    end: int
    standby: bool


def find_outages(faults: RecordArray) -> list[Outage]:
    """Return the outages in `faults` (`FAULT`, shape (n,)) in their order."""
    outages = []
    for fault in np.sort(faults[faults["kind"] == DAEMON_KILLED], order="begin"):
        begin, standby = float(fault["begin"]), bool(fault["standby"])
        end = begin + TAKEOVER if standby else float(fault["end"]) + START_UP
        first, last = (round(min(instant, LONGEST_DRIVE) * 1e9 / CYCLE_NS) for instant in (begin, end))
        outages.append(Outage(first, last, standby))
    return outages
