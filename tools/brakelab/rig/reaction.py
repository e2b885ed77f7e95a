"""Reaction of the ECU to a fault and its delay, from results and truth on one time axis."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.report.drive import DriveResult
from brakelab.report.modes import fault_masks
from brakelab.simulation.faults import Fault
from ecu.contract.faults import FAULTS, LATE
from ecu.contract.signals import DEGRADED
from ecu.recording.events import MODES

AFTER_S = 3.0
"""Effects up to this long after the end of a fault count as its consequences."""
FIRST_HEARD_S = 0.05
"""The vehicle sets off at the ECU's first frame: from then on it has heard demands."""
HELD_UP_S = 0.05
SHOWN_S = 1.0
"""A passing fault of the service shows its bit for so long."""


class Reaction(NamedTuple):
    """Reaction of the ECU to one fault. Times in ms after the fault began, NaN: never."""

    kind: str
    what: str
    """Frames, signals or corners that it hits."""
    t: float
    """s"""
    duration: float
    """s, inf: to the end."""
    bits: list[tuple[str, float]]
    """Fault bits that were raised, with when."""
    mode: str
    """Worst mode."""
    mode_after: float
    fallback: float
    """ms in all in which the vehicle did not obey the ECU but braked on its own."""
    fallback_after: float
    recovered: float
    """ms after the fault's end (of a killed daemon: after the kill) until everything is as before."""


def reactions(drive: DriveResult, truth: DriveResult, faults: list[Fault]) -> list[Reaction]:
    """Return the reaction to every fault, up to the beginning of the next or the vehicle's departure.

    `drive` are the ECU's results, `truth` the vehicle's on its own axis; both count from T_0.
    """
    found = []
    drive = _until(drive, truth.t[-1])
    for fault in faults:
        limit = min((other.t for other in faults if other.t > fault.t), default=math.inf)
        found.append(_reaction(_until(drive, limit), _until(truth, limit), fault))
    return found


def _until(drive: DriveResult, limit: float) -> DriveResult:
    rows = drive.t < limit
    return DriveResult(
        drive.t[rows], {name: values[rows] for name, values in drive.columns.items()}, drive.metadata
    )


def raised_alone(drive: DriveResult, truth: DriveResult, faults: list[Fault]) -> NDArray[np.int64]:
    """Return the fault bits raised in each row, not within a fault or `AFTER_S` after it, shape (n,).

    Effects of the machine's load are excluded: "late", and inputs lost where the vehicle was delayed by more
    than `HELD_UP_S`.
    """
    masks = fault_masks(drive) & ~LATE
    rises = masks & ~np.concatenate([[0], masks[:-1]])
    for fault in faults:
        rises[(drive.t >= fault.t) & (drive.t < _end(fault) + AFTER_S)] = 0
    rises[drive.t > truth.t[-1]] = 0  # the vehicle writes its files
    for place in np.flatnonzero(np.diff(truth.t) > HELD_UP_S):
        rises[(drive.t >= truth.t[place]) & (drive.t < truth.t[place + 1] + SHOWN_S)] = 0
    return rises


def _end(fault: Fault) -> float:
    """Return the end of the fault; a killed daemon stays dead, but its outage is evaluated."""
    return fault.t if fault.kind == "daemon_killed" and fault.standby else fault.end


def first_after(t: NDArray[np.float64], rows: NDArray[np.bool_], since: float) -> float:
    """Return the time of the first of `rows`, in ms after `since`; NaN: none."""
    places = np.flatnonzero(rows)
    return 1e3 * (float(t[places[0]]) - since) if len(places) else math.nan


def _usual(drive: DriveResult, since: float) -> int:
    """Return the mask of the last row before `since`."""
    before = np.flatnonzero(drive.t < since)
    return int(fault_masks(drive)[before[-1]]) if len(before) else 0


def raised(drive: DriveResult, since: float, until: float = math.inf) -> list[tuple[str, float]]:
    """Return the fault bits raised from `since` to `until` [s], with when in ms after `since`, in order.

    A bit that stood before does not count.
    """
    masks = fault_masks(drive) & ~_usual(drive, since)
    masks[(drive.t < since) | (drive.t >= until)] = 0
    found = [(one.name, first_after(drive.t, (masks & one.bit) != 0, since)) for one in FAULTS]
    return sorted((bit for bit in found if math.isfinite(bit[1])), key=lambda bit: bit[1])


def _reaction(drive: DriveResult, truth: DriveResult, fault: Fault) -> Reaction:
    mode = drive.column("mode")
    end = _end(fault)
    within = (drive.t >= fault.t) & (drive.t < end + AFTER_S)
    worst = int(np.nanmax(mode[within])) if within.any() else 0
    deaf = truth.column("demand_heard") == 0.0
    concerned = deaf & (truth.t >= max(fault.t, FIRST_HEARD_S)) & (truth.t < end + AFTER_S)
    period = float(np.median(np.diff(truth.t)))
    return Reaction(
        kind=fault.kind,
        what=", ".join([*fault.message, *fault.signal]),
        t=fault.t,
        duration=end - fault.t if math.isfinite(fault.t) else math.nan,
        bits=raised(drive, fault.t, end + AFTER_S),
        mode=MODES[worst],
        mode_after=first_after(drive.t, within & (mode == worst) & (mode >= DEGRADED), fault.t),
        fallback=1e3 * period * float(np.count_nonzero(concerned)),
        fallback_after=first_after(truth.t, concerned, fault.t),
        recovered=_recovered(drive, truth, fault),
    )


def _recovered(drive: DriveResult, truth: DriveResult, fault: Fault) -> float:
    """Return when the last effect of the fault disappeared, in ms after its end; "late" is the machine's."""
    since = fault.t if fault.kind == "daemon_killed" else _end(fault)
    if math.isinf(since):
        return math.nan
    masks = fault_masks(drive) & ~_usual(drive, fault.t) & ~LATE
    wrong = (masks != 0) | (drive.column("mode") >= DEGRADED)
    wrong &= (drive.t >= since) & (drive.t < since + AFTER_S + SHOWN_S)
    deaf = (truth.column("demand_heard") == 0.0) & (truth.t >= since) & (truth.t < since + AFTER_S + SHOWN_S)
    lasts = [float(t[rows][-1]) for t, rows in ((drive.t, wrong), (truth.t, deaf)) if rows.any()]
    if not lasts:
        return 0.0
    last = max(lasts)
    return math.nan if last >= min(drive.t[-1], truth.t[-1]) - 0.02 else 1e3 * (last - since) + 10.0
