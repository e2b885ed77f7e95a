"""Brake applications of a drive, from `<name>.brakes.parquet` where present, else from the result."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.report.drive import DriveResult
from brakelab.results.columns import open_columns
from brakelab.results.files import brakes_path
from brakelab.results.prediction import SHORT, left_out
from brakelab.stretches import stretches
from ecu.algorithm.estimate import STANDING
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

PERIOD = 0.01  # s, one row

_PER_BRAKE = ("t_start", "duration", "v_in", "v_end", "decel_mean", "decel_predicted")
_REMEDY = "write it again with `brake-ecu replay`, or remove it: the report then uses the result alone"


class Force(NamedTuple):
    """Mean specific force of an application [m/s^2], positive braking; NaN: not known."""

    measured: float
    predicted: float
    sigma: float
    """Standard deviation of `predicted`."""
    configured: float
    """Predicted with the configured friction."""
    configured_rest: float
    """Part of it that is not the linings'."""


_OF_FORCE = (
    "specific_force_mean",
    "specific_force_predicted",
    "sigma_specific_force",
    "specific_force_configured",
    "specific_force_configured_rest",
)
_UNKNOWN = Force(*[float("nan")] * 5)


class Braking(NamedTuple):
    """One brake application. Speeds in m/s, decelerations in m/s^2, magnitudes; NaN: not known."""

    number: int
    t_start: float
    t_end: float
    v_in: float
    v_end: float
    demanded: float
    """Mean of the demand over the application; it counts as 0 while the vehicle stands, as in `achieved`."""
    achieved: float
    """(v_in - v_end) / duration."""
    predicted: float
    """Of `achieved`, from pressures and the friction known before this application."""
    friction: Vector
    """Friction known after the application, per corner, shape (4,): the next one is predicted with it."""
    friction_sigma: Vector
    temperature_in: Vector
    """Of the discs at the start [degC], shape (4,)."""
    energy: float
    """Into the four brakes [J]."""
    force: Force
    before: Vector
    """Friction known before the brake application, per corner, shape (4,)."""
    before_sigma: Vector
    left_out: str
    """Why the prediction does not count, empty where it does."""


def brakings(drive: DriveResult, result: Path) -> list[Braking]:
    """Return the brake applications of a drive in order, without taps shorter than `SHORT`.

    Raises UserError when their file is damaged.
    """
    path = brakes_path(result)
    found = _from_file(drive, path) if path.exists() else _from_result(drive)
    lasting = [braking for braking in found if braking.t_end - braking.t_start >= SHORT]
    return [braking._replace(number=number) for number, braking in enumerate(lasting, 1)]


def inside(drive: DriveResult, braking: Braking, before: float = 0.0) -> slice:
    """Return the rows of the brake application and of `before` [s] ahead of it."""
    first = np.searchsorted(drive.t, braking.t_start - before)
    return slice(int(first), int(np.searchsorted(drive.t, braking.t_end, "right")))


def inside_any(drive: DriveResult, found: list[Braking]) -> NDArray[np.bool_]:
    """Return the rows of all brake applications, shape (n,)."""
    rows = np.zeros(len(drive.t), bool)
    for braking in found:
        rows[inside(drive, braking)] = True
    return rows


def mean_known(values: Vector) -> float:
    """Return the mean of the finite values, NaN where there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else float("nan")


def _demand(drive: DriveResult) -> Vector:
    stands = np.abs(drive.column("vehicle_speed")) < STANDING
    return drive.column("decel_demand_total") * ~stands


def _from_file(drive: DriveResult, path: Path) -> list[Braking]:
    table = open_columns(path, _REMEDY, ("brake", "corner", *_PER_BRAKE, "mu_b_mean"))
    corner, brake = table.columns["corner"], table.numbers("brake")
    per_brake = {name: table.numbers(name) for name in _PER_BRAKE}
    temperature, energy = map(table.known_numbers, ("disc_temperature_in", "brake_energy"))
    friction = table.numbers("mu_b_end" if "mu_b_end" in table.columns else "mu_b_mean")
    sigma, before, before_sigma = map(
        table.known_numbers, ("sigma_mu_b_end", "mu_b_before", "sigma_mu_b_before")
    )
    forces = [table.known_numbers(name) for name in _OF_FORCE]
    reasons = table.columns.get("left_out")
    demand, found = _demand(drive), []
    for number in np.unique(brake):
        rows = np.flatnonzero(brake == number)
        place = {str(corner[row]): row for row in rows}
        if set(place) != set(CORNERS):
            raise UserError(str(path), f"brake {number:.0f}", "needs one row each for " + ", ".join(CORNERS))
        order = [place[name] for name in CORNERS]
        t_start, duration, v_in, v_end, achieved, predicted = (
            float(per_brake[name][order[0]]) for name in _PER_BRAKE
        )
        braking = Braking(
            0, t_start, t_start + duration, v_in, v_end, float("nan"), achieved, predicted,
            friction[order], sigma[order], temperature[order], float(energy[order].sum()),
            Force(*(float(column[order[0]]) for column in forces)),
            before[order], before_sigma[order],
            str(reasons[order[0]] or "") if reasons is not None else left_out(duration, achieved, predicted),
        )  # fmt: skip
        found.append(braking._replace(demanded=mean_known(demand[inside(drive, braking)])))
    return found


def _from_result(drive: DriveResult) -> list[Braking]:
    name = "braking" if drive.has("braking") else "decel_demand_total"
    busy = np.nan_to_num(drive.column(name)) > 0.5
    friction, sigma = drive.corners("mu_b"), drive.corners("sigma_mu_b")
    temperature = drive.corners("disc_temperature")
    speed = drive.column("vehicle_speed")
    demand, found = _demand(drive), []
    for first, end in stretches(busy):
        last = end - 1
        duration = max(float(drive.t[last] - drive.t[first]), PERIOD)
        found.append(
            Braking(
                number=0,
                t_start=float(drive.t[first]),
                t_end=float(drive.t[last]),
                v_in=float(speed[first]),
                v_end=float(speed[last]),
                demanded=mean_known(demand[first:end]),
                achieved=float(speed[first] - speed[last]) / duration,
                predicted=float("nan"),
                friction=friction[min(end, len(friction) - 1)],
                friction_sigma=sigma[min(end, len(friction) - 1)],
                temperature_in=temperature[first],
                energy=float("nan"),
                force=_UNKNOWN,
                before=friction[max(first - 1, 0)],
                before_sigma=sigma[max(first - 1, 0)],
                left_out="no prediction",
            )
        )
    return found
