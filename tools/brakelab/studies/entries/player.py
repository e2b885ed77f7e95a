"""One entry hears one drive, cycle by cycle."""

import sys
from collections.abc import Collection
from contextlib import redirect_stdout
from time import thread_time_ns
from typing import Any, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.studies.entries.drives import NAMES, PERIOD, WITHHELD, Track
from brakelab.studies.entries.inputs import Inputs
from brakelab.studies.entries.observer import EntryError, Observer
from ecu.settings.config import Config


class Known(NamedTuple):
    """Further estimates of an entry beside friction; NaN: it gives none."""

    mass: float = float("nan")
    overrun: float = float("nan")
    pressure_zero: Vector = np.full(4, np.nan)


class Heard(NamedTuple):
    """Answers of an entry to a drive."""

    mu: Vector
    """Shape (n, 4)."""
    sigma: Vector
    """Shape (n, 4), NaN: not stated."""
    us: float
    """Processor time of a step, mean [µs]."""
    known: dict[int, Known]
    """After the rows asked for."""


FAILURES = (Exception, SystemExit)
"""Of an entry, whose failure is its result: it may not end the bench either."""


def _failed(what: str, error: BaseException, where: str) -> EntryError:
    return EntryError(f"{what} raised {type(error).__name__}: {str(error).partition(chr(10))[0]}{where}")


def new_entry(kind: type[Observer]) -> Observer:
    """Return an entry before its first car. Raises EntryError if it cannot be made."""
    try:
        with redirect_stdout(sys.stderr):
            return kind()
    except FAILURES as error:
        raise _failed(kind.__name__, error, "") from None


def reset(entry: Observer, config: Config) -> None:
    """Let the entry begin with another car. Raises EntryError if it fails."""
    try:
        with redirect_stdout(sys.stderr):
            entry.reset(config)
    except FAILURES as error:
        raise _failed("reset", error, "") from None


def _four(answer: Any, where: str) -> tuple[Vector, Vector]:
    try:
        mu, sigma = answer
    except (TypeError, ValueError):
        raise EntryError(f"step returned no pair of friction and sigma{where}") from None
    four = []
    for name, values in (("friction", mu), ("sigma", sigma)):
        try:
            array = np.asarray(values, np.float64)
        except (TypeError, ValueError):
            raise EntryError(f"step returned {name} that is not four numbers{where}") from None
        if array.shape != (4,):
            raise EntryError(f"step returned {name} of shape {array.shape}, not (4,){where}")
        four.append(array)
    if not np.isfinite(four[0]).all():
        raise EntryError(f"step returned friction that is not finite{where}")
    if (four[1] < 0.0).any() or np.isinf(four[1]).any():
        raise EntryError(f"step returned sigma below 0 or infinite{where}")
    return four[0], four[1]


def _known(entry: Observer) -> Known:
    values = {name: getattr(entry, name) for name in Known._fields if hasattr(entry, name)}
    known = Known(**values)
    zero = np.asarray(known.pressure_zero, np.float64)
    if zero.shape != (4,):
        raise EntryError(f"pressure_zero has shape {zero.shape}, not (4,)")
    return Known(float(known.mass), float(known.overrun), zero.copy())


def play(entry: Observer, track: Track, asked: Collection[int] = ()) -> Heard:
    """Play a drive to an entry and return its answers; `asked`: rows after which `Known` is noted.

    Raises:
        EntryError: it raised, or returned what is not friction and sigma of four brakes.
    """
    values = track.values.copy()
    if not getattr(entry, "wheel_transducers", False):
        values[:, WITHHELD] = np.nan
    values.setflags(write=False)
    signals = frozenset(NAMES[place] for place in np.flatnonzero(np.isfinite(values).any(axis=0)))
    n = len(values)
    mu, sigma, took = np.empty((n, 4)), np.empty((n, 4)), 0
    known = {}
    with redirect_stdout(sys.stderr):
        for k in range(n):
            inputs = Inputs(values[k], k * PERIOD, PERIOD, signals)
            began = thread_time_ns()
            try:
                answer = entry.step(inputs)
            except FAILURES as error:
                raise _failed("step", error, f", {track.name}, t = {k * PERIOD:.2f} s") from None
            took += thread_time_ns() - began
            mu[k], sigma[k] = _four(answer, f", {track.name}, t = {k * PERIOD:.2f} s")
            if k in asked:
                try:
                    known[k] = _known(entry)
                except EntryError:
                    raise
                except FAILURES as error:
                    raise _failed("mass, overrun or pressure_zero", error, "") from None
    return Heard(mu, sigma, 1e-3 * took / n, known)
