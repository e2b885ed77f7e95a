"""Goals of the friction laboratory beside their results."""

from typing import Final

import numpy as np

from brakelab.identify.friction.discovery import ILVO
from brakelab.identify.friction.estimators import NETWORK, OSTERMEYER, SURFACE
from brakelab.results.text_table import Table
from brakelab.results.verdict import Goal, met, verdict
from brakelab.studies.lab.brakes import SEED, recovery, table_errors
from brakelab.studies.lab.choice import choice_of, compared
from brakelab.studies.lab.discovery import NOISES
from brakelab.studies.lab.observer import AS_DRAWN, KINDS, OnTrip
from brakelab.studies.lab.run import Lab
from brakelab.studies.lab.trips import OnTrips, over_pads
from brakelab.studies.physics.heat import BRAKES

OBSERVER_GOAL: Final = 3.0  # %
INSIDE: Final = (90.0, 99.0)  # %
TRUE_TERMS: Final = 0.9  # of the draws
LONGEST_MIN: Final = 5.0  # CPC of one brake and all laws
RANKS: Final = {
    "A": (NETWORK, SURFACE, OSTERMEYER),
    "B": (NETWORK, OSTERMEYER, SURFACE),
    "C": (NETWORK, SURFACE, OSTERMEYER),
    "D": (NETWORK, SURFACE, OSTERMEYER),
}
"""Of Table 2.1, best first."""


def goal_table(lab: Lab) -> Table:
    """Return all goals."""
    rows = [
        _ranking(lab),
        _observer(lab),
        _table_3_4(lab),
        _inside(lab),
        _choice(lab),
        _terms(lab),
        _time(lab),
    ]
    columns = ("goal", "thesis", "found", "verdict")
    below = (
        f"Met: {met(row[-1] for row in rows)}. All from one run of `brake-ecu bench lab`; each row has its "
        "table below. Misses: see Causes."
    )
    return Table("Goals", columns, rows, below)


def as_drawn(lab: Lab) -> list[OnTrip]:
    """Return the cars of which nothing is known beforehand."""
    return [car for car in lab.in_cars if car.cause == AS_DRAWN]


def same_ranking(pads: list[OnTrips]) -> dict[str, int]:
    """Return on how many pads the estimators stand in the order of Table 2.1, by manoeuvre."""
    return {
        kind: sum(
            sorted(RANKS[kind], key=lambda name: pad.errors[name][kind].nrmse) == list(RANKS[kind])
            for pad in pads
        )
        for kind in KINDS
    }


def _ranking(lab: Lab) -> tuple[str, ...]:
    errors, same = over_pads(lab.on_trips), same_ranking(lab.on_trips)
    most = [kind for kind, count in same.items() if 2 * count > len(lab.on_trips)]
    return (
        "Table 2.1: the same ranking of response surface, Ostermeyer, ANN",
        "28/18/18/12, 37/13/20/14, 14/7/11/10 %",
        ", ".join(
            f"{name} {'/'.join(f'{np.median(errors[name][kind]):.0f}' for kind in KINDS)} %"
            for name in (SURFACE, OSTERMEYER, NETWORK)
        )
        + f"; so on most of {len(lab.on_trips)} pads in {', '.join(most) or 'none'}",
        verdict(Goal("kinds of braking", len(most), least=len(KINDS))),
    )


def _observer(lab: Lab) -> tuple[str, ...]:
    median = {kind: float(np.median([car.adapted[kind] for car in as_drawn(lab)])) for kind in KINDS}
    return (
        "joint observer ≤ 3 % in A, B, C, D, no dynamometer",
        "–",
        "/".join(f"{median[kind]:.1f}" for kind in KINDS) + " %",
        verdict(*(Goal(kind, median[kind], OBSERVER_GOAL) for kind in KINDS)),
    )


def _table_3_4(lab: Lab) -> tuple[str, ...]:
    found = {name: table_errors(name, lab.recovered) for name in ("R1", "R2")}
    reached = {"R1": 1.96, "R2": 2.03}
    goals = [
        Goal(name, abs(errors.mean() - reached[name]), max(2.0 * errors.std(), 0.02))
        for name, errors in found.items()
    ]
    return (
        "Table 3.4, forms of the errata, numbers identified from data: R1 1.96, R2 2.03 %",
        "as printed 12–36 % off",
        ", ".join(
            f"{name} {errors.mean():.2f} ± {2.0 * errors.std():.2f} %" for name, errors in found.items()
        ),
        verdict(*goals),
    )


def _inside(lab: Lab) -> tuple[str, ...]:
    each = {brake: 100.0 * float(recovery(brake, lab.recovered).inside.mean()) for brake in BRAKES}
    least = 100.0 * min(float(recovery(brake, lab.recovered).inside.min()) for brake in BRAKES)
    overall = float(np.mean(list(each.values())))
    return (
        "numbers of ILVO within their interval of 95 % in 90–99 % of draws, 1 % noise",
        "–",
        f"{overall:.0f} % ({', '.join(f'{brake} {value:.0f}' for brake, value in each.items())}), "
        f"least of one number {least:.0f}",
        verdict(
            Goal("all", overall, INSIDE[1], INSIDE[0]), Goal("least of one number", least, least=INSIDE[0])
        ),
    )


def _choice(lab: Lab) -> tuple[str, ...]:
    first = compared([choice_of(brake, SEED, lab.brakes[brake]) for brake in BRAKES])
    others, count = compared(lab.choices), len(lab.choices)
    return (
        "chosen law on AMS of the pads in closed loop: better than every single law of the thesis on 2 of 3, "
        "never worse than the constant",
        "–",
        f"better on {first[0]} of 3, worse than the constant on {first[1]}; other pads: {others[0]} and "
        f"{others[1]} of {count}",
        verdict(
            Goal("better", first[0], least=2),
            Goal("worse", first[1], most=0),
            Goal("other pads better", others[0], least=2 * count / 3),
            Goal("other pads worse", others[1], most=0),
        ),
    )


def _terms(lab: Lab) -> tuple[str, ...]:
    true = set(ILVO)
    goals = []
    for brake in BRAKES:
        ours = [set(d.sparse) for d in lab.draws if (d.brake, d.noise) == (brake, NOISES[0])]
        good = sum(true <= terms and len(terms - true) <= 1 for terms in ours)
        goals.append(Goal(brake, good, least=TRUE_TERMS * len(ours)))
    return (
        "discovery: ILVO's terms found in ≥ 18 of 20 draws at 1 % noise, at most one false",
        "found by hand",
        ", ".join(f"{goal.name} {goal.value:.0f}" for goal in goals),
        verdict(*goals),
    )


def _time(lab: Lab) -> tuple[str, ...]:
    minutes = [Goal(brake, lab.brakes[brake].seconds / 60.0, LONGEST_MIN) for brake in BRAKES]
    return (
        "CPC of one brake simulated, all laws identified, ≤ 5 min on two cores, with progress",
        "–",
        ", ".join(f"{goal.name} {goal.value:.1f}" for goal in minutes) + " min",
        verdict(*minutes),
    )
