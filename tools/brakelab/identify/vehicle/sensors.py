"""Zeros of the sensors, and how far the body dives: by kinematics, which knows nothing of forces.

    a_x,m / kappa = v' + g grade + b / kappa          kappa = 1 + g pitch gradient
    a_y,m = c v psi' + b_y

*Dive.* While the acceleration is steady (the body's swinging has ended), within a manoeuvre the grade is a
parabola of the place; what is left of a_x,m follows what is left of v' by kappa. *Zero of accel_x.* The
mean of a_x,m / kappa - v' by distance is b / kappa + g (mean grade), beside what curves add. A drive that
ends where it began has no mean grade; of another the grade of its blocks says how sure the mean is. What
curves add is shown beside the grade of their places, which a closed drive does not cancel: the grade of the
blocks says how far that may mislead. Each standstill shows b + g grade of its place. Speeds are those of the
wheels by the model of `model.py`.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.vehicle.fit import Places, Prior, Residuals, fit
from brakelab.identify.vehicle.reader import Rows
from brakelab.identify.vehicle.windows import SECONDS, Windows
from ecu.contract.params import GRAVITY

MANOEUVRE: Final = 12.0  # s, in which the grade is a parabola of the place
LIVELY: Final = 0.8  # m/s^2, range of v' that shows dive
LONGEST_STEP: Final = 20.0  # s between two speeds
BLOCK: Final = 500.0  # m, of road whose grade is of its own
USUAL_GRADE: Final = 0.02  # rad, of a road that the drive shows too little of
HEIGHT: Final = 0.5  # m, by which a closed drive may end elsewhere
ELSEWHERE: Final = 30.0  # m, by which another one may
MODEL: Final = 0.0015  # m/s^2, of what curves and gusts leave
APART: Final = 100.0  # m between two standstills that count as two
LEAST_STAND: Final = 2.0  # s
YAW_STEP: Final = 1e-4  # rad/s, resolution and drift
BANK: Final = 0.05  # m/s^2, of twenty seconds of road
FEWEST_WINDOWS: Final = 20  # windows
GATE: Final = 2.5  # sigma

Estimate = tuple[float, float]
"""A value and its standard deviation."""


class Steps(NamedTuple):
    """From one window to the next with a known speed."""

    drive: Vector
    at: Vector
    """s"""
    seconds: Vector
    felt: Vector
    """Mean reading of the accelerometer by halves, shape (2, n)."""
    change: Vector
    """v' by the wheels by halves, shape (2, n)."""
    speed: Vector
    yaw_rate: Vector
    straight: Rows
    steady: Rows


def steps_of(windows: Windows, speed: Vector) -> Steps:
    """Return the steps; `speed` [m/s] of each window by halves, shape (2, n), NaN: not known."""
    parts = []
    for drive in np.unique(windows.drive):
        own = np.flatnonzero(windows.drive == drive)
        sums = windows.accel_sum[:, own]
        known = np.flatnonzero(np.isfinite(speed[:, own]).all(axis=0))
        first, last = known[:-1], known[1:]
        seconds = np.asarray(SECONDS * (last - first), np.float64)
        v = speed[:, own]
        yaw = np.nan_to_num(windows.yaw_rate.mean(axis=0)[own])
        parts.append(Steps(
            np.full(len(first), float(drive)), 0.5 * (windows.t[own[first]] + windows.t[own[last]]), seconds,
            (sums[:, last] - sums[:, first]) / seconds, (v[:, last] - v[:, first]) / seconds,
            0.5 * (v[:, first] + v[:, last]).mean(axis=0), 0.5 * (yaw[first] + yaw[last]),
            windows.straight[own[first]] & windows.straight[own[last]],
            windows.steady[own[first]] & windows.steady[own[last]],
        ))  # fmt: skip
    columns: list[Any] = [np.concatenate(column, axis=-1) for column in zip(*parts, strict=True)]
    joined = Steps(*columns)
    kept = np.flatnonzero(np.isfinite(joined.felt).all(axis=0) & (joined.seconds < LONGEST_STEP))
    chosen: list[Any] = [column[..., kept] for column in joined]
    return Steps(*chosen)


def dive_of(steps: Steps, prior: Estimate) -> tuple[float, float, int] | None:
    """Return pitch gradient [rad per m/s^2], its standard deviation, number of steps; None: none seen."""
    rows, segments = [], []
    number = (steps.drive * 1e6 + steps.at // MANOEUVRE).astype(np.int64)
    for place in np.unique(number):
        good = steps.straight & steps.steady & (steps.seconds <= 2.0 * SECONDS)
        own = np.flatnonzero((number == place) & good)
        if len(own) >= 6 and np.ptp(steps.change[:, own].mean(axis=0)) > LIVELY:
            rows.append(own)
            segments.append(_without_grade(np.cumsum((steps.seconds * steps.speed)[own])))
    if not rows:
        return None

    def of(theta: Vector, half: int) -> Vector:
        left = steps.felt[half] - (1.0 + GRAVITY * theta[0]) * steps.change[half]
        return np.concatenate([out @ left[own] for out, own in zip(segments, rows, strict=True)])

    cluster = np.repeat(np.arange(len(rows)), [len(own) for own in rows])
    least = np.full(len(cluster), 0.005)
    mean, sigma = (np.array([one]) for one in prior)
    found = fit(Residuals(of, np.zeros_like(cluster), cluster, least), Prior(mean, sigma))
    return float(found.theta[0]), float(found.sigma[0]), len(cluster)


def _without_grade(place: Vector) -> Vector:
    """Return the matrix that takes a parabola over `place` [m] out of values, shape (n, n)."""
    along = (place - place.mean()) / max(float(np.ptp(place)), 1.0)
    basis, _ = np.linalg.qr(np.stack([along**k for k in range(3)], axis=1))
    return np.asarray(np.eye(len(place)) - basis @ basis.T)


def accel_zero(windows: Windows, steps: Steps, pitch_gradient: float, closed: bool) -> Estimate:
    """Return the zero of accel_x [m/s^2]; `closed`: each drive ends at the height where it began."""
    kappa = 1.0 + GRAVITY * pitch_gradient
    rest = (steps.felt / kappa - steps.change).mean(axis=0)
    weight = np.maximum(steps.seconds * steps.speed, 0.0)
    turn = steps.yaw_rate**2
    columns = np.stack([np.ones_like(turn), turn, turn * steps.speed**2], axis=1)
    root = np.sqrt(weight)[:, None]
    wide = columns[:, : 3 if np.ptp(steps.yaw_rate) > 0.05 else 1]
    found = np.linalg.lstsq(root * wide, root[:, 0] * rest, rcond=None)[0]
    left = rest - wide @ found
    distance = float(weight.sum())
    block = (np.cumsum(weight) // BLOCK).astype(np.int64)
    sums, lengths = np.bincount(block, weight * left), np.bincount(block, weight)
    whole = lengths > 0.5 * BLOCK
    grades = sums[whole] / lengths[whole]
    count = int(whole.sum())
    grade = float(np.sqrt(np.mean(grades**2))) if count >= 4 else GRAVITY * USUAL_GRADE
    if closed:
        rolled = float(np.hypot(GRAVITY * HEIGHT * np.sqrt(len(np.unique(steps.drive))) / distance, MODEL))
    else:
        rolled = float(np.hypot(GRAVITY * ELSEWHERE / distance, MODEL))
        rolled = float(np.hypot(grade / np.sqrt(max(count, 1)), rolled))
    rolled = float(np.hypot(rolled, _by_curves(wide[:, 1:], weight, grade, block)))
    estimates = [(kappa * float(found[0]), kappa * rolled), *_standing(windows, steps, max(grade, 0.05))]
    return _combined(estimates)


def _by_curves(columns: Vector, weight: Vector, grade: float, block: Places) -> float:
    """Return the standard deviation of the mean effect of curves [m/s^2], by the grade of the blocks.

    Args:
        columns: regressors of the effect, shape (n, k).
        weight: distance of each step [m].
        grade: of a block of road, standard deviation [m/s^2].
        block: that a step is in; its grade is of its own.
    """
    if not columns.shape[1]:
        return 0.0
    mean = weight @ columns / weight.sum()
    apart = columns - mean
    inverse = np.linalg.pinv(apart.T @ (weight[:, None] * apart))
    scores = np.stack([np.bincount(block, grade * weight * one) for one in apart.T], axis=1)
    return float(np.linalg.norm(scores @ inverse @ mean))


def _standing(windows: Windows, steps: Steps, grade: float) -> list[Estimate]:
    """Return the reading of each standstill; `grade` [m/s^2] of the roads, which it holds."""
    found: list[Estimate] = []
    for drive in np.unique(windows.drive):
        own = np.flatnonzero((windows.drive == drive) & windows.standing)
        rolled = steps.drive == drive
        place = np.interp(windows.t[own], steps.at[rolled], np.cumsum((steps.seconds * steps.speed)[rolled]))
        while len(own):
            here = np.abs(place - place[0]) < APART
            if SECONDS * here.sum() >= LEAST_STAND:
                found.append((float(np.median(windows.accel[:, own[here]].mean(axis=0))), 1.4 * grade))
            own, place = own[~here], place[~here]
    return found


def _combined(estimates: list[Estimate]) -> Estimate:
    """Return the mean by weight; what is far from the median counts with a sigma that puts it at `GATE`."""
    values, sigmas = np.array(estimates).T
    far = np.abs(values - values[_middle(values, sigmas)])
    weights = 1.0 / np.maximum(sigmas, far / GATE) ** 2
    return float(weights @ values / weights.sum()), float(1.0 / np.sqrt(weights.sum()))


def _middle(values: Vector, sigmas: Vector) -> int:
    """Return the place of the median by weight."""
    order = np.argsort(values)
    shares = np.cumsum(1.0 / sigmas[order] ** 2)
    return int(order[np.searchsorted(shares, 0.5 * shares[-1])])


def yaw_zero(windows: Windows) -> Estimate | None:
    """Return the zero of the yaw rate of a car that stands [rad/s]; None: it does not, or none is sent."""
    still = np.flatnonzero(windows.standing & np.isfinite(windows.yaw_rate).all(axis=0))
    if len(still) * SECONDS < LEAST_STAND:
        return None
    seen = windows.yaw_rate[:, still].mean(axis=0)
    return float(seen.mean()), float(np.hypot(seen.std() / np.sqrt(len(still)), YAW_STEP))


def lateral_zero(windows: Windows, radius: float, yaw: Estimate) -> Estimate | None:
    """Return the zero of accel_y [m/s^2], which holds the mean bank of the roads; None: not sent."""
    rows = np.flatnonzero(windows.free & np.isfinite(windows.accel_y + windows.yaw_rate).all(axis=0))
    if len(rows) < FEWEST_WINDOWS:
        return None
    speed = windows.omega.mean(axis=(0, 1))[rows] * radius
    felt, turn = windows.accel_y[:, rows], windows.yaw_rate[:, rows]

    def of(theta: Vector, half: int) -> Vector:
        return np.asarray(felt[half] - theta[0] * speed * (turn[half] - theta[2]) - theta[1])

    cluster = windows.cluster[rows]
    prior = Prior(np.array([1.05, 0.0, yaw[0]]), np.array([0.1, 0.5, yaw[1]]))
    found = fit(Residuals(of, np.zeros_like(cluster), cluster, np.full(len(rows), 0.005)), prior)
    return float(found.theta[1]), float(np.hypot(found.sigma[1], BANK / np.sqrt(len(np.unique(cluster)))))
