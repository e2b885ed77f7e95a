"""Brake force and fault bits of a car one of whose inputs lies, beside the same car without the lie.

Brake force is that of linings and motors,

    F = sum (T_b + max(T_m, 0)) / r_w / m                  true values, m: of the configuration

over that of the sound car, in the braking of the same number and at the same time in it, from `SETTLED_S` on
and above `LOWEST_SPEED`. A loss lasts for `w` where F stays below a share that long:

    least over w = min over windows of w of the greatest F in the window

The cause of a cell is measured where it strays farthest, over `SHORT_S`, beside the sound car there: the
friction that the ECU believes over the true one, the motors' demand, and the faults that act.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from brakelab.simulation.closed_loop import Drive
from brakelab.stretches import stretches
from ecu.contract.faults import ACCEL_IMPLAUSIBLE, IMPLAUSIBLE, MOTOR_SHORT, fault_mask
from ecu.contract.signals import CORNERS

Vector = NDArray[np.float64]

BEGIN: Final = 20.0  # s, of the lie
DECEL: Final = 4.0  # m/s^2
SETTLED_S: Final = 0.5
LOWEST_SPEED: Final = 5.0  # m/s
SHORT_S, LONG_S = 0.3, 2.0
"""A loss of more than `TAKES` may last for the one, of more than `COSTS` for the other."""
TAKES, COSTS = 0.1, 0.03  # of the force


class Cause(NamedTuple):
    """State of the brakes where a cell strays farthest, over that of the sound car there."""

    friction: tuple[float, float]
    """Believed over true, of the front and the rear linings; NaN: none is believed."""
    motors: float
    """Demanded of all motors; NaN: none brakes in the sound car."""
    faults: int
    """Mask of those that stand there and do not in the sound car."""


class Cell(NamedTuple):
    """One car on one road, one of whose inputs lies."""

    car: str
    road: str
    input: str
    lie: str
    least_short: float
    """Brake force over that of the sound car: what it falls below for `SHORT_S`."""
    least_long: float
    """For `LONG_S`."""
    most_long: float
    """What it stays above for `LONG_S`."""
    mean: float
    taken_s: float
    """Longest time for which more than `TAKES` of the force is missing."""
    off_s: float
    """Longest time for which the force is off by more than `COSTS`."""
    named_s: float
    """From the beginning of the lie until its fault bit; NaN: never."""
    late_s: float
    """From the beginning of the first 2 s that cost more than `COSTS`; NaN: nothing costs, or never named."""
    costs: bool
    first: int
    """Mask of the faults that come first and are not there in the sound car."""
    alarms: int
    """Mask of the inputs that the ECU of the sound car doubts."""
    cause: Cause


def brake_force(drive: Drive, mass: float) -> Vector:
    """Return the true force of all brakes and motors over the mass [m/s^2], shape (n,)."""
    truth = drive.truth
    wheels = [
        (truth[f"brake_torque_{c}"] + np.maximum(truth[f"motor_torque_{c}"], 0.0))
        / truth[f"rolling_radius_{c}"]
        for c in CORNERS
    ]
    force: Vector = np.sum(wheels, axis=0) / mass
    return force


def brakings(drive: Drive) -> list[slice]:
    """Return the rows of each braking, from the demand's full value to `LOWEST_SPEED`."""
    full = (drive.truth["decel_demand"] > 0.95 * DECEL) & (drive.truth["vehicle_speed"] > LOWEST_SPEED)
    return [slice(begin, end) for begin, end in stretches(full).tolist() if end - begin > 100]


class Braking(NamedTuple):
    """Rows of a braking after the lie began, those of the sound car beside them, and the force over its."""

    rows: NDArray[np.intp]
    beside: NDArray[np.intp]
    share: Vector


def _shares(drive: Drive, sound: Drive, mass: float) -> Iterator[Braking]:
    ours, theirs = brake_force(drive, mass), brake_force(sound, mass)
    for rows, reference in zip(brakings(drive), brakings(sound), strict=False):
        settled = round(100 * SETTLED_S)
        place = np.arange(rows.start + settled, rows.stop)
        place = place[drive.t[place] > BEGIN]
        if not len(place):
            continue
        beside = np.minimum(reference.start + place - rows.start, reference.stop - 1)
        yield Braking(place, beside, ours[place] / theirs[beside])


def _lasting(shares: Vector, seconds: float, least: bool) -> Vector:
    """Return, per window of `seconds`, the bound that all its shares keep to; empty where none is as long."""
    length = round(100 * seconds)
    if len(shares) < length:
        return np.empty(0)
    windows = sliding_window_view(shares, length)
    bound: Vector = windows.max(axis=1) if least else windows.min(axis=1)
    return bound


def _longest(holds: NDArray[np.bool_]) -> float:
    """Return the duration of the longest stretch of cycles [s]."""
    return 0.01 * max((end - begin for begin, end in stretches(holds).tolist()), default=0)


def _masks(drive: Drive) -> NDArray[np.int64]:
    return np.asarray(fault_mask(drive.outputs), np.int64)


def _cause(drive: Drive, sound: Drive, rows: NDArray[np.intp], beside: NDArray[np.intp]) -> Cause:
    def believed(one: Drive, place: NDArray[np.intp], corners: str) -> float:
        wheels = [one.outputs[f"mu_b_{c}"][place] / one.truth[f"mu_b_{c}"][place] for c in corners.split()]
        return float(np.mean(wheels))

    def motors(one: Drive, place: NDArray[np.intp]) -> float:
        return float(sum(np.mean(one.outputs[f"motor_demand_{c}"][place]) for c in CORNERS))

    front, rear = (believed(drive, rows, axle) / believed(sound, beside, axle) for axle in ("fl fr", "rl rr"))
    asked = motors(sound, beside)
    stood = int(np.bitwise_or.reduce(_masks(drive)[rows]))
    usual = int(np.bitwise_or.reduce(_masks(sound)[beside]))
    return Cause((front, rear), motors(drive, rows) / asked if asked > 0.0 else np.nan, stood & ~usual)


def _named(signals: tuple[str, ...]) -> int:
    """Return the mask of the faults that name one of `signals`; of a limit, that its motor is short."""
    own = sum(IMPLAUSIBLE.get(signal, 0) for signal in signals)
    own |= ACCEL_IMPLAUSIBLE if "accel_x" in signals else 0
    return own | (MOTOR_SHORT if signals[0].startswith("motor_limit") else 0)


def _first(t: Vector, masks: NDArray[np.int64]) -> tuple[float, int]:
    """Return when the first of the faults comes, NaN: never, and which they are."""
    found = np.flatnonzero(masks)
    return (float(t[found[0]]), int(masks[found[0]])) if len(found) else (np.nan, 0)


def judge(
    name: tuple[str, str, str, str], drive: Drive, sound: Drive, mass: float, signals: tuple[str, ...]
) -> Cell:
    """Return the cell `name` (car, road, input, lie) of a drive beside that of the sound car."""
    short, long, most, everything, costly = [1.0], [1.0], [1.0], [1.0], np.inf
    taken_s = off_s = farthest = 0.0
    place = beside = np.arange(1)
    for rows, reference, shares in _shares(drive, sound, mass):
        low, high = _lasting(shares, LONG_S, True), _lasting(shares, LONG_S, False)
        least, greatest = _lasting(shares, SHORT_S, True), _lasting(shares, SHORT_S, False)
        short.extend(least)
        long.extend(low)
        most.extend(high)
        everything.extend(shares)
        taken_s = max(taken_s, _longest(shares < 1.0 - TAKES))
        off_s = max(off_s, _longest(np.abs(shares - 1.0) > COSTS))
        beyond = np.flatnonzero((low < 1.0 - COSTS) | (high > 1.0 + COSTS))
        if len(beyond):
            costly = min(costly, float(drive.t[rows[beyond[0]]]))
        strays = np.maximum(1.0 - least, greatest - 1.0)
        if len(strays) and strays.max() > farthest:
            worst = int(np.argmax(strays))
            window = slice(worst, worst + round(100 * SHORT_S))
            farthest, place, beside = float(strays[worst]), rows[window], reference[window]
    after = drive.t >= BEGIN
    t, masks, usual = drive.t[after], _masks(drive)[after], int(np.bitwise_or.reduce(_masks(sound)))
    named, _ = _first(t, masks & _named(signals))
    return Cell(
        *name,
        least_short=float(min(short)),
        least_long=float(min(long)),
        most_long=float(max(most)),
        mean=float(np.mean(everything)),
        taken_s=taken_s,
        off_s=off_s,
        named_s=named - BEGIN,
        late_s=max(named - costly, 0.0) if np.isfinite(costly) else np.nan,
        costs=bool(np.isfinite(costly)),
        first=_first(t, masks & ~usual)[1],
        alarms=usual & sum(IMPLAUSIBLE.values()),
        cause=_cause(drive, sound, place, beside),
    )
