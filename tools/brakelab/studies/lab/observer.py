"""The joint observer in the four manoeuvres of Table 2.1: in a car, without a dynamometer.

A trip of applications of the kinds of `friction/trips.py` in closed loop, cars of the wide draw. The observer
has the car's configuration and the learned values of ten minutes of ordinary driving; the front linings are
of brake A under one of three laws, at a level other than the configured one. Counted as in `bench observers`:
from 0.8 s after the brakes of both axles are applied, above 15 km/h.

Its limits are measured by cars with one thing as configured, all else as drawn.
"""

import re
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.identify.friction.trips import GENTLE, HIGH, LOW, MILD
from brakelab.simulation.accuracy import friction_errors
from brakelab.simulation.closed_loop import Drive
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.scenario import Phase, Scenario
from brakelab.simulation.scenario_car import with_draw
from brakelab.stretches import stretches
from brakelab.studies.accuracy.observers import JOINT, ORDINARY, counted, drive_car
from brakelab.studies.accuracy.observers_cases import Setup
from brakelab.studies.study import WIDE
from ecu.recording.learned_range import out_of_range
from ecu.settings.config import new_params
from ecu.settings.resources import resource

CARS: Final = 8
BRAKINGS: Final = 6  # of each kind
KINDS: Final = "ABCD"
CRUISE: Final = 12.0  # s before each brake application
LOWEST_SPEED: Final = 40.0 / 3.6  # m/s, at the start of a brake application
HIGHEST_SPEED: Final = 130.0 / 3.6
LEAST_DECEL: Final = 0.5  # m/s^2
GREATEST_DECEL: Final = 3.5


AS_DRAWN: Final = "as drawn"
CAUSES: Final[dict[str, dict[str, str]]] = {
    AS_DRAWN: {},
    "zeros of accelerometer and pressure sensors known": {"accel_zero": "0.0", "pressure_zero": "0.0"},
    "drag and rolling resistance known": {"drag": "0.0", "rolling_resistance": "0.0"},
    "half the noise of every sensor": {"sensor_noise": "[0.5, 0.5]"},
    "torque of the motors known": {"motor_torque_scale": "0.0", "motor_torque_noise": "[0.0, 0.0]"},
    "mass and centre of gravity known": {"mass": "0.0", "cog_height": "0.0", "cog_place": "0.0"},
    "push-out pressure known": {"push_out_pressure": "0.0"},
    "linings all of SIM": {"friction_laws": '["SIM"]'},
    "push-out pressure known, linings of SIM": {"push_out_pressure": "0.0", "friction_laws": '["SIM"]'},
}
"""Lines of the draw's file that are changed."""


class OnTrip(NamedTuple):
    """One car: nRMSE [%] of the front axle by kind."""

    cause: str
    cold: dict[str, float]  # unadapted
    adapted: dict[str, float]
    nominal: dict[str, float]  # the configured constant


def trip_of_kinds(seed: int) -> tuple[Scenario, str]:
    """Return a trip, drawn by `seed`, and the kinds of its brake applications in order."""
    random = np.random.default_rng(seed)
    kinds = "".join(random.permutation(list(KINDS * BRAKINGS)))
    phases = []
    for kind in kinds:
        low, high = (LOWEST_SPEED, LOW) if kind in "AC" else (HIGH, HIGHEST_SPEED)
        speed = float(random.uniform(low, high))
        soft, hard = (MILD, GREATEST_DECEL) if kind in "AB" else (LEAST_DECEL, GENTLE)
        end = speed * float(random.uniform(0.4, 0.7))
        phases.append(Phase(kind="cruise", speed=speed, seconds=CRUISE))
        phases.append(Phase(kind="brake", decel=float(random.uniform(soft, hard)), until_speed=end))
    trip = shipped("sensitivity").model_copy(update={"phase": phases})
    return trip, kinds


def brakings(drive: Drive) -> list[NDArray[np.bool_]]:
    """Return the counted rows of each brake application, in order; shape (n,) each."""
    asked = drive.truth["decel_demand"] > 0.05
    rows = counted(drive)
    place = np.arange(len(drive.t))
    return [rows & (place >= begin) & (place < end) for begin, end in stretches(asked)]


def plant_files(folder: Path, changes: dict[str, str]) -> str:
    """Write the shipped cars into `folder`, their wide draw with `changes`; return the path of the SUV."""
    for path in resource("config/plant").glob("*.toml"):
        shutil.copy(path, folder)
    draw = folder / "draw.toml"
    wide, rest = draw.read_text("utf-8").split("[nominal]")
    for key, value in changes.items():
        wide, count = re.subn(rf"^{key} = .*$", f"{key} = {value}", wide, flags=re.MULTILINE)
        assert count == 1, key
    draw.write_text(f"{wide}[nominal]{rest}", "utf-8")
    return str(folder / "suv.toml")


def on_trip(job: tuple[str, int]) -> OnTrip:
    """Return the errors of the joint observer in one car, cold and adapted; `job`: cause and seed."""
    cause, seed = job
    config = configured()
    trip, kinds = trip_of_kinds(seed)
    with TemporaryDirectory() as name:
        car = {"plant": plant_files(Path(name), CAUSES[cause])}
        setup = Setup(with_draw(trip.model_copy(update=car), WIDE), config)
        before = Setup(with_draw(shipped(ORDINARY).model_copy(update=car), WIDE), config)
        _, learned = drive_car(before, JOINT, seed)
        kept = None if out_of_range(learned, new_params(config)["mu_nominal"][0]) else learned
        cold, nominal = _errors(drive_car(setup, JOINT, seed)[0], kinds)
        adapted, _ = _errors(drive_car(setup, JOINT, seed, kept)[0], kinds)
    return OnTrip(cause, cold, adapted, nominal)


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
