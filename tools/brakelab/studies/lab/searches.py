"""Figure C.1 on a drawn pad of brake A: the cost over two numbers of a law, searches on it, and profiles."""

from typing import Final, NamedTuple

from brakelab.identify.friction.candidates import candidates
from brakelab.identify.friction.cost import Cost, cost_over
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.fit import fit
from brakelab.identify.friction.profile import Profile, profile_over
from brakelab.results.text_table import Table
from brakelab.studies.lab.brakes import SEED, columns_of, linings, run

PICTURED: Final = {"ilvo": ((3, 4), (0.15, 0.15)), "ostermeyer": ((0, 2), (0.25, 0.25))}
"""Places of two numbers (b and c; p_1 and p_3 / p_2), and how far to draw, in shares of their bounds."""
POINTS: Final = 9  # of a profile


class Searches(NamedTuple):
    """Of CPC."""

    costs: dict[str, Cost]
    agreed: dict[str, str]  # starts of the whole search that ended in the best, of those tried
    profiles: list[Profile]  # of ILVO's numbers


def searches() -> Searches:
    """Return the cost surfaces and ILVO's profiles."""
    lining = linings().lining["A"]
    columns = columns_of(lining)
    stops = run(new_bench(lining, "A", SEED), "cpc", columns)
    known = {c.name: c for c in candidates(stops, lining.brake)}
    fitted = {name: fit(known[name], lining.brake, stops) for name in PICTURED}
    costs = {
        name: cost_over(fitted[name], lining.brake, stops, places, reach)
        for name, (places, reach) in PICTURED.items()
    }
    ilvo = fitted["ilvo"]
    profiles = [profile_over(ilvo, lining.brake, stops, k, POINTS) for k in range(len(ilvo.shares))]
    agreed = {name: f"{found.agreed} of {found.tried}" for name, found in fitted.items()}
    return Searches(costs, agreed, profiles)


def search_table(found: Searches) -> Table:
    """Return the results of both searches, and whether the cost is convex."""
    rows = [
        (
            f"{name}: {cost.names[0]}, {cost.names[1]}",
            f"{cost.nrmse.min():.2f}",
            f"{cost.least_squares.cost:.2f} ({cost.least_squares.evaluations})",
            f"{cost.simplex.cost:.2f} ({cost.simplex.evaluations})",
            str(cost.valleys),
            f"{100.0 * cost.convex:.0f}",
            found.agreed[name],
        )
        for name, cost in found.costs.items()
    ]
    columns = (
        "law: numbers",
        "least of the grid [%]",
        "least squares [%] (evaluations)",
        "simplex [%] (evaluations)",
        "ends of 16 searches",
        "convex [% of the area]",
        "starts that agree",
    )
    below = (
        "Brake A, CPC, the other numbers at their best. The thesis calls the problem convex for its "
        "quadratic cost: it is so in the residuals, not in the numbers of a differential equation. More than "
        "one end: a number that leaves no trace, or a search that got stuck. Agree: starts of the search of "
        "all numbers."
    )
    return Table("Figure C.1: the cost of two numbers", columns, rows, below)
