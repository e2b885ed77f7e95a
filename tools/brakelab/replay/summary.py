"""What `replay` prints of the brakings: a line for each, and how well they were predicted."""

import math
from collections import Counter
from collections.abc import Sequence

from rich.box import SIMPLE
from rich.table import Table

from brakelab.replay.brakes import LEARNED, BrakeRow
from brakelab.replay.prediction import SHORT, errors
from ecu.estimation.friction import GREATEST_RATIO, LEAST_RATIO
from ecu.signals import CORNERS


def brakings_table(rows: Sequence[BrakeRow], nominal: Sequence[float]) -> Table:
    """Return a table of the applications in `rows`, four rows each, without taps shorter than `SHORT`.

    `nominal`: nominal friction of each corner, to tell an estimate that stands at its bound.
    """
    table = Table(box=SIMPLE)
    for name in ("start s", "lasts s", "km/h", "decel m/s²", "predicted"):
        table.add_column(name, justify="right")
    for name in ("mu_b front", "mu_b rear", "learned"):
        table.add_column(name)
    for first in range(0, len(rows), len(CORNERS)):
        corners = rows[first : first + len(CORNERS)]
        one = corners[0]
        if one.duration < SHORT:
            continue
        table.add_row(
            f"{one.t_start:.2f}",
            f"{one.duration:.2f}",
            f"{_number(3.6 * one.v_in, 0)} → {_number(3.6 * one.v_end, 0)}",
            _number(one.decel_mean, 2),
            _number(one.decel_predicted, 2),
            _friction(corners[:2], nominal[:2]),
            _friction(corners[2:], nominal[2:]),
            _verdict(corners),
        )
    return table


def taps(rows: Sequence[BrakeRow]) -> int:
    """Return how many applications in `rows` are too short for the table."""
    return sum(row.duration < SHORT for row in rows[:: len(CORNERS)])


def prediction_lines(rows: Sequence[BrakeRow]) -> list[str]:
    """Return how far the predictions of the applications in `rows` were off, and which do not count."""
    ones = rows[:: len(CORNERS)]
    learned = [any(row.learned_before for row in rows[k : k + 4]) for k in range(0, len(rows), len(CORNERS))]
    counted = [k for k, row in enumerate(ones) if not row.left_out]
    found = errors(
        [ones[k].decel_mean for k in counted],
        [ones[k].decel_predicted for k in counted],
        [learned[k] for k in counted],
    )
    told = "prediction: no braking to judge it by"
    if found.counted:
        shares = f"{100 * found.median:.1f} % in the median, {100 * found.worst:.1f} % at worst"
        told = f"prediction of {found.counted} brakings: off by {shares}, bias {100 * found.bias:+.1f} %"
    if found.nominal:
        told += f"; {found.nominal} with nominal friction, as nothing was learned before"
    why = Counter(row.left_out for row in ones if row.left_out)
    if not why:
        return [told]
    return [
        told,
        "left out of the prediction: "
        + ", ".join(f"{count} {reason}" for reason, count in why.most_common()),
    ]


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


def _friction(corners: Sequence[BrakeRow], nominal: Sequence[float]) -> str:
    mean = sum(row.mu_b_end for row in corners) / len(corners)
    sigma = sum(row.sigma_mu_b_end for row in corners) / len(corners)
    bounded = any(
        math.isclose(row.mu_b_end, ratio * usual, rel_tol=1e-3)
        for row, usual in zip(corners, nominal, strict=True)
        for ratio in (LEAST_RATIO, GREATEST_RATIO)
    )
    return f"{_number(mean, 3)} ± {_number(sigma, 3)}{' at its bound' if bounded else ''}"


def _verdict(corners: Sequence[BrakeRow]) -> str:
    reasons = [_reason(corners[:2], "front"), _reason(corners[2:], "rear")]
    same = {row.learning for row in corners}
    if len(same) == 1:
        return "yes" if same == {LEARNED} else f"no: {same.pop()}"
    return "; ".join(reasons)


def _reason(corners: Sequence[BrakeRow], axle: str) -> str:
    left, right = ("yes" if row.learning == LEARNED else row.learning for row in corners)
    return f"{axle} {left}" if left == right else f"{axle} {left} / {right}"
