"""`brake-ecu bench compensation`: what compensation is worth, Figures 5.8 to 5.12 redrawn with one car."""

from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK, Line, Panel, write_chart
from brakelab.results.processes import run_each
from brakelab.simulation.accuracy import AXLES, columns
from brakelab.simulation.configured import configured
from brakelab.studies.control.blending import SHARES, WRONG, wrong_friction
from brakelab.studies.control.compensation import CARS, CURVES, RUNS, Run, applications, drive_all, one_car
from brakelab.studies.control.compensation_table import compensation_tables
from brakelab.studies.study import Asked, Measured, Study
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


TEXT: Final = (
    "Manoeuvres of section 5.7 and fade (6.2.3) in closed loop with the ECU of config/suv.toml, motors at "
    "rest but where it says so (then the ECU blends, f = 0.7 on both axles); cars are drawn per seed from "
    "config/plant/suv.toml, nothing was learned before. Ideal: the same controller in the same car, given "
    "the true friction. Achieved: brake and motor torque over radius and mass, all true. Uncompensated: "
    "nominal friction always. Under, over: given 1.15 and 0.85 of the true friction (section 5.6).\n\n"
    "![Figures 5.8 to 5.12 with car 0](images/compensation.svg)\n\nCar 0; pedal curves of its second "
    "application. In 5.8 friction is a constant that the configuration has 15 % too high or too low."
)


def _run(asked: Asked) -> Measured:
    config = configured()
    cars = run_each("compensation", partial(one_car, config), range(CARS))

    def draw(folder: Path) -> None:
        panels = pictured(config)
        write_chart(folder / "compensation.svg", panels, LEGEND)

    return Measured(compensation_tables(cars), draw=draw)


STUDY: Final = Study("What compensation is worth", TEXT, _run)
