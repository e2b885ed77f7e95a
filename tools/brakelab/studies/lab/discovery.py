"""Trial of the discovery of C.1: terms found, by the stops searched."""

from collections import Counter
from collections.abc import Iterable
from itertools import product
from typing import Final, NamedTuple

from brakelab.identify.friction.discovery import ILVO, NAMES, Support, greedy, library, sparse
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.sequence import load_sequence, run_sequence
from brakelab.identify.friction.stops import find_stops
from brakelab.results.text_table import Table
from brakelab.studies.lab.brakes import columns_of, linings, r1_recording
from brakelab.studies.physics.heat import BRAKES
from ecu.settings.resources import resource

DRAWS: Final = 20
SHOT: Final = 6  # draws that are searched by shooting too: seconds each
NOISES: Final = (0.01, 0.03)
SEED: Final = 1


class Draw(NamedTuple):
    """Terms found in one recording; those by shooting are None where not requested."""

    brake: str
    noise: float
    sparse: Support
    shot: Support | None


class PadTerms(NamedTuple):
    """Terms found in CPC of a pad that follows no law."""

    brake: str
    terms: Support
    error: float  # nRMSE [%]


def jobs() -> list[tuple[str, float, int]]:
    """Return brake, noise and draw of all recordings of R1."""
    return list(product(BRAKES, NOISES, range(DRAWS)))


def discovered(job: tuple[str, float, int]) -> Draw:
    """Return the terms found in a noisy recording of R1."""
    brake, noise, draw = job
    lining = linings().lining[brake]
    of = library(find_stops(r1_recording(lining, noise, draw), columns_of(lining, "R1"), "R1"))
    shot = greedy(of).terms if draw < SHOT and noise == NOISES[0] else None
    return Draw(brake, noise, sparse(of).terms, shot)


def pad_terms(brake: str) -> PadTerms:
    """Return the terms found in CPC of a drawn pad."""
    lining = linings().lining[brake]
    programme = load_sequence(resource("config/rig/cpc.toml"))
    recording = run_sequence(new_bench(lining, brake, SEED), programme, lambda share: None)
    found = sparse(library(find_stops(recording, columns_of(lining), "cpc")))
    return PadTerms(brake, found.terms, found.error)


def discovery_tables(draws: list[Draw], pads: list[PadTerms]) -> list[Table]:
    """Return the terms found in ILVO's stops, and in those of pads."""
    rows = []
    for brake, noise in product(BRAKES, NOISES):
        ours = [draw for draw in draws if (draw.brake, draw.noise) == (brake, noise)]
        rows.append((f"{brake}, {100 * noise:.0f} %", "sparse", *_score(draw.sparse for draw in ours)))
        shot = [draw.shot for draw in ours if draw.shot is not None]
        if shot:
            rows.append((f"{brake}, {100 * noise:.0f} %", "greedy", *_score(shot)))
    columns = ("stops, noise", "search", "all five, at most one false", "all five, none false", "what else")
    below = (
        f"Stops of ILVO (R1) as in the table above. Library: {', '.join(NAMES)}. The goal is 18 of 20 at "
        "1 %. Greedy is built from nothing by shooting and can end in ILVO in other words: p μ is p κ α, and "
        "with κ straight in T that is p α and p T α. |ω'| stands for p μ: a search that is offered the "
        "measured slowing copies the measured friction out of it, at a rate of 600, and finds nothing (error "
        "below the noise)."
    )
    found = [(pad.brake, ", ".join(NAMES[term] for term in pad.terms), f"{pad.error:.2f}") for pad in pads]
    other = (
        "The same search on CPC of the drawn pads, which are built of none of these terms. It takes more of "
        "them than ILVO has and they differ between pads: a description, not a law. Beside Table 3.3."
    )
    return [
        Table("Discovery: ILVO's terms in its own stops", columns, rows, below),
        Table("Discovery: terms found in pads", ("brake", "terms", "nRMSE [%]"), found, other),
    ]


def _score(supports: Iterable[Support]) -> tuple[str, str, str]:
    found = list(supports)
    true = set(ILVO)
    whole = [terms for terms in found if true <= set(terms)]
    near = sum(len(set(terms) - true) <= 1 for terms in whole)
    exact = sum(set(terms) == true for terms in whole)
    wrong = Counter(f"+ {NAMES[term]}" for terms in found for term in set(terms) - true)
    wrong += Counter(f"− {NAMES[term]}" for terms in found for term in true - set(terms))
    words = ", ".join(f"{name} ({count})" for name, count in wrong.most_common(4))
    return f"{near} of {len(found)}", f"{exact} of {len(found)}", words or "–"
