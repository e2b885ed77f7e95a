"""The report's section on the brakes: torque, distribution, response, work, and the gaps of a drive."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from brakelab.report.ak_table import Section as Conditions
from brakelab.report.ak_table import fade, observed, sections
from brakelab.report.brakings import Braking
from brakelab.report.csv_table import csv_link
from brakelab.report.distribution import plots_of_distribution
from brakelab.report.drive import DriveResult
from brakelab.report.energy import Work, plots_of_energy, works
from brakelab.report.response import LEAST_BAR, Response, plots_of_response, responses
from brakelab.report.torque import plots_of_torque
from brakelab.report.wear_missing import Missing
from brakelab.results.car import KEY, Car, unpacked
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

_AGAIN = "the result does not state its car: write it again with brake-ecu replay."


class Section(NamedTuple):
    """Content of the template."""

    conditions: list[Conditions]
    fades: list[str]
    responses: list[Response]
    works: list[Work]
    dense: bool
    """The size of the pads is known."""
    csv: str
    """Address of the download."""
    missing: list[Missing]


def read_car(drive: DriveResult, result: Path) -> Car | None:
    """Return the car that the result states, None: none. Raises UserError if it is damaged."""
    try:
        return unpacked(drive.metadata.get(KEY, ""))
    except (ValueError, TypeError) as error:
        remedy = f"not readable ({error!r}); write the result again with `brake-ecu replay`"
        raise UserError(str(result), f"metadata {KEY}", remedy) from None


def brakes_section(
    drive: DriveResult,
    truth: DriveResult | None,
    car: Car | None,
    found: list[Braking],
    without_pressure: bool,
) -> tuple[Section, dict[str, dict[str, Any]]]:
    """Return the section on a drive of `car` and its plots by place."""
    rows = responses(drive, found)
    csv = csv_link(found, rows)
    places = ("torque_plots", "distribution_plots", "response_plots", "energy_plots")
    plots: dict[str, dict[str, Any]] = {place: {} for place in places}
    if without_pressure or not found:
        return Section([], [], [], [], False, csv, _of_drive(drive)), plots
    applications = observed(drive, found)
    done: list[Work] = []
    if car is not None:
        done = works(drive, found, car)
        plots = {
            "torque_plots": plots_of_torque(drive, truth, found, car),
            "distribution_plots": plots_of_distribution(drive, truth, found, car),
            "response_plots": {},
            "energy_plots": plots_of_energy(drive, found, car) if done else {},
        }
    plots["response_plots"] = plots_of_response(rows)
    dense = car is not None and bool(np.isfinite(car.pad_area).all())
    some = [row for row in rows if any(math.isfinite(each) for each in (*row.plateau, *row.friction_sides))]
    section = Section(
        sections(applications),
        [fade(axle, mine) for axle, mine in applications.items() if mine],
        some,
        done,
        dense,
        csv,
        [*_of_plots(plots, car, applications, some, done, dense), *_of_drive(drive)],
    )
    return section, plots


def _of_plots(
    plots: dict[str, dict[str, Any]],
    car: Car | None,
    applications: dict[str, Any],
    rows: list[Response],
    done: list[Work],
    dense: bool,
) -> list[Missing]:
    found = []
    if car is None:
        found.append(Missing("Specific torque, distribution, energy of each brake", _AGAIN))
    else:
        if not plots["torque_plots"]:
            reason = "friction was observed for less than a second on either axle."
            found.append(Missing("Specific torque, C*", reason))
        if not plots["distribution_plots"]:
            reason = "the torques of the brakes are known for less than half a second of braking."
            found.append(Missing("Distribution of brake force", reason))
        if not done:
            found.append(Missing("Energy and power of each brake", "no brake torque is in this result."))
        elif not dense:
            reason = "CONFIG names no [front.pad] and [rear.pad] with their area; power stands in kW."
            found.append(Missing("Power density", reason))
    if not any(applications.values()):
        reason = "no brake application had 0.3 s of observed friction above 5 km/h."
        found.append(Missing("Friction by section", reason))
    if not any(math.isfinite(each) for row in rows for each in row.build_up):
        reason = f"no pressure rose from nothing to a plateau above {LEAST_BAR:.0f} bar."
        found.append(Missing("Build-up of pressure", reason))
    return found


def _of_drive(drive: DriveResult) -> list[Missing]:
    """Return the reasons for plots over the drive that are left out."""
    found = []
    if not any(drive.has(f"slip_{corner}") for corner in CORNERS):
        reason = "no slip is in this result: no wheel speed came in, or the car never rolled."
        found.append(Missing("Slip and speeds of the wheels", reason))
    if not any(np.nan_to_num(drive.column(f"motor_torque_{corner}")).any() for corner in CORNERS):
        found.append(Missing("Motors' share over time", "no motor torque is in this log, or it is always 0."))
    if not drive.has("accelerator_position"):
        found.append(Missing("Accelerator", "its position is not in this log."))
    return found
