"""Compares two linings section by section: are they different, or is it the scatter of applications?

Applications at the same place of the programme are a pair: what the conditions and the history do to both is
no scatter then. Of each section the mean logarithm of the ratio of friction has Student's interval, and its p
by the t-test of pairs. Over all sections p is adjusted by Holm's method, so that of linings that do not
differ at all one table in twenty shows a difference. Sections of one application have no scatter: no test.

Two recordings are two pads: what pads of one make differ by is in the difference, not in its interval.
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.stats import t as student

from brakelab.arrays import Vector
from brakelab.identify.friction.report_tables import Measured
from brakelab.identify.friction.sections import Part
from brakelab.results.text_table import Table

ALPHA: Final = 0.05
FEWEST_PAIRS: Final = 3


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
    """Return the sections that both recordings have, in the order of the programme."""
    others = {part.name: part for part in second.parts}
    rows = [_paired(part, first, others[part.name], second) for part in first.parts if part.name in others]
    adjusted = holm(np.array([row.p for row in rows]))
    return [row._replace(adjusted=float(p)) for row, p in zip(rows, adjusted, strict=True)]


def _paired(one: Part, first: Measured, other: Part, second: Measured) -> Compared:
    _, here, there = np.intersect1d(one.places, other.places, return_indices=True)
    mu, with_mu = first.mu(one)[here], second.mu(other)[there]
    ratio = np.log(with_mu / mu)
    count = len(ratio)
    means = float(mu.mean()) if count else np.nan, float(with_mu.mean()) if count else np.nan
    middle = float(ratio.mean()) if count else np.nan
    if count < FEWEST_PAIRS:
        return Compared(one.name, count, means, _percent(middle), np.nan, np.nan, np.nan, np.nan)
    error = float(ratio.std(ddof=1) / np.sqrt(count))
    half = float(student.ppf(1.0 - 0.5 * ALPHA, count - 1)) * error
    p = float(2.0 * student.sf(abs(middle) / max(error, 1e-300), count - 1))
    return Compared(
        one.name, count, means, _percent(middle), _percent(middle - half), _percent(middle + half), p, np.nan
    )


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
    differ = sum(row.adjusted < ALPHA for row in rows)
    tested = sum(bool(np.isfinite(row.p)) for row in rows)
    below = (
        f"Second: {second.name}. {differ} of {tested} sections differ. Pairs of applications at the same "
        "place of the programme: mean ratio with its interval of 95 %, t-test of pairs, p adjusted for all "
        f"sections by Holm's method ({ALPHA:g} in all). Two recordings are two pads: the scatter between "
        "pads of one make is not in the intervals. What one rig's sensors are off by cancels."
    )
    columns = ("section", "pairs", "μ first", "μ second", "change [%]", "95 % [%]", "p", "note")
    return Table(f"{first.name} and {second.name}", columns, table, below)


def _small(p: float) -> str:
    return "< 0.001" if p < 0.001 else f"{p:.3f}"
