"""Brake applications as CSV in the page itself: a link that needs no network."""

import csv
import io
import math
from collections.abc import Sequence
from urllib.parse import quote

from brakelab.report.brakings import Braking
from brakelab.report.response import Response
from ecu.contract.signals import CORNERS

HEAD = (
    "number", "t_start [s]", "duration [s]", "v_in [km/h]", "v_end [km/h]", "demanded [m/s^2]",
    "achieved [m/s^2]", "predicted [m/s^2]", "specific_force [m/s^2]", "specific_force_predicted [m/s^2]",
    "energy [kJ]",
    *(f"{name}_{corner} {unit}" for name, unit in (
        ("mu_b_before", "[-]"), ("mu_b_after", "[-]"), ("sigma_mu_b_after", "[-]"),
        ("disc_temperature_in", "[degC]"),
    ) for corner in CORNERS),
    "build_up_demand [s]",
    *(f"{name}_{axle} {unit}" for name, unit in (
        ("build_up", "[s]"), ("delay", "[s]"), ("gradient", "[bar/s]"), ("plateau", "[bar]"),
        ("pressure_left_right", "[%]"), ("friction_left_right", "[%]"),
    ) for axle in ("front", "rear")),
    "motors_share [%]", "left_out",
)  # fmt: skip
"""First line; units in brackets, percentages are left minus right over their mean."""


def csv_of(found: Sequence[Braking], rows: Sequence[Response]) -> str:
    """Return the brake applications as text; unknown values are empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(HEAD)
    for braking, row in zip(found, rows, strict=True):
        sides = [100.0 * value for value in (*row.pressure_sides, *row.friction_sides)]
        values = [
            braking.t_start, braking.t_end - braking.t_start, 3.6 * braking.v_in, 3.6 * braking.v_end,
            braking.demanded, braking.achieved, braking.predicted, braking.force.measured,
            braking.force.predicted, 1e-3 * braking.energy,
            *braking.before, *braking.friction, *braking.friction_sigma, *braking.temperature_in,
            row.demand, *row.build_up, *row.delay, *row.gradient, *row.plateau, *sides, 100.0 * row.motors,
        ]  # fmt: skip
        writer.writerow([braking.number, *map(_text, values), braking.left_out])
    return text.getvalue()


def csv_link(found: Sequence[Braking], rows: Sequence[Response]) -> str:
    """Return the address of a link to download them, empty without any."""
    return f"data:text/csv;charset=utf-8,{quote(csv_of(found, rows))}" if found else ""


def _text(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""
