"""Table 2.1 and Figures 2.6 to 2.9 beside the thesis, the joint observer as last row."""

from typing import Final

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.estimators import OSTERMEYER
from brakelab.results.text_table import Table
from brakelab.results.verdict import Goal, verdict
from brakelab.studies.lab.goals import OBSERVER_GOAL, as_drawn, same_ranking
from brakelab.studies.lab.observer import CAUSES, KINDS
from brakelab.studies.lab.run import Lab
from brakelab.studies.lab.trips import FACTORS, PADS, median_wrong, over_pads

TABLE_2_1: Final = {
    "response surface": (28.14, 17.74, 18.35, 12.27),
    "Ostermeyer": (36.99, 13.19, 20.03, 13.52),
    "ANN": (14.06, 6.68, 10.95, 10.05),
    "Ostermeyer*": (35.70, 13.96, 21.78, 14.61),
    "ANN*": (14.67, 7.85, 11.48, 9.71),
}


def estimator_tables(lab: Lab) -> list[Table]:
    """Return the tables of chapter 2."""
    return [_estimators(lab), _mean_errors(lab), _limits(lab), _temperature(lab)]


def _estimators(lab: Lab) -> Table:
    rows, cars = [], as_drawn(lab)
    for name, errors in over_pads(lab.on_trips).items():
        printed = TABLE_2_1.get(name)
        cells = []
        for place, kind in enumerate(KINDS):
            cells += [f"{printed[place]:.1f}" if printed else "–", _spread(errors[kind])]
        rows.append((name, *cells))
    observer = {kind: [car.adapted[kind] for car in cars] for kind in KINDS}
    cells = []
    for kind in KINDS:
        cells += ["–", _spread(observer[kind])]
    rows.append(("joint observer, in cars", *cells))
    cold = ", ".join(f"{np.median([car.cold[kind] for car in cars]):.1f}" for kind in KINDS)
    constant = ", ".join(f"{np.median([car.nominal[kind] for car in cars]):.0f}" for kind in KINDS)
    goal = verdict(*(Goal(kind, float(np.median(observer[kind])), OBSERVER_GOAL) for kind in KINDS))
    below = (
        f"nRMSE [%], median (worst) of {len(PADS)} pads, as many of each brake, each identified on trip 1 "
        "and judged on trip 2; *: temperature of "
        "a lumped model with constants 5 % off. A mild from low speed, B mild from high, C gentle from "
        "low, D gentle from high: all brake applications of a kind, where the thesis shows one of each. The "
        "order of "
        "the three is the thesis's on "
        f"{', '.join(f'{count} in {kind}' for kind, count in same_ranking(lab.on_trips).items())}. True "
        "friction is measured here; the thesis has an observer's estimate. Static LuGre knows speed alone."
        "\n\nThe joint observer: "
        f"front axle of {len(cars)} cars of the wide draw, which no dynamometer has seen, after ten "
        "minutes of ordinary driving; median (worst car). Nothing learned before: "
        f"{cold} %; the configured constant {constant} %. Goal: {OBSERVER_GOAL:.0f} %; {goal}."
    )
    columns = ("estimator", *(f"{kind}{what}" for kind in KINDS for what in (", thesis", "")))
    return Table("Table 2.1: estimators on a trip", columns, rows, below)


def _spread(errors: Vector | list[float]) -> str:
    return f"{np.median(errors):.1f} (to {max(errors):.1f})"


def _mean_errors(lab: Lab) -> Table:
    """Return what of Ostermeyer's error is no scatter, with the right and with the lumped temperature."""
    rows = []
    for pad, (brake, seed) in zip(lab.on_trips, PADS, strict=True):
        cells = [f"{pad.errors[n][kind].mean:+.1f}" for kind in KINDS for n in (OSTERMEYER, f"{OSTERMEYER}*")]
        rows.append((f"{brake}, pad {seed}", *cells))
    columns = ("pad", *(f"{kind}{mark}" for kind in KINDS for mark in ("", "*")))
    below = (
        "Mean error [%] of the applications of a kind. Where the lumped temperature (*) is the better one, "
        "its error takes away from a mean error that the law has with the right one: it knows temperature "
        "alone, so what speed and pressure do to the friction of a kind is left."
    )
    return Table("Table 2.1: mean error of Ostermeyer's law", columns, rows, below)


def _limits(lab: Lab) -> Table:
    rows = []
    for cause in CAUSES:
        of = [car.adapted for car in lab.in_cars if car.cause == cause]
        errors = {kind: np.array([car[kind] for car in of]) for kind in KINDS}
        rows.append((cause, *(_spread(errors[k]) for k in KINDS)))
    below = (
        "nRMSE [%] of the front axle, adapted, median (worst car) of the same cars, what a row names "
        "as their configuration has it. Why: see Causes."
    )
    return Table("What limits the joint observer", ("cars", *KINDS), rows, below)


def _temperature(lab: Lab) -> Table:
    wrong = median_wrong(lab.on_trips)
    rows = [(name, *(f"{error:.1f}" for error in errors)) for name, errors in wrong.items()]
    lost = {name: float(np.ptp(errors)) for name, errors in wrong.items()}
    order = sorted(lost, key=lambda name: -lost[name])
    below = (
        "nRMSE [%] over trip 2, median of the pads, when the temperature is wrong by this factor. Figure "
        "2.9 has no numbers; it says that the network is the most sensitive and Ostermeyer robust. Most is "
        "lost here by "
        f"{', then '.join(f'{name} ({lost[name]:.0f})' for name in order[:2])}; the others do not know the "
        "temperature. Settled, Ostermeyer's law is proportional to the kelvin temperature."
    )
    return Table(
        "Figure 2.9: a wrong temperature", ("estimator", *(f"× {f:g}" for f in FACTORS)), rows, below
    )
