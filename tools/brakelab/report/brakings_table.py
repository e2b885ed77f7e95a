"""The table of brake applications, of the page and of a notebook."""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.report.brakings import Braking, brakings
from brakelab.report.drive import DriveResult
from brakelab.report.look import DEMAND
from brakelab.report.page import environment
from brakelab.report.prediction import friction_text
from brakelab.report.sparkline import sparklines

NOTEBOOK: Final = files("brakelab.report") / "notebook.html.j2"


class Row(NamedTuple):
    """A line of the table of brake applications, in the page's units."""

    number: int
    t_start: float
    t_end: float
    duration: float
    v_in: float
    v_end: float
    demanded: float
    achieved: float
    predicted: float
    friction_front: str
    friction_rear: str
    temperature_front: float
    temperature_rear: float
    kilojoules: float
    sparkline: str


def brakings_table(drive: DriveResult, found: Sequence[Braking]) -> dict[str, Any]:
    """Return what the template of the table asks for."""
    rows = [_row(*pair) for pair in zip(found, sparklines(drive, [*found]), strict=True)]
    return {
        "brakings": rows,
        "with_temperature": any(np.isfinite(row.temperature_front) for row in rows),
        "with_sparklines": any(row.sparkline for row in rows),
        "with_energy": any(np.isfinite(row.kilojoules) for row in rows),
    }


def notebook(drive: DriveResult, result: Path, title: str) -> str:
    """Return the brake applications of a result as HTML for a notebook.

    Raises UserError when their file is damaged.
    """
    content = brakings_table(drive, brakings(drive, result))
    template = environment().from_string(NOTEBOOK.read_text("utf-8"))
    return template.render(title=title, zooms=False, demand=DEMAND, **content)


def _row(braking: Braking, sparkline: str) -> Row:
    return Row(
        number=braking.number,
        t_start=braking.t_start,
        t_end=braking.t_end,
        duration=braking.t_end - braking.t_start,
        v_in=braking.v_in,
        v_end=braking.v_end,
        demanded=braking.demanded,
        achieved=braking.achieved,
        predicted=braking.predicted,
        friction_front=friction_text(braking.friction[:2], braking.friction_sigma[:2]),
        friction_rear=friction_text(braking.friction[2:], braking.friction_sigma[2:]),
        temperature_front=float(braking.temperature_in[:2].mean()),
        temperature_rear=float(braking.temperature_in[2:].mean()),
        kilojoules=braking.energy * 1e-3,
        sparkline=sparkline,
    )
