"""Chapter 6 of the thesis: Observer 2 tuned by hand and by genetic algorithm, per brake application.

The tuning is searched on cars 0 to 3 in the first session (Table 6.1), all is judged on cars 4 to 7. The
joint observer, which is the default, drives the same sessions.

deviation   mean of the estimate over the mean of the true friction in a brake application, - 1
"""

from collections.abc import Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.tuning.command import FIRST_SESSION, LATER_SESSIONS, Budget, find_tuning, record_drives
from brakelab.identify.tuning.recording import Application, application_errors, drive_once
from brakelab.identify.tuning.search import RANGES
from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, Line, Panel
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.results.verdict import Goal, met, verdict
from brakelab.simulation.accuracy import AXLES
from brakelab.simulation.configured import with_observer
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.scenario_car import with_draw
from brakelab.studies.study import Asked, Measured, Study, picture
from ecu.settings.config import Config, config_hash, load_config
from ecu.settings.resources import resource

CARS: Final = 4
BUDGET: Final = Budget(generations=20, population=30, seed=0)
TUNINGS: Final = {"Observer 2 by hand": GREY, "Observer 2 tuned": BLUE, "joint observer": ORANGE}
_HAND, _TUNED, _JOINT = range(len(TUNINGS))
FADE: Final = "fade"


class Printed(NamedTuple):
    """A row of the thesis: front and rear, in %."""

    session: str
    first: int
    """Brake application of the session that the row begins with."""
    applications: int
    name: str
    tuned: tuple[float, float]
    deviation: tuple[float, float]
    """Of the tuned observer, recomputed from the printed means."""
    by_hand: tuple[float, float] | None = None


_AT_50: Final = "6.2, {} m/s² from 50 km/h"
_AT_100: Final = "6.2, {} m/s² from 100 km/h"
PRINTED: Final = (
    Printed("fixed-pedal", 0, 1, "6.1, pedal 20 %", (8.84, 22.44), (-6.5, 19.4), (18.78, 31.70)),
    Printed("fixed-pedal", 1, 1, "6.1, pedal 40 %", (7.35, 15.88), (-3.9, 13.6), (13.52, 20.70)),
    Printed("fixed-pedal", 2, 1, "6.1, pedal 60 %", (3.75, 10.11), (-3.9, 9.2), (7.01, 10.74)),
    Printed("bursts", 0, 12, "6.1, bursts, runs 4–6", (8.54, 16.13), (-2.2, 14.6), (12.35, 20.53)),
    Printed("fixed-decel", 0, 1, _AT_50.format(1.3), (14.08, 35.02), (-11.2, 35.3)),
    Printed("fixed-decel", 1, 1, _AT_50.format(3.5), (4.31, 16.80), (-2.0, 18.3)),
    Printed("fixed-decel", 2, 1, _AT_50.format(6), (10.10, 12.70), (13.7, 7.1)),
    Printed("fixed-decel", 3, 1, _AT_100.format(1.3), (13.70, 45.40), (-12.0, 56.6)),
    Printed("fixed-decel", 4, 1, _AT_100.format(3.5), (3.87, 16.40), (-3.8, 19.0)),
    Printed("fixed-decel", 5, 1, _AT_100.format(6), (9.70, 10.19), (11.1, -3.1)),
    Printed(FADE, 0, 1, "6.3, fade, run 1", (9.55, 19.02), (-6.8, 11.4)),
    Printed(FADE, 3, 1, "6.3, fade, run 4", (6.65, 17.60), (-4.6, 15.3)),
    Printed(FADE, 8, 1, "6.3, fade, run 9", (5.63, 14.60), (-3.8, 15.5)),
)

Driven = dict[tuple[str, int, int], list[Application]]
"""By session, place in `TUNINGS`, car."""
Case = tuple[str, int, int]


def _session(name: str, draw: str) -> tuple[Path, Scenario]:
    path = resource(f"config/scenarios/{name}.toml")
    return path, with_draw(load_scenario(path), draw)


def drive_case(configs: Sequence[Config], draw: str, case: Case) -> list[Application]:
    """Drive a session with one of `configs` and one car."""
    session, tuning, car = case
    return application_errors(drive_once(_session(session, draw)[1], configs[tuning], car))


def found_tuning(manual: Config, draw: str) -> Config:
    """Return Observer 2 tuned on the first session."""
    recordings = record_drives(manual, dict(_session(name, draw) for name in FIRST_SESSION), range(CARS))
    return find_tuning(manual, recordings, BUDGET)[2].config


class Figures(NamedTuple):
    """Medians over the cars of a row of the thesis, front and rear, in %."""

    nrmse: Array
    deviation: Array


def row_figures(driven: Driven, row: Printed, tuning: int) -> Figures:
    """Return the figures of a row of the thesis with one of `TUNINGS`."""
    nrmse, deviation = [], []
    for (session, number, _), applications in driven.items():
        if (session, number) == (row.session, tuning):
            found = applications[row.first : row.first + row.applications]
            nrmse.append(np.mean([each.nrmse for each in found], axis=0))
            ratios = [each.estimated / each.true - 1.0 for each in found]
            deviation.append(100.0 * np.mean(ratios, axis=0))
    return Figures(np.median(nrmse, axis=0), np.median(deviation, axis=0))


def _pair(values: Sequence[float] | Array, form: str = ".1f") -> str:
    return "/".join(f"{value:{form}}" for value in values)


def beside_the_thesis(figures: Figures, row: Printed) -> str:
    """Return the verdict on the nRMSE of front and rear against the thesis's tuned observer."""
    goals = zip(AXLES, figures.nrmse, row.tuned, strict=True)
    return verdict(*(Goal(axle, value, most) for axle, value, most in goals))


def tuning_tables(driven: Driven, manual: Config, tuned: Config) -> list[Table]:
    """Return the tables of nRMSE, of deviation and of the tuning."""
    errors, deviations, verdicts = [], [], []
    for row in PRINTED:
        hand, best, joint = (row_figures(driven, row, tuning) for tuning in (_HAND, _TUNED, _JOINT))
        verdicts.append((beside_the_thesis(best, row), beside_the_thesis(joint, row)))
        errors.append(
            (
                row.name,
                _pair(row.by_hand) if row.by_hand else "–",
                _pair(row.tuned),
                _pair(hand.nrmse),
                _pair(best.nrmse),
                verdicts[-1][0],
                _pair(joint.nrmse),
                verdicts[-1][1],
            )
        )
        deviations.append(
            (
                row.name,
                _pair(row.deviation, "+.1f"),
                *(_pair(f.deviation, "+.1f") for f in (hand, best, joint)),
            )
        )
    of_tuned, of_joint = (met(column) for column in zip(*verdicts, strict=True))
    keys = [
        (
            f"`{key}`",
            f"{getattr(manual.observer, key):g}",
            f"{getattr(tuned.observer, key):g}",
            f"{low:g}–{high:g}",
        )
        for key, (low, high) in RANGES.items()
    ]
    return [
        Table(
            "nRMSE of friction, front/rear [%]",
            (
                "table, brake application",
                "thesis, by hand",
                "thesis, tuned",
                "by hand",
                "tuned",
                "beside the thesis",
                "joint observer",
                "beside the thesis, joint",
            ),
            errors,
            f"Median over {CARS} cars. At most as printed for the tuned observer: tuned {of_tuned}, "
            f"joint {of_joint}.",
        ),
        Table(
            "Mean friction of a brake application beside the true one, front/rear [%]",
            ("table, brake application", "thesis, tuned", *TUNINGS),
            deviations,
            f"Median over {CARS} cars.",
        ),
        Table("Noise of Observer 2", ("key of `[observer]`", "by hand", "tuned", "searched"), keys, ""),
    ]


def fade_panels(driven: Driven) -> list[Panel]:
    """Return Figure 6.4 of the thesis: mean friction of each brake application of the fade test, one car."""
    panels = []
    for place, axle in enumerate(AXLES):
        lines = []
        for tuning, colour in enumerate(TUNINGS.values()):
            found = driven[FADE, tuning, CARS]
            runs = np.arange(1.0, len(found) + 1.0)
            if tuning == _JOINT:
                lines.append(Line(runs, np.array([each.true[place] for each in found]), GREEN, True))
            lines.append(Line(runs, np.array([each.estimated[place] for each in found]), colour))
        panels.append(Panel(f"Figure 6.4: friction, {axle} [–]", "run", (1.0, 10.0), (0.2, 0.6), lines))
    return panels


TEXT: Final = (
    "The three sessions of chapter 6 of the thesis with Observer 2, tuned by hand and by the genetic "
    "algorithm of `brake-ecu tune` ([tuning.md](../tuning.md)), and with the joint observer, which is the "
    "default. Between the stops of sessions 1 and 2 lie five minutes of driving, in the fade test none. The "
    "thesis had one car and its reference was friction by measured wheel torque; here it is the simulated "
    "car's true friction.\n\n![Friction in the fade test](images/tuning.svg)"
)
LEGEND: Final = [*TUNINGS.items(), ("true friction (dashed); one car", GREEN)]


def _run(asked: Asked) -> Measured:
    path = resource("config/suv.toml")
    manual = with_observer(load_config(path), kind="observer2")
    tuned = found_tuning(manual, asked.draw)
    configs = (manual, tuned, load_config(path))
    cases = list(product((*FIRST_SESSION, *LATER_SESSIONS), range(len(TUNINGS)), range(CARS, 2 * CARS)))
    found = run_each("tuning", partial(drive_case, configs, asked.draw), cases)
    driven = dict(zip(cases, found, strict=True))
    of = (
        f", config/{path.name} ({config_hash(configs[_JOINT])[:12]}), {asked.draw} draw, "
        f"tuned on cars 0–{CARS - 1}, {BUDGET.generations} generations of {BUDGET.population}, "
        f"seed {BUDGET.seed}, judged on cars {CARS}–{2 * CARS - 1}"
    )
    drawn = picture("tuning.svg", fade_panels(driven), LEGEND)
    return Measured(tuning_tables(driven, manual, tuned), of, draw=drawn)


STUDY: Final = Study("Tuning of Observer 2", TEXT, _run)
