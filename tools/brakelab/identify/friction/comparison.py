"""Compares two linings section by section: are they different, or is it the scatter of applications?

Applications at the same place of the programme are a pair: what the conditions and the history do to both is
no scatter then. Of each section the mean logarithm of the ratio of friction has Student's interval, and its p
by the t-test of pairs. Over all sections p is adjusted by Holm's method, so that of linings that do not
differ at all one table in twenty shows a difference. Sections of one application have no scatter: no test.

Two recordings are two pads: what pads of one make differ by is in the difference, not in its interval, and
so is what the sensors of two rigs differ by.
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.stats import t as student

from brakelab.arrays import Matrix, Vector
from brakelab.identify.friction.report_tables import Measured
from brakelab.identify.friction.sections import Part
from brakelab.results.text_table import Table

ALPHA: Final = 0.05
FEWEST_PAIRS: Final = 3
TOGETHER: Final = "all together"


class Compared(NamedTuple):
    """One section of two linings; second over first."""

    name: str
    pairs: int
    mu: tuple[float, float]
    change: float  # %, of geometric means
    low: float  # %, interval of 95 %; NaN with too few pairs
    high: float
    p: float  # of this section alone
    adjusted: float  # over all sections (Holm)


def compare(first: Measured, second: Measured) -> list[Compared]:
    """Return the sections that both recordings have, in the order of the programme, and all together."""
    others = {part.name: part for part in second.parts}
    pairs = {
        part.name: _pairs(part, first, others[part.name], second)
        for part in first.parts
        if part.name in others
    }
    if len(pairs) > 1:
        pairs[TOGETHER] = np.concatenate(list(pairs.values()), axis=1)
    rows = [_compared(name, *mu) for name, mu in pairs.items()]
    adjusted = holm(np.array([row.p for row in rows]))
    return [row._replace(adjusted=float(p)) for row, p in zip(rows, adjusted, strict=True)]


def _pairs(one: Part, first: Measured, other: Part, second: Measured) -> Matrix:
    """Return friction of the applications that both have, shape (2, pairs)."""
    _, here, there = np.intersect1d(one.places, other.places, return_indices=True)
    return np.stack([first.mu(one)[here], second.mu(other)[there]])


def _compared(name: str, mu: Vector, with_mu: Vector) -> Compared:
    ratio = np.log(with_mu / mu)
    count = len(ratio)
    if not count:
        return Compared(name, 0, (np.nan, np.nan), *[np.nan] * 5)
    means, middle = (float(mu.mean()), float(with_mu.mean())), float(ratio.mean())
    if count < FEWEST_PAIRS:
        return Compared(name, count, means, _percent(middle), *[np.nan] * 4)
    error = float(ratio.std(ddof=1) / np.sqrt(count))
    half = float(student.ppf(1.0 - 0.5 * ALPHA, count - 1)) * error
    p = float(2.0 * student.sf(abs(middle) / max(error, 1e-300), count - 1))
    ends = _percent(middle - half), _percent(middle + half)
    return Compared(name, count, means, _percent(middle), *ends, p, np.nan)


def _percent(logarithm: float) -> float:
    return 100.0 * float(np.expm1(logarithm))


def holm(p: Vector) -> Vector:
    """Return p adjusted for as many tests as are not NaN, shape as `p` (Holm 1979)."""
    adjusted = np.full(len(p), np.nan)
    order = [k for k in np.argsort(p) if np.isfinite(p[k])]
    least = 0.0
    for done, k in enumerate(order):
        least = max(least, min((len(order) - done) * float(p[k]), 1.0))
        adjusted[k] = least
    return adjusted


def comparison_table(first: Measured, second: Measured, rows: list[Compared]) -> Table:
    """Return both linings side by side, and which sections differ."""
    table = []
    for row in rows:
        tested = np.isfinite(row.p)
        table.append(
            (
                row.name,
                str(row.pairs),
                *(f"{mu:.3f}" for mu in row.mu),
                f"{row.change:+.1f}",
                f"{row.low:+.1f} to {row.high:+.1f}" if tested else "–",
                _small(row.adjusted) if tested else "–",
                ("differs" if row.adjusted < ALPHA else "–") if tested else "too few",
            )
        )
    sections = [row for row in rows if row.name != TOGETHER]
    differ = sum(row.adjusted < ALPHA for row in sections)
    tested = sum(bool(np.isfinite(row.p)) for row in sections)
    below = (
        f"Second: {second.name}. {differ} of {tested} sections differ. Pairs of applications at the same "
        "place of the programme: mean ratio with its interval of 95 %, t-test of pairs, p adjusted for all "
        f"rows by Holm's method ({ALPHA:g} in all). Two recordings are two pads: the scatter between "
        "pads of one make is not in the intervals. What one rig's sensors are off by cancels, "
        "what two rigs' are does not."
    )
    columns = ("section", "pairs", "μ first", "μ second", "change [%]", "95 % [%]", "p", "note")
    return Table(f"{first.name} and {second.name}", columns, table, below)


def _small(p: float) -> str:
    return "< 0.001" if p < 0.001 else f"{p:.3f}"
