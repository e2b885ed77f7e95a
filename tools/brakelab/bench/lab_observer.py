"""The joint observer in the four manoeuvres of Table 2.1: in a car, without a dynamometer.

A trip of brakings of the kinds of `friction_lab.trips` in closed loop, cars of the wide draw. The observer
knows of the car what its configuration says and what ten minutes of ordinary driving taught it; its front
linings are of brake A under one of three laws, of a level that is not the configured one. Counted as in
`bench observers`: from 0.8 s after the brakes of both axles came on, above 15 km/h.
"""

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.friction_lab.trips import GENTLE, HIGH, LOW, MILD
from brakelab.simulation.closed_loop import Drive
from brakelab.simulation.scenario import Phase, Scenario
from brakelab.simulation.scenario_car import with_draw
from brakelab.studies.observers import JOINT, ORDINARY, WIDE, counted, drive_car
from brakelab.studies.observers_cases import Setup, configured, shipped
from brakelab.studies.stops import friction_errors
from ecu.recording.store import out_of_range
from ecu.settings.config import new_params

CARS: Final = 8
BRAKINGS: Final = 6  # of each kind
KINDS: Final = "ABCD"
CRUISE: Final = 12.0  # s before each braking
SLOWEST: Final = 40.0 / 3.6  # m/s, at the start of a braking
FASTEST: Final = 130.0 / 3.6
SOFTEST: Final = 0.5  # m/s^2
HARDEST: Final = 3.5


class OnTrip(NamedTuple):
    """One car: nRMSE [%] of the front axle by kind."""

    cold: dict[str, float]  # nothing learned before
    adapted: dict[str, float]
    nominal: dict[str, float]  # the configured constant


def trip_of_kinds(seed: int) -> tuple[Scenario, str]:
    """Return a trip, drawn by `seed`, and the kinds of its brakings in order."""
    random = np.random.default_rng(seed)
    kinds = "".join(random.permutation(list(KINDS * BRAKINGS)))
    phases = []
    for kind in kinds:
        low, high = (SLOWEST, LOW) if kind in "AC" else (HIGH, FASTEST)
        speed = float(random.uniform(low, high))
        soft, hard = (MILD, HARDEST) if kind in "AB" else (SOFTEST, GENTLE)
        end = speed * float(random.uniform(0.4, 0.7))
        phases.append(Phase(kind="cruise", speed=speed, seconds=CRUISE))
        phases.append(Phase(kind="brake", decel=float(random.uniform(soft, hard)), until_speed=end))
    trip = shipped("sensitivity").model_copy(update={"phase": phases})
    return trip, kinds


def brakings(drive: Drive) -> list[NDArray[np.bool_]]:
    """Return the rows that count of each braking, in order; shape (n,) each."""
    asked = drive.truth["decel_demand"] > 0.05
    edges = np.flatnonzero(np.diff(np.concatenate([[False], asked, [False]]).astype(int)))
    rows = counted(drive)
    place = np.arange(len(drive.t))
    spans = list(pairwise(edges))[::2]
    return [rows & (place >= begin) & (place < end) for begin, end in spans]


def on_trip(seed: int) -> OnTrip:
    """Return the errors of the joint observer in one car, cold and adapted."""
    config = configured()
    trip, kinds = trip_of_kinds(seed)
    setup = Setup(with_draw(trip, WIDE), config)
    before = Setup(with_draw(shipped(ORDINARY), WIDE), config)
    _, learned = drive_car(before, JOINT, seed)
    kept = None if out_of_range(learned, new_params(config)["mu_nominal"][0]) else learned
    cold, nominal = _errors(drive_car(setup, JOINT, seed)[0], kinds)
    adapted, _ = _errors(drive_car(setup, JOINT, seed, kept)[0], kinds)
    return OnTrip(cold, adapted, nominal)


def _errors(drive: Drive, kinds: str) -> tuple[dict[str, float], dict[str, float]]:
    """Return the nRMSE [%] of the front axle by kind, of the observer and of the constant."""
    found = brakings(drive)
    assert len(found) == len(kinds)
    observer, constant = {}, {}
    nominal = float(configured().front.mu_nominal)
    for kind in KINDS:
        of_kind = [rows for rows, its in zip(found, kinds, strict=True) if its == kind]
        rows: NDArray[np.bool_] = np.any(of_kind, axis=0)
        observer[kind], _, constant[kind] = friction_errors(drive, rows, "front", nominal)
    return observer, constant
