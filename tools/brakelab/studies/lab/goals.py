"""Goals of the friction laboratory beside their results."""

from typing import Final

import numpy as np

from brakelab.identify.friction.discovery import ILVO
from brakelab.identify.friction.estimators import NETWORK, OSTERMEYER, SURFACE
from brakelab.results.text_table import Table
from brakelab.studies.lab.brakes import SEED, recovery, table_errors
from brakelab.studies.lab.choice import choice_of, met
from brakelab.studies.lab.discovery import NOISES
from brakelab.studies.lab.observer import AS_DRAWN, KINDS, OnTrip
from brakelab.studies.lab.run import Lab
from brakelab.studies.physics.heat import BRAKES

OBSERVER_GOAL: Final = 3.0  # %
INSIDE: Final = (90.0, 99.0)  # %
TRUE_TERMS: Final = 0.9  # of the draws
LONGEST: Final = 300.0  # s, CPC of one brake and all laws
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
    columns = ("goal", "thesis", "found", "met")
    below = "All from one run of `brake-ecu bench lab`; each row has its table below. Misses: see Causes."
    return Table("Goals", columns, rows, below)


def as_drawn(lab: Lab) -> list[OnTrip]:
    """Return the cars of which nothing is known beforehand."""
    return [car for car in lab.in_cars if car.cause == AS_DRAWN]


def _met(is_met: bool) -> str:
    return "yes" if is_met else "no"


def same_ranking(errors: dict[str, dict[str, float]]) -> list[str]:
    """Return the manoeuvres in which the estimators stand in the order of Table 2.1."""
    return [
        kind
        for kind in KINDS
        if sorted(RANKS[kind], key=lambda name: errors[name][kind]) == list(RANKS[kind])
    ]


def _ranking(lab: Lab) -> tuple[str, ...]:
    errors = lab.on_trips.errors
    return (
        "Table 2.1: the same ranking of response surface, Ostermeyer, ANN",
        "28/18/18/12, 37/13/20/14, 14/7/11/10 %",
        ", ".join(
            f"{name} {'/'.join(f'{errors[name][kind]:.0f}' for kind in KINDS)} %"
            for name in (SURFACE, OSTERMEYER, NETWORK)
        ),
        f"in {', '.join(same_ranking(errors)) or 'none'}",
    )


def _observer(lab: Lab) -> tuple[str, ...]:
    median = {kind: float(np.median([car.adapted[kind] for car in as_drawn(lab)])) for kind in KINDS}
    reached = [kind for kind in KINDS if median[kind] <= OBSERVER_GOAL]
    return (
        "joint observer ≤ 3 % in A, B, C, D, no dynamometer",
        "–",
        "/".join(f"{median[kind]:.1f}" for kind in KINDS) + " %",
        f"in {', '.join(reached) or 'none'}",
    )


def _table_3_4(lab: Lab) -> tuple[str, ...]:
    found = {name: table_errors(name, lab.recovered) for name in ("R1", "R2")}
    reached = {"R1": 1.96, "R2": 2.03}
    within = all(
        abs(errors.mean() - reached[name]) <= max(2.0 * errors.std(), 0.02) for name, errors in found.items()
    )
    return (
        "Table 3.4, forms of the errata, numbers identified from data: R1 1.96, R2 2.03 %",
        "as printed 12–36 % off",
        ", ".join(
            f"{name} {errors.mean():.2f} ± {2.0 * errors.std():.2f} %" for name, errors in found.items()
        ),
        _met(within),
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
        _met(INSIDE[0] <= overall <= INSIDE[1]) + (", not each" if least < INSIDE[0] else ""),
    )


def _choice(lab: Lab) -> tuple[str, ...]:
    first = met([choice_of(brake, SEED, lab.brakes[brake]) for brake in BRAKES])
    others, count = met(lab.choices), len(lab.choices)
    is_met = first[0] >= 2 and not first[1]
    holds = others[0] >= 2 * count / 3 and not others[1]
    return (
        "chosen law on AMS of the pads in closed loop: better than every single law of the thesis on 2 of 3, "
        "never worse than the constant",
        "–",
        f"better on {first[0]} of 3, worse than the constant on {first[1]}; other pads: {others[0]} and "
        f"{others[1]} of {count}",
        _met(is_met and holds)
        if is_met == holds
        else "on these pads, not on others"
        if is_met
        else "on others only",
    )


def _terms(lab: Lab) -> tuple[str, ...]:
    true = set(ILVO)
    words, is_met = [], True
    for brake in BRAKES:
        ours = [set(d.sparse) for d in lab.draws if (d.brake, d.noise) == (brake, NOISES[0])]
        good = sum(true <= terms and len(terms - true) <= 1 for terms in ours)
        is_met &= good >= TRUE_TERMS * len(ours)
        words.append(f"{brake} {good}")
    return (
        "discovery: ILVO's terms found in ≥ 18 of 20 draws at 1 % noise, at most one false",
        "found by hand",
        ", ".join(words),
        _met(is_met),
    )


def _time(lab: Lab) -> tuple[str, ...]:
    seconds = [lab.brakes[brake].seconds for brake in BRAKES]
    return (
        "CPC of one brake simulated, all laws identified, ≤ 5 min on two cores, with progress",
        "–",
        ", ".join(f"{brake} {value / 60.0:.1f}" for brake, value in zip(BRAKES, seconds, strict=True))
        + " min",
        _met(max(seconds) <= LONGEST),
    )
