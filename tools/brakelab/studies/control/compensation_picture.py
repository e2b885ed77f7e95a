"""Figures 5.8 to 5.12 of the thesis, redrawn with one car."""

from typing import Final

import numpy as np

from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK, Line, Panel
from brakelab.simulation.accuracy import AXLES, columns
from brakelab.studies.control.blending import SHARES, WRONG, wrong_friction
from brakelab.studies.control.compensation import CURVES, RUNS, Run, applications, drive_all
from ecu.settings.config import Config

LEGEND: Final = [
    ("ideal; true friction (dashed)", GREY),
    ("compensated; its estimate", ORANGE),
    ("uncompensated", BLUE),
    ("under-braking", GREEN),
    ("over-braking", PINK),
]


def _over_blending() -> Panel:
    lines = []
    for ratio, colour in ((1.0 + WRONG, GREEN), (1.0 - WRONG, PINK)):
        for compensate in (False, True):
            errors = [wrong_friction(share, ratio, compensate, 0) for share in SHARES]
            lines.append(Line(np.array(SHARES), np.array(errors), ORANGE if compensate else colour))
    return Panel("Figure 5.8: torque error over the demand, RMS [%]", "f", (0.0, 0.8), (0.0, 20.0), lines)


def _over_time(title: str, runs: dict[str, Run]) -> list[Panel]:
    lines = [Line(r.drive.t, r.decel, RUNS[kind], kind == "ideal") for kind, r in runs.items()]
    friction = []
    for axle in AXLES:
        drive = runs["compensated"].drive
        rows = np.ones(len(drive.t), np.bool_)
        friction.append(Line(drive.t, columns(drive.truth, "mu_b", axle, rows).mean(axis=0), GREY, True))
        friction.append(Line(drive.t, columns(drive.outputs, "mu_b", axle, rows).mean(axis=0), ORANGE))
    end = float(max(r.drive.t[-1] for r in runs.values()))
    return [
        Panel(f"{title}: deceleration [m/s²]", "t [s]", (0.0, end), (0.0, 6.0), lines),
        Panel(f"{title}: friction [–], rear above front", "t [s]", (0.0, end), (0.3, 0.7), friction),
    ]


def _curve(title: str, runs: dict[str, Run]) -> Panel:
    lines = []
    for kind, r in runs.items():
        rows = applications(r.drive)[1]
        pedal = r.drive.truth["pedal_position"][rows]
        arrived = int(np.argmax(pedal))
        lines.append(Line(pedal[:arrived], r.decel[rows][:arrived], RUNS[kind], kind == "ideal"))
    return Panel(f"{title}: deceleration [m/s²]", "pedal [%]", (0.0, 80.0), (0.0, 8.0), lines)


def pictured(config: Config) -> list[Panel]:
    """Drive car 0 and return the panels of Figures 5.8 to 5.12."""
    panels: list[Panel] = []
    for name, title in (
        ("repeated", "Figure 5.9, f = 0"),
        ("repeated, motors take 70 %", "Figure 5.10, f = 0.7"),
    ):
        panels += _over_time(title, drive_all(name, config, 0))
    titles = (
        "Figure 5.11a, 150 mm/s, f = 0",
        "Figure 5.12a, 50 mm/s, f = 0",
        "Figure 5.11b, 150 mm/s, f = 0.7",
        "Figure 5.12b, 50 mm/s, f = 0.7",
    )
    curves = dict(zip(titles, CURVES, strict=True))
    panels += [_curve(title, drive_all(curves[title], config, 0)) for title in sorted(titles)]
    return [*panels, _over_blending()]
