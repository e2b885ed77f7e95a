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
    """A line of the table of brake applications."""

    braking: Braking
    friction_front: str
    friction_rear: str
    sparkline: str


def brakings_table(drive: DriveResult, found: Sequence[Braking]) -> dict[str, Any]:
    """Return what the template of the table asks for."""
    rows = [
        Row(
            braking,
            friction_text(braking.friction[:2], braking.friction_sigma[:2]),
            friction_text(braking.friction[2:], braking.friction_sigma[2:]),
            sparkline,
        )
        for braking, sparkline in zip(found, sparklines(drive, [*found]), strict=True)
    ]
    return {
        "brakings": rows,
        "with_temperature": any(np.isfinite(braking.temperature_in[:2]).all() for braking in found),
        "with_sparklines": any(row.sparkline for row in rows),
        "with_energy": any(np.isfinite(braking.energy) for braking in found),
    }


def notebook(drive: DriveResult, result: Path, title: str) -> str:
    """Return the brake applications of a result as HTML for a notebook.

    Raises UserError when their file is damaged.
    """
    content = brakings_table(drive, brakings(drive, result))
    template = environment().from_string(NOTEBOOK.read_text("utf-8"))
    return template.render(title=title, zooms=False, demand=DEMAND, **content)
