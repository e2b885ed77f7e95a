"""Head of the page: origin of the result, and the drive in a few figures."""

import math
from datetime import UTC, datetime
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.report.accuracy import AXLES, Accuracy
from brakelab.report.brakings import Braking
from brakelab.report.drive import DriveResult, start_ns
from brakelab.report.modes import fault_masks, faults_seen
from brakelab.report.page import Tile, fixed, percent, signed_percent
from brakelab.report.timing import Timing, spread
from brakelab.results.prediction import Errors
from ecu.contract.faults import FAULTS

# Limits beyond which a tile is marked for an engineer's attention.
_HONEST_SHARE = 0.8
_DEMAND_ERROR = 0.1
_PREDICTION_ERROR = 0.1


SIMULATED_S: Final = 1_700_000_000
"""Date at which every simulated drive begins, which is none of a drive: `closed_loop.START_NS`."""


class FaultSeen(NamedTuple):
    """A row of the table of faults; times in s."""

    name: str
    first: float
    seconds: float
    remedy: str


def facts(drive: DriveResult) -> list[tuple[str, str]]:
    """Return label and value of each statement of the result on its origin."""
    start = start_ns(drive)
    when = ""
    if start is not None and start // 10**9 == SIMULATED_S:
        when = "simulated"
    elif start is not None:
        when = datetime.fromtimestamp(start // 10**9, UTC).strftime("%d %B %Y, %H:%M:%S UTC")
    rows = [
        ("Vehicle", drive.metadata.get("vehicle", "")),
        ("Start", when.lstrip("0")),
        ("Configuration", drive.metadata.get("config_hash", "")[:12]),
        ("brake-ecu", drive.metadata.get("version", "")),
        ("Observer", drive.metadata.get("observer", "")),
    ]
    return [(label, value) for label, value in rows if value]


def tiles(
    drive: DriveResult,
    found: list[Braking],
    shares: list[float],
    predicted: Errors,
    accuracy: dict[str, Accuracy] | None,
    timing: Timing | None,
) -> list[Tile]:
    """Return the summary in reading order; `shares`: the result of `tracking`."""
    shown = [_drive(drive), _brakings(found), *_friction(drive, accuracy)]
    if found:
        shown.append(_deceleration(shares))
    if predicted.counted:
        shown.append(_prediction(predicted))
    shown.append(_faults(drive))
    if timing is not None:
        late = spread(timing.lateness)
        note = f"lateness 99 % {late.p99:.0f} µs, worst {late.worst:.0f} µs"
        count = len(timing.lateness)
        shown.append(Tile("Missed periods", f"{timing.missed}", f"of {count}", note, timing.missed > 0))
    return shown


def faults(drive: DriveResult) -> list[FaultSeen]:
    """Return every fault that was active, with time and duration."""
    masks = fault_masks(drive)
    dt = np.append(np.diff(drive.t), 0.0)
    remedies = {fault.bit: fault.remedy for fault in FAULTS}
    rows = []
    for bit, name in faults_seen(drive).items():
        active = (masks & bit) != 0
        first = float(drive.t[int(np.argmax(active))])
        rows.append(FaultSeen(name, first, float(dt[active].sum()), remedies.get(bit, "")))
    return rows


def _drive(drive: DriveResult) -> Tile:
    speed = np.nan_to_num(drive.column("vehicle_speed"))
    kilometres = float((speed[1:] * np.diff(drive.t)).sum()) * 1e-3
    seconds = drive.t[-1] - drive.t[0]
    return Tile("Drive", f"{kilometres:.2f}", "km", f"{seconds:.0f} s, up to {speed.max() * 3.6:.0f} km/h")


def _brakings(found: list[Braking]) -> Tile:
    if not found:
        return Tile("Brake applications", "0", "", "none in this drive")
    hardest = max(found, key=_while_moving)
    note = f"hardest: no. {hardest.number}, {fixed(_while_moving(hardest), 1)} m/s²"
    return Tile("Brake applications", f"{len(found)}", "", note)


def _while_moving(braking: Braking) -> float:
    """Return the mean specific force [m/s^2] without the standstill at the end, where it is known."""
    measured = braking.force.measured
    return measured if math.isfinite(measured) else braking.achieved


def _friction(drive: DriveResult, accuracy: dict[str, Accuracy] | None) -> list[Tile]:
    mu, sigma = drive.corners("mu_b"), drive.corners("sigma_mu_b")
    shown = []
    for axle, wheels in AXLES.items():
        last, band = _last(mu[:, wheels]), 2.0 * _last(sigma[:, wheels])
        known = bool(np.isfinite(last))
        note = "at the end of the drive" if known else "nothing is known"
        warns = False
        if accuracy is not None and known:
            row = accuracy[axle]
            note = f"nRMSE {percent(row.nrmse, 1)} %, truth inside ±2σ {percent(row.inside, 0)} %"
            warns = row.inside < _HONEST_SHARE
        shown.append(
            Tile(f"Friction {axle}, ±2σ", fixed(last, 3), f"± {fixed(band, 3)}" if known else "", note, warns)
        )
    return shown


def _last(values: Vector) -> float:
    rows = values[np.isfinite(values).all(axis=1)]
    return float(rows[-1].mean()) if len(rows) else float("nan")


def _deceleration(shares: list[float]) -> Tile:
    known = np.array([share for share in shares if np.isfinite(share)])
    title = "Achieved over demanded"
    if not known.size:
        return Tile(title, fixed(float("nan"), 0), "", "no steady brake application by the brakes alone")
    mean, worst = float(known.mean()), float(known[np.argmax(np.abs(known))])
    note = f"steady deceleration; worst braking {signed_percent(worst, 1)} %"
    return Tile(title, signed_percent(mean, 1), "%", note, abs(worst) > _DEMAND_ERROR)


def _prediction(found: Errors) -> Tile:
    worst, bias = percent(found.worst, 1), signed_percent(found.bias, 1)
    note = f"mean of {found.counted}; worst {worst} %, bias {bias} %"
    return Tile("Prediction error", percent(found.mean, 1), "%", note, found.mean > _PREDICTION_ERROR)


def _faults(drive: DriveResult) -> Tile:
    seen = list(faults_seen(drive).values())
    if not drive.has("active_faults"):
        return Tile("Faults", fixed(float("nan"), 0), "", "not in the result")
    return Tile("Faults", f"{len(seen)}", "", ", ".join(seen) or "none seen", bool(seen))
