"""Summary that `replay` prints: a line per brake application, and the errors of their prediction."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np
from rich.box import SIMPLE
from rich.table import Table

from brakelab.results.brakes import LEARNED, BrakeRow
from brakelab.results.prediction import SHORT, Errors, Vector, errors, one_scale, running_average
from brakelab.results.text_table import cell
from ecu.algorithm.estimate import GREATEST_RATIO, LEAST_RATIO
from ecu.contract.signals import CORNERS

WIDTH: Final = 150
"""Columns of the table where no terminal says how wide it is."""
LISTED: Final = 40
"""Brakings of a table that a person reads."""


def brakings_table(rows: Sequence[BrakeRow], nominal: Sequence[float]) -> Table:
    """Return a table of the applications in `rows`, four rows each.

    `nominal`: nominal friction of each corner, to tell an estimate that stands at its bound.
    """
    table = Table(box=SIMPLE)
    for name in ("start s", "lasts s", "km/h", "m/s²", "predicted", "configured"):
        table.add_column(name, justify="right", overflow="fold")
    for name in ("mu_b front, then", "mu_b rear, then", "not learned"):
        table.add_column(name, overflow="fold")
    for first in range(0, len(rows), len(CORNERS)):
        corners = rows[first : first + len(CORNERS)]
        one = corners[0]
        table.add_row(
            f"{one.t_start:.2f}",
            f"{one.duration:.2f}",
            f"{cell(3.6 * one.v_in, '.0f')} → {cell(3.6 * one.v_end, '.0f')}",
            cell(one.specific_force_mean, ".2f"),
            f"{cell(one.specific_force_predicted, '.2f')} ± {cell(one.sigma_specific_force, '.2f')}",
            cell(one.specific_force_configured, ".2f"),
            _friction(corners[:2], nominal[:2]),
            _friction(corners[2:], nominal[2:]),
            _verdict(corners),
        )
    return table


def listed(rows: Sequence[BrakeRow], every: bool) -> tuple[Sequence[BrakeRow], int]:
    """Return the applications for the table, and how many before them it leaves out.

    They last at least `SHORT`, and are the last `LISTED` of these unless `every` one is asked for.
    """
    long = [row for row in rows if row.duration >= SHORT]
    last = long if every else long[-LISTED * len(CORNERS) :]
    return last, (len(long) - len(last)) // len(CORNERS)


def taps(rows: Sequence[BrakeRow]) -> int:
    """Return how many applications in `rows` are too short for the table."""
    return sum(row.duration < SHORT for row in rows[:: len(CORNERS)])


def judged(rows: Sequence[BrakeRow]) -> list[BrakeRow]:
    """Return a row of each application of `rows` whose prediction counts."""
    return [row for row in rows[:: len(CORNERS)] if not row.left_out]


def errors_of(rows: Sequence[BrakeRow], predicted: str = "specific_force_predicted") -> Errors:
    """Return how far the column `predicted` was off in `rows`, one of each application."""
    return errors([row.specific_force_mean for row in rows], [getattr(row, predicted) for row in rows])


def prediction_errors(rows: Sequence[BrakeRow]) -> Errors | None:
    """Return how far the predictions of the applications in `rows` were off, None: none counts."""
    counted = judged(rows)
    return errors_of(counted) if counted else None


def prediction_lines(rows: Sequence[BrakeRow]) -> list[str]:
    """Return how far the predictions of the applications in `rows` were off, and which do not count."""
    counted = judged(rows)
    measured = [row.specific_force_mean for row in counted]
    lines = ["prediction: no braking to judge it by"]
    if counted:
        found = errors_of(counted)
        spread = (
            f" on the mean, {100 * found.median:.1f} % in the median, {100 * found.worst:.1f} % at worst"
            if found.counted > 1
            else ""
        )
        lines = [
            f"prediction of {found.counted} braking{'s' if found.counted > 1 else ''}: "
            f"off by {100 * found.mean:.1f} %{spread}, bias {100 * found.bias:+.1f} %",
            f"beside it{', on the mean' if found.counted > 1 else ''}: " + ", ".join(
                f"{name} {100 * errors(measured, other).mean:.1f} %" for name, other in peers(counted).items()
            ),
        ]  # fmt: skip
    why = Counter(row.left_out for row in rows[:: len(CORNERS)] if row.left_out)
    if why:
        reasons = ", ".join(f"{count} {reason}" for reason, count in why.most_common())
        lines.append(f"left out of the prediction: {reasons}")
    return lines


def peers(rows: Sequence[BrakeRow]) -> dict[str, Vector]:
    """Return alternative predictions of the applications of `rows`, one row each, by name [m/s^2]."""
    measured = [row.specific_force_mean for row in rows]
    configured = [row.specific_force_configured for row in rows]
    rest = [row.specific_force_configured_rest for row in rows]
    return {
        "configured friction": np.asarray(configured),
        "running average": running_average(measured, configured, rest),
        "one scale in hindsight": one_scale(measured, configured, rest),
    }


def _friction(corners: Sequence[BrakeRow], nominal: Sequence[float]) -> str:
    mean = sum(row.mu_b_end for row in corners) / len(corners)
    sigma = sum(row.sigma_mu_b_end for row in corners) / len(corners)
    bounded = any(
        math.isclose(row.mu_b_end, ratio * usual, rel_tol=1e-3)
        for row, usual in zip(corners, nominal, strict=True)
        for ratio in (LEAST_RATIO, GREATEST_RATIO)
    )
    return f"{cell(mean, '.3f')} ± {cell(sigma, '.3f')}{' at its bound' if bounded else ''}"


def _verdict(corners: Sequence[BrakeRow]) -> str:
    reasons = [_reason(corners[:2], "front"), _reason(corners[2:], "rear")]
    same = {row.learning for row in corners}
    if len(same) == 1:
        return "" if same == {LEARNED} else same.pop()
    return "; ".join(reason for reason in reasons if reason)


def _reason(corners: Sequence[BrakeRow], axle: str) -> str:
    left, right = ("" if row.learning == LEARNED else row.learning for row in corners)
    if not (left or right):
        return ""
    return f"{axle} {left}" if left == right else f"{axle} {left or 'learned'} / {right or 'learned'}"
