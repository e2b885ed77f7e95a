"""The terms found, as a law of one's own: the same friction as the search's own model, and a candidate."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.friction.candidates import own_candidate
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.discovered_law import law_code
from brakelab.identify.friction.discovery import NAMES, Found, _shot, library
from brakelab.identify.friction.fit import replayed
from brakelab.identify.friction.stops import Stops

pytestmark = pytest.mark.study

SLOW = {
    # term: its part of friction over a stop, small so that steps of 5 ms are exact
    "κ: 1": 0.25,
    "κ: T": 0.15,
    "κ: p": 0.02,
    "α': p v μ": -0.05,
    "α': |ω'|": 0.1,
    "α': p T": -0.04,
    "α': v α": 0.02,
    "α': 1": 0.01,
}


@pytest.mark.parametrize(
    "names",
    [list(SLOW), ["κ: 1", "κ: T"], *(["κ: 1", name] for name in NAMES if name.startswith("α"))],
    ids=lambda names: ", ".join(names[-2:]),
)
def test_the_law_is_the_model_of_the_search(
    tmp_path: Path, stops: Stops, columns: Columns, names: list[str]
) -> None:
    of = library(stops)
    terms = tuple(sorted(NAMES.index(name) for name in names))
    coefficients = np.array([SLOW.get(NAMES[term], 0.03) for term in terms])
    weights = np.zeros(len(NAMES))
    weights[list(terms)] = coefficients
    path = tmp_path / "terms.py"
    path.write_text(law_code(Found(terms, coefficients, 0.0), of), "utf-8")
    candidate = own_candidate(str(path), 1000.0)
    law = candidate.law([0.5 * (free.low + free.high) for free in candidate.free])
    friction = replayed(law, columns.brake, stops, False)
    assert friction == pytest.approx(_shot(of, weights) + stops.mu, abs=1e-3)
