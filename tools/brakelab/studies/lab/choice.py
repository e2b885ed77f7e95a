"""Does the choice of a law hold on other pads? Drawn by further seeds, chosen by CPC, judged on AMS."""

from collections.abc import Callable
from typing import Final, NamedTuple

from brakelab.results.text_table import Table
from brakelab.studies.lab.brakes import Brake, measure
from brakelab.studies.physics.heat import BRAKES

SEEDS: Final = (3, 4, 5, 6)
"""Of pads that the rule of the choice was not made on."""
RIVALS: Final = ("constant", "ostermeyer", "ostermeyer_revised", "ilvo")


class Choice(NamedTuple):
    """A pad; RMS error [%] of the six means of AMS in closed loop."""

    brake: str
    seed: int
    chosen: str
    error: float
    rival: str  # the best of the others among RIVALS
    rival_error: float
    constant: float
    best: str  # of all laws, in hindsight
    best_error: float
    seconds: float  # CPC simulated and all laws identified


def choice_of(brake: str, seed: int, found: Brake) -> Choice:
    """Return how the chosen law of a pad does on AMS."""
    chosen = found.identified.chosen.name
    off = {name: law.in_closed_loop for name, law in found.ams.items()}
    rival = min((name for name in RIVALS if name != chosen), key=lambda name: off[name])
    best = min(off, key=lambda name: off[name])
    return Choice(
        brake,
        seed,
        chosen,
        off[chosen],
        rival,
        off[rival],
        off["constant"],
        best,
        off[best],
        found.seconds,
    )


def choices(progress: Callable[[str], None]) -> list[Choice]:
    """Return the choice on all further pads; minutes."""
    return [choice_of(brake, seed, measure(brake, progress, seed)) for seed in SEEDS for brake in BRAKES]


def compared(found: list[Choice]) -> tuple[int, int]:
    """Return on how many pads the choice beat every law of the thesis, and was worse than a constant."""
    return (
        sum(each.error < each.rival_error for each in found),
        sum(each.error > each.constant for each in found),
    )


def choice_table(found: list[Choice]) -> Table:
    """Return the choice on further pads."""
    rows = [
        (
            f"{each.brake}, pad {each.seed}",
            f"{each.chosen} {each.error:.1f}",
            f"{each.rival} {each.rival_error:.1f}",
            f"{each.constant:.1f}",
            f"{each.best} {each.best_error:.1f}",
        )
        for each in found
    ]
    better, worse = compared(found)
    whole = sum(
        compared([each for each in found if each.seed == seed])[0] >= 2
        and not compared([each for each in found if each.seed == seed])[1]
        for seed in SEEDS
    )
    below = (
        "RMS error [%] of the six means of AMS in closed loop, which the choice has not seen; pads that its "
        "rule was not made on. "
        f"Better than every single law of the thesis on {better} of {len(found)}, "
        f"worse than the constant on {worse}. The goal, two of three brakes and never worse than the "
        f"constant, is met on {whole} of {len(SEEDS)} sets of three. In hindsight: the least error of all "
        "laws, which CPC alone does not show."
    )
    columns = ("pad", "chosen", "best of the others", "constant", "best in hindsight")
    return Table("The choice on pads it was not made on", columns, rows, below)
